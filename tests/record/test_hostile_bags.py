"""Malicious bags: read in bounded memory or refused in one line; nothing is written."""

import errno
import json
import os
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.opcode import Opcode
from zstandard import ZstdCompressor

from stickslip_ros.errors import BagError
from stickslip_ros.record.chunk import MESSAGE_SIZE, DamageError, MessageBlock, records_in
from stickslip_ros.record.codec import pack_joint_state
from stickslip_ros.record.compression import (
    LARGEST,
    ZSTD_MAGIC,
    unpack,
    unpack_file,
    unpack_message,
)
from stickslip_ros.record.metadata import offered_profiles
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.repair import repair
from stickslip_ros.record.report import report_of_recording

HUGE = 1 << 30
MUCH_MEMORY = 400 << 20
"""Bytes that reading may take, whatever it reads; a sound bag takes some MB."""

MAGIC = b"\x89MCAP0\r\n"
STATE = "sensor_msgs/msg/JointState"
STATES = "/feed_drive/joint_states"
TITLE = "\x1b]0;owned\x07"
"""Sets the title of the window of a terminal that this is shown on."""

READER = """
import json, os, resource, sys
from itertools import product
from pathlib import Path
from stickslip_ros.record.repair import repair
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.errors import StickslipError

def outcome_of(action, bag):
    try:
        return str(action(bag))
    except StickslipError as error:
        return str(error)
    except BaseException as error:
        return f"CRASH {type(error).__name__}: {error}"

ACTIONS = (
    lambda bag: report_of_recording(bag)["missing"],
    lambda bag: repair(bag, bag.with_suffix(".out")).missing,
)
for bag, action in product(map(Path, sys.argv[1:]), ACTIONS):
    ours, theirs = os.pipe()
    if (child := os.fork()) == 0:
        taken = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + (600 << 20),) * 2)
        os.write(theirs, outcome_of(action, bag)[:10_000].encode())
        os._exit(0)
    os.close(theirs)
    before = int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize()
    with open(ours, encoding="utf-8", errors="replace") as outcome:
        said = outcome.read()
    used = os.wait4(child, 0)[2].ru_maxrss * 1024 - before
    print(json.dumps([said, used]))
"""


def text(value: str | bytes) -> bytes:
    data = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(data)) + data


def head(opcode: int, length: int) -> bytes:
    return struct.pack("<BQ", opcode, length)


def record(opcode: int, content: bytes) -> bytes:
    return head(opcode, len(content)) + content


def schema() -> bytes:
    return record(Opcode.SCHEMA, struct.pack("<H", 1) + text(STATE) + text("ros2msg") + text("x"))


def channel(topic: str = STATES) -> bytes:
    content = struct.pack("<HH", 1, 1) + text(topic) + text("cdr") + text("")
    return record(Opcode.CHANNEL, content)


def message(data: bytes) -> bytes:
    return record(Opcode.MESSAGE, struct.pack("<HIQQ", 1, 0, 1, 1) + data)


def chunk(records: bytes) -> bytes:
    packed = ZstdCompressor().compress(records)
    sizes = struct.pack("<QQQI", 0, 1, len(records), zlib.crc32(records))
    return record(Opcode.CHUNK, sizes + text("zstd") + struct.pack("<Q", len(packed)) + packed)


def state(stamp: int) -> bytes:
    return pack_joint_state(stamp, (0.0, 0.0), (0.1, 0.4), (0.0, 0.0))


HEADER = MAGIC + record(Opcode.HEADER, text("ros2") + text("somebody"))
DATA_END = record(Opcode.DATA_END, bytes(4))
SOUND = chunk(schema() + channel() + b"".join(message(state(n)) for n in range(1, 500)))
DESCRIPTION = "rosbag2_bagfile_information: {relative_file_paths: [bag_0.mcap]}"


def footer(summary_start: int = 0) -> bytes:
    return record(Opcode.FOOTER, struct.pack("<QQI", summary_start, 0, 0)) + MAGIC


