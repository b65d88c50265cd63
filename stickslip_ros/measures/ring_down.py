"""Ring-downs: decay rate and frequency of the vibration after a tap or a step of the feed."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import inf, pi, sqrt
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.noise import white_noise
from stickslip_ros.text import quantity

_FIRST_STEPS, _LAST_STEPS, _ROUNDING = 2.0, 1.0, 0.1
"""Amplitude of a ring-down, steps of the encoder, at its start and end at least; error of the
logarithm of two steps."""
_ERRORS, _CHANGE = 6.0, 0.15
"""Change of the amplitude in a period, standard errors and share, that no decay explains."""
_SHORTEST, _FEWEST_SAMPLES = 2.5, 5
"""Least length of a ring-down, periods; least number of samples in a period."""
_LARGEST_SPEED, _BELT_CHANGE, _BELT_STEP = 0.3, 0.05, 0.01
"""Largest speed of a vibration far from sticking, change of the belt speed in a ring-down, and in
two periods, in belt speeds."""
_AMPLITUDE_EFFECT, _DAMPING_RATIO, _UNLIKE = 5.0, 0.02, 0.1
"""Prior standard deviation of the change of the decay rate at a speed amplitude of a belt speed, in
decay rates of at least this damping ratio; largest residual beside the noise, in amplitudes."""
_MOST_STEPS, _MOST_GROWTH = 40, 20.0
"""Steps after which a search has not converged; logarithm of the growth in a window, at most."""


@dataclass(frozen=True)
class RingDown:
    """A decaying vibration after an excitation, with standard errors; SI units."""

    start: float
    end: float
    """Times of its first and last sample."""
    belt_speed: float
    """Belt speed when the decay rate is the one found."""
    decay_rate: float
    """Decay rate of the amplitude as it tends to zero; below zero it grows."""
    decay_error: float
    frequency: float
    """Damped frequency, Hz."""
    frequency_error: float
    amplitude: float
    """Amplitude at the start."""


def ring_downs(
    position: FloatArray, belt_velocity: FloatArray, period: float, after: float = -inf
) -> Iterator[RingDown]:
    """Yield the ring-downs of evenly spaced samples, in order of time.

    Taps and steps are found where the vibration changes by more than a decay does; their impulse
    need not be known. Between them a sine whose amplitude decays by r' = -(s + q r^2) r (Nayfeh,
    Mook, Nonlinear Oscillations, section 3.3) is fitted by least squares.

    Positions are in m, belt velocities in m/s, the sample period and the time `after` which they
    start in s.
    """
    step, noise, frequency = _signal(position, period)
    length, omega = round(1.0 / (frequency * period)), 2.0 * pi * frequency
    if length < _FEWEST_SAMPLES or len(position) < 4 * length:
        return
    # Complex amplitude of the sine in the period from each sample on.
    angle, error = omega * period * np.arange(len(position)), noise * sqrt(4.0 / length)
    wave = [np.ones(length), np.cos(angle[:length]), np.sin(angle[:length])]
    rows = np.linalg.pinv(np.array(wave).T)
    vibration = np.convolve(position - position[0], (rows[1] - 1j * rows[2])[::-1], "valid")
    vibration *= np.exp(-1j * angle[: len(vibration)])
    now, following, size = vibration[:-length], vibration[length:], np.abs(vibration)
    seen = size[:-length] > 8.0 * error
    if np.count_nonzero(seen) < length:
        return
    ratios = following[seen] / now[seen]
    ratio = complex(np.median(ratios.real), np.median(ratios.imag))
    changes = np.abs(following - ratio * now) > _ERRORS * error + _CHANGE * np.abs(now)
    belt = np.abs(belt_velocity)
    later = belt[2 * length - 1 :]
    changes |= np.abs(later - belt[: len(later)]) > _BELT_STEP * later
    edges = np.flatnonzero(np.diff(changes, prepend=False, append=False)).reshape(-1, 2).tolist()
    edges = [(-length, -length // 2), *edges]  # the samples may start with a decay
    ends = [*(first + length for first, _ in edges[1:]), len(position)]
    for (_, last), end in zip(edges, ends, strict=True):
        start = last + (length + 1) // 2
        decay = size[start : max(min(end - length, len(size)), start)]
        slow = np.flatnonzero(decay * omega < _LARGEST_SPEED * belt[start : start + len(decay)])
        if len(slow) == 0 or decay[slow[0]] < max(_FIRST_STEPS * step, _ERRORS * error):
            continue
        weak = np.flatnonzero(decay < max(_LAST_STEPS * step, 4.0 * error))
        rows = slice(start + int(slow[0]), start + int(weak[0]) + length if len(weak) else end)
        if rows.stop - rows.start < _SHORTEST * length or rows.start * period < after:
            continue
        guess = np.array([-np.log(abs(ratio)) / (length * period), omega, 0.0])
        amplitude = float(decay[slow[0]])
        ring_down = _fit(position[rows], belt[rows], period, guess, amplitude, step, noise)
        if ring_down is not None:
            begin = period * rows.start
            yield replace(ring_down, start=begin, end=begin + ring_down.end)


def _fit(
    x: FloatArray,
    belt: FloatArray,
    period: float,
    guess: FloatArray,
    amplitude: float,
    step: float,
    noise: float,
) -> RingDown | None:
    """Return the ring-down of a window; None if the vibration is another one.

    It is the fit of a sine whose amplitude r decays by r' = -(s + q r^2) r, beside a straight line.
    The amplitude has this effect on the decay near the equilibrium (Nayfeh, Mook, Nonlinear
    Oscillations, section 3.3); s is the decay rate. What q may be, the belt speed bounds. Errors
    are those of least squares with correlated residuals, and of rounding.
    """
    if float(np.ptp(belt)) > _BELT_CHANGE * float(np.mean(belt)):
        return None
    size = float(np.ptp(x))
    x, belt, step, noise = (x - x[0]) / size, belt / size, step / size, noise / size
    time: FloatArray = period * np.arange(len(x), dtype=np.float64)
    belt_speed = float(np.mean(belt))
    fit = _best(time, x, guess, amplitude / size, belt_speed, noise)
    if fit is None:
        return None
    decay, omega, _ = fit.shape
    residual, amplitude = x - _columns(time, fit.shape) @ fit.linear, fit.amplitude
    variance = float(residual @ residual) / max(len(x) - len(fit.shape) - len(fit.linear), 1)
    if not (sqrt(variance) <= 3.0 * noise + _UNLIKE * amplitude and omega > 0.0):
        return None
    variance = max(variance, noise**2 / 2.0) * _correlation(residual, omega * period)
    information = fit.slopes.T @ fit.slopes / variance
    information[2, 2] += 1.0 / fit.effect**2
    covariance = np.linalg.pinv(information)
    rounding = _ROUNDING * min(2.0 * step / amplitude, 1.0) ** 1.5
    rounding *= max(1.0 / float(time[-1]), abs(decay))
    # A decay rate that changes evenly is found as it is at this time.
    energy = np.exp(-2.0 * decay * time)
    middle = float(energy @ time / energy.sum())
    middle += float(energy @ (time - middle) ** 3) / float(energy @ (time - middle) ** 2) / 2.0
    # What the amplitude does beyond r^2 is of the order of its square.
    higher = 2.0 * fit.effect * (omega * amplitude / belt_speed) ** 2
    errors = np.sqrt(np.diag(covariance) + rounding**2 + higher**2)
    return RingDown(
        start=0.0,
        end=float(time[-1]),
        belt_speed=size * float(np.interp(middle, time, belt)),
        decay_rate=float(decay),
        decay_error=float(errors[0]),
        frequency=float(omega) / (2.0 * pi),
        frequency_error=float(errors[1]) / (2.0 * pi),
        amplitude=size * amplitude,
    )


class _Fit(NamedTuple):
    """Least squares of `_columns`, in the unit of the samples."""

    shape: FloatArray
    linear: FloatArray
    """Coefficients of the columns."""
    slopes: FloatArray
    """Derivatives of the residuals by the shape."""
    effect: float
    """Prior standard deviation of the effect of the amplitude."""

    @property
    def amplitude(self) -> float:
        """Amplitude at the start."""
        return float(np.hypot(*self.linear[2:]))


def _best(
    time: FloatArray,
    x: FloatArray,
    shape: FloatArray,
    amplitude: float,
    belt_speed: float,
    noise: float,
) -> _Fit | None:
    """Return the best fit, from a shape and an amplitude near it; None if it does not converge.

    The coefficients are the best ones of each shape (variable projection: G. Golub, V. Pereyra,
    SIAM Journal on Numerical Analysis 10, 1973).
    """

    def linear(shape: FloatArray) -> FloatArray:
        return _least_squares(_columns(time, shape), x)

    def residual(shape: FloatArray) -> FloatArray:
        return np.append(x - _columns(time, shape) @ linear(shape), noise / effect * shape[2])

    best, steps = None, float(shape[1]) * np.array([1e-5, 1e-6, 1e-5])
    for _ in range(2):  # what the amplitude may do follows from the fit
        least = max(abs(shape[0]), _DAMPING_RATIO * shape[1])
        effect = _AMPLITUDE_EFFECT * least * (shape[1] * amplitude / belt_speed) ** 2
        found = _minimum(residual, shape, steps)
        if found is None or -found[0] * time[-1] >= _MOST_GROWTH:
            return None
        best = _Fit(found, linear(found), _slopes(residual, found, steps)[:-1], effect)
        shape, amplitude = best.shape, best.amplitude
    return best


def _minimum(
    residual: Callable[[FloatArray], FloatArray], point: FloatArray, steps: FloatArray
) -> FloatArray | None:
    """Return where residuals have the least sum of squares, near a point; None if it is not found.

    The search is that of D. Marquardt (SIAM Journal on Applied Mathematics 11, 1963), with
    derivatives by differences over these steps. SciPy's would be imported while a run is recorded,
    which takes too long.
    """
    left, damping = residual(point), 1e-3
    for _ in range(_MOST_STEPS):
        slopes = _slopes(residual, point, steps)
        damped = np.diag(sqrt(damping) * np.linalg.norm(slopes, axis=0))
        change = _least_squares(np.vstack([slopes, damped]), -np.pad(left, (0, len(point))))
        tried = residual(point + change)
        if tried @ tried < left @ left:
            point, left, damping = point + change, tried, damping / 10.0
        else:
            damping *= 10.0
        if np.all(np.abs(change) < steps / 10.0):
            return point
    return None


def _slopes(
    residual: Callable[[FloatArray], FloatArray], point: FloatArray, steps: FloatArray
) -> FloatArray:
    """Return the derivatives of residuals by the coordinates of a point, as columns."""
    sides = [(residual(point + step), residual(point - step)) for step in np.diag(steps)]
    return np.column_stack([after - before for after, before in sides]) / (2.0 * steps)


def _least_squares(design: FloatArray, wanted: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.lstsq(design, wanted)[0], np.float64)


def _columns(time: FloatArray, shape: FloatArray) -> FloatArray:
    """Return the columns of a line and of a sine that decays: r' = -(s + q r^2) r, r(0) = 1."""
    decay, omega, effect = shape
    growth = np.minimum(-decay * time, _MOST_GROWTH)
    spent = -np.expm1(2.0 * growth) / (2.0 * decay) if abs(decay) > 1e-9 else time
    size = np.exp(growth) / np.sqrt(np.maximum(1.0 + 2.0 * effect * spent, 0.05))
    line = np.ones_like(time), time - time[-1] / 2.0
    return np.column_stack([*line, size * np.cos(omega * time), size * np.sin(omega * time)])


