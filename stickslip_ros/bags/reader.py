"""Reading a bag: a directory of MCAP files as rosbag2 lays it out, or one such file."""

import os
import re
from collections.abc import Iterator
from contextlib import ExitStack, closing
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from stickslip_ros.bags.mcap_file import McapFile
from stickslip_ros.bags.metadata import METADATA_FILE
from stickslip_ros.errors import BagError


class TopicBlock(NamedTuple):
    """Successive messages of one topic."""

    stamps: list[int]
    """Log times in ns."""
    messages: list[bytes]
    """The serialized messages."""


class Recording:
    """A bag that is open for reading; a context manager that closes it."""

    def __init__(self, path: Path) -> None:
        """Open a bag directory or one MCAP file, also such as a killed recorder leaves behind.

        Raises BagError if there is no bag, or one that is not stored as MCAP.
        """
        self.path = path
        with ExitStack() as files:
            self._files = [
                files.enter_context(closing(McapFile(file))) for file in _mcap_files(path)
            ]
            self._opened = files.pop_all()
        self.topics = {
            channel.topic: file.schemas[channel.schema_id].name
            for file in self._files
            for channel in file.channels.values()
            if channel.schema_id in file.schemas
        }
        """Name and type of each, as `/feed_drive/joint_states` and `sensor_msgs/msg/JointState`."""

    @property
    def complete(self) -> bool:
        """Whether the bag was closed properly, and nothing read of it so far was damaged."""
        described = not self.path.is_dir() or (self.path / METADATA_FILE).is_file()
        return described and all(file.complete for file in self._files)

    def topic_of_type(self, type_name: str, suffix: str) -> str:
        """Return the name of the one topic of that type whose name ends with that suffix.

        The suffix is a topic's last part or parts, as `joint_states`, or all its name. Raises
        BagError if there is no such topic, or several.
        """
        found = [
            topic
            for topic, topic_type in self.topics.items()
            if topic_type == type_name and f"/{topic}".endswith(f"/{suffix}")
        ]
        if len(found) == 1:
            return found[0]
        topics = ", ".join(f"{name} ({kind})" for name, kind in sorted(self.topics.items()))
        raise BagError(
            f"the bag {self.path} has {len(found) or 'no'} topics '{suffix}' of the type "
            f"{type_name}, one is needed; its topics are: {topics or 'none'}"
        )

    def messages(self, *topics: str) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, log time in ns and serialized message of these topics, as recorded in turn.

        Raises BagError where the operating system fails to read the bag.
        """
        for file in self._files:
            wanted = {
                channel_id: channel.topic
                for channel_id, channel in file.channels.items()
                if channel.topic in topics
            }
            for channel_id, stamp, data in file.messages(wanted):
                yield wanted[channel_id], stamp, data

    def blocks(self, *topics: str, size: int = 10_000) -> Iterator[dict[str, TopicBlock]]:
        """Yield the messages of these topics in blocks of `size` messages of all topics together.

        Each block has an entry for every topic, which may be empty. Raises BagError where the
        operating system fails to read the bag.
        """
        messages = self.messages(*topics)
        while batch := list(islice(messages, size)):
            block = {topic: TopicBlock([], []) for topic in topics}
            for topic, stamp, data in batch:
                stamps, datas = block[topic]
                stamps.append(stamp)
                datas.append(data)
            yield block

    def metadata(self, name: str) -> dict[str, str] | None:
        """Return the last table of texts of that name in the bag, None if there is none."""
        found = [file.metadata(name) for file in self._files]
        return next((table for table in reversed(found) if table is not None), None)

    def attachment(self, name: str) -> bytes | None:
        """Return the last file of that name attached to the bag, None if there is none."""
        found = [file.attachment(name) for file in self._files]
        return next((data for data in reversed(found) if data is not None), None)

    def close(self) -> None:
        """Close the files."""
        self._opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        exception_type: type[BaseException] | None,
        exception: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def _mcap_files(path: Path) -> list[Path]:
    """Return the files of a bag in the order in which they were recorded."""
    if not os.path.exists(path):
        raise BagError(f"the bag {path} does not exist")
    if not path.is_dir():
        if path.suffix == ".db3":
            raise _not_mcap(path)
        return [path]
    files = sorted(path.glob("*.mcap"), key=_place_in_bag)
    if not files:
        if next(path.glob("*.db3"), None):
            raise _not_mcap(path)
        raise BagError(f"the directory {path} is not a bag: it holds no .mcap file")
    return files


def _place_in_bag(file: Path) -> tuple[int, str]:
    """Sort `bag_2.mcap` before `bag_10.mcap`, as rosbag2 numbers the files of a bag it splits."""
    number = re.search(r"_(\d+)$", file.stem)
    return (int(number[1]) if number else 0), file.name


def _not_mcap(path: Path) -> BagError:
    return BagError(
        f"the bag {path} is stored as sqlite3, and only MCAP can be read; "
        "`ros2 bag convert` makes one of the other"
    )
