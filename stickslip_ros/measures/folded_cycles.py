"""Cycles of positions with noise, folded onto each other: period, drift, stick and shape."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf, pi
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.measures.drift import fit_line
from stickslip_ros.measures.stick_fit import StickFit, fit_stick

_DIFFERENCE = 1e-6
"""Step of a difference over the phase, in periods."""
GRID = 512
"""Points of a cycle at which its extremes are looked for."""
STICK_LEVEL = 6.63
"""Gain in squared residuals, in variances, above which a stick is shown: a test at 1 %."""
_HARMONICS = (6, 10, 14, 20, 28)
"""Numbers of harmonics of a cycle without a stick, from which the data choose."""
_DEGREES = (6, 9, 12, 16, 20, 26)
"""Degrees of the polynomial of a slip, beyond the conditions at its ends, likewise."""
_UNTESTED_ERRORS = 10.0
"""Stick time, in standard errors, from which a stick needs no test."""
STICKING_SHARE = 0.85
"""Share of the belt speed that a motion reaches that may stick."""
_PASSING_SHARE = 1.2
"""Share of the belt speed beyond which a motion has passed the belt instead of sticking."""
_FEW_STEPS = 25.0
"""Range, in steps of an encoder without noise, up to which stairs hide the form of the friction."""
_WHITENING_RESIDUAL = 0.45
"""Residual, in steps of an encoder, above which there is noise that makes the rounding white."""
_LEAST_DRIFTING, _DRIFT_ERRORS = 8, 5.0
"""Number of cycles, and standard errors of the drift, from which a drift is taken out."""
_OFFSETS = 16
"""Number of offsets of the grid of an encoder for which rounding is looked at."""


@dataclass(frozen=True)
class Shape:
    """A fitted cycle: its position as a function of the phase (s), `rows` by what was `found`."""

    rows: Callable[[FloatArray], FloatArray]
    """Derivatives of the position by the coefficients, in rows."""
    found: FloatArray
    covariance: FloatArray
    period: float

    def rates(self, phase: FloatArray) -> FloatArray:
        """Return the derivatives of the rows by time, by a central difference."""
        step = _DIFFERENCE * self.period
        return (self.rows(phase + step) - self.rows(phase - step)) / (2.0 * step)

    def value(self, phase: FloatArray) -> FloatArray:
        """Return positions, m, at phases, s."""
        return self.rows(phase) @ self.found

    def velocity(self, phase: FloatArray) -> FloatArray:
        """Return velocities, m/s, at phases, s."""
        return self.rates(phase) @ self.found


class Stick(NamedTuple):
    """Stick of the cycles, with the standard errors of duration, speed, landing and departure."""

    fit: StickFit
    time_error: float
    speed_error: float
    edge_errors: tuple[float, float]


class FoldedCycles:
    """Samples of several cycles and their common period."""

    def __init__(
        self, time: FloatArray, position: FloatArray, count: int, period: float, step: float
    ) -> None:
        self.time, self.position, self.count, self.period = time, position, count, period
        self._step = step
        self.hidden_stick = 0.0
        """Stick time, s, that would not show: the error of a motion that shows none."""

    @property
    def _turns(self) -> FloatArray:
        return self.time / self.period

    @property
    def phase(self) -> FloatArray:
        """Time of each sample within its cycle, s, from 0 to the period."""
        turns: FloatArray = self._turns % 1.0
        return turns * self.period

    @property
    def number(self) -> IntArray:
        """Number of the cycle of each sample."""
        return np.clip(np.floor(self._turns), 0, self.count - 1).astype(np.int64)

    @property
    def phases(self) -> float:
        """Period over the largest gap between the samples of all cycles."""
        phase = np.sort(self.phase)
        return self.period / float(np.diff(phase, append=phase[0] + self.period).max())

    def smooth(self) -> Shape:
        """Return the cycle as a Fourier series, after fitting the period to it."""

        def rows(phase: FloatArray, harmonics: int) -> FloatArray:
            angle = phase[:, None] * (2.0 * pi / self.period * np.arange(1.0, harmonics + 1.0))
            return np.hstack([np.ones((len(phase), 1)), np.cos(angle), np.sin(angle)])

        most = max(len(self.time) // (3 * self.count), 1)
        if most < _HARMONICS[0]:  # the cycles have samples at different phases
            most = max(min(int(self.phases / 3.0), _HARMONICS[2]), 1)
        few = min(_HARMONICS[0], most)
        for _ in range(6):
            if abs(self.adjust(self._linear(rows, [few]))) < 1e-9:
                break
        if self._step:  # more harmonics would follow the stairs
            most = min(most, max(int(np.ptp(self.position) / self._step / 2.0), 2))
        choices = [each for each in _HARMONICS if each <= most] or [most]
        return self._linear(rows, choices)

    def remove_drift(self, shape: Shape) -> bool:
        """Return whether the positions drift, after the drift is taken out of them.

        The cycles would not lie on each other. It is that of what the shape leaves in each cycle.
        """
        residual, number = self.position - shape.value(self.phase), self.number
        seen = np.bincount(number, minlength=self.count)
        if self.count < _LEAST_DRIFTING or seen.min() == 0:
            return False
        middle = (np.arange(self.count) - (self.count - 1) / 2.0) * self.period
        means = np.bincount(number, residual) / seen
        rate, error = fit_line(middle.astype(np.float64), means.astype(np.float64))
        drifts = abs(rate) > _DRIFT_ERRORS * error
        if drifts:
            self.position = self.position - rate * (self.time - self.count * self.period / 2.0)
        return drifts

    def _linear(
        self,
        rows: Callable[[FloatArray, int], FloatArray],
        sizes: Sequence[int],
        known: int = 0,
    ) -> Shape:
        """Return a shape that is linear in coefficients, of the size that the data ask for.

        The first ones are `known` to be 1.
        """
        phase = self.phase
        squares, width, size = inf, 0, sizes[0]
        basis = residual = found = np.empty((0, 0))
        for size in sizes:
            every = rows(phase, size)
            basis, rest = every[:, known:], self.position - every[:, :known].sum(axis=1)
            found = np.linalg.lstsq(basis, rest, rcond=None)[0]
            residual = rest - basis @ found
            left, more = float(residual @ residual), basis.shape[1] - width
            # A coefficient takes one variance of noise. The size that adds no more than noise is
            # used, not the one before it: then the bias is small against the standard error.
            if squares - left <= 3.0 * more * left / max(len(phase) - basis.shape[1], 1):
                break
            squares, width = left, basis.shape[1]
        return Shape(
            lambda phase: rows(phase, size),
            np.append(np.ones(known), found),
            np.pad(self._covariance(basis, residual, slice(None)), ((known, 0), (known, 0))),
            self.period,
        )

    def stick(self, shape: Shape, belt_speed: float, noise: float) -> Stick | None:
        """Return the stick of the cycles; None without one."""
        grid = np.linspace(0.0, self.period, GRID, endpoint=False)
        velocity = shape.velocity(grid)
        if not STICKING_SHARE * belt_speed < velocity.max() < _PASSING_SHARE * belt_speed:
            return None
        near = velocity > np.minimum(0.93 * belt_speed, 0.98 * velocity.max())
        turn = 2j * pi / self.period
        centre = np.angle(np.sum(np.exp(turn * grid[near]))) / (2.0 * pi) * self.period
        guess = max(np.count_nonzero(near) * self.period / GRID - 0.05 * self.period, 0.0)
        frequency = 2.0 * pi / self.period
        reach = guess / 2.0 + _reach(noise * frequency / belt_speed) / frequency
        around = self.phase - centre
        around -= np.rint(around / self.period) * self.period
        used = np.flatnonzero(np.abs(around) < min(reach, 0.49 * self.period))
        gap = self.period / self.phases
        self.hidden_stick = max(guess, gap)
        if len(used) < 12:
            return None
        time, position = around[used], self.position[used]
        # The stairs of a few steps look like falls of the friction.
        may_fall = (
            noise >= self._step / 2.0 or float(np.ptp(self.position)) > _FEW_STEPS * self._step
        )
        with_stick = fit_stick(time, position, belt_speed, frequency, guess, may_fall=may_fall)
        covariance = self._covariance(with_stick.jacobian, with_stick.residual, used)
        covariance[:3, :3] += with_stick.spread
        middle, length, speed = np.eye(3, len(covariance))
        landing, departure, time_error, speed_error = (
            float(np.sqrt(g @ covariance @ g))
            for g in (middle - length / 2.0, middle + length / 2.0, length, speed)
        )
        hidden = with_stick.stick_time < self.period / len(self.time)  # no sample need be in it
        if not hidden and with_stick.stick_time < _UNTESTED_ERRORS * time_error:
            without = fit_stick(time, position, with_stick.belt_speed, frequency, 0.0, sticks=False)
            variance = with_stick.squares / max(len(time) - with_stick.jacobian.shape[1], 1)
            hidden = without.squares - with_stick.squares <= STICK_LEVEL * variance
        if hidden:
            # A short stick changes the positions by its square, by s = 2 t dt with a time t.
            unseen = (2.0 * with_stick.stick_time * time_error) ** 0.5
            self.hidden_stick = max(with_stick.stick_time, unseen, gap)
            return None
        moved = replace(
            with_stick,
            centre=with_stick.centre + centre,
            offset=with_stick.offset - with_stick.belt_speed * centre,
        )
        return Stick(moved, time_error, speed_error, (landing, departure))

    def slip(self, stick: StickFit) -> Shape:
        """Return the cycle as a stick and a slip that starts and ends at the speed of the belt."""
        length = self.period - stick.stick_time

        def rows(phase: FloatArray, degree: int) -> FloatArray:
            after = (phase - stick.departure) % self.period
            u = np.clip(after / length, 0.0, 1.0)
            line = stick.offset + stick.belt_speed * (after + stick.departure)
            # After the landing the next stick has started: its line is lower.
            line -= stick.belt_speed * self.period * u * u * (3.0 - 2.0 * u)
            slip = (u * (1.0 - u))[:, None] ** 2 * chebyshev.chebvander(2.0 * u - 1.0, degree)
            return np.column_stack([line, slip])

        # With a whole number of samples per cycle the slip has few different ones.
        most = self.phases * length / self.period / 2.0
        degrees = [each for each in _DEGREES if each <= most] or _DEGREES[:1]
        return self._linear(rows, degrees, known=1)

    def adjust(self, shape: Shape) -> float:
        """Fit the period to what a shape leaves; return its change, as a share."""
        jacobian, residual = self._shifts(shape), self.position - shape.value(self.phase)
        found = np.linalg.lstsq(jacobian, residual, rcond=None)[0]
        change = float(np.clip(found[1] / self.period, -0.02, 0.02))
        self.period *= 1.0 + change
        return change

    def period_error(self, shape: Shape, residual: FloatArray) -> float:
        """Return the standard error of the period, s."""
        covariance = self._covariance(self._shifts(shape), residual, slice(None))
        return float(np.sqrt(covariance[1, 1]))

    def relative_amplitudes(self, shape: Shape, residual: FloatArray) -> FloatArray:
        """Return the amplitude of each cycle over that of the shape."""
        phase, number = self.phase, self.number
        values = shape.value(phase)
        rate = shape.velocity(phase)
        design = np.column_stack([values - values.mean(), np.ones(len(phase)), rate])
        relative = np.ones(self.count)
        for cycle in range(self.count):
            rows = number == cycle
            if np.count_nonzero(rows) > 6:
                found = np.linalg.lstsq(design[rows], residual[rows], rcond=None)[0]
                relative[cycle] += found[0]
        return relative

    def _shifts(self, shape: Shape) -> FloatArray:
        """Return the derivatives of the positions by delay, period and offset."""
        rate = -shape.velocity(self.phase)
        return np.column_stack([rate, rate * self._turns, np.ones(len(rate))])

    def _covariance(
        self, jacobian: FloatArray, residual: FloatArray, rows: IntArray | slice
    ) -> FloatArray:
        """Return the covariance of a fit to these rows, see `_clustered`, and that by rounding.

        Rounding to steps follows the motion alike in each cycle: it is the mean over the offsets
        that the fit may have from the grid of the steps.
        """
        covariance = _clustered(jacobian, residual, self.number[rows])
        if float(np.std(residual)) < _WHITENING_RESIDUAL * self._step:
            fitted = self.position[rows] - residual
            steps = fitted[:, None] / self._step + np.arange(_OFFSETS) / _OFFSETS
            errors = np.linalg.pinv(jacobian) @ ((np.rint(steps) - steps) * self._step)
            covariance += errors @ errors.T / _OFFSETS
        return covariance


def _clustered(jacobian: FloatArray, residual: FloatArray, number: IntArray) -> FloatArray:
    """Return the covariance of a least-squares fit, by its noise or by the scatter of the cycles.

    Whichever has the larger standard errors: cycles that differ make the residuals of one cycle
    depend on each other. Their scatter is the sandwich of Liang and Zeger (Biometrika 1986).
    """
    freedom = max(len(residual) - jacobian.shape[1], 1)
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    plain = inverse * float(residual @ residual) / freedom
    scores = np.array(
        [jacobian[number == each].T @ residual[number == each] for each in np.unique(number)]
    )
    count = len(scores)
    if count < 2:
        return plain
    scatter = inverse @ (scores.T @ scores) @ inverse * (count / (count - 1))
    scale = np.sqrt(np.maximum(np.diag(scatter), 1e-300) / np.maximum(np.diag(plain), 1e-300))
    # The scatter of twenty cycles is itself uncertain by a sixth.
    return scatter if float(np.median(scale)) > 1.0 + 2.0 / np.sqrt(2.0 * count) else plain


def _reach(noise: float) -> float:
    """Return how far from the edges the fit reaches, in radians of the cycle.

    A wide reach biases, a narrow one leaves noise: 9 ms at 0.1 um, 13 ms at 5 um for a slide of
    16 Hz at 40 mm/s. `noise` is in natural units.
    """
    return float(np.clip((noise / 1.4e-4) ** 0.09, 0.5, 1.6))
