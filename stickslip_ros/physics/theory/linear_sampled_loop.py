"""The loop of the nodes, linear near its equilibrium: sampled, held, washed out and delayed.

It is exactly the loop of `SampledLoop` and `Washout`: between samples the force is constant, so
that the matrix exponential gives the motion from one sample to the next.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise
from math import frexp, inf, isfinite, log, pi
from typing import Any, NamedTuple, Self

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.deprecated_names import Renamed
from stickslip_ros.physics.loop.sampled_loop import whole_and_rest
from stickslip_ros.physics.model.control import WashoutGains
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.theory.linear import expand
from stickslip_ros.physics.theory.requirements import AUTONOMOUS, STATIC, require

LONGEST_DELAY = 300
"""Largest delay, in whole periods, for which the matrix is built; its order grows with it."""

SETTLED = 0.01
"""Share of its first size that a deviation has at the 1 % settling time."""

_ROUNDING = 1e-14
"""Relative error of a multiplier."""

_SLIDE, _FILTER = slice(0, 2), 2
"""Indices of X, Y and of the filter's z = d w in the state; the forces under way follow."""


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


def why_no_linear_loop(drive: Drive, rate: float, force_delay: float) -> str | None:
    """Return a sentence that says why `LinearSampledLoop.from_drive` returns None, or None."""
    if drive.belt_speed == 0.0:
        return "the belt rests: friction holds the slide, and the motion near it is not linear"
    if force_delay * rate > LONGEST_DELAY:
        return (
            f"the force comes {force_delay * rate:g} periods late; the theory of the sampled loop "
            f"covers at most {LONGEST_DELAY}"
        )
    return None


