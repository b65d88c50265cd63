"""Bags with bytes cut, flipped or inserted, and what a repair makes of them.

No traceback, no wrong data, no sound chunk lost.
"""

import random
import resource
import struct
from functools import cached_property
from itertools import pairwise
from operator import add

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from stickslip_ros.errors import BagError, StickslipError
from stickslip_ros.record.codec import pack_joint_state, pack_wrench
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.recorder import Recorder
from stickslip_ros.record.repair import repair
from stickslip_ros.record.report import report_of_recording
from tests.examples import examples
from tests.record.runs import FORCES, STAMPS, STATES, foreign_file, record, state

STATE_TYPE = "sensor_msgs/msg/JointState"
CHUNKS = 10
PAIRS = 40
"""Of a joint state and a force, in each chunk."""
MUCH_MEMORY = 100_000_000


def message(number):
    """Return the joint state or force of that number, of which no two are alike."""
    noise = random.Random(number).random()
    if number % 2:
        return pack_wrench(number, noise)
    return pack_joint_state(number, (noise, 0.0), (0.1, 0.4), (noise, -noise))


MESSAGES = [message(number) for number in range(2 * CHUNKS * PAIRS)]


class SoundFile:
    """A bag's file of ten chunks, and where its records are."""

    def __init__(self, content):
        self.content = content

    @cached_property
    def starts(self):
        """Where the records start; the end of the last is included."""
        starts = [8]
        while starts[-1] < len(self.content) - 8:
            length = int.from_bytes(self.content[starts[-1] + 1 :][:8], "little")
            starts.append(starts[-1] + 9 + length)
        return starts

    @cached_property
    def chunks(self):
        """The chunk records."""
        records = [self.content[a:b] for a, b in pairwise(self.starts)]
        return [record for record in records if record[0] == Opcode.CHUNK]

    @cached_property
    def definitions(self):
        """Stretches that tell of the topics: a chunk and the definitions that follow it."""
        stretches, chunk = [self.chunks[0]], None
        for start, end in pairwise(self.starts):
            if self.content[start] == Opcode.CHUNK:
                chunk = start
            elif self.content[start] == Opcode.CHANNEL and chunk is not None:
                stretches.append(self.content[chunk:end])
            elif self.content[start] == Opcode.DATA_END:
                return stretches
        raise AssertionError("there is no end of data")

    @property
    def summary(self):
        """From the end of data on."""
        return self.content[int.from_bytes(self.content[-28:-20], "little") :]


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    directory = tmp_path_factory.mktemp("sound") / "bag"
    with Recorder(directory) as recorder:
        kinds = {STATES: STATE_TYPE, FORCES: "geometry_msgs/msg/WrenchStamped"}
        channels = [recorder.add_topic(topic, kind, 10) for topic, kind in kinds.items()]
        for number, data in enumerate(MESSAGES):
            recorder.write(channels[number % 2], data, number)
            if number % (2 * PAIRS) == 2 * PAIRS - 1:
                recorder.flush()
                recorder.add_metadata(f"table {number}", {"number": str(number)})
        recorder.attach("note", b"of nothing", "text/plain")
    file = SoundFile((directory / "bag_0.mcap").read_bytes())
    assert len(file.chunks) == CHUNKS
    return file


@pytest.fixture(scope="module")
def scratch(tmp_path_factory):
    return tmp_path_factory.mktemp("scratch") / "bag_0.mcap"


