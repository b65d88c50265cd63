"""Ring-downs: decay rate and frequency of the vibration after a tap or a step of the feed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf, pi, sqrt
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.noise import white_noise
from stickslip_ros.text import quantity

LEAST_STEPS = 2.0
"""Least amplitude of a ring-down at its start, in steps of the encoder."""
_LAST_STEPS = 1.0
"""Amplitude up to which a ring-down is used, in steps: below, rounding distorts it."""
_ERRORS = 6.0
"""Standard errors of the amplitude above which it changes by more than noise."""
_CHANGE = 0.15
"""Change of the vibration in a period that no decay explains, as a share of it."""
_SHORTEST, _FEWEST_SAMPLES = 2.5, 5
"""Least length of a ring-down, periods; least number of samples in a period."""
LARGEST_SPEED = 0.3
"""Largest speed of the vibration, in belt speeds, of a slide that is far from sticking."""
_BELT_CHANGE, _BELT_STEP = 0.05, 0.01
"""Largest change of the belt speed during a ring-down, and in two periods of it, as a share."""
_UNLIKE = 0.1
"""Largest residual beside the noise, in amplitudes, of what is a ring-down."""
_AMPLITUDE_EFFECT, _DAMPING_RATIO = 5.0, 0.02
"""Standard deviation of the decay rate's change at a speed amplitude of a belt speed, in decay
rates of at least this damping ratio, before the data tell it."""
_ROUNDING = 0.1
"""Error of the logarithm of an amplitude of half a step of the encoder by rounding."""
_ITERATIONS = 12


@dataclass(frozen=True)
class RingDown:
    """A decaying vibration after an excitation; errors are standard errors."""

    start: float
    """Time of its first sample, s."""
    duration: float
    """Time that was used, s."""
    belt_speed: float
    """Mean belt speed, weighted by the energy of the vibration, m/s."""
    decay_rate: float
    """Decay rate of the amplitude as it tends to zero, 1/s; below zero it grows."""
    decay_error: float
    """1/s."""
    frequency: float
    """Damped frequency, Hz."""
    frequency_error: float
    """Hz."""
    amplitude: float
    """Amplitude at the start, m."""


class RingDownWindow(NamedTuple):
    """Where a ring-down is: its rows, and what the sliding fits tell of it."""

    rows: slice
    frequency: float
    """Hz."""
    decay_rate: float
    """1/s."""
    noise: float
    """Standard deviation of the positions, m."""
    step: float
    """Step of the encoder, m; the smallest change of the position."""


def ring_downs(
    position: FloatArray, belt_velocity: FloatArray, period: float
) -> Iterator[RingDown]:
    """Yield the ring-downs of evenly spaced samples.

    Taps and steps are found where the vibration changes by more than a decay does; their impulse
    need not be known. A vibration that does not decay, as a limit cycle, is none.

    Parameters
    ----------
    position, belt_velocity : array
        Displacement of the slide, m, and velocity of the belt, m/s; shape (samples,).
    period : float
        Sample period, s.

    Yields
    ------
    RingDown
        In order of time.
    """
    for window in ring_down_windows(position, belt_velocity, period):
        found = fit_ring_down(position, belt_velocity, period, window)
        if found is not None:
            yield found


def ring_down_windows(
    position: FloatArray, belt_velocity: FloatArray, period: float
) -> Sequence[RingDownWindow]:
    """Return where the ring-downs of evenly spaced samples are; arguments as for `ring_downs`."""
    step = _step(position)
    noise = max(white_noise(position), step / sqrt(12.0))
    frequency = _frequency(position, period, noise)
    length = round(1.0 / (frequency * period))
    if length < _FEWEST_SAMPLES or len(position) < 4 * length:
        return []
    vibration = _vibration(position, 2.0 * pi * frequency * period, length)
    error = noise * sqrt(4.0 / length)
    now, following = vibration[:-length], vibration[length:]
    size = np.abs(vibration)
    seen = size[:-length] > 8.0 * error
    if np.count_nonzero(seen) < length:
        return []
    ratios = following[seen] / now[seen]
    ratio = complex(np.median(ratios.real), np.median(ratios.imag))
    changes = np.abs(following - ratio * now) > _ERRORS * error + _CHANGE * np.abs(now)
    belt_speed = np.abs(belt_velocity)
    later = belt_speed[2 * length - 1 :]
    changes |= np.abs(later - belt_speed[: len(later)]) > _BELT_STEP * later
    edges = np.flatnonzero(np.diff(changes, prepend=False, append=False)).reshape(-1, 2)
    edges = [(-length, -length // 2), *edges.tolist()]  # the samples may start with a decay
    ends = [*(first + length for first, _ in edges[1:]), len(position)]
    fastest = LARGEST_SPEED / (2.0 * pi * frequency)
    found: list[RingDownWindow] = []
    for (_, last), end in zip(edges, ends, strict=True):
        start = last + (length + 1) // 2
        own = size[start : max(min(end - length, len(size)), start)]
        slow = np.flatnonzero(own < fastest * belt_speed[start : start + len(own)])
        if len(slow) == 0 or own[slow[0]] < max(LEAST_STEPS * step, _ERRORS * error):
            continue
        lost = np.flatnonzero(own < max(_LAST_STEPS * step, 4.0 * error))
        if len(lost):
            end = start + int(lost[0]) + length
        start += int(slow[0])
        count = end - start - length
        if count < (_SHORTEST - 1.0) * length:
            continue
        part = vibration[start : start + count]
        first, later = part[:-length], part[length:]
        ratio = complex(np.vdot(first, later) / np.vdot(first, first))
        turned = float(np.angle(ratio)) / (2.0 * pi * length * period)
        decay = -float(np.log(max(abs(ratio), 1e-3))) / (length * period)
        found.append(
            RingDownWindow(slice(start, end), frequency + turned, decay, noise, step),
        )
    return found


def fit_ring_down(
    position: FloatArray, belt_velocity: FloatArray, period: float, window: RingDownWindow
) -> RingDown | None:
    """Return the ring-down of a window; None if the vibration is another one.

    It is the fit of a sine whose amplitude r decays by r' = -(s + q r^2) r, beside a straight line.
    The amplitude has this effect on the decay near the equilibrium (Nayfeh, Mook, Nonlinear
    Oscillations, section 3.3); s is the decay rate. What q may be, the belt speed bounds. Errors
    are those of least squares with correlated residuals, and of rounding.
    """
    x, belt = position[window.rows], np.abs(belt_velocity[window.rows])
    time: FloatArray = period * np.arange(len(x), dtype=np.float64)
    belt_speed = float(np.mean(belt))
    if float(np.ptp(belt)) > _BELT_CHANGE * belt_speed:
        return None
    omega = 2.0 * pi * window.frequency
    shape = np.array([window.decay_rate, omega, 0.0])
    steps = omega * np.array([1e-5, 1e-6, 1e-5])
    linear = _solved(_columns(time, shape), x)
    amplitude, prior = 0.0, 1.0
    design = np.empty((0, 0))
    for _ in range(_ITERATIONS):
        amplitude = float(np.hypot(*linear[2:]))
        least = max(abs(shape[0]), _DAMPING_RATIO * omega)
        prior = _AMPLITUDE_EFFECT * least * (omega * amplitude / belt_speed) ** 2
        columns = _columns(time, shape)
        slopes = [
            (_columns(time, shape + each) - _columns(time, shape - each)) @ linear / (2.0 * each[k])
            for k, each in enumerate(np.diag(steps))
        ]
        design = np.column_stack([*slopes, columns])
        row = np.zeros(design.shape[1])
        row[2] = window.noise / prior
        residual = np.append(x - columns @ linear, -shape[2] * row[2])
        change = _solved(np.vstack([design, row]), residual)
        # The effect of the amplitude stays above what ends the decay.
        limits = np.array([0.02 * omega, 0.02 * omega, max(abs(shape[0]), 0.005 * omega) / 4.0])
        shape = shape + np.clip(change[:3], -limits, limits)
        linear = _solved(_columns(time, shape), x)
        if np.all(np.abs(change[:3]) < 1e-7 * omega):
            break
    residual = x - _columns(time, shape) @ linear
    variance = float(residual @ residual) / max(len(x) - design.shape[1], 1)
    known = np.all(np.isfinite(residual)) and shape[1] > 0.0
    if not known or sqrt(variance) > 3.0 * window.noise + _UNLIKE * amplitude:
        return None
    variance = max(variance, window.noise**2 / 2.0) * _correlation(residual, shape[1] * period)
    information = design.T @ design / variance
    information[2, 2] += 1.0 / prior**2
    scale = 1.0 / np.sqrt(np.diag(information))
    covariance = np.linalg.pinv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    lasts = min(float(time[-1]), 1.0 / max(abs(shape[0]), 1e-9))
    rounding = _ROUNDING * min(2.0 * window.step / amplitude, 1.0) ** 1.5 / lasts
    energy = np.exp(-2.0 * shape[0] * time)
    return RingDown(
        start=window.rows.start * period,
        duration=len(x) * period,
        belt_speed=float(energy @ belt / energy.sum()),
        decay_rate=float(shape[0]),
        decay_error=sqrt(covariance[0, 0] + rounding**2),
        frequency=float(shape[1]) / (2.0 * pi),
        frequency_error=sqrt(covariance[1, 1] + rounding**2) / (2.0 * pi),
        amplitude=amplitude,
    )


def _solved(rows: FloatArray, values: FloatArray) -> FloatArray:
    scale = np.sqrt(np.sum(rows**2, axis=0)) + np.finfo(float).tiny
    found: FloatArray = np.linalg.lstsq(rows / scale, values, rcond=None)[0] / scale
    return found


def _columns(time: FloatArray, shape: FloatArray) -> FloatArray:
    """Return the columns of a line and of a sine that decays: r' = -(s + q r^2) r, r(0) = 1."""
    decay, omega, effect = shape
    spent = -np.expm1(-2.0 * decay * time) / (2.0 * decay) if abs(decay) > 1e-9 else time
    size = np.exp(-decay * time) / np.sqrt(np.maximum(1.0 + 2.0 * effect * spent, 0.05))
    line = np.ones_like(time), time - time[-1] / 2.0
    return np.column_stack([*line, size * np.cos(omega * time), size * np.sin(omega * time)])


