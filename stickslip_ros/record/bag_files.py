"""The files of a bag: a directory of MCAP files in rosbag2's layout, or one such file.

A bag of another format becomes one of these.
"""

import os
import re
import tempfile
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from itertools import chain
from os.path import abspath
from pathlib import Path
from typing import Self

from stickslip_ros.arrays import IntArray
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.record.bag_formats import mcap_of
from stickslip_ros.record.chunk import MessageBlock
from stickslip_ros.record.compression import unpack_file
from stickslip_ros.record.mcap_file import McapFile
from stickslip_ros.record.metadata import metadata_faults
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import printable

_PACKED_SUFFIX = ".mcap.zstd"
"""Suffix of the files that rosbag2 compressed as a whole."""


class BagFiles:
    """A bag that is open for reading; a context manager that closes it.

    Raises BagError if `path` is not a bag.
    """

    def __init__(self, path: Path | str, *continued: Path) -> None:
        """Open the files of a bag directory, or one MCAP file, and of bags that continue it."""
        self.path = Path(path)
        """The bag."""
        self._unreadable: list[str] = []
        with ExitStack() as opened:
            places = [mcap_of(bag, opened) for bag in (self.path, *continued)]
            by_place = {place: _mcap_files(place) for place in places}
            paths = [path for paths in by_place.values() for path in paths]
            files = self._readable_files([_unpacked(path, opened) for path in paths])
            self.files = [opened.enter_context(closing(file)) for file in files]
            """The MCAP files in order, without those that cannot be read."""
            self._opened = opened.pop_all()
        self._metadata_faults = [
            fault
            for place, paths in by_place.items()
            if place.is_dir()
            for fault in metadata_faults(place, paths)
        ]
        self.topics = {
            channel.topic: file.schemas[channel.schema_id].name
            for file in self.files
            for channel in file.channels.values()
            if channel.schema_id in file.schemas
        }
        """Types by name, such as `sensor_msgs/msg/JointState` by `/feed_drive/joint_states`."""
        self.time_span: tuple[int, int] | None = None
        """Log times of the first and the last message, ns; None if the bag does not tell them."""
        accounts = [file.statistics for file in self.files]
        known = [account for account in accounts if account is not None and account.message_count]
        if known and None not in accounts:
            start = min(account.message_start_time for account in known)
            self.time_span = start, max(account.message_end_time for account in known)

    @property
    def damage(self) -> list[str]:
        """Sentences on an incomplete end and damage; further reading may find more."""
        in_files = (sentence for file in self.files for sentence in file.damage)
        return [*map(printable, (*self._metadata_faults, *self._unreadable, *in_files))]

    def message_blocks(self, *topics: str) -> Iterator[dict[str, MessageBlock]]:
        """Yield the messages of these topics, by their full names, block by block.

        A block, such as a chunk, is in the order of its file. Raises BagError if the operating
        system fails to read the bag.
        """
        for file in self.files:
            channels = {topic: list[int]() for topic in topics}
            for number, channel in file.channels.items():
                channels.get(channel.topic, []).append(number)
            for block in file.blocks([*chain(*channels.values())]):
                yield {topic: block.on_channels(numbers) for topic, numbers in channels.items()}

    def messages(self, *topics: str) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, log time (ns) and CDR data of each message of these topics, in file order.

        Topics and errors are those of `message_blocks`.
        """
        for file in self.files:
            names = {n: channel.topic for n, channel in file.channels.items()}
            for block in file.blocks([n for n, topic in names.items() if topic in topics]):
                columns = (block.channel, block.log_time, block.begin, block.end)
                for number, stamp, begin, end in zip(*(c.tolist() for c in columns), strict=True):
                    yield names[number], stamp, block.data[begin:end]

    def offered_qos(self, topic: str) -> str:
        """Return the QoS profiles that the recorded publishers of a topic (full name) offered.

        They are rosbag2's YAML, a list with one profile for each publisher; empty if unknown.
        """
        profiles = (
            channel.metadata.get("offered_qos_profiles", "")
            for file in self.files
            for channel in file.channels.values()
            if channel.topic == topic
        )
        return next(filter(None, profiles), "")

    def metadata(self, name: str) -> dict[str, str] | None:
        """Return the last metadata table of a name, such as `stickslip_ros/analyzer`, or None."""
        last = deque((table for file in self.files for table in file.tables(name)), maxlen=1)
        return last[0].metadata if last else None

    def attachment(self, name: str) -> bytes | None:
        """Return the content of the last attached file of a name; None if there is none."""
        attachments = (content for file in self.files for content in file.attachments(name))
        last = deque(attachments, maxlen=1)
        return last[0].data if last else None

    def close(self) -> None:
        """Close the bag."""
        self._opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _readable_files(self, paths: Sequence[Path]) -> Iterator[McapFile]:
        """Open the files; raise BagError if none can be read, otherwise list those that cannot."""
        errors: list[BagError] = []
        for path in paths:
            try:
                yield McapFile(path)
            except BagError as error:
                errors.append(error)
        if len(errors) == len(paths):
            raise errors[0]
        self._unreadable = [str(error) for error in errors]


def runs_of(bags: Iterable[Path]) -> dict[Path, dict[Path, float]]:
    """Return the bags that begin a run, each with those that continue it and the gaps before, s.

    NAME_2 continues NAME if an analyzer that was restarted has written it, with `bag_exists: next`,
    its messages are later, and the parameters of the plant, where both have them, are the same.
    Raises InvalidInputError for a bag that is given twice.
    """
    runs: dict[Path, dict[Path, float]] = {}
    for bag in bags:
        if abspath(bag) in {abspath(other) for one in runs for other in (one, *runs[one])}:
            raise InvalidInputError(f"{bag} is given twice")
        for first, continued in runs.items():
            if re.fullmatch(re.escape(str(first)) + r"_\d+", str(bag)) and bag.is_dir():
                gap = _gap([first, *continued][-1], bag)
                if gap is not None:
                    continued[bag] = gap
                    break
        else:
            runs[bag] = {}
    return runs


def _gap(before: Path, after: Path) -> float | None:
    """Return the time (s) from the end of a bag to the bag that continues it, None if none does."""
    with BagFiles(before) as one, BagFiles(after) as other:
        plants, analyzers = (
            [bag.metadata(f"stickslip_ros/{node}") for bag in (one, other)]
            for node in ("plant", "analyzer")
        )
        restarted = (analyzers[0] or {}).get("bag_exists") == '"next"'
        if not restarted or analyzers[0] != analyzers[1]:
            return None
        ends = [times.max() for block in one.message_blocks(*one.topics) for times in _times(block)]
        first = next(other.message_blocks(*other.topics), {})
        begin = min((times.min() for times in _times(first)), default=0)
        gap = int(begin - max(ends, default=begin)) / NANOSECONDS
        return gap if gap > 0.0 and (plants[0] == plants[1] or None in plants) else None


def _times(block: Mapping[str, MessageBlock]) -> Iterator[IntArray]:
    return (messages.log_time for messages in block.values() if len(messages))


def _mcap_files(path: Path) -> list[Path]:
    """Return the files of a bag in the order in which they were recorded."""
    if not os.path.exists(path):
        raise BagError(f"the bag {path} does not exist")
    files = [path]
    if path.is_dir():
        files = sorted([*path.glob("*.mcap"), *path.glob(f"*{_PACKED_SUFFIX}")], key=_place_in_bag)
    if not files:
        raise BagError(f"the directory {path} is not a bag: it holds no .mcap file")
    return files


def _unpacked(path: Path, opened: ExitStack) -> Path:
    """Return a file as MCAP; unpack one that rosbag2 compressed as a whole until the bag closes."""
    if not path.name.endswith(_PACKED_SUFFIX):
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
