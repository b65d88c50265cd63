"""Writing a bag: a directory with one MCAP file and, once closed, `metadata.yaml`."""

import os
import tempfile
from collections.abc import Generator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Literal, NoReturn, Self

import yaml
from mcap.writer import CompressionType, Writer

from stickslip_ros.bags.definitions import message_definition, type_hash
from stickslip_ros.bags.mcap_file import McapFile
from stickslip_ros.bags.metadata import closing_information, opening_information, write_metadata
from stickslip_ros.errors import BagError

Compression = Literal["lz4", "zstd", "none"]

_COMPRESSION_TYPES: dict[Compression, CompressionType] = {
    "lz4": CompressionType.LZ4,
    "zstd": CompressionType.ZSTD,
    "none": CompressionType.NONE,
}
_STAMP_LIMIT = 2**63


@dataclass(frozen=True)
class QosProfile:
    """What the publisher of a recorded topic offers, and offers again when it is played back."""

    depth: int
    history: Literal["keep_last", "keep_all"] = "keep_last"
    reliability: Literal["reliable", "best_effort"] = "reliable"
    durability: Literal["volatile", "transient_local"] = "volatile"

    def to_yaml(self) -> str:
        """Return the profile as rosbag2 keeps it with a channel: a YAML list of one profile."""
        unlimited = {"sec": 9223372036, "nsec": 854775807}
        profile = {
            "history": self.history,
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
            "deadline": dict(unlimited),
            "lifespan": dict(unlimited),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(unlimited),
            "avoid_ros_namespace_conventions": False,
        }
        return yaml.safe_dump([profile], sort_keys=False).strip()


def check_new_bag(path: Path) -> None:
    """Raise BagError for a path at which no bag can be created; leaves nothing behind."""
    if os.path.lexists(path):
        raise BagError(f"the bag {path} exists already, and nothing is ever overwritten")
    parent = next(parent for parent in _absolute(path).parents if os.path.lexists(parent))
    if not parent.is_dir():
        raise BagError(f"the bag {path} cannot be created: {parent} is not a directory")
    try:
        os.rmdir(tempfile.mkdtemp(dir=parent))  # what permissions alone do not tell
    except OSError as error:
        raise BagError(
            f"the bag {path} cannot be created: {parent} cannot be written to ({error.strerror})"
        ) from None


class Recorder:
    """Writes a bag, message by message as they arrive; a context manager that closes it.

    To be used by one thread at a time.
    """

    def __init__(
        self,
        directory: Path,
        compression: Compression = "lz4",
        custom_data: Mapping[str, str] | None = None,
    ) -> None:
        """Create the bag directory, with parents if need be, and open `<its name>_0.mcap` in it.

        `compression` is that of the file's chunks; `custom_data` goes into `metadata.yaml`. Raises
        BagError if the directory exists or cannot be created, and then leaves nothing behind.
        """
        check_new_bag(directory)
        self.directory = _absolute(directory)
        self._custom_data = dict(custom_data or {})
        self._path = self.directory / f"{self.directory.name}_0.mcap"
        self._schema_ids: dict[str, int] = {}
        self._topics: set[str] = set()
        information = opening_information(self._path.name, self._custom_data)
        missing = [parent for parent in self.directory.parents if not os.path.lexists(parent)]
        try:
            with ExitStack() as undo:
                for new in (*reversed(missing), self.directory):
                    new.mkdir()
                    undo.callback(new.rmdir)
                self._stream = self._path.open("xb")
                undo.callback(self._path.unlink)
                undo.callback(self._stream.close)
                self._writer = Writer(self._stream, compression=_COMPRESSION_TYPES[compression])
                self._writer.start(profile="ros2")
                self._writer.add_metadata(
                    "rosbag2", {"serialized_metadata": yaml.safe_dump(information, sort_keys=False)}
                )
                self._writer.flush()
                undo.pop_all()
        except (OSError, ValueError) as error:
            raise BagError(f"the bag {directory} cannot be created: {error}") from error
        self._add_message = self._writer.add_message

    def add_topic(self, name: str, type_name: str, qos: QosProfile) -> int:
        """Add a topic, such as `/feed_drive/joint_states`, and return its channel for `write`.

        The type is one such as `sensor_msgs/msg/JointState`. Raises BagError if the topic is in the
        bag already, its type is not installed, or the bag is closed or fails.
        """
        if name in self._topics:
            raise BagError(f"the topic {name} is in the bag {self.directory} already")
        definition = message_definition(type_name).encode()
        metadata = {"offered_qos_profiles": qos.to_yaml(), "topic_type_hash": type_hash(type_name)}
        with self._writing():
            if type_name not in self._schema_ids:
                self._schema_ids[type_name] = self._writer.register_schema(
                    type_name, "ros2msg", definition
                )
            self._topics.add(name)
            return self._writer.register_channel(name, "cdr", self._schema_ids[type_name], metadata)

    def write(self, channel: int, data: bytes, stamp: int) -> None:
        """Append a serialized message; the stamp in ns becomes its log and publish time.

        Raises BagError for a stamp that is negative or beyond 63 bits, and if the bag is closed or
        fails.
        """
        # The library would leave half a record behind if it came upon such a stamp.
        if not 0 <= stamp < _STAMP_LIMIT:
            raise BagError(
                f"a message of the stamp {stamp} ns cannot be written to the bag {self.directory}; "
                "stamps are from 0 to 2^63 - 1 ns"
            )
        try:
            self._add_message(channel, stamp, data, stamp)
        except OSError as error:
            self._fail(error)

    def flush(self) -> None:
        """Hand all that was written to the operating system, so that it outlives this process.

        Raises BagError if the bag is closed or fails.
        """
        with self._writing():
            self._writer.flush()

    def attach(self, name: str, data: bytes, media_type: str) -> None:
        """Put a whole file of a media type such as `text/yaml` into the bag.

        Raises BagError if the bag is closed or fails.
        """
        with self._writing():
            self._writer.add_attachment(0, 0, name, media_type, data)

    def add_metadata(self, name: str, data: Mapping[str, str]) -> None:
        """Put a table of texts into the bag.

        Raises BagError if the bag is closed or fails.
        """
        with self._writing():
            self._writer.add_metadata(name, dict(data))

    def close(self) -> None:
        """Finish the file and write `metadata.yaml`; does nothing when done already.

        Raises BagError if the bag fails.
        """
        if self._stream.closed:
            return
        with self._writing():
            self._add_message = self._refuse
            self._writer.finish()
            self._stream.close()
            with closing(McapFile(self._path)) as file:
                information = closing_information(file, self._custom_data)
            write_metadata(self.directory, information)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        exception_type: type[BaseException] | None,
        exception: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    @contextmanager
    def _writing(self) -> Generator[None]:
        if self._stream.closed:
            self._refuse()
        try:
            yield
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> NoReturn:
        """Close the file as it is: after half a record nothing more can be appended."""
        self._add_message = self._refuse
        with suppress(OSError):
            self._stream.close()
        raise BagError(
            f"the bag {self.directory} cannot be written any more ({error}); "
            "what it holds so far can be read"
        ) from error

    def _refuse(self, *_: object) -> NoReturn:
        raise BagError(f"the bag {self.directory} is closed")


def _absolute(path: Path) -> Path:
    """Return the path without `.` and `..`, so that its last part is a name."""
    return Path(os.path.abspath(path))