def _correlation(residual: FloatArray, turn: float) -> float:
    """Return by what correlated residuals increase the variance of a sine of `turn` a sample."""
    lags = np.arange(1, min(round(2.0 * pi / turn), len(residual) - 1) + 1)
    total = max(float(residual @ residual), 1e-300)
    shares = np.array([float(residual[lag:] @ residual[:-lag]) for lag in lags]) / total
    window = 1.0 - lags / (len(lags) + 1.0)
    return max(1.0 + 2.0 * float(np.sum(shares * np.cos(turn * lags) * window)), 1.0)


def _vibration(position: FloatArray, turn: float, length: int) -> np.ndarray:
    """Return the complex amplitude of the sine in the period from each sample on, m."""
    angle = turn * np.arange(length)
    rows = np.linalg.pinv(np.column_stack([np.ones(length), np.cos(angle), np.sin(angle)]))
    level = position - position[0]
    found = np.correlate(level, rows[1], "valid") - 1j * np.correlate(level, rows[2], "valid")
    return found * np.exp(-1j * turn * np.arange(len(found)))


def _step(position: FloatArray) -> float:
    """Return the smallest change of the position, m; 0 where it does not change."""
    sizes = np.abs(np.diff(position))
    sizes = sizes[sizes > 1e-9 * float(np.ptp(position))] if len(sizes) else sizes
    return float(sizes.min()) if len(sizes) else 0.0


