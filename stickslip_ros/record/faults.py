"""Faults of sensors that a recording shows: dropouts, wraps, and velocities that cannot be."""

from math import pi

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray, rms, windows
from stickslip_ros.measures.noise import PRECISION, white_noise
from stickslip_ros.text import quantity

_STEEPER = 10.0
"""Size of a jump, in steps before or after it and of the encoder."""
_AROUND, _QUIET = 7, 5
"""Steps before and after a jump, and how many of them must be as small."""
_LONGEST, LARGEST_SHARE = 20, 0.05
"""Longest dropout, in samples; share of the samples that dropouts are at most."""
MOST_SHIFTS = 3
"""Most jumps from which a signal does not come back; more of them are motion."""
_LEAST_SHARE = 0.01
"""Least jump, as a share of the range of the signal without its extreme hundredths."""
_TURNS = (1.0, 2.0 * pi, 360.0, *(2.0**bits for bits in range(8, 33)))
"""Turns of counters, in their units."""
_SAME_TURN = 1e-3
"""Relative difference of jumps by one turn."""
_WINDOW, _MOST_WINDOWS = 8, 100_000
"""Steps over which displacements are compared with velocities; how many of these are."""
_RATIO, _CORRELATION, _LATE_SHARE, _UNKNOWN_SHARE = 1.4, 0.7, 0.03, 0.1
"""Ratio of displacements to velocities from which these are in another unit; least correlation of
the two; share of the displacements that a delay makes, from which a velocity is late; share of
them by which the motion between the velocities is unknown."""


