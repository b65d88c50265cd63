"""Read the recorded motion and forces of a drive from a bag."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import chain
from math import inf
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from stickslip_ros.arrays import IntArray
from stickslip_ros.errors import BagError
from stickslip_ros.record.bag_files import BagFiles
from stickslip_ros.record.bag_layout import ANY_LAYOUT, BagLayout, DriveInBag
from stickslip_ros.record.cdr import Layout, Messages, Refused, decode
from stickslip_ros.record.chunk import MessageBlock
from stickslip_ros.record.codec import (
    CONTROLLER_STATE,
    controller_references_in,
    force_layouts,
    joint_states_in,
    references_in,
    wrenches_in,
)
from stickslip_ros.record.imperfections import play_note, ripple_note
from stickslip_ros.record.motion_reader import MotionReader
from stickslip_ros.record.topics import (
    APPLIED_DISTURBANCE,
    APPLIED_FORCE,
    CONTROL_FORCE,
    DROPPED_FORCE,
    JOINT_STATES,
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
from stickslip_ros.text import printable, quantity

ColumnsT = TypeVar("ColumnsT", SampleColumns, ForceColumns, ReferenceColumns)
_Run = tuple[SampleColumns, ForceColumns, ForceColumns]


class RunBlock(NamedTuple):
    """A part of a recorded run, such as one chunk of its bag; each column set may be empty."""

    joint_states: SampleColumns
    """Joint states in the order of the file."""
    control_forces: ForceColumns
    """Control forces that were sent."""
    dropped_forces: ForceColumns
    """Control forces that did not act."""
    of_another_machine: bool = False
    """Whether the joint states are not those of our plant; then the block is the whole run."""
    velocity_estimated: bool = False
    """Whether velocities that are not recorded were estimated from the positions."""


class Recording(BagFiles):
    """A bag that is open for reading; a context manager that closes it.

    Columns are read on first access. `blocks` yields them chunk by chunk, in the memory of one
    chunk. Either raises BagError if the bag holds several drives and no namespace was given, if a
    choice for a bag of another machine is missing or wrong, or if the operating system fails.
    Incomplete or damaged bags, such as those of a killed recorder, are read as far as possible;
    `missing` lists what they lack.

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
    continued : sequence of Path, optional
        Bags that continue the run, see `runs_of`.

    Raises
    ------
    BagError
        If `path` is not a bag.

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
        continued: Sequence[Path] = (),
    ) -> None:
        super().__init__(path, *continued)
        self._drive = DriveInBag(self, namespace, layout, belt_speed)
        self._notes: dict[str, Sequence[str]] = {}
        self._refused: dict[str, Sequence[str]] = {}

    @property
    def notes(self) -> list[str]:
        """Sentences on how the motion of another machine was read, and what it lacks."""
        return [*chain(*self._notes.values())]

    @property
    def complete(self) -> bool:
        """Whether `missing` is empty."""
        return not self.missing

    @property
    def missing(self) -> list[str]:
        """Sentences on what the bag lacks; further reading may find more.

        They name an incomplete end, damage, and messages that could not be decoded.
        """
        return [*self.damage, *chain(*self._refused.values())]

    @property
    def joint_states(self) -> SampleColumns:
        """All joint states."""
        return self._run.joint_states

    @cached_property
    def true_joint_states(self) -> SampleColumns:
        """All true states; none without `publish_truth`."""
        return self._columns(TRUE_JOINT_STATES, joint_states_in)

    @cached_property
    def applied_forces(self) -> ForceColumns:
        """All forces of the actuator; none without `publish_truth`."""
        return self._columns(APPLIED_FORCE, wrenches_in)

    @property
    def control_forces(self) -> ForceColumns:
        """All control forces that were sent."""
        return self._run.control_forces

    @cached_property
    def applied_disturbances(self) -> ForceColumns:
        """All changes of the disturbance force, stamped with the first sample they act on."""
        return self._columns(APPLIED_DISTURBANCE, wrenches_in)

    @property
    def dropped_forces(self) -> ForceColumns:
        """All control forces that did not act, as sent."""
        return self._run.dropped_forces

    @cached_property
    def references(self) -> ReferenceColumns:
        """All references of the controller; those in the states of a JointTrajectoryController."""
        states, drive = self._drive.name(JOINT_STATES), self._drive
        if self.topics.get(states) != CONTROLLER_STATE or drive.name(REFERENCE):
            return self._columns(REFERENCE, references_in)
        decode = controller_references_in(drive.layout.joint)
        references = self._columns(REFERENCE, decode, states)
        if np.array_equal(references.stamp, self.joint_states.stamp):
            notes = play_note(references.position, self.joint_states.position, "m")
            self._notes[REFERENCE.name] = [*notes]
        return references

    @property
    def dropped_known(self) -> bool:
        """Whether it is known which control forces did not act; some older bags do not tell.

        By the times of the log a force is not found among those that were sent.
        """
        return self._drive.name(DROPPED_FORCE) != "" and self._drive.layout.time != "log"

    def name_of(self, topic: Topic[Any]) -> str:
        """Return the full name that a topic of the drive has, whether the bag has it or not.

        Parameters
        ----------
        topic : Topic
            A topic of `record.topics`.

        Returns
        -------
        str
            Its name in the namespace of the drive.

        Raises
        ------
        BagError
            If the bag holds several drives and no namespace was given.
        """
        return self._drive.prefix + topic.name

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
        yield from self._runs(least)
        if self.topics.get(self._drive.name(JOINT_STATES)) == CONTROLLER_STATE:
            _ = self.references  # of which there may be a note

    @cached_property
    def _run(self) -> RunBlock:
        return next(self._runs(inf), RunBlock(NO_SAMPLES, NO_FORCES, NO_FORCES))

    def _runs(self, least: float) -> Iterator[RunBlock]:
        reader = _RunReader(self._drive)
        for run in reader.blocks(least):
            self._notes[JOINT_STATES.name] = reader.notes(run)
            self._refused[JOINT_STATES.name] = _sentences(reader.refused)
            yield run

    def _columns(
        self,
        topic: Topic[Any],
        decode: Callable[[bytes, IntArray, IntArray], tuple[ColumnsT, Refused]],
        name: str | None = None,
    ) -> ColumnsT:
        """Return all columns of a topic as one; by the times of the log, those of whole blocks."""
        name = self._drive.name(topic) if name is None else name
        nothing, by_log = np.empty(0, np.int64), self._drive.layout.time == "log"
        parts: list[ColumnsT] = []
        counts: dict[str, Refused] = {}
        for block in self.message_blocks(name) if name else ():
            part, refused = decode(*block[name].messages)
            if by_log:
                log_time = block[name].log_time
                part = replace(part, stamp=log_time) if len(part) == len(log_time) else part[:0]
            parts.append(part)
            _count(counts, name, refused)
        columns = decode(b"", nothing, nothing)[0].followed_by(*parts)
        self._refused[topic.name] = _sentences(counts)
        return columns