def _correlation(residual: FloatArray, turn: float) -> float:
    """Return by what correlated residuals increase the variance of a sine of `turn` a sample."""
    lags = np.arange(1, min(round(2.0 * pi / turn), len(residual) - 1) + 1)
    shares = np.array([float(residual[lag:] @ residual[:-lag]) for lag in lags])
    shares *= np.cos(turn * lags) * (1.0 - lags / (len(lags) + 1.0))
    return max(1.0 + 2.0 * float(shares.sum()) / max(float(residual @ residual), 1e-300), 1.0)


def _signal(position: FloatArray, period: float) -> tuple[float, float, float]:
    """Return the smallest change of a position, its noise, m, and its frequency, Hz.

    The frequency is that of most of the velocity beside noise; infinite where there is none.
    """
    moves = np.diff(position)
    count, sizes = len(moves), np.abs(moves)
    if count < 64 or not sizes.any():
        return 0.0, 0.0, inf
    step = float(sizes[sizes > 1e-9 * np.ptp(position)].min())
    noise, window = max(white_noise(position), step / sqrt(12.0)), np.hanning(count)
    order, reach = np.arange(count // 2 + 1), max(round(0.001 * count), 1)
    power = np.abs(np.fft.rfft((moves - moves.mean()) * window)) ** 2
    power -= (2.0 * _ERRORS * noise * np.sin(pi * order / count)) ** 2 * float(window @ window)
    smooth = np.convolve(power, np.ones(2 * reach + 1), "same")[: count // _FEWEST_SAMPLES]
    at = int(np.argmax(smooth))
    if smooth[at] <= 0.0 or at < 2:
        return step, noise, inf
    around = slice(max(at - reach, 0), at + reach + 1)
    weight = np.maximum(power[around], 0.0)
    return step, noise, float(order[around] @ weight / weight.sum()) / (count * period)


def why_no_ring_down(
    position: FloatArray, belt_velocity: FloatArray, period: float, length: str = "m"
) -> str:
    """Return why there is none in samples, and what would give one; `length` is their unit."""
    belt_speed, spread = float(np.mean(np.abs(belt_velocity))), float(np.std(position))
    step, _, frequency = _signal(position, period)
    if belt_speed == 0.0:
        return "the belt is at rest, or its speed is not recorded"
    if frequency < inf and 2.0 * pi * frequency * spread > _LARGEST_SPEED * belt_speed / 1.4:
        return "the slide vibrates already, or sticks: a run at a higher feed would tell a decay"
    size = f" of {quantity(10.0 * step, length)} or more" if step else ""
    return f"no decay is seen: taps, or steps of the feed, with an amplitude{size} would tell one"
