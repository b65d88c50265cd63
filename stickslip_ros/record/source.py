"""A bag, whatever its format: its messages in blocks, and what is stored beside them."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Self

from stickslip_ros.arrays import IntArray
from stickslip_ros.record.cdr import Messages


class Block(NamedTuple):
    """Adjacent messages of a bag in the order of its file, such as those of one chunk.

    The serialized message i is `data[begin[i] : end[i]]`; arrays have the shape (messages,).
    """

    names: Sequence[str]
    """Full names of topics."""
    topic: IntArray
    """Place of the topic of each message among these names."""
    log_time: IntArray
    """Log times, ns."""
    data: bytes
    begin: IntArray
    end: IntArray

    @property
    def messages(self) -> Messages:
        """The serialized messages."""
        return Messages(self.data, self.begin, self.end)

    def of_topic(self, name: str) -> "Block":
        """Return the messages on one of these topics."""
        rows = self.topic == self.names.index(name)
        if rows.all():
            return self
        columns = self.log_time[rows], self.data, self.begin[rows], self.end[rows]
        return Block(self.names, self.topic[rows], *columns)


class Source(ABC):
    """A bag that is open for reading; a context manager that closes it.

    Each format of bags is a subclass, which a `Recording` takes. Its messages are CDR.
    """

    path: Path
    """The bag."""
    topics: Mapping[str, str]
    """Types by name, such as `sensor_msgs/msg/JointState` by `/feed_drive/joint_states`."""
    time_span: tuple[int, int] | None = None
    """Log times of the first and the last message, ns; None if the bag does not tell them."""

    @property
    def damage(self) -> list[str]:
        """Sentences on an incomplete end and damage; further reading may find more."""
        return []

    @abstractmethod
    def blocks(self, *topics: str) -> Iterator[Block]:
        """Yield the messages of these topics, given by their full names, block by block.

        Raises BagError if the operating system fails to read the bag.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the bag."""

    def metadata(self, name: str) -> dict[str, str] | None:
        """Return the last metadata table of a name, such as `stickslip_ros/analyzer`, or None."""
        return None

    def attachment(self, name: str) -> bytes | None:
        """Return the content of the last attached file of a name; None if there is none."""
        return None

    def offered_qos(self, topic: str) -> str:
        """Return the QoS profiles that the recorded publishers of a topic (full name) offered.

        They are rosbag2's YAML, a list with one profile for each publisher; empty if unknown.
        """
        return ""

    def messages(self, *topics: str) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, log time (ns) and CDR data of each message of these topics, in file order.

        Topics and errors are those of `blocks`.
        """
        for block in self.blocks(*topics):
            columns = (block.topic, block.log_time, block.begin, block.end)
            name_of = dict(enumerate(block.names))
            for topic, stamp, begin, end in zip(*(c.tolist() for c in columns), strict=True):
                yield name_of[topic], stamp, block.data[begin:end]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()
