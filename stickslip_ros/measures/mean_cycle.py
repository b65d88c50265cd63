"""The mean cycle of positions with noise: cycles that are alike, folded onto each other.

Folded by a fitted period, the positions of the cycles lie on each other. They are fitted by a
Fourier series, or by a stick (`stick_fit`) and a polynomial slip where a test of the squared
residuals shows a stick. The standard errors are those of linear least squares, from the noise or,
if larger, from the scatter of the cycles: the sandwich of K.-Y. Liang and S. L. Zeger, Longitudinal
data analysis using generalized linear models, Biometrika 73, 1986.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import hypot, inf, pi, sqrt
from typing import NamedTuple, Self

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray, rms
from stickslip_ros.measures.cycle_measures import LEAST_CYCLES, STICKING_SHARE, Cycle, CycleMeans
from stickslip_ros.measures.noise import FEW_SAMPLES, LEAST_SAMPLES
from stickslip_ros.measures.parabolas import vertex
from stickslip_ros.measures.stick_fit import StickFit, fit_stick

_DIFFERENCE = 1e-6
"""Step of a difference over the phase, in periods."""
_GRID = 512
"""Points of a cycle at which its extremes are looked for."""
_STICK_LEVEL, _UNTESTED_ERRORS = 6.63, 10.0
"""Gain in squared residuals, in variances, above which a stick is shown, a test at 1 %; stick time,
in standard errors, from which a stick needs no test."""
_HARMONICS, _DEGREES = (6, 10, 14, 20, 28), (6, 9, 12, 16, 20, 26)
"""Numbers of harmonics of a cycle without a stick, and degrees of the polynomial of a slip beyond
the conditions at its ends, from which the data choose."""
_PASSING_SHARE = 1.2
"""Highest speed, in belt speeds, from which a motion has passed the belt."""
_FEW_STEPS = 25.0
"""Range, in steps of an encoder without noise, up to which stairs hide the form of the friction."""
_WHITENING_RESIDUAL, _OFFSETS = 0.45, 16
"""Residual, in steps of an encoder, above which there is noise that makes the rounding white;
number of offsets of the grid of an encoder for which rounding is looked at."""
_LEAST_DRIFTING, _DRIFT_ERRORS = 8, 5.0
"""Number of cycles, and standard errors of the drift, from which a drift is taken out."""
_LEAST_PHASES = 12.0
"""Least number of different phases: with a whole number of samples per cycle there are no more."""
_UNLIKE_NOISE, _UNLIKE_AMPLITUDE = 3.0, 0.05
"""Residuals, in deviations of the noise and in amplitudes, up to which cycles are alike."""


@dataclass(frozen=True)
class Shape:
    """A fitted cycle: its position as a function of the phase (s), `rows` by what was `fitted`."""

    rows: Callable[[FloatArray], FloatArray]
    """Derivatives of the position by the coefficients, in rows."""
    fitted: FloatArray
    covariance: FloatArray
    period: float

    @property
    def grid(self) -> FloatArray:
        """Phases, s, at which extremes are looked for."""
        return np.linspace(0.0, self.period, _GRID, endpoint=False)

    @property
    def fastest(self) -> tuple[float, float]:
        """The highest velocity, m/s, and three of its standard errors."""
        velocity = self.velocity(self.grid)
        row = self.rates(self.grid[[np.argmax(velocity)]])[0]
        return float(velocity.max()), 3.0 * sqrt(row @ self.covariance @ row)

    def rates(self, phase: FloatArray) -> FloatArray:
        """Return the derivatives of the rows by time, by a central difference."""
        step = _DIFFERENCE * self.period
        return (self.rows(phase + step) - self.rows(phase - step)) / (2.0 * step)

    def value(self, phase: FloatArray) -> FloatArray:
        """Return positions, m, at phases, s."""
        return self.rows(phase) @ self.fitted

    def velocity(self, phase: FloatArray) -> FloatArray:
        """Return velocities, m/s, at phases, s."""
        return self.rates(phase) @ self.fitted


class Stick(NamedTuple):
    """Stick of the cycles, with the standard errors of duration, speed, landing and departure."""

    fit: StickFit
    time_error: float
    speed_error: float
    edge_errors: tuple[float, float]


@dataclass(frozen=True)
class MeanCycle(CycleMeans):
    """Mean of cycles that are alike; they stick if the data show it, at a level of 1 %."""

    noise: float
    """Standard deviation of the residuals, m."""
    phase: FloatArray
    """Time of each sample within its cycle, s; shape (n,)."""
    position: FloatArray
    """Positions, m; shape (n,)."""
    fitted: FloatArray
    """The fit at each sample, m; shape (n,)."""
    stick: Stick | None
    """The stick within the cycle, on a belt that moves forward; None without one."""
    overtakes: bool
    """Whether the slide overtakes the belt, and may stick for a moment where it passes its speed.
    """


def fit_mean_cycle(
    time: FloatArray,
    position: FloatArray,
    belt_velocity: float,
    starts: FloatArray,
    noise: float,
    step: float,
    stick_speed: float,
) -> MeanCycle | None:
    """Fit the mean of cycles of equal period to samples, s and m, on a belt with a velocity, m/s.

    `starts` are the starts of the cycles and the end of the last, s, `noise` is the standard
    deviation of the positions, m, and `step` that to which they are rounded, m. With a
    `stick_speed`, m/s, for friction with a memory, the slide sticks where the Fourier series has
    at most this relative speed. None where there are too few samples, or where the cycles are not
    alike.
    """
    count = len(starts) - 1
    if count < LEAST_CYCLES or len(time) < LEAST_SAMPLES * count:
        return None
    sign, belt_speed = -1.0 if belt_velocity < 0.0 else 1.0, abs(belt_velocity)
    period = float(starts[-1] - starts[0]) / count
    fold, shape = FoldedCycles(time - starts[0], sign * position, count, period, step).smoothed()
    if len(time) < FEW_SAMPLES * count and fold.phases < _LEAST_PHASES:
        return None
    stick, hidden, overtakes = None, 0.0, False
    if belt_speed > 0.0 and stick_speed == 0.0:
        stick, hidden = _find_stick(fold, shape, belt_speed, noise)
        fastest, error = shape.fastest
        overtakes = fastest - error > _PASSING_SHARE * belt_speed
    if stick is not None:
        fold = fold.adjusted(fold.slip(stick.fit))
        shape = fold.slip(stick.fit)
    fitted = shape.value(fold.phase)
    residual = fold.position - fitted
    cycle, errors = _measures(shape, stick, fold.period_error(shape, residual), hidden)
    if stick_speed > 0.0:
        share, error = _slow_share(shape, belt_speed, stick_speed)
        cycle, errors = replace(cycle, stick_fraction=share), replace(errors, stick_fraction=error)
    if rms(residual) > _UNLIKE_NOISE * noise + _UNLIKE_AMPLITUDE * cycle.amplitude:
        return None
    return MeanCycle(
        cycle=replace(cycle, midpoint=sign * cycle.midpoint),
        errors=errors,
        sticks=cycle.stick_fraction > 0.0,
        amplitudes=cycle.amplitude * fold.relative_amplitudes(shape, residual),
        noise=rms(residual),
        phase=fold.phase,
        position=sign * fold.position,
        fitted=sign * fitted,
        stick=stick,
        overtakes=overtakes,
    )


@dataclass(frozen=True)
class FoldedCycles:
    """Samples of several cycles and their common period; SI units."""

    time: FloatArray
    position: FloatArray
    count: int
    period: float
    step: float

    @property
    def phase(self) -> FloatArray:
        """Time of each sample within its cycle, s, from 0 to the period."""
        return self.time / self.period % 1.0 * self.period

    @property
    def number(self) -> IntArray:
        """Number of the cycle of each sample."""
        return np.clip(np.floor(self.time / self.period), 0, self.count - 1).astype(np.int64)

    @property
    def phases(self) -> float:
        """Period over the largest gap between the samples of all cycles."""
        phase = np.sort(self.phase)
        return self.period / float(np.diff(phase, append=phase[0] + self.period).max())

    def smoothed(self) -> tuple[Self, Shape]:
        """Return the cycles with a fitted period, and their Fourier series."""
        fold = self
        most = max(len(fold.time) // (3 * fold.count), 1)
        if most < _HARMONICS[0]:  # the cycles have samples at different phases
            most = max(min(int(fold.phases / 3.0), _HARMONICS[2]), 1)
        for _ in range(6):
            before = fold.period
            fold = fold.adjusted(fold._series([min(_HARMONICS[0], most)]))
            if abs(fold.period / before - 1.0) < 1e-9:
                break
        if fold.step:  # more harmonics would follow the stairs
            most = min(most, max(int(np.ptp(fold.position) / fold.step / 2.0), 2))
        return fold, fold._series([size for size in _HARMONICS if size <= most] or [most])

    def _series(self, sizes: Sequence[int]) -> Shape:
        def rows(phase: FloatArray, harmonics: int) -> FloatArray:
            angle = phase[:, None] * (2.0 * pi / self.period * np.arange(1.0, harmonics + 1.0))
            return np.hstack([np.ones((len(phase), 1)), np.cos(angle), np.sin(angle)])

        return self._linear(rows, sizes)

    def slip(self, stick: StickFit) -> Shape:
        """Return the cycle as a stick and a slip that starts and ends at the speed of the belt."""
        from numpy.polynomial import chebyshev  # only where it is noisy

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
        degrees = [degree for degree in _DEGREES if degree <= most] or _DEGREES[:1]
        return self._linear(rows, degrees, known=1)

    def _linear(
        self, rows: Callable[[FloatArray, int], FloatArray], sizes: Sequence[int], known: int = 0
    ) -> Shape:
        """Return a shape that is linear in coefficients, of the size that the data ask for.

        The first ones are `known` to be 1.
        """
        phase = self.phase
        squares, width, size = inf, 0, sizes[0]
        basis = residual = coefficients = np.empty((0, 0))
        for size in sizes:
            every = rows(phase, size)
            basis, rest = every[:, known:], self.position - every[:, :known].sum(axis=1)
            coefficients = np.linalg.lstsq(basis, rest, rcond=None)[0]
            residual = rest - basis @ coefficients
            left, more = float(residual @ residual), basis.shape[1] - width
            # A coefficient takes one variance of noise. The size that adds no more than noise is
            # used, not the one before it: then the bias is small against the standard error.
            if squares - left <= 3.0 * more * left / max(len(phase) - basis.shape[1], 1):
                break
            squares, width = left, basis.shape[1]
        covariance = self.covariance(basis, residual, slice(None))
        return Shape(
            lambda phase: rows(phase, size),
            np.append(np.ones(known), coefficients),
            np.pad(covariance, ((known, 0), (known, 0))),
            self.period,
        )

    def adjusted(self, shape: Shape) -> Self:
        """Return the cycles with the period, and without the drift, that fit what a shape leaves.

        With a drift the cycles would not lie on each other. A few do not tell it.
        """
        shifts, residual = self._shifts(shape), self.position - shape.value(self.phase)
        columns = 4 if self.count >= _LEAST_DRIFTING else 3
        coefficients = np.linalg.lstsq(shifts[:, :columns], residual, rcond=None)[0]
        change = float(np.clip(coefficients[1] / self.period, -0.02, 0.02))
        drift = shifts[:, 3:columns] @ coefficients[3:]
        error = rms(residual - shifts[:, :columns] @ coefficients) / len(residual) ** 0.5
        drift *= float(np.std(drift)) > _DRIFT_ERRORS * error
        return replace(self, period=self.period * (1.0 + change), position=self.position - drift)

    def period_error(self, shape: Shape, residual: FloatArray) -> float:
        """Return the standard error of the period, s."""
        covariance = self.covariance(self._shifts(shape)[:, :3], residual, slice(None))
        return float(np.sqrt(covariance[1, 1]))

    def relative_amplitudes(self, shape: Shape, residual: FloatArray) -> FloatArray:
        """Return the amplitude of each cycle over that of the shape."""
        values, number = shape.value(self.phase), self.number
        rate = shape.velocity(self.phase)
        design = np.column_stack([values - values.mean(), np.ones(len(rate)), rate])
        relative = np.ones(self.count)
        for cycle in range(self.count):
            rows = number == cycle
            if np.count_nonzero(rows) > 6:
                relative[cycle] += np.linalg.lstsq(design[rows], residual[rows], rcond=None)[0][0]
        return relative

    def _shifts(self, shape: Shape) -> FloatArray:
        """Return the derivatives of the positions by delay, period, offset and drift."""
        rate, turns = -shape.velocity(self.phase), self.time / self.period
        return np.column_stack([rate, rate * turns, np.ones(len(rate)), turns - self.count / 2.0])

    def covariance(
        self, jacobian: FloatArray, residual: FloatArray, rows: IntArray | slice
    ) -> FloatArray:
        """Return the covariance of a fit to these rows, see `_clustered`, and that by rounding.

        Rounding to steps follows the motion alike in each cycle: it is the mean over the offsets
        that the fit may have from the grid of the steps.
        """
        covariance = _clustered(jacobian, residual, self.number[rows])
        if float(np.std(residual)) < _WHITENING_RESIDUAL * self.step:
            fitted = self.position[rows] - residual
            steps = fitted[:, None] / self.step + np.arange(_OFFSETS) / _OFFSETS
            errors = np.linalg.pinv(jacobian) @ ((np.rint(steps) - steps) * self.step)
            covariance += errors @ errors.T / _OFFSETS
        return covariance


def _clustered(jacobian: FloatArray, residual: FloatArray, number: IntArray) -> FloatArray:
    """Return the covariance of a least-squares fit, by its noise or by the scatter of the cycles.

    Whichever has the larger standard errors: cycles that differ make the residuals of one cycle
    depend on each other.
    """
    freedom = max(len(residual) - jacobian.shape[1], 1)
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    plain = inverse * float(residual @ residual) / freedom
    scores = np.array(
        [jacobian[number == cycle].T @ residual[number == cycle] for cycle in np.unique(number)]
    )
    count = len(scores)
    if count < 2:
        return plain
    scatter = inverse @ (scores.T @ scores) @ inverse * (count / (count - 1))
    scale = np.sqrt(np.maximum(np.diag(scatter), 1e-300) / np.maximum(np.diag(plain), 1e-300))
    # The scatter of twenty cycles is itself uncertain by a sixth.
    return scatter if float(np.median(scale)) > 1.0 + 2.0 / np.sqrt(2.0 * count) else plain


def _find_stick(
    fold: FoldedCycles, shape: Shape, belt_speed: float, noise: float
) -> tuple[Stick | None, float]:
    """Return the stick of the cycles, if they show one, and the stick time that would not."""
    part = _fast_part(shape, belt_speed)
    if part is None:
        fastest, error = shape.fastest
        far = fastest + error < STICKING_SHARE * belt_speed
        far |= fastest - error > _PASSING_SHARE * belt_speed
        # Where the noise hides how fast it is, a stick may be as long as the last term's period.
        return None, 0.0 if far else 2.0 * shape.period / (len(shape.fitted) - 1)
    (centre, guess), gap = part, fold.period / fold.phases
    frequency = 2.0 * pi / fold.period
    reach = guess / 2.0 + _reach(noise * frequency / belt_speed) / frequency
    around = fold.phase - centre
    around -= np.rint(around / fold.period) * fold.period
    used = np.flatnonzero(np.abs(around) < min(reach, 0.49 * fold.period))
    if len(used) < 12:
        return None, max(guess, gap)
    samples = around[used], fold.position[used]
    # The stairs of a few steps look like falls of the friction.
    may_fall = bool(noise >= fold.step / 2.0 or np.ptp(fold.position) > _FEW_STEPS * fold.step)
    fit = fit_stick(*samples, belt_speed, frequency, guess, may_fall=may_fall)
    stick = _with_errors(fit, fold.covariance(fit.jacobian, fit.residual, used), centre)
    # In a short one no sample need be.
    hidden = fit.stick_time < fold.period / len(fold.time)
    if not hidden and fit.stick_time < _UNTESTED_ERRORS * stick.time_error:
        without = fit_stick(*samples, fit.belt_speed, frequency, 0.0)
        variance = fit.squares / max(len(used) - fit.jacobian.shape[1], 1)
        hidden = without.squares - fit.squares <= _STICK_LEVEL * variance
    if not hidden:
        return stick, 0.0
    # A short stick changes the positions by its square, by s = 2 t dt with a time t.
    return None, max(fit.stick_time, (2.0 * fit.stick_time * stick.time_error) ** 0.5, gap)


def _fast_part(shape: Shape, belt_speed: float) -> tuple[float, float] | None:
    """Return the middle of what is about as fast as the belt, and the stick time in it, s.

    None where the motion does not come near the speed of the belt, or passes it.
    """
    velocity, frequency = shape.velocity(shape.grid), 2.0 * pi / shape.period
    if not STICKING_SHARE * belt_speed < velocity.max() < _PASSING_SHARE * belt_speed:
        return None
    near = velocity > np.minimum(0.93 * belt_speed, 0.98 * velocity.max())
    middle = float(np.angle(np.sum(np.exp(1j * frequency * shape.grid[near])))) / frequency
    duration = np.count_nonzero(near) * shape.period / _GRID - 0.05 * shape.period
    return middle, max(duration, 0.0)


def _with_errors(fit: StickFit, covariance: FloatArray, centre: float) -> Stick:
    """Return the stick of a fit at times since a phase, `centre`, with its standard errors."""
    covariance[:3, :3] += fit.spread
    middle, length, speed = np.eye(3, len(covariance))
    time_error, speed_error, landing, departure = (
        float(np.sqrt(g @ covariance @ g))
        for g in (length, speed, middle - length / 2.0, middle + length / 2.0)
    )
    offset = fit.offset - fit.belt_speed * centre
    moved = replace(fit, centre=fit.centre + centre, offset=offset)
    return Stick(moved, time_error, speed_error, (landing, departure))


def _reach(noise: float) -> float:
    """Return how far from the edges the fit reaches, in radians of the cycle.

    A wide reach biases, a narrow one leaves noise: 9 ms at 0.1 um, 13 ms at 5 um for a slide of
    16 Hz at 40 mm/s. `noise` is in natural units.
    """
    return float(np.clip((noise / 1.4e-4) ** 0.09, 0.5, 1.6))


def _measures(
    shape: Shape, stick: Stick | None, period_error: float, hidden_stick: float
) -> tuple[Cycle, Cycle]:
    """Return the measures of a shape, and their standard errors."""
    period, grid = shape.period, shape.grid
    courses = shape.value(grid), shape.velocity(grid)
    at = np.array([_refined(grid, sign * course) for course in courses for sign in (1.0, -1.0)])
    (high, low), (peak, slowest) = shape.value(at)[:2], shape.velocity(at)[2:]
    rows, rates = shape.rows(at), shape.rates(at)
    stick_time, time_error, peak_row, peak_error = 0.0, hidden_stick, rates[2], 0.0
    if stick is not None:
        stick_time, time_error = stick.fit.stick_time, stick.time_error
        peak, peak_row, peak_error = stick.fit.belt_speed, 0.0 * rates[2], stick.speed_error

    def error(gradient: FloatArray) -> float:
        return float(np.sqrt(gradient @ shape.covariance @ gradient))

    cycle = Cycle(
        amplitude=float(high - low) / 2.0,
        velocity_amplitude=float(peak - slowest) / 2.0,
        midpoint=float(high + low) / 2.0,
        period=period,
        frequency=1.0 / period,
        stick_fraction=stick_time / period,
    )
    errors = Cycle(
        amplitude=error((rows[0] - rows[1]) / 2.0),
        velocity_amplitude=hypot(error((peak_row - rates[3]) / 2.0), peak_error / 2.0),
        midpoint=error((rows[0] + rows[1]) / 2.0),
        period=period_error,
        frequency=period_error / period**2,
        stick_fraction=time_error / period,
    )
    return cycle, errors


def _slow_share(series: Shape, belt_speed: float, stick_speed: float) -> tuple[float, float]:
    """Return the share of a cycle with at most this relative speed, m/s, and its standard error.

    The error is what the standard error of the speed changes, and the time that a Fourier series
    resolves, half a period of its last term, where its speed comes near the belt's.
    """
    grid = np.linspace(0.0, series.period, 8 * _GRID, endpoint=False)
    rates = series.rates(grid)
    relative = rates @ series.fitted - belt_speed
    error = np.sqrt(np.maximum(np.sum(rates @ series.covariance * rates, axis=1), 0.0))
    share, most, least = (
        float(np.mean(np.abs(relative) + change <= stick_speed)) for change in (0.0, -error, error)
    )
    near = float(relative.max()) >= -max(stick_speed, (1.0 - STICKING_SHARE) * belt_speed)
    return share, hypot((most - least) / 2.0, 1.0 / (len(series.fitted) - 1) if near else 0.0)


def _refined(grid: FloatArray, values: FloatArray) -> float:
    """Return where values on a periodic grid are highest, by the parabola through three."""
    at = int(np.argmax(values))
    lag, _ = vertex(values.take([at - 1, at, at + 1], mode="wrap"))
    return float(grid[at] + lag * (grid[1] - grid[0]))