def bag_of(directory: Path, *parts: bytes | int, end: bytes = DATA_END + footer()) -> Path:
    """Write a bag of these records; a number stands for so many bytes that take no disk."""
    directory.mkdir()
    with (directory / "bag_0.mcap").open("wb") as file:
        file.write(HEADER)
        for part in parts:
            if isinstance(part, int):
                file.seek(part, 1)
            else:
                file.write(part)
        file.write(end)
    (directory / "metadata.yaml").write_text(DESCRIPTION, encoding="utf-8")
    return directory


def attachment_of_a_gigabyte(path: Path) -> Path:
    before = struct.pack("<QQ", 1, 1) + text("a") + text("b") + struct.pack("<Q", HUGE)
    length = len(before) + HUGE + 4
    return bag_of(path, SOUND, head(Opcode.ATTACHMENT, length) + before, HUGE, bytes(4))


def summary_of_a_gigabyte(path: Path) -> Path:
    start = len(HEADER + SOUND + DATA_END)
    return bag_of(path, SOUND, DATA_END, HUGE, end=footer(start))


def records_of_a_gigabyte() -> list[list[bytes | int]]:
    """Return records whose fields say that a gigabyte follows, and what is around them."""
    size, long_size = struct.pack("<I", HUGE), struct.pack("<Q", HUGE)
    times = struct.pack("<QQQI", 0, 1, 1000, 0)

    def of(opcode: int, before: bytes) -> bytes:
        return head(opcode, len(before) + HUGE) + before

    begun = of(Opcode.MESSAGE, struct.pack("<HIQQ", 1, 0, 1, 1))
    table = of(Opcode.METADATA, text("stickslip_ros/analyzer") + size)
    names = struct.pack("<H", 2) + text("a") + text("b")
    return [
        [schema(), channel(), begun, HUGE, SOUND],
        [SOUND, of(Opcode.CHUNK, times + text("zstd") + long_size), HUGE],
        [SOUND, of(Opcode.MESSAGE_INDEX, struct.pack("<H", 1) + size), HUGE],
        [of(Opcode.SCHEMA, names + size), HUGE, SOUND],
        [SOUND, table, HUGE],
        [of(0x90, b""), HUGE, SOUND],
    ]


def definitions_without_end(path: Path) -> Path:
    topics = b"".join(channel(f"/{os.urandom(500_000).hex()}") for _ in range(40))
    return bag_of(path, chunk(schema() + topics), SOUND)


def messages_packed_small(path: Path) -> Path:
    packed = message(ZstdCompressor().compress(bytes(1 << 20)))
    return bag_of(path, schema(), channel(), packed * 600)


def nothing_packed_small(path: Path) -> Path:
    """Without a checksum it might be anything; as records it would be three million of no size."""
    packed = ZstdCompressor().compress(bytes(32 << 20))
    sizes = struct.pack("<QQQI", 0, 0, 32 << 20, 0)
    bomb = record(Opcode.CHUNK, sizes + text("zstd") + struct.pack("<Q", len(packed)) + packed)
    return bag_of(path, bomb * 6, SOUND)


def profiles_without_end(path: Path) -> Path:
    profiles = text("offered_qos_profiles") + text("[" + "a," * 5_000_000 + "]")
    topic = struct.pack("<HH", 1, 1) + text(STATES) + text("cdr") + text(profiles)
    return bag_of(path, chunk(schema() + record(Opcode.CHANNEL, topic) + message(state(1))))


def described(write: Callable[[Path], object]) -> Callable[[Path], Path]:
    """Return what makes a bag whose description is written, or made, in another way."""

    def make(path: Path) -> Path:
        bag_of(path, SOUND)
        (path / "metadata.yaml").unlink()
        write(path / "metadata.yaml")
        return path

    return make


REPEATED = "a0: &a0 [xxxxxxxxxx]\n" + "".join(
    f"a{n}: &a{n} [{','.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 10)
)
REPEATED += "rosbag2_bagfile_information: {relative_file_paths: [*a9]}"


def read_by_children(bags: Sequence[Path]) -> list[tuple[str, int]]:
    """Return what report and repair of each bag said, and what memory they took.

    Each is a process of its own, a fork of one that has imported the package.
    """
    output = subprocess.run(
        [sys.executable, "-c", READER, *bags], check=True, capture_output=True, text=True
    ).stdout
    return [(said, used) for said, used in map(json.loads, output.splitlines())]


