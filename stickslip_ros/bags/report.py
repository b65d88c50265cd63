"""The report of a recorded run: its measures and counts, from the bag."""

from pathlib import Path
from typing import Any

from stickslip_ros.bags.messages import joint_state_columns, wrench_columns
from stickslip_ros.bags.reader import Recording
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.knots import BoolArray
from stickslip_ros.physics.samples import IntArray, RunMeter

DEFAULT_WINDOW = 20


def report_of_bag(
    path: Path,
    *,
    start: float = 0.0,
    end: float = float("inf"),
    window: int = DEFAULT_WINDOW,
) -> dict[str, Any]:
    """Return measures, counts and completeness of the recording at `path`, ready for JSON.

    Only what lies from `start` to `end` (s after the first joint state) is measured, over the last
    `window` whole cycles of it. Raises BagError for what is no bag or holds no joint states, and
    InvalidInputError for an empty part.
    """
    if not start < end:
        raise InvalidInputError(f"the part from {start} s to {end} s is empty")
    meter = RunMeter(window)
    first: int | None = None
    with Recording(path) as recording:
        states = recording.topic_of_type("sensor_msgs/msg/JointState", suffix="joint_states")
        control = states.removesuffix("joint_states") + "control_force"
        for block in recording.blocks(states, control):
            if states in block:
                columns = joint_state_columns(block[states].messages)
                if first is None:
                    first = int(columns.stamp[0])
                rows = _within(columns.stamp, first, start, end)
                meter.motion.feed(
                    columns.stamp[rows],
                    columns.position[rows],
                    columns.velocity[rows],
                    columns.belt_velocity[rows],
                )
            if control in block and first is not None:
                forces = wrench_columns(block[control].messages)
                rows = _within(forces.stamp, first, start, end)
                meter.force.feed(forces.stamp[rows], forces.force[rows])
        complete = recording.complete
    return {**meter.report(), "complete": complete}


def _within(stamp: IntArray, first: int, start: float, end: float) -> BoolArray:
    since = (stamp - first) * 1e-9
    return (since >= start) & (since <= end)