class _RunReader:
    """Reads the motion and the forces of a drive once, block by block."""

    def __init__(self, drive: DriveInBag) -> None:
        self._drive, self._by_effort = drive, drive.layout.force == "effort"
        topics = map(drive.name, (JOINT_STATES, CONTROL_FORCE, DROPPED_FORCE))
        self._states, self._forces, self._dropped = topics
        self._by_log = drive.layout.time == "log"
        if self._by_log:
            self._dropped = ""
        if self._by_effort:
            self._forces = ""
        self._motion = MotionReader(
            self._states,
            drive.layout,
            drive.belt_speed,
            str(drive.source.path),
            drive.source.topics.get(self._states, JOINT_STATES.type_name),
        )
        kind = drive.source.topics.get(self._forces, CONTROL_FORCE.type_name)
        by_layout = self._by_log or drive.layout.force_topic or kind != CONTROL_FORCE.type_name
        layouts = force_layouts(drive.layout.joint, drive.force_number)
        self._force_layout = layouts[kind] if by_layout else None
        plant = drive.source.metadata("stickslip_ros/plant") or {}
        self._has_friction = plant.get("effort") != '"actuator"'
        self._unstamped = False
        self.refused: dict[str, Refused] = {}
        """What could not be decoded so far, by topic."""

    def blocks(self, least: float) -> Iterator[RunBlock]:
        """Yield blocks of so many messages or more.

        The last block may have fewer, and what another machine recorded is one block.
        """
        gathered: list[_Run] = []
        count = 0
        for block in self._drive.source.message_blocks(self._states, self._forces, self._dropped):
            run = self._decoded(block)
            gathered.append(run)
            count += sum(map(len, run))
            if count >= least and self._motion.machine is None:
                yield RunBlock(*_joined(gathered))
                gathered, count = [], 0
        self._check_clocks()
        if gathered:
            run = RunBlock(*_joined(gathered))
            if (machine := self._motion.machine) is not None:
                states = machine.whole(run.joint_states)
                run = RunBlock(states, *run[1:3], True, machine.estimated)
            yield run

    def _decoded(self, block: Mapping[str, MessageBlock]) -> _Run:
        sent = block[self._states]
        states, forces, refused = self._motion.read(sent.messages, sent.log_time)
        _count(self.refused, self._states, refused)
        if not self._has_friction:
            states = replace(states, friction_force=np.full(len(states), np.nan))
        if not self._by_effort:
            sent = block[self._forces]
            if self._force_layout is None:
                forces, refused = wrenches_in(*sent.messages)
            else:
                forces, unstamped, refused = read_forces(
                    self._force_layout, sent.messages, sent.log_time, by_log=self._by_log
                )
                self._unstamped |= unstamped
            _count(self.refused, self._forces, refused)
        dropped, refused = wrenches_in(*block[self._dropped].messages)
        _count(self.refused, self._dropped, refused)
        return states, forces, dropped

    def _check_clocks(self) -> None:
        """Refuse log times of forces beside stamps of another clock."""
        apart = self._motion.clock_offset
        if self._unstamped and apart and abs(apart) > NANOSECONDS:
            raise BagError(
                f"the forces on {self._forces} have no stamps, and those of the joint states "
                f"are {quantity(abs(apart) / NANOSECONDS, 's')} from their log times: --time log "
                "takes the log times of both"
            )

    def notes(self, run: RunBlock) -> list[str]:
        """Return sentences on how the motion was read up to the end of a block."""
        machine, states = self._motion.machine, run.joint_states
        notes = [] if machine is None else machine.notes
        if self._by_effort:
            time = (states.stamp - states.stamp[:1]) / NANOSECONDS
            notes += ripple_note(time, states.position, run.control_forces.force, ("m", "N"))
        if self._unstamped:
            notes.append(f"the forces on {self._forces} have no stamps: their log times count")
        return notes


def _count(counts: dict[str, Refused], topic: str, refused: Refused) -> None:
    if refused.number > 0:
        counts[topic] = counts.get(topic, Refused(0, "")).followed_by(refused)


def _sentences(refused: Mapping[str, Refused]) -> list[str]:
    """Return sentences on messages that could not be decoded, by their topics."""
    return [
        printable(f"{number} messages on {topic} could not be read: {reason}")
        for topic, (number, reason) in refused.items()
    ]


def _joined(runs: Sequence[_Run]) -> _Run:
    parts: Any = zip(*runs, strict=True)
    states, forces, dropped = (first.followed_by(*others) for first, *others in parts)
    return states, forces, dropped


def read_forces(
    layout_of: Callable[[bytes], Layout], messages: Messages, log_time: IntArray, *, by_log: bool
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