OTHERS = [
    summary_of_a_gigabyte,
    described(lambda file: (file.touch(), os.truncate(file, HUGE))),
    described(lambda file: file.symlink_to("/dev/zero")),
    described(os.mkfifo),
    described(lambda file: file.write_text(REPEATED)),
    definitions_without_end,
    messages_packed_small,
    nothing_packed_small,
    profiles_without_end,
    *(lambda path, parts=parts: bag_of(path, *parts) for parts in records_of_a_gigabyte()),
]


@pytest.mark.process
@pytest.mark.parametrize(
    "makers",
    [[attachment_of_a_gigabyte], pytest.param(OTHERS, marks=pytest.mark.long)],
    ids=["attachment", "others"],
)
def test_memory_is_bounded(tmp_path: Path, makers: Sequence[Callable[[Path], Path]]) -> None:
    bags = [make(tmp_path / f"bag{number}") for number, make in enumerate(makers)]
    outcomes = read_by_children(bags)
    assert len(outcomes) == 2 * len(bags)
    for number, (said, used) in enumerate(outcomes):
        assert not said.startswith("CRASH"), number
        assert "\n" not in said, number
        assert used < MUCH_MEMORY, number


FIRST, SIZE = len(schema() + channel()), len(message(state(1)))
STARTS = [FIRST + SIZE * number for number in range(499)]
"""Where the messages of the sound chunk start."""


@pytest.mark.parametrize(
    "starts",
    [
        STARTS[1:],
        STARTS[:-1],
        STARTS[::2],
        [*STARTS, STARTS[0]],
        [*STARTS, 2**40],
        [*STARTS, 2**63],
        [0, *STARTS],
        [start + 1 for start in STARTS],
        [],
    ],
)
def test_a_false_index_hides_nothing(tmp_path: Path, starts: list[int]) -> None:
    entries = b"".join(struct.pack("<QQ", 1, start) for start in starts)
    index = record(Opcode.MESSAGE_INDEX, struct.pack("<H", 1) + text(entries))
    with Recording(bag_of(tmp_path / "bag", SOUND, index)) as recording:
        assert recording.joint_states.stamp.tolist() == list(range(1, 500))
        assert recording.complete


def test_an_index_into_a_message_is_not_followed(tmp_path: Path) -> None:
    starts = (FIRST, FIRST + MESSAGE_SIZE + SIZE)  # of a message, and of one within the next
    content = message(state(1)) + message(message(state(2)))
    index = b"".join(struct.pack("<QQ", 1, start) for start in starts)
    indexed = record(Opcode.MESSAGE_INDEX, struct.pack("<H", 1) + text(index))
    with Recording(
        bag_of(tmp_path / "bag", chunk(schema() + channel() + content), indexed)
    ) as recording:
        assert recording.joint_states.stamp.tolist() == [1]
        assert not recording.complete


@pytest.mark.parametrize("place", [0, 2**62, 2**63, 2**64 - 1])
def test_an_index_of_tables_that_points_nowhere_is_no_fault(tmp_path: Path, place: int) -> None:
    table = struct.pack("<QQ", place, 10) + text("stickslip_ros/analyzer")
    attached = struct.pack("<QQQQQ", place, 10, 0, 0, 0) + text("a") + text("b")
    summary = record(Opcode.METADATA_INDEX, table) + record(Opcode.ATTACHMENT_INDEX, attached)
    end = DATA_END + summary + footer(len(HEADER + SOUND + DATA_END))
    bag = bag_of(tmp_path / "bag", SOUND, end=end)
    assert report_of_recording(bag)["samples"] == 499
    assert repair(bag, tmp_path / "out").messages == {STATES: 499}


def test_a_packed_file_does_not_fill_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packed, unpacked = tmp_path / "bag_0.mcap.zstd", tmp_path / "bag_0.mcap"
    packed.write_bytes(ZstdCompressor().compress(bytes(64 << 20)))

    def little_room(_: Path) -> SimpleNamespace:
        return SimpleNamespace(free=32 << 20)

    monkeypatch.setattr("shutil.disk_usage", little_room)
    with pytest.raises(OSError, match="it would") as raised:
        unpack_file(packed, unpacked)
    assert raised.value.errno == errno.ENOSPC
    assert unpacked.stat().st_size <= 16 << 20


