"""The theory of gains: the linear gains with which the sampled loop of eq. 17 and 18 is stable."""

from collections.abc import Callable, Iterator
from itertools import accumulate, pairwise
from math import isfinite, log, pi
from typing import Any, NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import ContinuousControl, ControlLaw, LinearFeedback, Washout
from stickslip_ros.model.drive_layout import POSITION, SPEED

_ROUNDING = 1e-14
"""Relative error of a multiplier."""
_UNSEEN_SHARE = 1e-9
"""Share of a turn, next to one that a difference does not see, in which gains are infinite."""


class GainInterval(NamedTuple):
    """Interval of linear gains in which the loop is stable, N s/m."""

    low: float
    """Lower end, N s/m."""
    high: float
    """Upper end, N s/m."""

    @property
    def critical(self) -> float:
        """End nearest to zero, N s/m; the upper end if zero is inside."""
        return self.low if self.low >= 0.0 else self.high


def gains_of(law: ControlLaw | ContinuousControl | None) -> Washout | None:
    """Return the gains of a law that the theory of gains covers; None for any other law."""
    control = law.continuous if isinstance(law, ControlLaw) else law
    return control if isinstance(control, Washout) else None


def why_no_gains(law: ControlLaw) -> str | None:
    """Return a sentence that says why the theory of gains does not cover a law, or None."""
    if gains_of(law) is not None:
        return None
    return f"this exists for the {Washout.name} law only, and the control law is {law.name}"


def feedback_family(
    corner_frequency: float, linear_gains: FloatArray, period: float
) -> LinearFeedback:
    """Return the linear forms of controllers that differ in their linear gain, stacked.

    The cutoff frequency is in rad/s, the gains are in N s/m, shape (m,), and the sample period is
    in s.
    """
    unit = Washout(corner_frequency, 1.0, 0.0).linear_feedback(period)
    gains = linear_gains[:, np.newaxis]
    return LinearFeedback(unit.state, unit.input, gains * unit.output, gains * unit.direct)


def nearest_to_zero(intervals: list[GainInterval]) -> GainInterval:
    """Return the interval nearest to a gain of zero."""
    return min(intervals, key=lambda interval: max(interval.low, -interval.high, 0.0))


