import pytest
from mcap.exceptions import McapError
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from stickslip_ros.errors import BagError
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.repair import repair
from stickslip_ros.record.report import report_of_recording
from tests.record.runs import FORCES, STAMPS, STATES, foreign_file, record, state

STATE_TYPE = "sensor_msgs/msg/JointState"


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
