"""A recorded run from its bag: as columns, and as a report of its measures and counts."""

from collections.abc import Iterator, Sequence
from dataclasses import fields
from math import isinf
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from stickslip_ros.bags.messages import (
    JointStateColumns,
    WrenchColumns,
    joint_state_columns,
    wrench_columns,
)
from stickslip_ros.bags.reader import Recording
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.physics.knots import BoolArray
from stickslip_ros.physics.samples import IntArray, RunMeter

_DEFAULT_WINDOW = 20
"""Cycles to average over for a bag of somebody else's."""
_LARGEST_WINDOW = 100_000

ColumnsT = TypeVar("ColumnsT", JointStateColumns, WrenchColumns)


def report_of_bag(
    path: Path,
    *,
    start: float = 0.0,
    end: float = float("inf"),
    window: int | None = None,
) -> dict[str, Any]:
    """Return measures, counts and completeness of the recording at `path`, ready for JSON.

    Only what lies from `start` on and before `end` (s after the first joint state) is measured,
    over the last `window` whole cycles of it (None: as many as the analyzer did). Raises BagError
    for what is no bag or holds no joint states, and InvalidInputError for an empty part.
    """
    if not start < end:
        raise InvalidInputError(f"the part from {start} s to {end} s is empty")
    first: int | None = None
    with Recording(path) as recording:
        meter = RunMeter(window or _window_at_recording(recording))
        for states, forces in _column_blocks(recording):
            if first is None and len(states.stamp):
                first = int(states.stamp[0])
            if first is None:
                continue
            rows = _within(states.stamp, first, start, end)
            meter.motion.feed(
                states.stamp[rows],
                states.position[rows],
                states.velocity[rows],
                states.belt_velocity[rows],
            )
            rows = _within(forces.stamp, first, start, end)
            meter.force.feed(forces.stamp[rows], forces.force[rows])
        complete = recording.complete
    if first is None:
        raise BagError(f"the bag {path} holds no joint states")
    if meter.motion.samples == 0:
        raise InvalidInputError(f"the part from {start} s to {end} s of {path} holds no samples")
    return {**meter.report(), "complete": complete}


def read_columns(path: Path) -> tuple[JointStateColumns, WrenchColumns]:
    """Return the joint states and the control forces of the recording at `path`, all at once.

    Raises BagError for what is no bag or holds no joint states.
    """
    with Recording(path) as recording:
        blocks = list(_column_blocks(recording))
    if not blocks:
        raise BagError(f"the bag {path} holds no joint states")
    states, forces = zip(*blocks, strict=True)
    return _joined(JointStateColumns, states), _joined(WrenchColumns, forces)


def _window_at_recording(recording: Recording) -> int:
    kept = recording.metadata("stickslip_ros/analyzer") or {}
    try:
        window = int(kept["window"])
    except (KeyError, ValueError):
        return _DEFAULT_WINDOW
    return window if 0 < window <= _LARGEST_WINDOW else _DEFAULT_WINDOW


def _column_blocks(recording: Recording) -> Iterator[tuple[JointStateColumns, WrenchColumns]]:
    states = recording.topic_of_type("sensor_msgs/msg/JointState", suffix="joint_states")
    control = states.removesuffix("joint_states") + "control_force"
    topics = [topic for topic in (states, control) if topic in recording.topics]
    for block in recording.blocks(*topics):
        messages = block[control].messages if control in block else []
        yield joint_state_columns(block[states].messages), wrench_columns(messages)


def _joined(kind: type[ColumnsT], blocks: Sequence[ColumnsT]) -> ColumnsT:
    """Return blocks of columns, dataclasses of arrays, as one."""
    names = [field.name for field in fields(kind)]
    return kind(*(np.concatenate([getattr(block, name) for block in blocks]) for name in names))


def _within(stamp: IntArray, first: int, start: float, end: float) -> BoolArray:
    """Return which stamps lie from `start` on and before `end`, s after `first` (ns)."""
    since = stamp - first
    return (since >= round(start * 1e9)) & (since < (end * 1e9 if isinf(end) else round(end * 1e9)))