class GainBoundary:
    """1/G(e^(j theta)), the gains that put a multiplier there; dimensionless.

    From the force to v, with l = e^(j theta) and the whole periods m of the delay,
    G = (l - 1)^2 (b l + c) / (l^(m+1) (l - e^(-d T)) (l - e^(s1 T)) (l - e^(s2 T)) ...),
    s1, s2, ... being the eigenvalues of the open loop. One factor l - 1 is the filter's; the other
    one shows that a constant force does not move the slide permanently. b and c are the force that
    starts during a period, and the one that ends in it; with each state of a friction law b l + c
    or of the actuator becomes a polynomial of one degree more. With a difference of x over n
    samples for the velocity, that polynomial for x takes its place, times 1 + l + ... + l^(n-1)
    over n T, and the delay is n periods longer. In this form nothing cancels at high rates.
    """

    def __init__(
        self,
        jacobian: FloatArray,
        held: tuple[FloatArray, FloatArray, FloatArray],
        whole_delay: int,
        period: float,
        corner_frequency: float,
        difference_samples: int,
    ) -> None:
        """Take the open loop, see `LinearSampledLoop`, and a cutoff frequency; dimensionless."""
        slide, starting, ending = held
        self._spans = difference_samples
        self._whole = whole_delay
        self._period = period
        values = np.linalg.eigvals(jacobian).astype(np.complex128)
        self._poles = np.array([-corner_frequency, *values]) * period
        self._forces: Any = [starting[1], slide[0, 0] * ending[1] - slide[1, 0] * ending[0]]
        if difference_samples:
            starts, ends = (_after(POSITION, slide, column) for column in (starting, ending))
            mean = np.ones(difference_samples) / (difference_samples * period)
            self._forces = np.polymul(np.polyadd([*starts, 0.0], ends), mean)
            self._whole += difference_samples
        elif len(slide) > 2:
            starts, ends = (_after(SPEED, slide, column) for column in (starting, ending))
            self._forces = np.polydiv(np.polyadd([*starts, 0.0], ends), [1.0, -1.0])[0]
        """b l + c, as coefficients."""

    def gain(self, theta: Any) -> Any:
        """Return 1/G, an array of the shape of theta."""
        forward = np.exp(1j * theta)
        # The form of l - e^s that does not overflow on either side.
        differences = np.prod(
            [
                np.exp(pole) * np.expm1(1j * theta - pole)
                if pole.real > 0.0
                else -forward * np.expm1(pole - 1j * theta)
                for pole in self._poles
            ],
            axis=0,
        )
        zeros = np.expm1(1j * theta) ** 2 * np.polyval(self._forces, forward)
        with np.errstate(divide="ignore", invalid="ignore"):
            return forward ** (self._whole + 1) * differences / zeros

    def stable_intervals(self, unit: float, radius: Callable[[float], float]) -> list[GainInterval]:
        """Return the intervals of gains with which the loop is stable, in ascending order.

        `unit` is the unit of the dimensionless gains, N s/m, and `radius` returns the spectral
        radius of the loop with a gain, N s/m.

        By D-decomposition (Neimark): a multiplier e^(j theta) on the unit circle requires
        k1 = 1/G(e^(j theta)), which is a gain where it is real. These gains bound intervals in each
        of which the number of multipliers outside the circle is constant; where Im(1/G) rises with
        theta, the number increases with the gain. In the intervals where it is smallest it is zero,
        or no gain is stable. Beyond the last of these gains no gain is stable: G has more poles
        than zeros, so that a multiplier grows with the gain.
        """
        crossings = sorted(self.crossings())
        outside = accumulate(number for _, number in crossings)
        counted = [
            (number, GainInterval(low * unit, high * unit))
            for number, ((low, _), (high, _)) in zip(outside, pairwise(crossings), strict=False)
            if low < high
        ]
        if not counted:
            return []
        fewest = min(number for number, _ in counted)
        intervals = [interval for number, interval in counted if number == fewest]
        nearest = nearest_to_zero(intervals)
        # Near an end the loop is slow; at a high rate also far from zero.
        low, high = nearest
        tried = (0.0, 2.0 * nearest.critical, (low + high) / 2.0)
        least = min(radius(gain) for gain in tried if low < gain < high)
        return intervals if least < 1.0 - _ROUNDING else []

    def crossings(self) -> Iterator[tuple[float, int]]:
        """Yield the real gains, and how many multipliers leave the circle there as it rises."""
        theta = self._angles()
        imaginary = self.gain(theta).imag
        theta, imaginary = theta[imaginary != 0.0], imaginary[imaginary != 0.0]
        rows = np.flatnonzero(np.sign(imaginary[:-1]) * np.sign(imaginary[1:]) < 0.0)
        low, high, rising = theta[rows], theta[rows + 1], np.sign(imaginary[rows + 1])
        for _ in range(60):
            middle = (low + high) / 2.0
            above = self.gain(middle).imag * rising > 0.0
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        gains = self.gain(low)
        if self._spans:  # where a difference sees nothing, 1/G changes its sign through infinity
            turns = low * (self._spans / (2.0 * pi))
            finite = (np.abs(turns - np.rint(turns)) > _UNSEEN_SHARE) | (np.rint(turns) == 0.0)
            low, gains, rising = low[finite], gains[finite], rising[finite]
        # An undamped drive's own multipliers are on the circle, which is a gain of zero.
        unsure = np.abs(self.gain(low + _ROUNDING * self._period) - gains)
        gains = np.where(np.abs(gains) > unsure, gains.real, 0.0)
        for gain, number in zip(gains.tolist(), rising.tolist(), strict=True):
            yield gain, 2 * int(number)
        # One real multiplier at -1. By symmetry 1/G is real there; the sum is exact.
        poles = np.exp(self._poles)
        difference = float(np.polyval(self._forces, -1.0))
        unseen = self._spans > 0 and self._spans % 2 == 0
        if difference != 0.0 and not unseen:
            gain = float(np.prod(-1.0 - poles).real) / (4.0 * difference)
            if isfinite(gain):
                yield gain * (-1.0) ** (self._whole + 1), -int(np.sign(imaginary[-1]))

    def _angles(self) -> FloatArray:
        """Return angles above 0 and below pi between which the phase of each factor changes little.

        The phase of a factor l - e^s changes near the angle of e^s, fast if it is near the circle.
        """
        steps = 16 * (self._whole + 2)
        parts: list[Any] = [np.arange(1, steps) * (pi / steps), self._near(0.0, self._period)]
        for pole in self._poles:
            parts.append(self._near(abs(float(np.angle(np.exp(1j * pole.imag)))), abs(pole.real)))
        for turn in range(1, self._spans // 2 + 1):
            parts.append(self._near(2.0 * pi * turn / self._spans, 0.0))
        for zero in np.roots(self._forces):
            size = abs(complex(zero))
            if size > 0.0 and zero.real < 0.0:
                parts.append(self._near(pi, abs(log(size)) + abs(pi - abs(np.angle(zero)))))
        theta = np.sort(np.concatenate(parts))
        return theta[(theta > 0.0) & (theta < pi)]

    @staticmethod
    def _near(angle: float, width: float) -> FloatArray:
        distances: Any = np.geomspace(1e-3 * max(width, 1e-12), pi, 200)
        return np.concatenate([angle - distances, angle + distances])


def _after(state: int, slide: FloatArray, force: FloatArray) -> Any:
    """Return the polynomial e^T adj(l I - slide) force, that of a state after a force.

    By the determinant lemma it is det(l I - slide + force e^T) - det(l I - slide).
    """
    seen = np.zeros(len(slide))
    seen[state] = 1.0
    difference = np.poly(slide - np.outer(force, seen)) - np.poly(slide)
    return difference[1:]
