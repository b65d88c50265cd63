"""Control forces in bags and on live topics, whatever the type of their messages."""

from collections.abc import Callable

import numpy as np

from stickslip_ros.arrays import IntArray
from stickslip_ros.record.bag_files import Block
from stickslip_ros.record.bag_layout import DriveInBag
from stickslip_ros.record.cdr import Layout, Messages, Refused, decode
from stickslip_ros.record.codec import force_layouts, wrenches_in
from stickslip_ros.record.topics import CONTROL_FORCE
from stickslip_ros.samples import ForceColumns


class ForceReader:
    """Reads the control forces of a drive in a bag, block by block."""

    def __init__(self, drive: DriveInBag, topic: str) -> None:
        """Take the name of the topic, which may be empty."""
        layout, kind = drive.layout, drive.source.topics.get(topic, CONTROL_FORCE.type_name)
        self._by_log = layout.time == "log"
        self._as_sent = kind == CONTROL_FORCE.type_name and not (layout.force_topic or self._by_log)
        self._layout_of = force_layouts(layout.joint, drive.force_number)[kind]
        self.unstamped = False
        """Whether a force had no stamp, and has its log time."""

    def read(self, block: Block) -> tuple[ForceColumns, Refused]:
        """Return forces, and what was refused."""
        if self._as_sent:
            return wrenches_in(*block.messages)
        forces, unstamped, refused = read_forces(
            self._layout_of, block.messages, block.log_time, by_log=self._by_log
        )
        self.unstamped |= unstamped
        return forces, refused


def read_forces(
    layout_of: Callable[[bytes], Layout],
    messages: Messages,
    log_time: IntArray,
    *,
    by_log: bool = False,
) -> tuple[ForceColumns, bool, Refused]:
    """Return forces, whether one has no stamp, and what was refused.

    Without a stamp a force has its log time; `by_log` all have.
    """
    rows, stamp, values, refused = decode(*messages, layout_of, 1)
    known = np.isfinite(values[0])  # commands of other joints tell nothing
    stamp, log_time = stamp[known], log_time[rows][known]
    unstamped = (stamp == 0) | by_log
    forces = ForceColumns(np.where(unstamped, log_time, stamp), values[0, known])
    return forces, bool(unstamped.any()) and not by_log, refused
