"""Reading a bag: a directory of MCAP files as rosbag2 lays it out, or one such file."""

import os
import re
import tempfile
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np

from stickslip_ros.arrays import IntArray
from stickslip_ros.bags.chunk import MessageBlock
from stickslip_ros.bags.compression import unpack_file
from stickslip_ros.bags.mcap_file import McapFile
from stickslip_ros.bags.metadata import metadata_faults
from stickslip_ros.errors import BagError
from stickslip_ros.messages.cdr import Refused
from stickslip_ros.messages.codec import joint_states_in, wrenches_in
from stickslip_ros.messages.topics import (
    APPLIED_DISTURBANCE,
    CONTROL_FORCE,
    DROPPED_FORCE,
    JOINT_STATES,
    RECORDED_TOPICS,
    Topic,
)
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.text import printable

_PACKED = ".mcap.zstd"
"""Ending of the files that rosbag2 packs as a whole."""


ColumnsT = TypeVar("ColumnsT", SampleColumns, ForceColumns)
_Decode = Callable[[bytes, IntArray, IntArray], tuple[ColumnsT, Refused]]


class RunBlock(NamedTuple):
    """A stretch of a recorded run, of one chunk of its bag; each part may be empty."""

    joint_states: SampleColumns
    control_forces: ForceColumns
    dropped_forces: ForceColumns


class Recording:
    """A bag that is open for reading; a context manager that closes it.

    Columns are read when they are asked for, `blocks` gives them a chunk at a time:

        with Recording("bags/my_run") as recording:
            recording.topics                       # {'/feed_drive/joint_states': …}
            states = recording.joint_states        # all of them: numpy arrays
            states.stamp, states.position          # ns, m
            for block in recording.blocks():       # in the memory of one chunk
                block.control_forces.force         # N
            recording.missing                      # [] if nothing is
    """

    def __init__(self, path: Path | str, namespace: str | None = None) -> None:
        """Open a bag directory or one MCAP file, also such as a killed recorder leaves behind.

        The columns are those of the drive in the ROS `namespace`, such as `/feed_drive`; None will
        do where the bag holds one drive. Raises BagError if there is no bag, or one that is not
        stored as MCAP.
        """
        self.path = Path(path)
        self._namespace = namespace
        self._unreadable: list[str] = []
        self._refused: Counter[str] = Counter()
        self._reasons: dict[str, str] = {}
        paths = _mcap_files(self.path)
        with ExitStack() as opened:
            files = self._readable_files([_unpacked(path, opened) for path in paths])
            self.files = [opened.enter_context(closing(file)) for file in files]
            """The MCAP files in their order; those that cannot be read are left out."""
            self._opened = opened.pop_all()
        self._metadata_faults = metadata_faults(self.path, paths) if self.path.is_dir() else []
        self.topics = {
            channel.topic: file.schemas[channel.schema_id].name
            for file in self.files
            for channel in file.channels.values()
            if channel.schema_id in file.schemas
        }
        """Name and type of each, as `/feed_drive/joint_states` and `sensor_msgs/msg/JointState`."""

    @property
    def complete(self) -> bool:
        """Whether nothing is `missing`."""
        return not self.missing

    @property
    def missing(self) -> list[str]:
        """What the bag lacks, in sentences; reading on may find more.

        That is an end that no recorder wrote, damage, and messages that could not be understood.
        """
        sentences = [
            *self._metadata_faults,
            *self._unreadable,
            *(sentence for file in self.files for sentence in file.damage),
            *(
                f"{number} messages on {topic} could not be read: {self._reasons[topic]}"
                for topic, number in self._refused.items()
            ),
        ]
        return [printable(sentence) for sentence in sentences]

    @cached_property
    def joint_states(self) -> SampleColumns:
        """All joint states; BagError as for `blocks`."""
        return self._whole(JOINT_STATES, joint_states_in)

    @cached_property
    def control_forces(self) -> ForceColumns:
        """All control forces; BagError as for `blocks`."""
        return self._whole(CONTROL_FORCE, wrenches_in)

    @cached_property
    def applied_disturbances(self) -> ForceColumns:
        """All disturbance forces at the samples from which they act; BagError as for `blocks`."""
        return self._whole(APPLIED_DISTURBANCE, wrenches_in)

    @cached_property
    def dropped_forces(self) -> ForceColumns:
        """All control forces that did not act, as they were sent; BagError as for `blocks`."""
        return self._whole(DROPPED_FORCE, wrenches_in)

    @property
    def dropped_known(self) -> bool:
        """Whether the bag tells which control forces did not act; BagError as for `blocks`.

        Bags of older versions do not, nor those of other plants.
        """
        return self._topic(DROPPED_FORCE) != ""

    def blocks(self, least: int = 1) -> Iterator[RunBlock]:
        """Yield joint states, control forces sent and dropped, a chunk at a time, in file order.

        Chunks with fewer than `least` of all are joined to ones with more, the last ones excepted.
        Messages that cannot be understood are left out, and `missing` then tells of them. Raises
        BagError where the bag holds several drives and no namespace was given, and where the
        operating system fails to read it.
        """
        states, forces, dropped = map(self._topic, (JOINT_STATES, CONTROL_FORCE, DROPPED_FORCE))
        gathered: list[RunBlock] = []
        count = 0
        for messages, channels in self._blocks(states, forces, dropped):
            block = RunBlock(
                self._decoded(states, messages, channels, joint_states_in),
                self._decoded(forces, messages, channels, wrenches_in),
                self._decoded(dropped, messages, channels, wrenches_in),
            )
            gathered.append(block)
            count += sum(map(len, block))
            if count >= least:
                yield _joined_blocks(gathered)
                gathered, count = [], 0
        if gathered:
            yield _joined_blocks(gathered)

    def messages(self, *topics: str) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, log time in ns and serialized message of these topics, as recorded in turn.

        Raises BagError where the operating system fails to read the bag.
        """
        for block, channels in self._blocks(*topics):
            names = {channel: topic for topic, ids in channels.items() for channel in ids}
            columns = (block.channel, block.log_time, block.begin, block.end)
            for channel, stamp, begin, end in zip(*(c.tolist() for c in columns), strict=True):
                yield names[channel], stamp, block.data[begin:end]

    def offered_qos(self, topic: str) -> str:
        """Return what the recorded publishers of a topic offered, as rosbag2's YAML; "" if unknown.

        It is a list with an item for each publisher.
        """
        found = [
            channel.metadata.get("offered_qos_profiles", "")
            for file in self.files
            for channel in file.channels.values()
            if channel.topic == topic
        ]
        return next(filter(None, found), "")

    def metadata(self, name: str) -> dict[str, str] | None:
        """Return the last table of texts of that name in the bag, None if there is none."""
        last = deque((table for file in self.files for table in file.tables(name)), maxlen=1)
        return last[0].metadata if last else None

    def attachment(self, name: str) -> bytes | None:
        """Return the last file of that name attached to the bag, None if there is none."""
        attachments = (found for file in self.files for found in file.attachments(name))
        last = deque(attachments, maxlen=1)
        return last[0].data if last else None

    def close(self) -> None:
        """Close the files."""
        self._opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _readable_files(self, paths: Sequence[Path]) -> Iterator[McapFile]:
        """Open the files; raise BagError if none can be read, otherwise note those that cannot."""
        errors: list[BagError] = []
        for path in paths:
            try:
                yield McapFile(path)
            except BagError as error:
                errors.append(error)
        if len(errors) == len(paths):
            raise errors[0]
        self._unreadable = [str(error) for error in errors]

    @cached_property
    def _prefix(self) -> str:
        """What the names of the drive's topics begin with; BagError if there are several drives."""
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
                    f"the bag {self.path} holds {len(prefixes)} drives; name the namespace of one "
                    f"of them: {namespaces}"
                )
            if prefixes:
                return prefixes[0]
        return "/"

    def _topic(self, topic: Topic[Any]) -> str:
        """Return the name of a topic of the drive, "" if the bag has none."""
        name = self._prefix + topic.name
        return name if self.topics.get(name) == topic.type_name else ""

    def _blocks(self, *topics: str) -> Iterator[tuple[MessageBlock, dict[str, list[int]]]]:
        """Yield the messages of these topics chunk by chunk, and the channels of each topic."""
        for file in self.files:
            channels: dict[str, list[int]] = {}
            for number, channel in file.channels.items():
                if channel.topic in topics:
                    channels.setdefault(channel.topic, []).append(number)
            for block in file.blocks([number for ids in channels.values() for number in ids]):
                yield block, channels

    def _decoded(
        self,
        topic: str,
        block: MessageBlock,
        channels: dict[str, list[int]],
        decode: _Decode[ColumnsT],
    ) -> ColumnsT:
        messages = block.on(channels.get(topic, []))
        columns, refused = decode(messages.data, messages.begin, messages.end)
        if refused.number > 0:
            self._refused[topic] += refused.number
            self._reasons.setdefault(topic, refused.reason)
        return columns

    def _whole(self, topic: Topic[Any], decode: _Decode[ColumnsT]) -> ColumnsT:
        """Return all columns of a topic as one."""
        name = self._topic(topic)
        blocks = [self._decoded(name, block, ids, decode) for block, ids in self._blocks(name)]
        if not blocks:
            nothing = np.empty(0, np.int64)
            blocks = [decode(b"", nothing, nothing)[0]]
        return blocks[0].followed_by(*blocks[1:])