@dataclass(frozen=True)
class LinearSampledLoop:
    """Drive at its equilibrium under a sampled washout controller, linearised; for any gains.

    With the period T, v_n = y_n - z_n and q = 1 - exp(-d T) the controller is z_(n+1) = z_n + q v_n
    and force n = k1 v_n, which acts from n T + delay to (n + 1) T + delay. The state is X, Y, z and
    the forces under way, the newest first.

    Examples
    --------
    The slide of a machine tool, sampled at 1 kHz without delay:

    >>> from stickslip_ros.physics.model.drive import Drive
    >>> from stickslip_ros.physics.model.control import WashoutGains
    >>> from stickslip_ros.physics.model.friction import Stribeck
    >>> from stickslip_ros.physics.theory.linear_sampled_loop import LinearSampledLoop
    >>> drive = Drive(mass=100.0, damping=200.0, stiffness=1e6, normal_force=1000.0,
    ...               belt_speed=0.04, friction=Stribeck(0.4, 0.25, 0.05))
    >>> loop = LinearSampledLoop.from_drive(drive, rate=1000.0)
    >>> round(loop.critical_linear_gain(corner_frequency=20.0), 1)
    -1451.2
    >>> round(loop.settling_time(WashoutGains(20.0, linear=-3000.0, cubic=0.0)), 3)
    0.601
    """

    drive: Drive
    """Drive in SI units."""
    rate: float
    """Samples per second, Hz."""
    force_delay: float
    """Delay from a sample to the start of its force, s."""
    jacobian: FloatArray
    """Jacobian of the open loop, dimensionless (see `Expansion.jacobian`); shape (2, 2)."""

    of = Renamed("from_drive")

    @classmethod
    def from_drive(cls, drive: Drive, rate: float, force_delay: float = 0.0) -> Self | None:
        """Return the linear loop of a drive.

        Parameters
        ----------
        drive : Drive
            Drive in SI units.
        rate : float
            Samples per second, Hz.
        force_delay : float, optional
            Delay from a sample to the start of its force, s.

        Returns
        -------
        LinearSampledLoop or None
            Loop; None if the belt is at rest, or if the delay is longer than 300 periods.

        Raises
        ------
        InvalidInputError
            If the friction law has a memory, or belt or load follow a course.
        """
        require("the theory of the sampled loop", drive, AUTONOMOUS, STATIC)
        expansion = expand(drive)
        if expansion is None or why_no_linear_loop(drive, rate, force_delay):
            return None
        return cls(drive, rate, force_delay, expansion.jacobian)

    def transition_matrix(self, gains: WashoutGains) -> FloatArray:
        """Return the matrix from the state at one sample to the state at the next.

        Parameters
        ----------
        gains : WashoutGains
            Controller in SI units; its cubic gain is not used.

        Returns
        -------
        ndarray
            Matrix for the dimensionless state, shape (n, n); n is 3 plus the number of periods of
            the delay, rounded up.
        """
        scaled = gains.scaled(self.drive)
        return self._transitions(np.float64(scaled.corner_frequency), np.float64(scaled.linear))

    def spectral_radius(self, gains: WashoutGains) -> float:
        """Return the factor by which a small deviation grows per sample, in the long run.

        Parameters
        ----------
        gains : WashoutGains
            Controller in SI units; its cubic gain is not used.

        Returns
        -------
        float
            Spectral radius of the transition matrix; the loop is stable below 1.
        """
        return float(_spectral_radius(self.transition_matrix(gains)))

    def decay_rate(self, gains: WashoutGains) -> float:
        """Return the rate at which a small deviation decays.

        Parameters
        ----------
        gains : WashoutGains
            Controller in SI units; its cubic gain is not used.

        Returns
        -------
        float
            Decay rate, 1/s; below zero the deviation grows.
        """
        radius = self.spectral_radius(gains)
        return -log(radius) * self.rate if radius > 0.0 else inf

    def decay_rates(self, corner_frequencies: FloatArray, linear_gains: FloatArray) -> FloatArray:
        """Return the decay rates over cutoff frequencies and linear gains.

        Parameters
        ----------
        corner_frequencies : ndarray
            Cutoff frequencies, rad/s; shape (m,).
        linear_gains : ndarray
            Linear gains, N s/m; shape (n,) for all cutoff frequencies, or (m, n).

        Returns
        -------
        ndarray
            Decay rates, 1/s; shape (m, n).
        """
        shape = (len(corner_frequencies), linear_gains.shape[-1])
        rows = zip(corner_frequencies, np.broadcast_to(linear_gains, shape), strict=True)
        radii = np.array([self._radii(d, row) for d, row in rows]).reshape(shape)
        with np.errstate(divide="ignore"):
            return -np.log(radii) * self.rate

    def settling_time(self, gains: WashoutGains) -> float | None:
        """Return the 1 % settling time of a small deviation.

        Parameters
        ----------
        gains : WashoutGains
            Controller in SI units; its cubic gain is not used.

        Returns
        -------
        float or None
            Time in which a deviation decays to a hundredth, s; None if it grows.
        """
        return settling_time(self.decay_rate(gains))

    def stable_linear_gains(self, corner_frequency: float) -> list[GainInterval]:
        """Return all linear gains with which the loop is stable.

        By D-decomposition (Neimark): a multiplier e^(j theta) on the unit circle requires
        k1 = 1/G(e^(j theta)), which is a gain where it is real. These gains bound intervals in each
        of which the number of multipliers outside the circle is constant; where Im(1/G) rises with
        theta, the number increases with the gain. In the intervals where it is smallest it is zero,
        or no gain is stable. Beyond the last of these gains no gain is stable: G has more poles
        than zeros, so that a multiplier grows with the gain.

        Parameters
        ----------
        corner_frequency : float
            Cutoff frequency, rad/s.

        Returns
        -------
        list of GainInterval
            Stable intervals in ascending order; empty if no gain is stable.
        """
        boundary = _Boundary(self, corner_frequency / self.drive.angular_frequency)
        crossings = sorted(boundary.crossings())
        unit = self.drive.normal_force / self.drive.speed_scale
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
        nearest = min(intervals, key=_distance)
        # Near an end the loop is slow; at a high rate also far from zero.
        low, high = nearest
        tried = (0.0, 2.0 * nearest.critical, (low + high) / 2.0)
        radius = min(
            self.spectral_radius(WashoutGains(corner_frequency, gain, 0.0))
            for gain in tried
            if low < gain < high
        )
        return intervals if radius < 1.0 - _ROUNDING else []

    def critical_linear_gain(self, corner_frequency: float) -> float | None:
        """Return the linear gain that the loop needs, or that it allows, to be stable.

        It is the critical end of the stable interval nearest to zero. At a high rate and without
        delay it is k1* of the continuous loop, which is stable below it.

        Parameters
        ----------
        corner_frequency : float
            Cutoff frequency, rad/s.

        Returns
        -------
        float or None
            Critical linear gain, N s/m; None if no gain stabilises the loop.
        """
        intervals = self.stable_linear_gains(corner_frequency)
        return min(intervals, key=_distance).critical if intervals else None

    def coarsened(self) -> Self:
        """Return a similar loop at a rate at which even a long delay is few periods, for searches.

        To hold the force also delays it, by half a period on average; the sum is kept. A loop of
        small order is returned as it is.
        """
        if self.order <= 24:  # searching many gains is quick
            return self
        rate = min(self.rate, max(20.0 / self.force_delay, 5.0 * self.drive.angular_frequency))
        mean_delay = self.force_delay + 0.5 / self.rate
        return replace(self, rate=rate, force_delay=mean_delay - 0.5 / rate)

    @property
    def order(self) -> int:
        """Number n of components of the state."""
        whole, rest = self.delay
        return 3 + whole + (rest > 0.0)

    @cached_property
    def period(self) -> float:
        """Sample period T, dimensionless."""
        return self.drive.angular_frequency / self.rate

    @cached_property
    def delay(self) -> tuple[int, float]:
        """Delay in whole periods, and the remainder in periods, below one."""
        return whole_and_rest(self.force_delay * self.rate)

    @cached_property
    def held(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Effect of one period: transition of the slide, and the effects of two unit forces.

        The first force starts during the period (or with it), and the second ends in it. Shapes (2,
        2), (2,), (2,).
        """
        split = self.delay[1]
        before, ending = self._slide(split)
        after, starting = self._slide(1.0 - split)
        return after @ before, starting, after @ ending

    def _slide(self, periods: float) -> tuple[FloatArray, FloatArray]:
        """Return the transition of the slide over some periods, and the effect of a unit force."""
        block = np.zeros((3, 3))
        block[:2, :2] = self.jacobian
        block[1, 2] = 1.0
        transition = _exponential(block * (periods * self.period))
        return transition[:2, :2], transition[:2, 2]

    def _radii(self, corner_frequency: float, linear_gains: FloatArray) -> FloatArray:
        scaled = WashoutGains(corner_frequency, linear_gains, 0.0).scaled(self.drive)
        corners = np.full(len(linear_gains), scaled.corner_frequency)
        return _spectral_radius(self._transitions(corners, scaled.linear))

    def _transitions(self, corner_frequency: Any, linear_gain: Any) -> FloatArray:
        """Return the transition matrices for dimensionless arrays of one shape, (..., n, n)."""
        whole, split = self.delay
        under_way = self.order - 3
        slide, starting, ending = self.held
        matrix = np.zeros((*corner_frequency.shape, 3 + under_way, 3 + under_way))
        forces = np.zeros((*corner_frequency.shape, 1 + under_way, 3 + under_way))
        forces[..., 0, 1] = linear_gain
        forces[..., 0, _FILTER] = -linear_gain
        forces[..., 1:, 3:] = np.eye(under_way)
        matrix[..., _SLIDE, _SLIDE] = slide
        matrix[..., _SLIDE, :] += starting[:, None] * forces[..., whole, None, :]
        if split > 0.0:
            matrix[..., _SLIDE, :] += ending[:, None] * forces[..., whole + 1, None, :]
        step = -np.expm1(-corner_frequency * self.period)
        matrix[..., _FILTER, 1] = step
        matrix[..., _FILTER, _FILTER] = 1.0 - step
        matrix[..., 3:, :] = forces[..., :-1, :]
        return matrix


def settling_time(decay_rate: float) -> float | None:
    """Return the time (s) in which a deviation with this decay rate (1/s) falls to a hundredth."""
    return -log(SETTLED) / decay_rate if decay_rate > 0.0 else None


class _Boundary:
    """1/G(e^(j theta)), the gains that put a multiplier there; dimensionless.

    From the force to v, with l = e^(j theta) and the whole periods m of the delay,
    G = (l - 1)^2 (b l + c) / (l^(m+1) (l - e^(-d T)) (l - e^(s1 T)) (l - e^(s2 T))),
    s1 and s2 being the eigenvalues of the open loop. One factor l - 1 is the filter's; the other
    one shows that a constant force does not move the slide permanently. b and c are the force that
    starts during a period, and the one that ends in it. In this form nothing cancels at high rates.
    """

    def __init__(self, loop: LinearSampledLoop, corner_frequency: float) -> None:
        slide, starting, ending = loop.held
        self._whole = loop.delay[0]
        self._period = loop.period
        values = np.linalg.eigvals(loop.jacobian).astype(np.complex128)
        self._poles = np.array([-corner_frequency, *values]) * loop.period
        self._starting = float(starting[1])
        self._ending = float(slide[0, 0] * ending[1] - slide[1, 0] * ending[0])

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
        zeros = np.expm1(1j * theta) ** 2 * (self._starting * forward + self._ending)
        with np.errstate(divide="ignore", invalid="ignore"):
            return forward ** (self._whole + 1) * differences / zeros

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
        # An undamped drive's own multipliers are on the circle, which is a gain of zero.
        unsure = np.abs(self.gain(low + _ROUNDING * self._period) - gains)
        gains = np.where(np.abs(gains) > unsure, gains.real, 0.0)
        for gain, number in zip(gains.tolist(), rising.tolist(), strict=True):
            yield gain, 2 * int(number)
        # One real multiplier at -1. By symmetry 1/G is real there; the sum is exact.
        poles = np.exp(self._poles)
        difference = self._ending - self._starting
        if difference != 0.0:
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
        if self._ending > 0.0 and self._starting > 0.0:
            parts.append(self._near(pi, abs(log(self._ending / self._starting))))
        theta = np.sort(np.concatenate(parts))
        return theta[(theta > 0.0) & (theta < pi)]

    @staticmethod
    def _near(angle: float, width: float) -> FloatArray:
        distances: Any = np.geomspace(1e-3 * max(width, 1e-12), pi, 200)
        return np.concatenate([angle - distances, angle + distances])


def _exponential(matrix: FloatArray) -> FloatArray:
    """Return the exponential of a small matrix: the series of a part of it, squared repeatedly.

    scipy's version divides each one among threads, which takes hundreds of times as long.
    """
    squarings = max(frexp(float(np.abs(matrix).sum(axis=0).max()))[1] + 1, 0)
    part, one = matrix * 0.5**squarings, np.eye(len(matrix))
    found = one
    # With a norm of one half the remaining terms are below rounding.
    for order in range(16, 0, -1):
        found = one + part @ found / order
    for _ in range(squarings):
        found = found @ found
    return found


def _spectral_radius(matrices: FloatArray) -> Any:
    return np.abs(np.linalg.eigvals(matrices)).max(axis=-1)


def _distance(interval: GainInterval) -> float:
    """Return how far the interval is from zero."""
    return max(interval.low, -interval.high, 0.0)
