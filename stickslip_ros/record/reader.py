"""Read the recorded motion and forces of a drive from a bag."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from math import inf
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from stickslip_ros.arrays import IntArray
from stickslip_ros.errors import BagError
from stickslip_ros.record.bag_files import BagFiles
from stickslip_ros.record.cdr import Messages, Refused
from stickslip_ros.record.chunk import MessageBlock
from stickslip_ros.record.codec import (
    FORCE_TYPES,
    STATE_TYPES,
    force_layouts,
    joint_states_in,
    references_in,
    wrenches_in,
)
from stickslip_ros.record.motion_reader import (
    ANY_LAYOUT,
    BagLayout,
    MotionReader,
    NumberedTopic,
    read_forces,
)
from stickslip_ros.record.topics import (
    APPLIED_DISTURBANCE,
    APPLIED_FORCE,
    CONTROL_FORCE,
    DROPPED_FORCE,
    JOINT_STATES,
    RECORDED_TOPICS,
    REFERENCE,
    TRUE_JOINT_STATES,
    Topic,
)
from stickslip_ros.samples import (
    NO_FORCES,
    NO_SAMPLES,
    ForceColumns,
    ReferenceColumns,
    SampleColumns,
)
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import number_in, printable, quantity, shown

ColumnsT = TypeVar("ColumnsT", SampleColumns, ForceColumns, ReferenceColumns)
_Decode = Callable[[bytes, IntArray, IntArray], tuple[ColumnsT, Refused]]


class RunBlock(NamedTuple):
    """A part of a recorded run, from one chunk of its bag; each column set may be empty."""

    joint_states: SampleColumns
    """Joint states in the order of the file."""
    control_forces: ForceColumns
    """Control forces that were sent."""
    dropped_forces: ForceColumns
    """Control forces that did not act."""


class Recording(BagFiles):
    """A bag that is open for reading; a context manager that closes it.

    Columns are read on first access. `blocks` yields them chunk by chunk, in the memory of one
    chunk. Incomplete or damaged bags, such as those of a killed recorder, are read as far as
    possible; `missing` lists what they lack.

    Parameters
    ----------
    path : Path or str
        A bag directory, or one MCAP file.
    namespace : str or None
        ROS namespace of the drive whose columns are read, such as `/feed_drive`; None if the bag
        holds only one drive.
    belt_speed : float or None
        Belt speed, m/s, where the joint states have no belt; None: the belt counts as at rest.
    layout : BagLayout, optional
        Where a bag of another machine has motion and force; by default it is found.

    Raises
    ------
    BagError
        If `path` is not a bag, or a bag that is not stored as MCAP.

    Examples
    --------
    >>> from stickslip_ros.record.reader import Recording
    >>> with Recording("bags/reference") as recording:
    ...     states = recording.joint_states
    ...     missing = recording.missing
    >>> states.stamp.dtype, states.position.dtype  # ns, m
    (dtype('int64'), dtype('float64'))
    >>> missing
    []
    """

    def __init__(
        self,
        path: Path | str,
        namespace: str | None = None,
        *,
        belt_speed: float | None = None,
        layout: BagLayout = ANY_LAYOUT,
    ) -> None:
        super().__init__(path)
        self._belt_speed, self._given_layout = belt_speed, layout
        self._namespace = namespace
        self._motion: MotionReader | None = None
        self._timed_by_log = ""
        self._refused: Counter[str] = Counter()
        self._reasons: dict[str, str] = {}

    @property
    def notes(self) -> Sequence[str]:
        """Sentences on how the motion of another machine was read so far, and what it lacks."""
        notes = [] if self._motion is None else self._motion.notes
        if self._timed_by_log:
            notes.append(
                f"the forces on {self._timed_by_log} have no stamps: their log times count"
            )
        return notes

    @property
    def complete(self) -> bool:
        """Whether `missing` is empty."""
        return not self.missing

    @property
    def missing(self) -> list[str]:
        """Sentences on what the bag lacks; further reading may find more.

        They name an incomplete end, damage, and messages that could not be decoded.
        """
        sentences = [
            *self.damage,
            *(
                f"{number} messages on {topic} could not be read: {self._reasons[topic]}"
                for topic, number in self._refused.items()
            ),
        ]
        return [printable(sentence) for sentence in sentences]

    @cached_property
    def joint_states(self) -> SampleColumns:
        """All joint states; raises BagError as `blocks` does."""
        return self._states_and_efforts[0]

    @cached_property
    def true_joint_states(self) -> SampleColumns:
        """All true states; none without `publish_truth`. Raises BagError as `blocks` does."""
        return self._whole(TRUE_JOINT_STATES, joint_states_in)

    @cached_property
    def applied_forces(self) -> ForceColumns:
        """All forces of the actuator; none without `publish_truth`.

        Raises BagError as `blocks` does.
        """
        return self._whole(APPLIED_FORCE, wrenches_in)

    @cached_property
    def control_forces(self) -> ForceColumns:
        """All control forces that were sent; raises BagError as `blocks` does."""
        if self._layout.force == "effort":
            return self._states_and_efforts[1]
        name = self._topic(CONTROL_FORCE)
        parts = [self._forces(name, on(name)) for on in self._chunks(name)]
        self._check_clocks()
        return NO_FORCES.followed_by(*parts)

    @cached_property
    def applied_disturbances(self) -> ForceColumns:
        """All changes of the disturbance force, stamped with the first sample they act on.

        Raises BagError as `blocks` does.
        """
        return self._whole(APPLIED_DISTURBANCE, wrenches_in)

    @cached_property
    def dropped_forces(self) -> ForceColumns:
        """All control forces that did not act, as sent; raises BagError as `blocks` does."""
        return self._whole(DROPPED_FORCE, wrenches_in)

    @cached_property
    def references(self) -> ReferenceColumns:
        """All references of the controller; raises BagError as `blocks` does."""
        return self._whole(REFERENCE, references_in)

    @property
    def dropped_known(self) -> bool:
        """Whether the bag records which control forces did not act.

        Bags of older versions and of other plants do not. Raises BagError as `blocks` does.
        """
        return self._topic(DROPPED_FORCE) != ""

    def name_of(self, topic: Topic[Any]) -> str:
        """Return the full name that a topic of the drive has, whether the bag has it or not.

        Parameters
        ----------
        topic : Topic
            A topic of `messages.topics`.

        Returns
        -------
        str
            Its name in the namespace of the drive.

        Raises
        ------
        BagError
            If the bag holds several drives and no namespace was given.
        """
        return self._prefix + topic.name

    def blocks(self, least: int = 1) -> Iterator[RunBlock]:
        """Yield joint states, control forces and dropped forces in file order, chunk by chunk.

        What another machine recorded is one block. Messages that cannot be decoded are skipped and
        listed in `missing`.

        Parameters
        ----------
        least : int
            Smallest number of messages in a block; smaller chunks are joined. The last block may
            have fewer.

        Yields
        ------
        RunBlock
            The messages of one chunk, or of several joined ones.

        Raises
        ------
        BagError
            If the bag holds several drives and no namespace was given, or if the operating system
            fails to read it.
        """
        states, forces, dropped = map(self._topic, (JOINT_STATES, CONTROL_FORCE, DROPPED_FORCE))
        by_effort = self._layout.force == "effort"
        if by_effort:
            forces = ""
        self._motion = motion = self._motion_reader(states)
        gathered: list[RunBlock] = []
        count = 0
        for on in self._chunks(states, forces, dropped):
            samples, efforts = self._states(motion, states, on(states))
            block = RunBlock(
                samples,
                efforts if by_effort else self._forces(forces, on(forces)),
                self._decoded(dropped, on(dropped), wrenches_in),
            )
            gathered.append(block)
            count += sum(map(len, block))
            if count >= least and motion.own:
                yield _joined_blocks(gathered)
                gathered, count = [], 0
        self._check_clocks()
        if gathered:
            block = _joined_blocks(gathered)
            if not motion.own:
                states = motion.without_lost_velocities(block.joint_states)
                block = block._replace(joint_states=states)
            yield block

    @cached_property
    def _layout(self) -> BagLayout:
        """The layout that was given or, without one, that the analyzer used."""
        if self._given_layout != ANY_LAYOUT:
            return self._given_layout
        kept = {name: text.strip('"') for name, text in self._of_the_analyzer.items()}
        joint, belt = (kept.get(name) or None for name in ("joint", "belt_joint"))
        force = "effort" if kept.get("force_type") == "effort" else "topic"
        return BagLayout(joint, belt, force=force)

    @cached_property
    def _of_the_analyzer(self) -> dict[str, str]:
        """The parameters of the analyzer, as texts."""
        return self.metadata("stickslip_ros/analyzer") or {}

    @cached_property
    def _prefix(self) -> str:
        """Prefix of the names of the drive's topics; BagError if there are several drives."""
        if self._layout.states_topic is not None:
            return NumberedTopic.of(self._layout.states_topic).name.rpartition("/")[0] + "/"
        if self._namespace is not None:
            return f"/{self._namespace.strip('/')}/".replace("//", "/")
        for topic in RECORDED_TOPICS:
            prefixes = [
                name.removesuffix(topic.name)
                for name, type_name in self.topics.items()
                if type_name == topic.type_name and f"/{name}".endswith(f"/{topic.name}")
            ]
            if len(prefixes) > 1:
                namespaces = ", ".join(sorted(prefix.rstrip("/") or "/" for prefix in prefixes))
                raise BagError(
                    f"the bag {self.path} holds {len(prefixes)} drives; choose one by its "
                    f"namespace: {namespaces}"
                )
            if prefixes:
                return prefixes[0]
        return "/"

    def _topic(self, topic: Topic[Any]) -> str:
        """Return the name of a topic of the drive, "" if the bag has none.

        Raises BagError if the topic that was chosen is not there, or of another type.
        """
        chosen = {JOINT_STATES: "states_topic", CONTROL_FORCE: "force_topic"}.get(topic, "")
        given = getattr(self._layout, chosen, None)
        types = FORCE_TYPES if topic == CONTROL_FORCE else (topic.type_name,)
        if given is None:
            name = self._prefix + topic.name
            if self.topics.get(name) in types:
                return name
            others = {*STATE_TYPES} - {topic.type_name} if topic == JOINT_STATES else ()
            found = [each for each, kind in self.topics.items() if kind in others]
            return found[0] if len(found) == 1 and self._namespace is None else ""
        if topic == JOINT_STATES:
            types = (*STATE_TYPES,)
        name = NumberedTopic.of(given).name
        if self.topics.get(name) not in types:
            allowed = [each for each, kind in self.topics.items() if kind in types]
            raise BagError(
                printable(
                    f"{chosen} = {shown(name)} is refused: topics of the bag {self.path} that are "
                    f"{', '.join(types)} are {', '.join(sorted(allowed)) or 'none'}"
                )
            )
        return name

    @property
    def of_another_machine(self) -> bool:
        """Whether the joint states that were read are not those of our plant."""
        return self._motion is not None and not self._motion.own

    @property
    def velocity_estimated(self) -> bool:
        """Whether velocities that are not recorded were estimated from the positions so far."""
        return self._motion is not None and self._motion.estimated

    def _motion_reader(self, topic: str) -> MotionReader:
        belt_speed = self._belt_speed
        if belt_speed is None:
            belt_speed = number_in(self._of_the_analyzer.get("belt_speed", "")) or None
        kind = self.topics.get(topic, JOINT_STATES.type_name)
        return MotionReader(topic, self._layout, belt_speed, str(self.path), kind)

    @cached_property
    def _states_and_efforts(self) -> tuple[SampleColumns, ForceColumns]:
        """All joint states, and their efforts if these are the forces."""
        name = self._topic(JOINT_STATES)
        self._motion = motion = self._motion_reader(name)
        read = [self._states(motion, name, on(name)) for on in self._chunks(name)]
        states, efforts = zip(*read, strict=True) if read else ((), ())
        return NO_SAMPLES.followed_by(*states), NO_FORCES.followed_by(*efforts)

    def _states(
        self, motion: MotionReader, topic: str, messages: MessageBlock
    ) -> tuple[SampleColumns, ForceColumns]:
        states, efforts, refused = motion.read(_content(messages), messages.log_time)
        self._note(topic, refused)
        if self._effort_is_of_actuator:
            states = replace(states, friction_force=np.full(len(states), np.nan))
        return states, efforts

    @cached_property
    def _effort_is_of_actuator(self) -> bool:
        """Whether our plant recorded the force of its actuator in place of the friction."""
        return (self.metadata("stickslip_ros/plant") or {}).get("effort") == '"actuator"'

    def _forces(self, topic: str, messages: MessageBlock) -> ForceColumns:
        layout, kind = self._layout, self.topics.get(topic, CONTROL_FORCE.type_name)
        by_log = layout.time == "log"
        if kind == CONTROL_FORCE.type_name and not (layout.force_topic or by_log):
            return self._decoded(topic, messages, wrenches_in)
        number = NumberedTopic.of(layout.force_topic or "").number
        kept = number_in(self._of_the_analyzer.get("force_number", ""))
        if number is None and 0.0 < kept < inf:
            number = int(kept)
        forces, unstamped, refused = read_forces(
            force_layouts(layout.joint, number)[kind],
            _content(messages),
            messages.log_time,
            by_log=by_log,
        )
        if unstamped:
            self._timed_by_log = topic
        self._note(topic, refused)
        return forces

    def _check_clocks(self) -> None:
        """Refuse log times of forces beside stamps of another clock."""
        apart = self._motion and self._motion.clock_offset
        if self._timed_by_log and apart and abs(apart) > NANOSECONDS:
            raise BagError(
                f"the forces on {self._timed_by_log} have no stamps, and those of the joint states "
                f"are {quantity(abs(apart) / NANOSECONDS, 's')} from their log times: --time log "
                "takes the log times of both"
            )

    def _note(self, topic: str, refused: Refused) -> None:
        if refused.number > 0:
            self._refused[topic] += refused.number
            self._reasons.setdefault(topic, refused.reason)

    def _decoded(self, topic: str, messages: MessageBlock, decode: _Decode[ColumnsT]) -> ColumnsT:
        columns, refused = decode(*_content(messages))
        self._note(topic, refused)
        return columns

    def _whole(self, topic: Topic[Any], decode: _Decode[ColumnsT]) -> ColumnsT:
        """Return all columns of a topic as one."""
        name, nothing = self._topic(topic), np.empty(0, np.int64)
        parts = (self._decoded(name, on(name), decode) for on in self._chunks(name))
        return decode(b"", nothing, nothing)[0].followed_by(*parts)

    def _chunks(self, *topics: str) -> Iterator[Callable[[str], MessageBlock]]:
        """Yield for each chunk of the bag what returns its messages on one of these topics."""
        for block, topic_of in self.message_blocks(*topics):
            yield lambda topic, block=block, topic_of=topic_of: block.on(
                [number for number, name in topic_of.items() if name == topic]
            )


def _content(block: MessageBlock) -> Messages:
    return Messages(block.data, block.begin, block.end)


def _joined_blocks(blocks: Sequence[RunBlock]) -> RunBlock:
    parts: Any = zip(*blocks, strict=True)
    return RunBlock(*(first.followed_by(*others) for first, *others in parts))