class Jumps:
    """Steps of a signal that are ten times as large as most of those before, or after."""

    def __init__(self, signal: FloatArray, rounding: float = 0.0) -> None:
        """Find the jumps of a signal; they are larger than a rounding and encoder steps, too."""
        self._signal = signal
        part = signal[:: 1 + len(signal) // _MOST_WINDOWS]
        low, high = np.quantile(part, [0.01, 0.99]) if len(part) else (0.0, 0.0)
        self._unit = _unit(signal, rounding)
        least = max(_STEEPER * self._unit, _LEAST_SHARE * float(high - low))
        jumps = [
            part.start + np.flatnonzero(np.abs(np.diff(signal[part])) > least)
            for part in windows(len(signal), 1)
        ]
        self._rows = rows = np.concatenate([np.empty(0, np.int64), *jumps])
        size = np.abs(self._step(rows))
        quiet: list[BoolArray] = []
        for side in (-1, 1):
            count = np.zeros(len(rows), np.int64)
            for distance in range(1, _AROUND + 1):
                other = rows + side * distance
                inside = (other >= 0) & (other < len(signal) - 1)
                beside = np.abs(self._step(np.clip(other, 0, len(signal) - 2)))
                count += inside & (_STEEPER * beside < size)
            quiet.append(count >= _QUIET)
        self._after_quiet, self._before_quiet = quiet

    def _step(self, rows: IntArray) -> FloatArray:
        return self._signal[rows + 1] - self._signal[rows]

    def dropouts(self) -> IntArray:
        """Return the samples that the signal jumps to, and back from, as no motion does.

        They are 1 to 20 samples between two jumps. None are found where they would be more than a
        twentieth of the samples: then the motion jumps.
        """
        signal, dropped = self._signal, list[int]()
        first, last = self._rows[self._after_quiet], self._rows[self._before_quiet]
        place = np.searchsorted(last, first, "right")
        first, place = first[place < len(last)], place[place < len(last)]
        ended = -1
        for begin, end in zip(first.tolist(), last[place].tolist(), strict=True):
            if begin <= ended or end - begin > _LONGEST:
                continue
            size = np.abs(np.diff(signal[begin : end + 2]))
            least = min(size[0], size[-1]) / 2.0
            returns = abs(signal[end + 1] - signal[begin]) < least
            if returns and size[1:-1].max(initial=0.0) < least:
                dropped += range(begin + 1, end + 1)
                ended = end
        return np.array(dropped if len(dropped) <= LARGEST_SHARE * len(signal) else [], np.int64)

    def shifts(self) -> list[tuple[int, float]]:
        """Return the samples after jumps from which the signal does not come back, and their sizes.

        None are found if there are more than three: then the motion jumps.
        """
        rows = self._rows[self._after_quiet & self._before_quiet]
        lost = self.dropouts()
        rows = rows[~np.isin(rows, lost) & ~np.isin(rows + 1, lost)]
        sizes = self._step(rows).tolist()
        return [*zip((rows + 1).tolist(), sizes, strict=True)] if len(rows) <= MOST_SHIFTS else []

    def wrap(self) -> tuple[float, IntArray] | None:
        """Return the turn of a counter that wraps, and the samples after its jumps, or None.

        All jumps are by one turn, and against the motion. The turn is known from jumps in both
        directions, or is that of a counter.
        """
        rows = self._rows[self._after_quiet & self._before_quiet]
        rows = rows[(rows > 0) & (rows < len(self._signal) - 2)]
        if not len(rows):
            return None
        before, jump, after = (self._step(rows + place) for place in (-1, 0, 1))
        turns = (before + after) / 2.0 - jump
        turn = float(np.median(np.abs(turns)))
        against = np.all(before * jump < 0.0) and np.all(after * jump < 0.0)
        same = np.all(np.abs(np.abs(turns) - turn) <= _SAME_TURN * turn)
        if not (against and same) or float(np.ptp(self._signal)) > (1.0 + _SAME_TURN) * turn:
            return None
        known = [candidate * scale for scale in (1.0, self._unit) for candidate in _TURNS]
        nearest = min(known, key=lambda candidate: abs(candidate - turn))
        if abs(nearest - turn) <= _SAME_TURN * turn:
            return nearest, rows + 1
        return (turn, rows + 1) if np.ptp(np.sign(turns)) else None


def shift_note(size: float, place: str, unit: str = "m") -> str:
    """Return a sentence on a jump from which the positions do not come back."""
    return (
        f"the position jumps by {quantity(float(f'{size:.3g}'), unit)}, {place}, and does not come "
        "back, as after a new zero or lost counts: --to or --from takes one side"
    )


def lost_velocities(
    time: FloatArray, position: FloatArray, velocity: FloatArray
) -> tuple[str | None, BoolArray]:
    """Return how velocities contradict positions, as `velocity_fault` has it, and which jump.

    A velocity that jumps away and back, and less so by the positions, is not that of the motion.
    """
    spikes = np.zeros(len(time), np.bool_)
    spikes[Jumps(velocity).dropouts()] = True
    if spikes.any():
        between = np.interp(time, time[~spikes], velocity[~spikes])
        by_position = differences(time, position)
        spikes &= np.abs(velocity - by_position) > np.abs(between - by_position)
    return velocity_fault(time[~spikes], position[~spikes], velocity[~spikes]), spikes


def differences(time: FloatArray, position: FloatArray) -> FloatArray:
    """Return the velocity at each time, by the positions on both sides; NaN where time stands."""
    velocity = np.zeros(len(time))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for part in windows(len(time), 2):  # of a long array at once takes four times as long
            at, moved = time[part], position[part]
            velocity[part][1:-1] = (moved[2:] - moved[:-2]) / (at[2:] - at[:-2])
        if len(time) > 1:
            moved, lasting = (column[[1, -1]] - column[[0, -2]] for column in (position, time))
            velocity[[0, -1]] = moved / lasting
    return velocity


def velocity_fault(time: FloatArray, position: FloatArray, velocity: FloatArray) -> str | None:
    """Return how velocities contradict positions, as "is 1000 times ..."; None if they do not.

    Displacements over windows of eight steps are those by the velocities times a ratio and, for a
    velocity behind a first-order lag, their changes times its time constant. Noise of either leaves
    the ratio between the two that least squares give. Nothing is said of velocities between which
    the motion is not known: by every other one the displacements would differ.
    """
    step = np.diff(time)
    rows = np.arange(0, len(step) - _WINDOW, max(_WINDOW, 2 * (len(step) // _MOST_WINDOWS)))
    lasting = time[rows + _WINDOW] - time[rows]
    rows = rows[lasting < 1.5 * np.median(lasting)] if len(rows) else rows  # no gaps
    if len(rows) < _WINDOW:
        return None
    moved = position[rows + _WINDOW] - position[rows]
    by_velocity, by_half = (_integral(time, velocity, rows, stride) for stride in (1, 2))
    change = velocity[rows + _WINDOW] - velocity[rows]
    both, square = float(by_velocity @ moved), float(by_velocity @ by_velocity)
    sizes = rms(moved) * rms(by_velocity)
    if not velocity.any() and rms(moved) > _STEEPER * _noise_of(position):
        return "is 0 throughout"
    if not sizes or rms(by_half - by_velocity) > _UNKNOWN_SHARE * rms(by_velocity):
        return None
    if abs(both) < _CORRELATION * sizes * len(rows):
        clear = rms(moved - by_velocity) > _STEEPER * _noise_of(position)
        return "does not follow the positions" if clear else None
    ratios = np.array([both / square, float(moved @ moved) / both])
    if both < 0.0 or np.all(ratios > _RATIO) or np.all(ratios < 1.0 / _RATIO):
        ratio = float(np.sqrt(ratios[0] * ratios[1]) * np.sign(both))
        return f"is {float(f'{1.0 / ratio:.3g}'):g} times that of the positions"
    (_, delay), *_ = np.linalg.lstsq(np.column_stack([by_velocity, change]), moved)
    late = abs(delay) > 2.0 * float(np.median(step))
    if late and abs(delay) * rms(change) > _LATE_SHARE * rms(moved):
        side = "later" if delay > 0.0 else "earlier"
        return f"is {quantity(float(f'{abs(delay):.2g}'), 's')} {side} than that of the positions"
    return None


def _noise_of(position: FloatArray) -> float:
    """Return the noise of positions, or the step of their encoder if it is larger, m."""
    part = position[:_MOST_WINDOWS]
    return max(white_noise(part), _unit(part))


def _integral(time: FloatArray, velocity: FloatArray, rows: IntArray, stride: int) -> FloatArray:
    """Return displacements over windows from even rows on, by one of `stride` velocities."""
    time, velocity = time[::stride], velocity[::stride]
    steps = (velocity[1:] + velocity[:-1]) / 2.0 * np.diff(time)
    total = np.append(0.0, np.cumsum(steps))
    return total[(rows + _WINDOW) // stride] - total[rows // stride]


def _unit(signal: FloatArray, rounding: float = 0.0) -> float:
    """Return the smallest step of a signal that is larger than a rounding; infinite without one."""
    least = np.inf
    rounding = max(rounding, PRECISION * float(np.abs(signal).max(initial=0.0)))
    for part in windows(len(signal), 1):
        sizes = np.abs(np.diff(signal[part]))
        least = float(np.min(sizes, where=sizes > rounding, initial=least))
    return least
