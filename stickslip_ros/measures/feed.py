"""The part of a recording in which a machine moves, and the frame in which its slide vibrates."""

from dataclasses import replace

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import LEAST_CYCLES
from stickslip_ros.measures.noise import NOISE_SAMPLES, PRECISION, encoder_step, rises, white_noise
from stickslip_ros.measures.rests import moves
from stickslip_ros.measures.segmentation import stick_slip
from stickslip_ros.samples import SampleColumns
from stickslip_ros.stamps import NANOSECONDS

_MOST_CYCLES = 1_000_000
_FEWEST, _BLOCKS, _RANGE = 32, 8192, 8.0
"""Samples at an end from which a standstill is told; positions that are compared; range of the
noise, in standard deviations."""
_SAME_FEED = 0.01
"""Relative difference of two estimates of one feed."""
_PASSES = 4
"""Passes in which the feed is corrected."""
_BACK_SHARE = 1.1
"""Largest distance that a cycle covers beside the feed, in advances per cycle; it is less than one
for a slide that does not go back."""
_LAST_CYCLES = 5
"""Number of cycles, at most, whose feed is the last one."""
_ONE_FEED = 4.0
"""Range of the positions less the mean feed, in advances per cycle, up to which there is one."""


def mean_feed(time: FloatArray, position: FloatArray) -> float | None:
    """Return the mean velocity of a slide that advances in cycles, m/s; None for other motions.

    It is that over whole cycles: the position less the feed has the same extremes in each of them.
    A cycle ends where this position falls below its mean by half its standard deviation after it
    was as far above it. There must be three or more, and they must not go back.
    """
    if len(time) < 2 or not time[-1] > time[0]:
        return None
    feed = float((position[-1] - position[0]) / (time[-1] - time[0]))
    for _ in range(_PASSES):
        rest = np.copysign(1.0, feed) * (position - feed * time)
        rest -= rest.mean()
        falls = rises(-rest, float(rest.std()) / 2.0)
        if len(falls) <= LEAST_CYCLES:
            return None
        parts = np.split(rest, falls)[1:-1]
        covered = float(np.median([np.ptp(part) for part in parts]))
        lasting = float(time[falls[-1]] - time[falls[0]]) / len(parts)
        if covered > _BACK_SHARE * abs(feed) * lasting:
            return None
        slopes: list[float] = []
        for extreme in (np.argmax, np.argmin):
            rows = falls[:-1] + [int(extreme(part)) for part in parts]
            at = time[rows] - time[rows].mean()
            slopes.append(float(at @ rest[rows] / (at @ at)))
        feed += float(np.copysign(1.0, feed)) * sum(slopes) / 2.0
    return feed


def moving_part(samples: SampleColumns) -> slice:
    """Return the rows between the standstills before and after a motion, all where there are none.

    A standstill is twice as long as any stretch in between in which the position stays. On a belt
    that moves, one after the motion alone is the equilibrium to which it tends.
    """
    rows = np.flatnonzero(samples.is_valid)
    if len(rows) < _FEWEST:
        return slice(0, len(samples))
    position = samples.position[rows]
    noise = white_noise(position[: len(position) // 2][-NOISE_SAMPLES:])
    least = max(1.5 * encoder_step(position[-NOISE_SAMPLES:]), _RANGE * noise)
    least = max(least, PRECISION * float(np.abs(position).max()))
    stays = max(len(position) // _BLOCKS, 1)
    ends = [float(np.median(part)) for part in (position[:_FEWEST], position[-_FEWEST:])]
    first, last = (
        int(np.argmax(np.abs(course - end) > least))
        for course, end in zip((position, position[::-1]), ends, strict=True)
    )
    last = len(position) - 1 - last
    if last - first < _FEWEST:
        return slice(0, len(samples))
    changes = np.flatnonzero(moves(position[first : last + 1 : stays], least)) * stays
    if len(changes) < 2:
        return slice(0, len(samples))
    longest = 2 * max(int(np.diff(changes).max()), _FEWEST)
    begin = rows[first] if first > longest else 0
    if begin == 0 and samples.belt_velocity[rows].any():
        return slice(0, len(samples))
    end = rows[last] + 1 if len(position) - 1 - last > longest else len(samples)
    return slice(int(begin), int(end))


def last_feed(samples: SampleColumns) -> int:
    """Return the row from which a slide that sticks and slips has its last feed; 0 without others.

    The mean feed of several is that of none of them, and cycles seen from it are not those of the
    slide. The last feed is that of the last cycles on a guide at rest.
    """
    rows = np.flatnonzero(samples.is_valid)
    if not len(rows) or samples.belt_velocity[rows].any():
        return 0
    time = (samples.stamp[rows] - samples.stamp[rows[0]]) / NANOSECONDS
    position = samples.position[rows]
    last = stick_slip(time, position, 0.0, _LAST_CYCLES, 0.0)
    if last is None or not last.rests or not last.feed:
        return 0
    time = time[time <= last.end]
    position = position[: len(time)]
    advance = last.feed * last.cycle.period
    mean = (position[-1] - position[0]) / (time[-1] - time[0])
    if np.ptp(position - mean * time) <= _ONE_FEED * abs(advance):
        return 0
    # The last of them is a release, where the slide is the farthest behind.
    beside = (position - position[-1] - last.feed * (time - time[-1])) / advance
    others = np.flatnonzero(np.abs(beside - 0.5) > 1.0)
    if not len(others):
        return 0
    # Going back, the line is left about a cycle after the change.
    begin = time[others[-1]] + last.cycle.period
    lasting = time[-1] - begin > LEAST_CYCLES * last.cycle.period
    return int(rows[time.searchsorted(begin)]) if lasting else 0


def relative_to_feed(samples: SampleColumns) -> tuple[SampleColumns, float]:
    """Return samples relative to the mean feed, if there is one, and the feed, m/s; 0 without.

    Position and velocity are less those of the feed, and the guide moves against it as a belt does.
    """
    known = samples[samples.is_valid]
    if not len(known) or known.belt_velocity.any():
        return samples, 0.0
    time = (samples.stamp - samples.stamp[0]) / NANOSECONDS
    time_known = time[samples.is_valid]
    slips = stick_slip(time_known, known.position, 0.0, _MOST_CYCLES, 0.0)
    feed = mean_feed(time_known, known.position)
    if slips is not None and slips.rests:  # the slips of a ripple, say, have another feed
        apart = abs((feed or 0.0) - slips.feed)
        feed = slips.feed if apart > _SAME_FEED * abs(slips.feed) else feed
    if not feed:
        return samples, 0.0
    moved = replace(
        samples,
        position=samples.position - feed * time,
        velocity=samples.velocity - feed,
        belt_velocity=samples.belt_velocity - feed,
    )
    return moved, feed