def _joined_blocks(blocks: Sequence[RunBlock]) -> RunBlock:
    parts: Any = zip(*blocks, strict=True)
    return RunBlock(*(first.followed_by(*others) for first, *others in parts))


def _mcap_files(path: Path) -> list[Path]:
    """Return the files of a bag in the order in which they were recorded."""
    if not os.path.exists(path):
        raise BagError(f"the bag {path} does not exist")
    files, sqlite = [path], path.suffix == ".db3"
    if path.is_dir():
        files = sorted([*path.glob("*.mcap"), *path.glob(f"*{_PACKED}")], key=_place_in_bag)
        sqlite = not files and any(path.glob("*.db3"))
    if sqlite:
        raise BagError(
            f"the bag {path} is stored as sqlite3, and only MCAP can be read; "
            "`ros2 bag convert` makes one of the other"
        )
    if not files:
        raise BagError(f"the directory {path} is not a bag: it holds no .mcap file")
    return files


def _unpacked(path: Path, opened: ExitStack) -> Path:
    """Return a file as MCAP: what rosbag2 packed as a whole is unpacked until the bag closes."""
    if not path.name.endswith(_PACKED):
        return path
    directory = opened.enter_context(tempfile.TemporaryDirectory(prefix="stickslip_ros_"))
    unpacked = Path(directory, path.name.removesuffix(".zstd"))
    try:
        unpack_file(path, unpacked)
    except OSError as error:
        raise BagError(f"the file {path} cannot be unpacked: {error.strerror}") from error
    return unpacked


def _place_in_bag(file: Path) -> tuple[int, str]:
    """Sort `bag_2.mcap` before `bag_10.mcap`, as rosbag2 numbers the files of a bag it splits."""
    number = re.search(r"_(\d+)\.mcap", file.name)
    return (int(number[1]) if number else 0), file.name
