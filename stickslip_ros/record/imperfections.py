"""Imperfections of a machine that a recording shows: play, and force that ripples over the way."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray, rms
from stickslip_ros.text import quantity

_FEWEST, _MOST = 200, 1 << 18
"""Fewest samples that are judged, and most of a ripple."""
_INSIDE, _SPREAD, _STANDING = 0.3, 0.05, 0.1
"""Distance from the middle of a play that is inside, its spread at the sides, and how far the
position may move inside for each move of the reference."""
_PASSAGES, _USUAL = 4, 0.8
"""Fewest passages through a play, and share of them in which the position stands."""
_AROUND, _PERIODS, _CELLS, _PASSES = 4, 4, 1 << 13, 256
"""Samples on either side that tell an acceleration; fewest periods in the range of a ripple; most
cells of the range, and passes between reversals, into which forces are sorted."""
_CHANCE, _AS_GOOD, _LEAST = 1e-3, 0.5, 0.02
"""Chance with which random residuals are a ripple; share of what it explains that a vibration in
time may explain; least ripple, as a share of the force."""
_BAND, _LOBE = 1.5, 3
"""Ratio of frequencies around a peak to which it is compared, and places beside it that are not."""


def play_note(
    reference: FloatArray, position: FloatArray, unit: str, what: str = "the reference"
) -> Iterator[str]:
    """Yield a sentence on the play between a position and its reference, if they show one.

    Their difference has one value forward and another one backward, whatever the speed, and between
    the two the position stands. `unit` is that of both, arrays of shape (samples,), and `what` the
    name of the reference.
    """
    known = np.isfinite(reference) & np.isfinite(position)
    reference, position = reference[known], position[known]
    driven, moved = np.diff(reference), np.diff(position)
    apart = ((reference - position)[1:] + (reference - position)[:-1]) / 2.0
    fast = np.abs(driven) > 0.1 * rms(driven) if len(driven) else driven > 0.0
    sides = [apart[fast & (moved * sign > 0.5 * np.abs(driven))] for sign in (1.0, -1.0)]
    if min(map(len, sides)) < _FEWEST // 4:
        return
    forward, backward = map(np.median, sides)
    play = float(forward - backward)
    inside = np.abs(apart - (forward + backward) / 2.0) < _INSIDE * play
    passage = np.cumsum(np.diff(inside, prepend=False) & inside)[inside]
    by_reference, by_position = (
        np.abs(np.bincount(passage, steps[inside])) for steps in (driven, moved)
    )
    through = by_reference > _INSIDE * play
    count = np.count_nonzero(through)
    spread = max(rms(side - np.median(side)) for side in sides)
    if count < _PASSAGES or spread > _SPREAD * play:
        return
    if np.mean(by_position[through] < _STANDING * by_reference[through]) >= _USUAL:
        yield (
            f"the position stands at {count} reversals until {what} has moved by "
            f"{quantity(float(f'{play:.2g}'), unit)}: that is play between them, or friction "
            "behind a spring"
        )


def ripple_note(
    time: FloatArray, position: FloatArray, force: FloatArray, units: tuple[str, str]
) -> Iterator[str]:
    """Yield a sentence on a force that ripples over the position, if several passes show it.

    What inertia, friction and slow changes leave of the force is transformed over the position, for
    each pass between two reversals. A ripple is a line in the power of their sum. The threshold is
    such that white residuals pass it in one of a thousand recordings; passes of random phases do
    not pass it more often. No note is given if a vibration that starts at each reversal explains
    the residual as well.
    The arrays have the shape (samples,), `units` are those of position and force.
    """
    known = np.flatnonzero(np.isfinite(time) & np.isfinite(position) & np.isfinite(force))[:_MOST]
    time, position, force = time[known], position[known], force[known]
    middle = slice(_AROUND, len(time) - _AROUND)
    if len(time) < _FEWEST:
        return
    before, after = position[: -2 * _AROUND], position[2 * _AROUND :]
    lasting = time[2 * _AROUND :] - time[: -2 * _AROUND]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        speed = (after - before) / lasting
        acceleration = 4.0 * (after - 2.0 * position[middle] + before) / lasting**2
    moving = np.isfinite(speed) & np.isfinite(acceleration)
    moving &= np.abs(speed) > 0.05 * rms(speed[moving]) if moving.any() else moving
    at, since, pull = position[middle][moving], time[middle][moving], force[middle][moving]
    speed, acceleration = speed[moving], acceleration[moving]
    span, step = float(np.ptp(at)) if len(at) else 0.0, float(np.median(np.abs(np.diff(position))))
    cells = int(min(_CELLS, 2.0 * span / step)) if step else _CELLS
    if len(at) < _FEWEST or cells < 16 * _PERIODS or not np.isfinite(span):
        return
    place, side = (at - at.min()) / span, np.sign(speed)
    slow = [np.ones(len(at)), side, speed, acceleration, place, place**2]
    causes = np.column_stack([*slow, side * place, side * np.sqrt(np.abs(speed))])
    rest = pull - causes @ np.linalg.lstsq(causes, pull)[0]
    weighted = rest * np.sin(np.pi * place) ** 2  # passes turn at the ends, which are lines to all
    bounds = [0, *(np.flatnonzero(np.diff(side)) + 1).tolist(), len(at)]
    peak, power = _line(np.minimum((cells * place).astype(int), cells - 1), weighted, bounds)
    if peak is None:
        return
    starts = np.repeat(since[bounds[:-1]], np.diff(bounds))
    tick = np.rint((since - starts) / np.median(np.diff(since))).astype(int)
    by_time = sum(
        np.abs(np.fft.rfft(np.bincount(tick[way], weighted[way], 2 * tick.max() + 2))) ** 2
        / np.count_nonzero(way)
        for way in (side > 0.0, side < 0.0)
        if way.any()
    )
    if np.max(by_time) > _AS_GOOD * power / len(at):
        return
    near = np.linspace(peak - 1.0, peak + 1.0, 41)
    turns = near[np.argmax([abs(weighted @ np.exp(1j * np.pi * turn * place)) for turn in near])]
    waves = np.column_stack([causes, np.cos(np.pi * turns * place), np.sin(np.pi * turns * place)])
    amplitude = float(np.hypot(*np.linalg.lstsq(waves, pull)[0][-2:]))
    if amplitude > _LEAST * rms(pull):
        length, size = (
            quantity(float(f"{value:.2g}"), unit)
            for value, unit in zip((2.0 * span / turns, amplitude), units, strict=True)
        )
        yield f"the force has a ripple over the position: amplitude {size}, period {length}"


def _line(cell: IntArray, values: FloatArray, bounds: Sequence[int]) -> tuple[int | None, float]:
    """Return the double of the frequency of a line that passes have in common, and its power."""
    cells = int(cell.max()) + 1
    total, single = np.zeros(cells // 2, complex), np.zeros(cells // 2)
    passes = [slice(*pair) for pair in pairwise(bounds)]
    for part in sorted(passes, key=lambda part: part.start - part.stop)[:_PASSES]:
        wave = np.fft.rfft(np.bincount(cell[part], values[part], 2 * cells))[: cells // 2]
        total += wave
        single += np.abs(wave) ** 2
    power, first = np.abs(total) ** 2, 2 * _PERIODS
    peak = first + int(np.argmax(power[first:]))
    others = np.arange(int(peak / _BAND), min(len(power), int(peak * _BAND) + 1))
    usual = np.quantile(power[others[np.abs(others - peak) > _LOBE]], 0.9) / np.log(10.0)
    least = max(np.log(len(power) / _CHANCE) * usual, -np.log(_CHANCE) * single[peak])
    return (peak if power[peak] > least else None), float(power[peak])
