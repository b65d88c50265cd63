"""Write a bag: a directory of MCAP files and, once a file is finished, `metadata.yaml`.

Each flush passes the current chunk to the operating system, so that it survives this process.
Syncing it to the disk, so that it survives a power loss, may take a second: a background thread
does this and everything else that must not block the caller.
"""

import os
import tempfile
from collections import deque
from collections.abc import Callable, Collection, Generator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager, suppress
from math import inf
from pathlib import Path
from typing import Any, Literal, NoReturn, Self

import yaml
from mcap.records import Channel, Schema
from mcap.writer import CompressionType

from stickslip_ros.errors import BagError
from stickslip_ros.record.bag_files import BagFiles
from stickslip_ros.record.definitions import message_definition, type_hash
from stickslip_ros.record.file_writer import LAST_STAMP, Definitions, FileWriter
from stickslip_ros.record.mcap_file import McapFile
from stickslip_ros.record.metadata import BagDescription
from stickslip_ros.record.topics import HISTORY, RELIABLE, VOLATILE
from stickslip_ros.stamps import NANOSECONDS

Compression = Literal["lz4", "zstd", "none"]


def offered_qos(depth: int, reliability: str = RELIABLE, durability: str = VOLATILE) -> str:
    """Return the QoS that a publisher of ours offers, as rosbag2 stores it with a channel.

    It is YAML: a list of one profile, which a player offers again.
    """
    unlimited = {"sec": 9223372036, "nsec": 854775807}
    profile = {
        "history": HISTORY,
        "depth": depth,
        "reliability": reliability,
        "durability": durability,
        "deadline": dict(unlimited),
        "lifespan": dict(unlimited),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(unlimited),
        "avoid_ros_namespace_conventions": False,
    }
    return yaml.safe_dump([profile], sort_keys=False).strip()


def check_new_bag(path: Path) -> None:
    """Raise BagError if no bag can be created at a path; leave nothing behind."""
    if os.path.lexists(path):
        raise BagError(f"the bag {path} exists already and is not overwritten")
    parent = next(parent for parent in _absolute(path).parents if os.path.lexists(parent))
    if not parent.is_dir():
        raise BagError(f"the bag {path} cannot be created: {parent} is not a directory")
    try:
        with tempfile.TemporaryFile(dir=parent) as file:  # permissions alone are not enough
            file.write(bytes(4096))
    except OSError as error:
        raise BagError(
            f"the bag {path} cannot be created: {parent} cannot be written to ({error.strerror})"
        ) from None


