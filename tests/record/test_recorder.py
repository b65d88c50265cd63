import os
import struct
from io import BytesIO
from itertools import product
from pathlib import Path
from threading import Event

import pytest
import yaml
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from stickslip_ros.errors import BagError
from stickslip_ros.record.codec import pack_joint_state, pack_wrench
from stickslip_ros.record.definitions import message_definition, type_hash
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.recorder import Recorder, check_new_bag
from tests.nodes.graph import wait_for
from tests.record.runs import FORCES, full_disk
from tests.record.runs import STATES as JOINT_STATES

DEPTH = 2000

END = struct.pack("<BQ4x BQ20x", Opcode.DATA_END, 4, Opcode.FOOTER, 20) + MCAP0_MAGIC
"""Of a file without a summary."""


def add_topics(recorder):
    states = recorder.add_topic(JOINT_STATES, "sensor_msgs/msg/JointState", DEPTH)
    return states, recorder.add_topic(FORCES, "geometry_msgs/msg/WrenchStamped", DEPTH)


def record(directory, count, **options):
    """Write `count` pairs of joint state and force, 1 ms apart from 1 s on."""
    with Recorder(directory, **options) as recorder:
        states, forces = add_topics(recorder)
        for number in range(count):
            stamp = 10**9 + number * 10**6
            recorder.write(states, pack_joint_state(stamp, (number, 0), (0, 0), (0, 0)), stamp)
            recorder.write(forces, pack_wrench(stamp, -number), stamp)


def add_a(recorder):
    return recorder.add_topic("/a", "std_msgs/msg/Float64", DEPTH)


def stamps_in(directory):
    """Return the stamps that can be read of topic /a, and whether the bag is complete."""
    with Recording(directory) as recording:
        stamps = [stamp for _, stamp, _ in recording.messages("/a")]
        return stamps, recording.complete


def information(directory):
    return yaml.safe_load((directory / "metadata.yaml").read_text())["rosbag2_bagfile_information"]


