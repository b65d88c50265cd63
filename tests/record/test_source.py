"""A bag of any format is what yields its messages in blocks."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from typing_extensions import override

from stickslip_ros.record.cdr import joined
from stickslip_ros.record.codec import pack_wrench
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.source import Block, Source
from tests.record.runs import FORCES, STATES, state


class Listed(Source):
    """Messages in memory, with the stamps at which they were recorded."""

    def __init__(self, messages: Sequence[tuple[str, int, bytes]]) -> None:
        self.path = Path("memory")
        self.topics = {
            STATES: "sensor_msgs/msg/JointState",
            FORCES: "geometry_msgs/msg/WrenchStamped",
        }
        self._messages = messages

    @override
    def blocks(self, *topics: str) -> Iterator[Block]:
        chosen = [message for message in self._messages if message[0] in topics]
        places = np.array([topics.index(topic) for topic, _, _ in chosen])
        stamps = np.array([stamp for _, stamp, _ in chosen])
        yield Block(topics, places, stamps, *joined([data for _, _, data in chosen]))

    @override
    def close(self) -> None:
        pass


def test_a_bag_of_another_format_is_read_by_its_blocks() -> None:
    messages = [(STATES, n, state(n)) for n in range(5)] + [(FORCES, 3, pack_wrench(3, -2.0))]
    bag = Listed([*messages, (FORCES, 4, b"rubbish")])
    reading = Recording(bag)
    assert reading.joint_states.stamp.tolist() == [0, 1, 2, 3, 4]
    assert reading.control_forces.force.tolist() == [-2.0]
    (sentence,) = reading.missing
    assert sentence.startswith(f"1 messages on {FORCES} could not be read")
    assert [*bag.messages(STATES, FORCES)][:-1] == messages