@st.composite
def edits(draw, file):
    """Cut, flip, insert and falsify lengths, here and there, at the start of records above all."""
    size = len(file.content)
    places = st.integers(0, size) | st.builds(add, st.sampled_from(file.starts), st.integers(0, 60))
    lengths = st.sampled_from([2**60, 2**63, 2**64 - 1, 2**40, 2**32 - 1, 2**31, 0])
    return draw(
        st.lists(
            st.one_of(
                st.tuples(st.just("flip"), places, st.integers(1, 255)),
                st.tuples(st.just("remove"), places, st.integers(1, 40)),
                st.tuples(st.just("remove"), places, st.integers(1, size // 2)),
                st.tuples(st.just("insert"), places, st.binary(min_size=1, max_size=40)),
                st.tuples(st.just("length"), places, lengths),
                st.tuples(st.just("zero"), places, st.integers(1, 4096)),
                st.tuples(st.just("truncate"), places, st.none()),
            ),
            min_size=1,
            max_size=4,
        )
    )


def damaged(content, edits):
    for edit, place, what in edits:
        before, after = content[:place], content[place:]
        match edit:
            case "flip":
                content = before + bytes(byte ^ what for byte in after[:1]) + after[1:]
            case "remove":
                content = before + after[what:]
            case "insert":
                content = before + what + after
            case "length":
                content = before + struct.pack("<Q", what) + after[8:]
            case "zero":
                content = before + bytes(what) + after[what:]
            case _:
                content = before
    return content


def most_memory():
    """Return the largest memory, in bytes, that this process has had so far."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def check(content, file, path):
    """Read, report and look at everything; fail at anything but a refusal by a sentence."""
    path.write_bytes(content)
    intact = [number for number, chunk in enumerate(file.chunks) if chunk in content]
    expected = [
        number for chunk in intact for number in range(2 * chunk * PAIRS, 2 * (chunk + 1) * PAIRS)
    ]
    # Otherwise nothing may be left that tells of the topics.
    understood = any(stretch in content for stretch in file.definitions) or (
        len(content) == len(file.content) and content.endswith(file.summary)
    )
    read, refusal = [], ""
    memory = most_memory()
    try:
        with Recording(path) as recording:
            for _, stamp, data in recording.messages(STATES, FORCES):
                assert data == MESSAGES[stamp]
                read.append(stamp)
            assert recording.joint_states.stamp.tolist() == [s for s in read if s % 2 == 0]
            for name in (f"table {2 * PAIRS - 1}", "rosbag2"):
                recording.metadata(name)
            recording.attachment("note")
            assert recording.missing or len(read) == len(MESSAGES)
        report_of_recording(path)
    except StickslipError as error:
        refusal = str(error)
    assert most_memory() - memory < MUCH_MEMORY
    assert "\n" not in refusal
    assert not (understood and set(expected) - set(read)), f"intact chunks {intact} are lost"


def test_the_type_of_a_topic_is_known_from_a_summary_that_has_moved(sound, scratch):
    name = sound.content.index(b"sensor_msgs/msg/JointState")
    first = sound.content.index(sound.chunks[0])
    check(damaged(sound.content, [("flip", name, 1), ("remove", first - 39, 40)]), sound, scratch)


@examples(quick=50, thorough=100)
@given(st.data())
def test_damage_is_survived(sound, scratch, data):
    check(damaged(sound.content, data.draw(edits(sound))), sound, scratch)


def content(path):
    """Return all that a file holds, as the mcap library reads it."""
    with path.open("rb") as stream:
        reader = make_reader(stream)
        messages = [
            (
                (schema.name, schema.encoding, schema.data),
                (channel.topic, channel.message_encoding, channel.metadata),
                (message.log_time, message.publish_time, message.sequence, message.data),
            )
            for schema, channel, message in reader.iter_messages(log_time_order=False)
        ]
        tables = [(m.name, m.metadata) for m in reader.iter_metadata() if m.name != "rosbag2"]
        attachments = list(reader.iter_attachments())
    return messages, tables, attachments


def test_all_that_another_recorder_wrote_comes_over(tmp_path):
    path = tmp_path / "foreign.mcap"
    with foreign_file(path, chunk_size=200) as writer:
        writer.add_attachment(1, 2, "note", "text/plain", b"first")
        writer.add_attachment(3, 4, "note", "text/plain", b"second")
        writer.add_metadata("made", {"by": "hand"})
        channels = [
            writer.register_channel(
                "/a", encoding, writer.register_schema("x/msg/A", "ros2msg", text), {"key": key}
            )
            for encoding, text, key in (
                ("cdr", b"int32 a", "1"), ("json", b"int32 a", "1"),
                ("cdr", b"int32 b", "1"), ("cdr", b"int32 a", "2"),
            )
        ]  # fmt: skip
        for number in range(40):
            writer.add_message(
                channels[number % 4], 100 + number, bytes([number]), 90 + number, number
            )
    assert repair(path, tmp_path / "sound").missing == []
    assert content(tmp_path / "sound" / "sound_0.mcap") == content(path)


def test_what_is_left_of_a_damaged_bag_is_sound(tmp_path):
    record(tmp_path / "bag")
    file = tmp_path / "bag" / "bag_0.mcap"
    file.write_bytes(cut := file.read_bytes()[:-100])
    before = report_of_recording(tmp_path / "bag")
    with pytest.raises(McapError), file.open("rb") as stream:
        list(make_reader(stream).iter_messages())
    repaired = repair(tmp_path / "bag", tmp_path / "sound")
    assert repaired.messages == {STATES: len(STAMPS), FORCES: len(STAMPS)}
    assert repaired.missing
    report = report_of_recording(tmp_path / "sound")
    changed = {"complete": True, "missing": []}
    assert not before["complete"]
    assert report == before | changed
    assert file.read_bytes() == cut
    with Reader(tmp_path / "sound") as reader:
        assert {c.topic: c.msgcount for c in reader.connections} == repaired.messages
        assert all(c.digest.startswith("RIHS01_") for c in reader.connections)


def test_messages_that_no_bag_can_hold_are_left_out_and_counted(tmp_path):
    path = tmp_path / "foreign.mcap"
    with foreign_file(path) as writer:
        schema = writer.register_schema(STATE_TYPE, "ros2msg", b"")
        states = writer.register_channel(STATES, "cdr", schema)
        typeless = writer.register_channel("/typeless", "cdr", 0)
        for stamp, time in enumerate([1, 2**63, 2, 3]):
            writer.add_message(states, time, state(stamp), 2**64 - 1 if time == 2 else time)
        writer.add_message(typeless, 5, b"", 5)
    repaired = repair(path, tmp_path / "sound")
    assert repaired.messages == {STATES: 2}
    assert repaired.missing == [
        "foreign.mcap: /typeless is omitted: its type is unknown",
        "foreign.mcap: 2 messages are omitted: their times exceed 2^63 - 1 ns",
    ]
    with Recording(tmp_path / "sound") as recording:
        assert recording.joint_states.stamp.tolist() == [0, 3]


def test_nothing_is_written_into_the_original(tmp_path):
    record(tmp_path / "bag")
    before = sorted((tmp_path / "bag").iterdir())
    for bag in ("bag", "bag/bag_0.mcap"):
        with pytest.raises(BagError, match="would lie within"):
            repair(tmp_path / bag, tmp_path / "bag" / "out")
    assert sorted((tmp_path / "bag").iterdir()) == before


def test_a_repair_that_fails_leaves_nothing_behind(tmp_path):
    def fail(_):
        raise BagError("the disk is full")

    record(tmp_path / "bag")
    with pytest.raises(BagError, match="full"):
        repair(tmp_path / "bag", tmp_path / "out", fail)
    assert not (tmp_path / "out").exists()
