"""The motion in joint states, of our plant and of other machines: in bags and on live topics."""

from collections.abc import Callable, Iterable
from functools import partial
from itertools import chain

from stickslip_ros.arrays import IntArray
from stickslip_ros.errors import BagError
from stickslip_ros.record.bag_layout import ANY_LAYOUT, BagLayout
from stickslip_ros.record.cdr import Layout, Messages, Refused, decode
from stickslip_ros.record.codec import BELT, SLIDE, STATE_TYPES, joint_layout, joint_state_layout
from stickslip_ros.record.machine_motion import MachineMotion, StampCheck
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.text import printable, shown

_SEEN, _MOST_NAMES = 1000, 20
"""Messages of which the joints are looked at first; names of joints in a message to the user."""


class MotionReader:
    """Reads the joint states of a drive, block by block.

    Joint states of slide and belt, as our plant sends them, are read as they are. Of others the
    slide is the joint that was chosen, or the only one, and its motion is a `MachineMotion`.
    Messages that do not name it are left out.
    """

    def __init__(
        self,
        topic: str,
        layout: BagLayout = ANY_LAYOUT,
        belt_speed: float | None = None,
        source: str = "",
        kind: str = "sensor_msgs/msg/JointState",
    ) -> None:
        """Take topic and source, for messages to the user, and the belt speed (m/s) of no belt.

        `kind` is the type of the messages, one of `STATE_TYPES`.
        """
        self._topic, self._layout, self._belt_speed = topic, layout, belt_speed
        self._where = f"on {topic} of {source}" if source else f"on {topic}"
        self._kind = kind
        self._layout_of: Callable[[bytes], Layout] | None = None
        """Where messages have the joint, once it is known."""
        self.machine: MachineMotion | None = None
        """Motion of another machine; None for joint states of our plant, or before any."""
        self._stamps = StampCheck(self._where)
        self.clock_offset: int | None = None
        """Log time less stamp of the first sample, ns."""

    def read(
        self, messages: Messages, log_time: IntArray | None = None
    ) -> tuple[SampleColumns, ForceColumns, Refused]:
        """Read messages; also return efforts that are forces.

        Raises BagError if the joint must be chosen, or is not there, if the stamps tell no times,
        or if two sources take turns.
        """
        if self._layout_of is None:
            self._layout_of = self._find_joint(messages)
        layout_of = self._layout_of or joint_state_layout
        rows, stamp, values, refused = decode(*messages, layout_of, 7)
        if log_time is not None:
            if len(rows) and self.clock_offset is None:
                self.clock_offset = int(log_time[rows[0]] - stamp[0])
            if self._layout.time == "log":
                stamp = log_time[rows]
        samples = SampleColumns(stamp, *values)
        forces = ForceColumns(stamp[:0], values[0, :0])
        if self.machine is not None:
            samples, forces = self.machine.read(samples)
        if self._layout.time != "log":
            self._stamps.check(samples.stamp, ours=self.machine is None)
        return samples, forces, refused

    def _find_joint(self, messages: Messages) -> Callable[[bytes], Layout] | None:
        """Return where messages have the joint, by the names in the first ones; None without any.

        Raises BagError if it must be chosen, or what was chosen is not there.
        """
        seen: list[list[str]] = []

        def layout_of(data: bytes) -> Layout:
            joints = STATE_TYPES[self._kind](data, "joint state")
            seen.append(joints.names)
            return joints.layout_of()

        decode(messages.data, messages.begin[:_SEEN], messages.end[:_SEEN], layout_of, 0)
        known = dict.fromkeys(chain(*seen))
        if not known:
            return None
        joint, belt = self._layout.joint, self._layout.belt_joint
        ours = self._kind.startswith("sensor") and any({SLIDE, BELT} <= {*names} for names in seen)
        if ours and joint is None and belt is None:
            if self._layout.force == "effort":
                raise BagError(
                    f"the effort {self._where} is the friction of our plant: the force is on "
                    "control_force, and --force effort is refused"
                )
            return joint_state_layout
        others = [name for name in known if name != belt]
        if joint is None and len(others) != 1:
            raise self._several(others)
        name = others[0] if joint is None else joint
        for option, chosen in (("joint", name), ("belt_joint", belt)):
            if chosen is not None and chosen not in known:
                raise BagError(
                    printable(
                        f"{option} = {shown(chosen)} is refused: the joint states {self._where} "
                        f"are of the joints {_listed(known)}"
                    )
                )
        self.machine = MachineMotion(name, self._topic, self._where, self._layout, self._belt_speed)
        if joint is None:
            return partial(self._only_joint, name)
        return partial(joint_layout, joint=name, belt=belt, kind=self._kind)

    def _only_joint(self, joint: str, data: bytes) -> Layout:
        """Return the layout of the only joint; refuse messages of others."""
        names, belt = STATE_TYPES[self._kind](data, "joint state").names, self._layout.belt_joint
        if joint not in names and belt not in names:
            raise self._several([joint, *names])
        return joint_layout(data, joint, belt, self._kind)

    def _several(self, names: Iterable[str]) -> BagError:
        return BagError(
            printable(
                f"the joint states {self._where} are of the joints {_listed(names)}: --joint NAME "
                "must choose one"
            )
        )


def _listed(names: Iterable[str]) -> str:
    unique = [*dict.fromkeys(names)]
    return ", ".join(unique[:_MOST_NAMES]) + (", ..." if len(unique) > _MOST_NAMES else "")