class Recorder:
    """Write a bag message by message; a context manager that closes it.

    Not thread-safe: use it in one thread at a time.
    """

    def __init__(
        self,
        directory: Path,
        compression: Compression = "lz4",
        *,
        max_bag_size: int = 0,
        max_bag_duration: float = 0.0,
    ) -> None:
        """Create the bag directory, with missing parents, and open `<its name>_0.mcap` in it.

        `compression` applies to the chunks. A new file is started when the current one has reached
        `max_bag_size` bytes, or before its messages span more than `max_bag_duration` seconds by
        their stamps (0: no limit). Raises BagError if the directory exists or cannot be created;
        then nothing is left behind.
        """
        check_new_bag(directory)
        self.directory = _absolute(directory)
        self._compression = CompressionType[compression.upper()]
        self._max_size = max_bag_size
        self._max_duration = round(max_bag_duration * NANOSECONDS)
        self._description = BagDescription()
        self._definitions = Definitions()
        self._files = 0
        missing = [parent for parent in self.directory.parents if not os.path.lexists(parent)]
        made = [*reversed(missing), self.directory]
        try:
            with ExitStack() as undo:
                for new in made:
                    new.mkdir()
                    undo.callback(new.rmdir)
                self._open_file()
                undo.pop_all()
        except (OSError, ValueError) as error:
            raise BagError(f"the bag {directory} cannot be created: {error}") from error
        self._closed = False
        self._background = ThreadPoolExecutor(1, f"recorder of {self.directory.name}")
        self._tasks: deque[Future[None]] = deque()
        self._sync: Future[None] | None = None
        self._in_background(_sync_directories, [*(new.parent for new in made), self.directory])

    def add_topic(self, name: str, type_name: str, depth: int, **policies: str) -> int:
        """Add a topic, such as `/feed_drive/joint_states`, and return its channel for `write`.

        An example of a type is `sensor_msgs/msg/JointState`; `depth` is that of the history that
        its publisher offers, `policies` are as in `offered_qos`. Raises BagError if the topic is
        already in the bag, its type is not installed, or the bag is closed or fails.
        """
        if name in self._definitions.topics:
            raise BagError(f"the topic {name} is already in the bag {self.directory}")
        definition = message_definition(type_name).encode()
        metadata = {
            "offered_qos_profiles": offered_qos(depth, **policies),
            "topic_type_hash": type_hash(type_name),
        }
        return self.add_channel(
            Channel(0, name, "cdr", metadata, 0), Schema(0, definition, "ros2msg", type_name)
        )

    def add_channel(self, channel: Channel, schema: Schema) -> int:
        """Add a channel of another file, and return its number in this bag for `write`.

        The ids in `channel` and `schema` are ignored. Raises BagError if the bag is closed or
        fails.
        """
        with self._writing():
            self._definitions.add(channel, schema, self._file)
        return len(self._definitions.topics)

    def write(
        self,
        channel: int,
        data: bytes,
        stamp: int,
        publish_time: int | None = None,
        sequence: int = 0,
    ) -> None:
        """Append a serialized message; its log time is the stamp, in ns.

        The publish time defaults to the stamp. Raises BagError for a time that is negative or
        needs more than 63 bits, and if the bag is closed or fails.
        """
        if publish_time is None:
            publish_time = stamp
        elif not 0 <= publish_time <= LAST_STAMP:
            self._refuse_stamp(publish_time)
        if not self._file.earliest <= stamp <= self._file.latest:
            self._make_room(stamp)
        try:
            self._add_message(channel, stamp, data, publish_time, sequence)
        except OSError as error:
            self._fail(error)

    def flush(self) -> None:
        """Pass all written data to the operating system, so that it survives this process.

        The data are synced to the disk soon after, or soon after the next flush if the flushes
        follow each other closely. Raises BagError if the bag is closed or fails; an error of the
        disk is raised at the next flush.
        """
        with self._writing():
            must_sync = self._file.flush(self._definitions.records)
            # A sync that has not started yet includes this flush.
            if must_sync and (self._sync is None or self._sync.running() or self._sync.done()):
                self._sync = self._in_background(self._file.stream.sync)

    def attach(
        self, name: str, data: bytes, media_type: str, log_time: int = 0, create_time: int = 0
    ) -> None:
        """Attach a file of a media type such as `text/yaml` to the bag; times are in ns.

        Raises BagError if the bag is closed or fails.
        """
        with self._writing():
            self._file.writer.add_attachment(create_time, log_time, name, media_type, data)

    def add_metadata(self, name: str, data: Mapping[str, str]) -> None:
        """Add a metadata table to the bag: to the current file and the following ones.

        Raises BagError if the bag is closed or fails.
        """
        with self._writing():
            self._definitions.tables[name] = dict(data)
            self._file.writer.add_metadata(name, self._definitions.tables[name])

    def close(self) -> None:
        """Finish the bag and sync it to the disk; do nothing if it is already closed.

        Raises BagError if the bag fails.
        """
        if self._closed:
            return
        with self._writing():
            self._in_background(self._finish, self._file)
            self._wait_for_tasks(at_most=0)
        self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _open_file(self) -> None:
        path = self.directory / f"{self.directory.name}_{self._files}.mcap"
        self._file = FileWriter(path, self._compression, self._definitions)
        self._add_message = self._file.writer.add_message
        self._files += 1

    def _make_room(self, stamp: int) -> None:
        """Start another file if a message with this stamp does not belong in the current one."""
        if not 0 <= stamp <= LAST_STAMP:
            self._refuse_stamp(stamp)
        if stamp > self._file.latest:
            with self._writing():
                self._wait_for_tasks(at_most=3)  # in case the disk is slower than the caller
                finished = self._file
                finished.writer.flush()
                finished.stream.limit = inf
                self._open_file()
                self._in_background(self._finish, finished)
                self._sync = None
        self._file.admit(stamp, self._max_size, self._max_duration)

    def _finish(self, file: FileWriter) -> None:
        """Complete a file and describe it; the following file, if any, already exists."""
        file.finish()
        with closing(McapFile(file.stream.path)) as finished:
            self._description.add(finished)
        self._description.write(self.directory)
        _sync_directories([self.directory])

    def _in_background(self, task: Callable[..., None], *arguments: Any) -> Future[None]:
        self._tasks.append(self._background.submit(task, *arguments))
        return self._tasks[-1]

    def _wait_for_tasks(self, at_most: int) -> None:
        """Wait until at most `at_most` tasks are pending; raise the error of a finished one."""
        while self._tasks and (len(self._tasks) > at_most or self._tasks[0].done()):
            self._tasks.popleft().result()

    @contextmanager
    def _writing(self) -> Generator[None]:
        if self._closed:
            self._refuse()
        try:
            self._wait_for_tasks(at_most=len(self._tasks))
            yield
        except (OSError, BagError) as error:
            self._fail(error)

    def _fail(self, error: Exception) -> NoReturn:
        """Close the file as it is: nothing can be appended after half a record."""
        self._end()
        self._file.stream.cut()
        left = "it holds no message"  # the disk may have had no room for the first ones
        with suppress(BagError), BagFiles(self.directory) as bag:
            if next(bag.messages(*self._definitions.topics), None) is not None:
                left = "what was written so far can be read"
        raise BagError(
            f"the bag {self.directory} can no longer be written ({error}); {left}"
        ) from error

    def _end(self) -> None:
        self._closed = True
        self._add_message = self._refuse
        self._background.shutdown()

    def _refuse_stamp(self, stamp: int) -> NoReturn:
        """Refuse a stamp before the library fails on it and leaves half a record behind."""
        raise BagError(
            f"a message with the stamp {stamp} ns cannot be written to the bag {self.directory}; "
            "stamps must be from 0 to 2^63 - 1 ns"
        )

    def _refuse(self, *_: object) -> NoReturn:
        raise BagError(f"the bag {self.directory} is closed")


def _sync_directories(directories: Collection[Path]) -> None:
    """Sync directories to the disk, if the file system and the permissions allow it."""
    for directory in directories:
        with suppress(OSError):
            descriptor = os.open(directory, os.O_RDONLY)
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)


def _absolute(path: Path) -> Path:
    """Return the path without `.` and `..`, so that its last part is a name."""
    try:
        return Path(os.path.abspath(path))
    except FileNotFoundError:
        raise BagError(
            f"the bag {path} cannot be created: the current directory has been deleted"
        ) from None
