"""Faults of sensors that a recording shows: dropouts, wraps, and velocities that cannot be."""

from dataclasses import dataclass
from math import pi

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray, rms
from stickslip_ros.physics.measures.noise import white_noise
from stickslip_ros.text import quantity

_STEEPER = 10.0
"""Size of a jump, in steps before or after it and of the encoder."""
_AROUND, _QUIET = 7, 5
"""Steps before and after a jump, and how many of them must be as small."""
_LONGEST, _LARGEST_SHARE = 20, 0.05
"""Longest dropout, in samples; share of the samples that dropouts are at most."""
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


@dataclass(frozen=True)
class Wrap:
    """Jumps of a counter that wraps."""

    turn: float
    """Size of the jumps."""
    rows: IntArray
    """Samples after the jumps."""


class Jumps:
    """Steps of a signal that are ten times as large as most of those before, or after.

    Examples
    --------
    >>> import numpy as np
    >>> from stickslip_ros.bags.faults import Jumps
    >>> signal = np.sin(0.01 * np.arange(1000.0))
    >>> signal[200:203] = -5.0
    >>> np.flatnonzero(Jumps(signal).dropouts()).tolist()
    [200, 201, 202]
    """

    def __init__(self, signal: FloatArray) -> None:
        """Find the jumps of a signal; they are also larger than steps of an encoder."""
        self._signal, self._step = signal, np.diff(signal)
        size = np.abs(self._step)
        part = signal[:: 1 + len(signal) // _MOST_WINDOWS]
        low, high = np.quantile(part, [0.01, 0.99]) if len(part) else (0.0, 0.0)
        least = max(_STEEPER * _unit(self._step), _LEAST_SHARE * float(high - low))
        self._rows = rows = np.flatnonzero(size > least)
        quiet: list[BoolArray] = []
        for side in (-1, 1):
            count = np.zeros(len(rows), np.int64)
            for distance in range(1, _AROUND + 1):
                other = rows + side * distance
                inside = (other >= 0) & (other < len(size))
                beside = size[np.clip(other, 0, len(size) - 1)]
                count += inside & (_STEEPER * beside < size[rows])
            quiet.append(count >= _QUIET)
        self._after_quiet, self._before_quiet = quiet

    def dropouts(self) -> BoolArray:
        """Return which samples the signal jumps to, and back from, as no motion does.

        They are 1 to 20 samples between two jumps. None are found where they would be more than a
        twentieth of the samples: then the motion jumps.
        """
        signal, step = self._signal, self._step
        found = np.zeros(len(signal), np.bool_)
        first, last = self._rows[self._after_quiet], self._rows[self._before_quiet]
        place = np.searchsorted(last, first, "right")
        first, place = first[place < len(last)], place[place < len(last)]
        ended = -1
        for begin, end in zip(first.tolist(), last[place].tolist(), strict=True):
            size = min(abs(step[begin]), abs(step[end]))
            inner = np.abs(step[begin + 1 : end]).max(initial=0.0)
            returns = abs(signal[end + 1] - signal[begin]) < size / 2.0
            if begin > ended and end - begin <= _LONGEST and inner < size / 2.0 and returns:
                found[begin + 1 : end + 1] = True
                ended = end
        if np.count_nonzero(found) > _LARGEST_SHARE * len(signal):
            found[:] = False
        return found

    def wrap(self) -> Wrap | None:
        """Return the jumps by one turn, all against the motion; None without any.

        The turn is known from jumps in both directions, or is that of a counter.
        """
        step, rows = self._step, self._rows[self._after_quiet & self._before_quiet]
        rows = rows[(rows > 0) & (rows < len(step) - 1)]
        if not len(rows):
            return None
        beside = (step[rows - 1] + step[rows + 1]) / 2.0
        turns = beside - step[rows]
        turn = float(np.median(np.abs(turns)))
        against = np.all(step[rows - 1] * step[rows] < 0.0) and np.all(
            step[rows + 1] * step[rows] < 0.0
        )
        same = np.all(np.abs(np.abs(turns) - turn) <= _SAME_TURN * turn)
        if not (against and same) or float(np.ptp(self._signal)) > (1.0 + _SAME_TURN) * turn:
            return None
        unit = _unit(step)
        known = [each * scale for scale in (1.0, unit) for each in _TURNS]
        nearest = min(known, key=lambda each: abs(each - turn))
        if abs(nearest - turn) <= _SAME_TURN * turn:
            return Wrap(nearest, rows + 1)
        return Wrap(turn, rows + 1) if np.ptp(np.sign(turns)) else None


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
    if not sizes or rms(by_half - by_velocity) > _UNKNOWN_SHARE * rms(by_velocity):
        return None
    if abs(both) < _CORRELATION * sizes * len(rows):
        part = position[:_MOST_WINDOWS]
        noise = max(white_noise(part), _unit(np.diff(part)))
        clear = rms(moved - by_velocity) > _STEEPER * noise
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


def _integral(time: FloatArray, velocity: FloatArray, rows: IntArray, stride: int) -> FloatArray:
    """Return displacements over windows from even rows on, by one of `stride` velocities."""
    time, velocity = time[::stride], velocity[::stride]
    steps = (velocity[1:] + velocity[:-1]) / 2.0 * np.diff(time)
    total = np.append(0.0, np.cumsum(steps))
    return total[(rows + _WINDOW) // stride] - total[rows // stride]


def _unit(step: FloatArray) -> float:
    """Return the smallest step of a signal; infinite without one."""
    sizes = np.abs(step)
    return float(np.min(sizes, where=sizes > 0.0, initial=np.inf))