def test_a_description_leads_nowhere_else(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", SOUND)
    for description, missing in (
        ("a: &a [x]\nrosbag2_bagfile_information: !!timestamp b", "metadata.yaml cannot be"),
        (
            "rosbag2_bagfile_information: {relative_file_paths: [/etc/passwd, ../../bag_1.mcap]}",
            "../../bag_1.mcap, /etc/passwd is listed in metadata.yaml but does not exist",
        ),
    ):
        (bag / "metadata.yaml").write_text(description, encoding="utf-8")
        report = report_of_recording(bag)
        assert report["samples"] == 499
        assert report["missing"][0].startswith(missing)


def test_what_shrinks_much_is_sound(tmp_path: Path) -> None:
    """A black picture, say, or an empty map."""
    black = chunk(message(bytes(12 << 20)))
    assert len(black) < 12_000
    bag = bag_of(tmp_path / "bag", chunk(schema() + channel("/camera/image")), black)
    repaired = repair(bag, tmp_path / "out")
    assert repaired.missing == []
    assert repaired.messages["/camera/image"] == 1


def test_an_unreadable_table_is_reported(tmp_path: Path) -> None:
    damaged = record(Opcode.METADATA, text("stickslip_ros/analyzer") + text(bytes([9, 0, 0, 0, 1])))
    report = report_of_recording(bag_of(tmp_path / "bag", SOUND, damaged))
    assert report["samples"] == 499
    (missing,) = report["missing"]
    assert missing.startswith("bag_0.mcap: bytes")


def test_repair_writes_into_its_directory_only(tmp_path: Path) -> None:
    content = struct.pack("<QQ", 1, 1) + text("../../escaped") + text("t") + struct.pack("<Q", 0)
    table = record(Opcode.METADATA, text("../escaped") + text(b""))
    attached = record(Opcode.ATTACHMENT, content + bytes(4))
    bag = bag_of(tmp_path / "bag", SOUND, attached, table)
    repair(bag, tmp_path / "out")
    assert sorted(os.listdir(tmp_path)) == ["bag", "out"]
    assert sorted(os.listdir(tmp_path / "out")) == ["metadata.yaml", "out_0.mcap"]


def test_names_cannot_steer_a_terminal(tmp_path: Path) -> None:
    odd = chunk(schema() + channel(f"/{TITLE}/joint_states") + message(b"no state"))
    bag = bag_of(tmp_path / "bag", odd)
    shown = r"/\x1b]0;owned\x07/joint_states"
    with pytest.raises(BagError) as raised:
        report_of_recording(bag)
    assert shown in str(raised.value)
    assert str(raised.value).isprintable()
    with Recording(bag) as recording:
        assert list(recording.topics) == [f"/{TITLE}/joint_states"]
        for _ in recording.blocks():
            pass
        assert all(sentence.isprintable() for sentence in recording.missing)
        assert any(shown in sentence for sentence in recording.missing)


def test_what_is_damaged_or_of_a_false_size_is_not_unpacked() -> None:
    damaged = ZSTD_MAGIC + b"\xff" * 20
    assert unpack_message(damaged) == damaged
    for compression, size in (("snappy", 3), ("", 4), ("", LARGEST + 1)):
        assert unpack(compression, b"abc", size) is None
    for data in (b"\x05", head(Opcode.MESSAGE, 1), bytes(9)):
        with pytest.raises(DamageError):
            list(records_in(data))
    with pytest.raises(DamageError):
        MessageBlock(bytes(20), np.array([0]))
    assert offered_profiles("&a [*a]") == offered_profiles("a: [") == []


@pytest.mark.parametrize(
    "profiles",
    ['["\\ud800"]', f"- {{depth: 0x{'f' * 50_000}}}", f"- {{depth: 0b{'1' * 50_000}}}",
     f"- {{depth: {'1:' * 20_000}1}}"],
    ids=["surrogate", "hexadecimal", "binary", "base 60"],
)  # fmt: skip
def test_profiles_that_yaml_cannot_write_are_left_out(profiles: str) -> None:
    assert offered_profiles(profiles) == []