@pytest.mark.parametrize("compression", ["lz4", "zstd", "none"])
def test_rosbags_reads_what_was_recorded(tmp_path, compression):
    bag = tmp_path / "bag"
    record(bag, 3, compression=compression)
    with AnyReader([bag]) as reader:
        assert (reader.start_time, reader.end_time) == (10**9, 10**9 + 2 * 10**6 + 1)
        for number, (connection, stamp, data) in enumerate(reader.messages()):
            message = reader.deserialize(data, connection.msgtype)
            assert connection.topic == (JOINT_STATES, FORCES)[number % 2]
            assert stamp == 10**9 + number // 2 * 10**6
            assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(stamp, 10**9)
            if connection.topic == FORCES:
                force, torque = message.wrench.force, message.wrench.torque
                assert message.header.frame_id == "slide"
                assert [force.x, force.y, force.z] == [-(number // 2), 0.0, 0.0]
                assert [torque.x, torque.y, torque.z] == [0.0] * 3
            else:
                assert message.position[0] == number // 2


def test_metadata_yaml_is_that_of_rosbags(tmp_path):
    bag, other = tmp_path / "bag", tmp_path / "other"
    record(bag, 3)
    copy = Writer(other, version=9, storage_plugin=StoragePlugin.MCAP)
    with Reader(bag) as reader, copy:
        copied = {
            each.id: copy.add_connection(
                each.topic,
                each.msgtype,
                typestore=get_typestore(Stores.ROS2_JAZZY),
                offered_qos_profiles=each.ext.offered_qos_profiles,
            )
            for each in reader.connections
        }
        for connection, stamp, data in reader.messages():
            copy.write(copied[connection.id], stamp, data)
    found, expected = information(bag), information(other)
    assert (found.pop("custom_data"), expected.pop("custom_data") or {}) == ({}, {})
    assert found.pop("ros_distro") == "jazzy"
    del expected["ros_distro"]
    assert [expected["files"][0].pop("path")] == expected.pop("relative_file_paths")
    assert found["files"][0].pop("path") == "bag_0.mcap"
    assert found.pop("relative_file_paths") == ["bag_0.mcap"]
    assert found == expected
    assert sorted(path.name for path in bag.iterdir()) == ["bag_0.mcap", "metadata.yaml"]


def test_the_file_itself_is_that_of_rosbag2(tmp_path):
    record(tmp_path / "bag", 1)
    file = tmp_path / "bag" / "bag_0.mcap"
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        (record_of_rosbag2,) = reader.iter_metadata()
        for schema, channel, message in reader.iter_messages():
            assert schema.encoding == "ros2msg"
            assert channel.message_encoding == "cdr"
            assert channel.metadata["topic_type_hash"] == type_hash(schema.name)
            assert (message.log_time, message.publish_time) == (10**9, 10**9)
    assert record_of_rosbag2.name == "rosbag2"
    serialized = yaml.safe_load(record_of_rosbag2.metadata["serialized_metadata"])
    assert serialized.keys() == information(tmp_path / "bag").keys()
    assert (serialized["version"], serialized["ros_distro"]) == (9, "jazzy")
    with Reader(file) as reader:
        connection = reader.topics[JOINT_STATES].connections[0]
        assert connection.msgtype == "sensor_msgs/msg/JointState"
        assert connection.msgdef.data == message_definition("sensor_msgs/msg/JointState")
        (qos,) = connection.ext.offered_qos_profiles
        assert (qos.history.name, qos.depth) == ("KEEP_LAST", 2000)
        assert (qos.reliability.name, qos.durability.name) == ("RELIABLE", "VOLATILE")
        assert {*qos.deadline, *qos.lifespan} == {9223372036, 854775807}  # unlimited


def test_a_bag_may_be_empty_have_stamps_in_any_order_and_get_a_topic_late(tmp_path):
    record(tmp_path / "empty", 0)
    assert information(tmp_path / "empty")["message_count"] == 0
    with Reader(tmp_path / "empty") as reader:
        assert set(reader.topics) == {JOINT_STATES, FORCES}
        assert list(reader.messages()) == []
    with Recorder(tmp_path / "bag") as recorder:
        channel = add_a(recorder)
        for stamp in (50, 20, 90):
            recorder.write(channel, bytes(12), stamp)
        recorder.flush()
        late = recorder.add_topic("/b", "std_msgs/msg/Float64", DEPTH)
        recorder.write(late, bytes(12), 30)
    assert information(tmp_path / "bag")["starting_time"] == {"nanoseconds_since_epoch": 20}
    assert information(tmp_path / "bag")["duration"] == {"nanoseconds": 70}
    assert [topic for topic, *_ in contents(tmp_path / "bag")] == ["/a", "/b", "/a", "/a"]


def records(content):
    """Return opcode and place of the records of a file that are in no chunk."""
    found, place = [], 8
    while place < len(content) - 8:
        opcode, length = struct.unpack_from("<BQ", content, place)
        found.append((opcode, place))
        place += 9 + length
    return found


def test_definitions_are_repeated_where_damage_to_the_first_chunk_cannot_reach(tmp_path):
    with Recorder(tmp_path / "bag", compression="none") as recorder:
        states, forces = add_topics(recorder)
        for stamp in range(2000):
            recorder.write(states, bytes(300), stamp)
            recorder.write(forces, bytes(100), stamp)
            if stamp % 100 == 99:
                recorder.flush()
    content = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    opcodes = [opcode for opcode, _ in records(content)]
    outside = opcodes[: opcodes.index(Opcode.DATA_END)]
    assert outside.index(Opcode.CHANNEL) < outside.index(Opcode.CHUNK)
    schemas = [place for opcode, place in records(content) if opcode == Opcode.SCHEMA]
    start = schemas[2]  # behind the two topics' own
    after_header = records(content)[1][1]
    rest = StreamReader(BytesIO(content[:after_header] + content[start:])).records
    stamps = [record.log_time for record in rest if isinstance(record, Message)]
    assert len(stamps) > 1000
    assert stamps == sorted(2 * list(range(2000)))[-len(stamps) :]


def test_definitions_take_little_of_a_file_that_is_flushed_all_the_time(tmp_path):
    sizes = {}
    for name, flushes in (("flushed", True), ("whole", False)):
        with Recorder(tmp_path / name, compression="none") as recorder:
            states, _ = add_topics(recorder)
            for stamp in range(2000):
                recorder.write(states, bytes(1000), stamp)
                if flushes and stamp % 10 == 9:
                    recorder.flush()
        sizes[name] = sum(file.stat().st_size for file in (tmp_path / name).glob("*.mcap"))
    assert sizes["flushed"] < 1.1 * sizes["whole"]


def contents(bag):
    """Return what rosbags finds in a bag: topic, stamp and message, in turn."""
    with AnyReader([bag]) as reader:
        return [(connection.topic, *message) for connection, *message in reader.messages()]


def test_a_bag_that_is_split_by_size_holds_the_same(tmp_path):
    record(tmp_path / "whole", 20_000, compression="none")
    record(tmp_path / "split", 20_000, compression="none", max_bag_size=1_500_000)
    files = ["split_0.mcap", "split_1.mcap", "split_2.mcap"]
    assert {file.name for file in (tmp_path / "split").iterdir()} == {*files, "metadata.yaml"}
    for file in files[:-1]:
        assert 1_500_000 < (tmp_path / "split" / file).stat().st_size < 3_000_000
    assert contents(tmp_path / "split") == contents(tmp_path / "whole")
    with Recording(tmp_path / "split") as recording:
        assert recording.complete
    whole, split = information(tmp_path / "whole"), information(tmp_path / "split")
    assert split["relative_file_paths"] == files
    assert [file["path"] for file in split["files"]] == files
    assert sum(file["message_count"] for file in split["files"]) == 40_000
    for name in ("duration", "starting_time", "message_count", "topics_with_message_count"):
        assert split[name] == whole[name]


def test_a_bag_is_split_by_the_time_between_stamps(tmp_path):
    """As rosbag2 does: what is further from the earliest stamp of a file is in the next one."""
    with Recorder(tmp_path / "bag", max_bag_duration=3.0) as recorder:
        channel = add_a(recorder)
        for second in (5, 4, 6, 7, 8, 9, 11, 12, 10, 13):
            recorder.write(channel, bytes(12), second * 10**9)
    assert [
        (file["starting_time"]["nanoseconds_since_epoch"], file["duration"]["nanoseconds"])
        for file in information(tmp_path / "bag")["files"]
    ] == [(4 * 10**9, 3 * 10**9), (8 * 10**9, 3 * 10**9), (10 * 10**9, 3 * 10**9)]
    seconds = [stamp / 10**9 for _, stamp, _ in contents(tmp_path / "bag")]
    assert seconds == [4, 5, 6, 7, 8, 9, 11, 10, 12, 13]


def test_each_file_of_a_split_bag_is_complete_by_itself(tmp_path):
    with Recorder(tmp_path / "bag", max_bag_size=1) as recorder:
        channel, _ = add_topics(recorder)
        recorder.add_metadata("early", {"a": "1"})
        for stamp in range(3):
            recorder.write(channel, pack_joint_state(stamp + 1, (0, 0), (0, 0), (0, 0)), stamp)
            recorder.flush()
        recorder.add_metadata("late", {"b": "2"})
    files = sorted((tmp_path / "bag").glob("*.mcap"))
    assert len(files) == 3
    for number, file in enumerate(files):
        with file.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            assert [message.log_time for _, _, message in reader.iter_messages()] == [number]
            assert {table.name for table in reader.iter_metadata()} >= {"rosbag2", "early"}
        with Reader(file) as reader:
            assert set(reader.topics) == {JOINT_STATES, FORCES}
        with Recording(file) as recording:
            assert recording.complete
    with Recording(tmp_path / "bag") as recording:
        assert recording.metadata("early") == {"a": "1"}
        assert recording.metadata("late") == {"b": "2"}


def test_what_is_finished_is_described_while_the_recording_goes_on(tmp_path):
    bag = tmp_path / "bag"
    with Recorder(bag, max_bag_size=1) as recorder:
        channel = add_a(recorder)
        recorder.write(channel, bytes(12), 1)
        recorder.flush()
        assert not (bag / "metadata.yaml").exists()
        recorder.write(channel, bytes(12), 2)
        recorder.flush()
        wait_for((bag / "metadata.yaml").exists, "the first file is finished")
        assert stamps_in(bag) == ([1, 2], False)
        assert [stamp for _, stamp, _ in contents(bag)] == [1]
    assert stamps_in(bag) == ([1, 2], True)


def test_a_slow_disk_does_not_hold_up_the_recording(tmp_path, monkeypatch):
    ready, handed = Event(), []

    def sync(descriptor):
        handed.append(descriptor)
        assert ready.wait(60.0)

    monkeypatch.setattr(os, "fdatasync", sync)
    with Recorder(tmp_path / "bag") as recorder:
        channel = add_a(recorder)
        for stamp in range(100):
            recorder.write(channel, bytes(12), stamp)
            recorder.flush()
        assert stamps_in(tmp_path / "bag") == ([*range(100)], False)
        wait_for(lambda: handed, "the disk is busy")
        ready.set()
    assert len(handed) <= 3  # at the first flush, once for all others, at the end
    assert stamps_in(tmp_path / "bag") == ([*range(100)], True)


def test_a_disk_that_refuses_what_it_is_handed_ends_the_recording(tmp_path, monkeypatch):
    recorder = Recorder(tmp_path / "bag")
    channel = add_a(recorder)
    recorder.write(channel, bytes(12), 1)

    def sync(_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fdatasync", sync)

    def refused():
        try:
            recorder.flush()
        except BagError as error:
            return "Input/output error" in str(error)
        return False

    wait_for(refused, "the error is told")
    with pytest.raises(BagError, match="is closed"):
        recorder.write(channel, bytes(12), 2)
    recorder.close()
    assert stamps_in(tmp_path / "bag") == ([1], False)


def test_closing_fails_where_the_disk_refuses(tmp_path, monkeypatch):
    def sync(_):
        raise OSError(28, "No space left on device")

    for call in ("fdatasync", "fsync"):
        recorder = Recorder(tmp_path / call)
        with monkeypatch.context() as patch:
            patch.setattr(os, call, sync)
            with pytest.raises(BagError, match="No space left"):
                recorder.close()
        assert [file.name for file in (tmp_path / call).iterdir()] == [f"{call}_0.mcap"]


def test_what_is_refused_or_fails_leaves_the_bag_whole(tmp_path):
    with pytest.raises(KeyError), Recorder(tmp_path / "bag") as recorder:  # noqa: PT012
        channel = add_a(recorder)
        recorder.write(channel, bytes(12), 7)
        for stamp in (-1, 2**63):
            with pytest.raises(BagError, match=f"stamp {stamp} ns"):
                recorder.write(channel, bytes(12), stamp)
        with pytest.raises(BagError, match="/a is already in the bag"):
            add_a(recorder)
        with pytest.raises(BagError, match="not installed"):
            recorder.add_topic("/b", "std_msgs/msg/Nothing", DEPTH)
        recorder.write(channel, bytes(12), 8)
        raise KeyError
    assert stamps_in(tmp_path / "bag") == ([7, 8], True)
    content = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    for refused in (
        lambda: recorder.write(channel, bytes(12), 9),
        lambda: recorder.add_topic("/b", "std_msgs/msg/Float64", DEPTH),
        lambda: recorder.attach("a", b"", "text/plain"),
        lambda: recorder.add_metadata("a", {}),
        recorder.flush,
    ):
        with pytest.raises(BagError, match="is closed"):
            refused()
    recorder.close()
    assert (tmp_path / "bag" / "bag_0.mcap").read_bytes() == content


@pytest.fixture
def small_disk():
    with full_disk(100_000):
        yield


@pytest.mark.usefixtures("small_disk")
def test_a_full_disk_ends_the_recording_and_keeps_what_was_written(tmp_path):
    recorder = Recorder(tmp_path / "bag", compression="none")
    channel = add_a(recorder)
    with pytest.raises(BagError, match=r"no longer be written .*; what was written so far can be"):  # noqa: PT012
        for stamp in range(100_000):
            recorder.write(channel, bytes(12), stamp)
            if stamp % 100 == 99:
                recorder.flush()
    with pytest.raises(BagError, match="is closed"):
        recorder.write(channel, bytes(12), 1)
    recorder.close()
    stamps, complete = stamps_in(tmp_path / "bag")
    assert not complete
    assert len(stamps) >= 1000
    assert stamps == list(range(len(stamps)))


@pytest.mark.usefixtures("small_disk")
def test_on_a_full_disk_no_half_record_is_left(tmp_path):
    for name, before, left in (("first", [], "it holds no message"), ("next", [1], "can be read")):
        recorder = Recorder(tmp_path / name)
        channel = add_a(recorder)
        for stamp in before:
            recorder.write(channel, bytes(12), stamp)
        recorder.flush()
        recorder.write(channel, os.urandom(200_000), 2)
        with pytest.raises(BagError, match=f"can no longer be written .*{left}"):
            recorder.flush()
        assert stamps_in(tmp_path / name)[0] == before
        content = (tmp_path / name / f"{name}_0.mcap").read_bytes()
        with_an_end = StreamReader(BytesIO(content + END)).records
        assert [each.log_time for each in with_an_end if isinstance(each, Message)] == before


def test_parents_are_made_and_the_file_is_named_after_the_directory(tmp_path, monkeypatch):
    check_new_bag(tmp_path / "a" / "b" / "bag")
    assert list(tmp_path.iterdir()) == []
    monkeypatch.chdir(tmp_path)
    record(Path("a/b/x/../bag/."), 1)
    assert (tmp_path / "a" / "b" / "bag" / "bag_0.mcap").is_file()


def tree(directory):
    return sorted((path, path.lstat().st_mtime_ns) for path in directory.rglob("*"))


def test_a_path_that_cannot_become_a_bag_is_refused(tmp_path):
    (tmp_path / "file").write_text("precious")
    (tmp_path / "directory").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "directory")
    (tmp_path / "dangling").symlink_to(tmp_path / "nothing")
    before = tree(tmp_path)
    names = "file directory link dangling file/bag file/parent/bag dangling/bag"
    for name, refuse in product(names.split(), (check_new_bag, Recorder)):
        with pytest.raises(BagError, match=str(tmp_path / name)):
            refuse(tmp_path / name)
        assert tree(tmp_path) == before


def test_a_bag_that_fails_to_open_leaves_nothing_behind(tmp_path):
    for path in (*(tmp_path / n for n in (f"p/{'a' * 250}", f"{'a' * 300}/bag", "nul\0nul")),
                 Path("/proc/bag")):  # fmt: skip
        with pytest.raises(BagError, match="cannot be created"):
            Recorder(path)
    assert list(tmp_path.iterdir()) == []
