"""Measures of the mean cycle of positions with noise, and their standard errors."""

from dataclasses import dataclass, replace
from math import hypot

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import LEAST_CYCLES, Cycle, CycleMeans
from stickslip_ros.measures.folded_cycles import GRID, STICKING_SHARE, FoldedCycles, Shape, Stick
from stickslip_ros.measures.noise import FEW_SAMPLES, LEAST_SAMPLES

_LEAST_PHASES = 12.0
"""Least number of different phases: with a whole number of samples per cycle there are no more."""
_DRAWS = 64
"""Number of draws from which the error of a share of a cycle is estimated."""
_UNLIKE_NOISE, _UNLIKE_AMPLITUDE = 3.0, 0.05
"""Residuals, in deviations of the noise and in amplitudes, up to which cycles are alike."""


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

    Folded by the period, they are fitted by a Fourier series, or by a stick and a polynomial slip
    where a test of the squared residuals shows a stick. The standard errors are those of linear
    least squares, from the noise or, if larger, from the scatter of the cycles (cluster-robust).

    `starts` are the starts of the cycles and the end of the last, s, `noise` is the standard
    deviation of the positions, m, and `step` that to which they are rounded, m. With a
    `stick_speed`, m/s, for friction with a memory, the slide sticks where the Fourier series has
    at most this relative speed. None where there are too few samples, or where the cycles are not
    alike.
    """
    count = len(starts) - 1
    if count < LEAST_CYCLES or len(time) < LEAST_SAMPLES * count:
        return None
    sign = -1.0 if belt_velocity < 0.0 else 1.0
    period = float(starts[-1] - starts[0]) / count
    fold = FoldedCycles(time - starts[0], sign * position, count, period, step)
    belt_speed = abs(belt_velocity)
    shape = fold.smooth()
    if fold.remove_drift(shape):
        shape = fold.smooth()
    if len(time) < FEW_SAMPLES * count and fold.phases < _LEAST_PHASES:
        return None
    rigid = belt_speed > 0.0 and stick_speed == 0.0
    stick = fold.stick(shape, belt_speed, noise) if rigid else None
    if stick is not None:
        shape = fold.slip(stick.fit)
        fold.adjust(shape)
        shape = fold.slip(stick.fit)
    fitted = shape.value(fold.phase)
    residual = fold.position - fitted
    spread = float(np.sqrt(np.mean(residual**2)))
    cycle, errors = _measures(shape, fold, stick, fold.period_error(shape, residual))
    if stick_speed > 0.0:
        share, error = _slow_share(shape, fold.period, belt_speed, stick_speed)
        cycle, errors = replace(cycle, stick_fraction=share), replace(errors, stick_fraction=error)
    if spread > _UNLIKE_NOISE * noise + _UNLIKE_AMPLITUDE * cycle.amplitude:
        return None
    return MeanCycle(
        cycle=replace(cycle, midpoint=sign * cycle.midpoint),
        errors=errors,
        sticks=cycle.stick_fraction > 0.0,
        amplitudes=cycle.amplitude * fold.relative_amplitudes(shape, residual),
        noise=spread,
        phase=fold.phase,
        position=sign * fold.position,
        fitted=sign * fitted,
        stick=stick,
    )


def _measures(
    shape: Shape, fold: FoldedCycles, stick: Stick | None, period_error: float
) -> tuple[Cycle, Cycle]:
    """Return the measures of a shape, and their standard errors."""
    grid, period = np.linspace(0.0, fold.period, GRID, endpoint=False), fold.period
    courses = shape.value(grid), shape.velocity(grid)
    at = np.array([_refined(grid, sign * course) for course in courses for sign in (1.0, -1.0)])
    positions, velocities = shape.value(at), shape.velocity(at)
    rows, rates = shape.rows(at), shape.rates(at)
    peak, peak_row, peak_error = velocities[2], rates[2], 0.0
    if stick is not None:
        peak, peak_row, peak_error = stick.fit.belt_speed, 0.0 * rates[2], stick.speed_error

    def error(gradient: FloatArray) -> float:
        return float(np.sqrt(gradient @ shape.covariance @ gradient))

    cycle = Cycle(
        amplitude=float(positions[0] - positions[1]) / 2.0,
        velocity_amplitude=float(peak - velocities[3]) / 2.0,
        midpoint=float(positions[0] + positions[1]) / 2.0,
        period=period,
        frequency=1.0 / period,
        stick_fraction=0.0 if stick is None else stick.fit.stick_time / period,
    )
    errors = Cycle(
        amplitude=error((rows[0] - rows[1]) / 2.0),
        velocity_amplitude=hypot(error((peak_row - rates[3]) / 2.0), peak_error / 2.0),
        midpoint=error((rows[0] + rows[1]) / 2.0),
        period=period_error,
        frequency=period_error / period**2,
        stick_fraction=(fold.hidden_stick if stick is None else stick.time_error) / period,
    )
    return cycle, errors


def _slow_share(
    series: Shape, period: float, belt_speed: float, stick_speed: float
) -> tuple[float, float]:
    """Return the share of a cycle with at most this relative speed, m/s, and its standard error.

    The error is that of draws of the coefficients from their covariance, and the time that a
    Fourier series resolves, half a period of its last term, where its speed comes near the belt's.
    """
    grid, random = np.linspace(0.0, period, 8 * GRID, endpoint=False), np.random.default_rng(0)
    draws = random.multivariate_normal(
        0.0 * series.found, series.covariance, _DRAWS, check_valid="ignore", method="eigh"
    )
    relative = series.velocity(grid) - belt_speed
    drawn = np.abs(relative + draws @ series.rates(grid).T) <= stick_speed
    share = float(np.mean(np.abs(relative) <= stick_speed))
    scatter = float(np.sqrt(np.mean((drawn.mean(axis=1) - share) ** 2)))
    near = float(relative.max()) >= -max(stick_speed, (1.0 - STICKING_SHARE) * belt_speed)
    return share, hypot(scatter, 1.0 / (len(series.found) - 1)) if near else scatter


def _refined(grid: FloatArray, values: FloatArray) -> float:
    """Return where values on a periodic grid are highest, by the parabola through three."""
    at = int(np.argmax(values))
    before, here, after = values[at - 1], values[at], values[(at + 1) % len(values)]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(grid[at] + shift * (grid[1] - grid[0]))
