"""Samples for the tests of the measures, and meters that are fed with them."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from stickslip_ros.measures import Cycle
from stickslip_ros.measures.sample_assumptions import EXACT, SampleAssumptions
from stickslip_ros.measures.sample_meter import SampleMeter
from stickslip_ros.samples import SampleColumns


def columns(
    stamp: npt.NDArray[np.int64],
    position: npt.NDArray[np.float64],
    velocity: npt.NDArray[np.float64] | None = None,
    belt_velocity: npt.NDArray[np.float64] | float = 0.04,
) -> SampleColumns:
    """Return samples of which nothing else is known; the velocity is by difference."""
    if velocity is None:
        step = (stamp[1] - stamp[0]) * 1e-9
        velocity = np.asarray(np.diff(position, prepend=position[0]) / step)
    unknown, belt = np.full(len(stamp), np.nan), np.zeros(len(stamp)) + belt_velocity
    return SampleColumns(stamp, position, velocity, unknown, unknown, belt)


def milliseconds(count: int) -> npt.NDArray[np.int64]:
    """Return the stamps of so many samples at 1 kHz."""
    return np.arange(count) * 1_000_000


def behind_a_play(course: npt.NDArray[np.float64], play: float) -> npt.NDArray[np.float64]:
    """Return what stands until a course is more than a play away from it, on either side."""
    place = course.copy()
    for row in range(1, len(course)):
        place[row] = min(max(place[row - 1], course[row] - play), course[row] + play)
    return place


def feed(meter: SampleMeter, samples: SampleColumns, starts: Sequence[int] = ()) -> list[Cycle]:
    """Feed a meter in blocks with these starts; return the cycles that it finds."""
    ends = [*starts, len(samples)]
    blocks = (samples[start:end] for start, end in zip([0, *starts], ends, strict=True))
    return [cycle for block in blocks for cycle in meter.feed(block)]


def fed(
    samples: SampleColumns, reading: SampleAssumptions = EXACT, starts: Sequence[int] = ()
) -> SampleMeter:
    """Return a meter of the last 20 cycles that is fed with samples."""
    meter = SampleMeter(20, reading=reading)
    feed(meter, samples, starts)
    return meter
