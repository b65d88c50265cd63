"""Where a bag has the motion and the forces of a drive: topics, joints, and what times count."""

import re
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import Any, get_args

from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.record import ForceSource, TimeSource
from stickslip_ros.record.bag_files import BagFiles
from stickslip_ros.record.codec import FORCE_TYPES, STATE_TYPES
from stickslip_ros.record.topics import CONTROL_FORCE, JOINT_STATES, RECORDED_TOPICS, Topic
from stickslip_ros.text import must_be_one_of, number_in, printable, shown

_NUMBERED = re.compile(r"(.+)\[(\d+)\]")


@dataclass(frozen=True)
class BagLayout:
    """Where bags of other machines have motion and force; what is not given is found.

    Raises InvalidInputError if a time or a force is none of those allowed.
    """

    joint: str | None = None
    """Joint that is the slide."""
    belt_joint: str | None = None
    """Joint that is the belt."""
    states_topic: str | None = None
    """Full name of the topic of joint states; with [2] behind it, of two sources the second."""
    force_topic: str | None = None
    """Full name of the topic of forces; with [2] behind it, the second number of an array."""
    time: str = "header"
    """`header`: the stamps in the messages; `log`: the times at which they were recorded."""
    force: str = "topic"
    """`topic`: the force is that of a topic; `effort`: it is the effort of the joint."""

    def __post_init__(self) -> None:
        for name, value, allowed in (
            ("time", self.time, get_args(TimeSource)),
            ("force", self.force, get_args(ForceSource)),
        ):
            if value not in allowed:
                raise InvalidInputError(
                    f"{name} = {shown(value)} is invalid: {must_be_one_of(str(value), allowed)}"
                )


ANY_LAYOUT = BagLayout()
"""Nothing is known of the layout."""


def numbered(topic: str | None) -> tuple[str, int | None]:
    """Return the name of a topic, empty without one, and the number in brackets behind it."""
    parts = _NUMBERED.fullmatch(topic or "")
    return (parts[1], int(parts[2])) if parts else (topic or "", None)


@dataclass(frozen=True)
class DriveInBag:
    """Where a bag has one drive, and what it tells of it."""

    source: BagFiles
    namespace: str | None = None
    """ROS namespace of the drive; None if the bag holds only one drive."""
    given_layout: BagLayout = ANY_LAYOUT
    """What is known of the layout."""
    given_belt_speed: float | None = None
    """Belt speed, m/s, where the joint states have no belt."""

    @cached_property
    def analyzer(self) -> dict[str, str]:
        """The parameters of the analyzer, as texts."""
        return self.source.metadata("stickslip_ros/analyzer") or {}

    @cached_property
    def layout(self) -> BagLayout:
        """The layout that was given and, where it tells nothing, that the analyzer used.

        What the analyzer used is that of its own topics.
        """
        given = self.given_layout
        if given.states_topic is not None:
            return given
        kept = {name: text.strip('"') for name, text in self.analyzer.items()}
        joint, belt = (
            getattr(given, name) or kept.get(name) or None for name in ("joint", "belt_joint")
        )
        by_effort = kept.get("force_type") == "effort" and given.force_topic is None
        force = "effort" if by_effort else given.force
        return replace(given, joint=joint, belt_joint=belt if belt != joint else None, force=force)

    @cached_property
    def belt_speed(self) -> float | None:
        """The belt speed, m/s, that was given or, without one, that the analyzer used."""
        if self.given_belt_speed is not None:
            return self.given_belt_speed
        return number_in(self.analyzer.get("belt_speed", "")) or None

    @cached_property
    def force_number(self) -> int | None:
        """The place of the force in an array of numbers, from 1; None if it is not known."""
        _, number = numbered(self.layout.force_topic)
        kept = number_in(self.analyzer.get("force_number", ""))
        return int(kept) if number is None and 0.0 < kept < inf else number

    @cached_property
    def prefix(self) -> str:
        """Prefix of the names of the drive's topics; BagError if there are several drives."""
        if self.layout.states_topic is not None:
            return numbered(self.layout.states_topic)[0].rpartition("/")[0] + "/"
        if self.namespace is not None:
            return f"/{self.namespace.strip('/')}/".replace("//", "/")
        for topic in RECORDED_TOPICS:
            prefixes = [
                name.removesuffix(topic.name)
                for name, type_name in self.source.topics.items()
                if type_name == topic.type_name and f"/{name}".endswith(f"/{topic.name}")
            ]
            if len(prefixes) > 1:
                namespaces = ", ".join(sorted(prefix.rstrip("/") or "/" for prefix in prefixes))
                raise BagError(
                    f"the bag {self.source.path} holds {len(prefixes)} drives; choose one by its "
                    f"namespace: {namespaces}"
                )
            if prefixes:
                return prefixes[0]
        return "/"

    def name(self, topic: Topic[Any]) -> str:
        """Return the full name of a topic of the drive, "" if the bag has none.

        Raises BagError if there are several drives, and if the topic that was chosen is not there,
        or of another type.
        """
        chosen, types = {
            JOINT_STATES: ("states_topic", (*STATE_TYPES,)),
            CONTROL_FORCE: ("force_topic", FORCE_TYPES),
        }.get(topic, ("", (topic.type_name,)))
        given, topics = getattr(self.layout, chosen, None), self.source.topics
        fitting = sorted(name for name, kind in topics.items() if kind in types)
        name = self.prefix + topic.name if given is None else numbered(given)[0]
        if name in fitting:
            return name
        if given is not None:
            raise BagError(
                printable(
                    f"{chosen} = {shown(name)} is refused: topics of the bag {self.source.path} "
                    f"that are {', '.join(types)} are {', '.join(fitting) or 'none'}"
                )
            )
        others = [other for other in fitting if topics[other] != topic.type_name]
        is_only = topic == JOINT_STATES and len(others) == 1 and self.namespace is None
        return others[0] if is_only else ""
