"""A recorder that is killed at any moment leaves all flushed data intact."""

import random
import subprocess
import sys
from pathlib import Path
from threading import Timer

import pytest

from stickslip_ros.record.reader import Recording
from stickslip_ros.record.recorder import Compression, Recorder

pytestmark = pytest.mark.process

TOPICS = ("/a", "/b")
COMPRESSIONS: tuple[Compression, ...] = ("lz4", "zstd", "none")
LONGEST_LIFE = 0.3


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 8))]
)
def test_nothing_is_lost_that_was_flushed_before(tmp_path: Path, seed: int) -> None:
    safe, begun = kill_a_recorder(tmp_path / "bag", seed)
    with Recording(tmp_path / "bag") as recording:
        recorded = list(recording.messages(*TOPICS))
        assert not recording.complete
    assert recorded == [message(number) for number in range(len(recorded))]
    assert safe <= len(recorded) <= begun


def message(number: int) -> tuple[str, int, bytes]:
    """Return topic, stamp and bytes of the message that is recorded as that number."""
    return TOPICS[number % 2], number, random.Random(number).randbytes(number % 200)


def kill_a_recorder(bag: Path, seed: int) -> tuple[int, int]:
    """Return how many messages the recorder said were safe, and begun, before it was killed."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.record.test_killed_recorder", bag, str(seed)],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        told = [process.stdout.readline()]
        kill = Timer(random.Random(seed).uniform(0.0, LONGEST_LIFE), process.kill)
        kill.start()
        told += process.stdout
        kill.join()
    numbers = {what: int(number) for what, number in map(str.split, ["safe 0", *told])}
    return numbers["safe"], numbers["begun"]


def record_without_end(bag: Path, seed: int) -> None:
    """Record, and tell what is about to be written and what is flushed."""
    chance = random.Random(seed)
    compression, size = chance.choice(COMPRESSIONS), chance.choice([0, 20_000, 200_000])
    recorder = Recorder(bag, compression, max_bag_size=size)
    channels = {topic: recorder.add_topic(topic, "std_msgs/msg/Float64", 1) for topic in TOPICS}
    number = 0
    while True:
        end = number + chance.randrange(1, 300)
        tell(f"begun {end}")
        while number < end:
            topic, stamp, data = message(number)
            recorder.write(channels[topic], data, stamp)
            number += 1
        recorder.flush()
        tell(f"safe {end}")


def tell(what: str) -> None:
    """Print all of it or, if this process is killed now, nothing."""
    sys.stdout.write(f"{what}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    record_without_end(Path(sys.argv[1]), int(sys.argv[2]))