def _frequency(position: FloatArray, period: float, noise: float) -> float:
    """Return the frequency of most of the motion beside noise, Hz; infinite where there is none."""
    moves = np.diff(position)
    count = len(moves)
    if count < 64:
        return inf
    # A drift of the positions has no power in the spectrum of the velocities; noise has much.
    window, order = np.hanning(count), np.arange(count // 2 + 1)
    power = np.abs(np.fft.rfft((moves - moves.mean()) * window)) ** 2
    power -= (2.0 * _ERRORS * noise * np.sin(pi * order / count)) ** 2 * float(window @ window)
    reach = max(round(0.001 * count), 1)
    smooth = np.convolve(power, np.ones(2 * reach + 1), "same")[: round(count / _FEWEST_SAMPLES)]
    at = int(np.argmax(smooth))
    around = slice(max(at - reach, 0), at + reach + 1)
    weight = np.maximum(power[around], 0.0)
    if smooth[at] <= 0.0 or at < 2:
        return inf
    return float(order[around] @ weight / weight.sum()) / (count * period)


def why_no_ring_down(
    position: FloatArray, belt_velocity: FloatArray, period: float, length: str = "m"
) -> str:
    """Return why samples without a ring-down have none, and what would give one, as a sentence.

    `length` is the unit of the positions; the other arguments are those of `ring_downs`.
    """
    belt_speed = float(np.mean(np.abs(belt_velocity)))
    if belt_speed == 0.0:
        return "the belt is at rest, or its speed is not recorded"
    step, amplitude = _step(position), sqrt(2.0) * float(np.std(position))
    frequency = _frequency(position, period, max(white_noise(position), step / sqrt(12.0)))
    if frequency < inf and 2.0 * pi * frequency * amplitude > LARGEST_SPEED * belt_speed:
        return "the slide vibrates already, or sticks: a run at a higher feed would tell a decay"
    taps = f" of at least {quantity(10.0 * step, length)}" if step > 0.0 else ""
    return (
        "no decay after an excitation is seen: taps on the slide, or steps of the feed, that make "
        f"it vibrate with an amplitude{taps} would tell one"
    )
