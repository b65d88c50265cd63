import os
import shutil
import struct
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.record import bag_formats
from stickslip_ros.record.bag_files import runs_of
from stickslip_ros.record.codec import pack_joint_state, pack_wrench
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.recorder import Recorder
from tests.record.runs import FORCES, write_bag
from tests.record.runs import STATES as JOINT_STATES

DEPTH = 10
COUNT = 600


def state(number):
    return pack_joint_state(number, (number, 0.0), (0.0, 0.4), (0.0, 0.0))


STATES = [state(number) for number in range(COUNT)]


def record(directory, numbers, flush_every=100):
    with Recorder(directory) as recorder:
        channel = recorder.add_topic(JOINT_STATES, "sensor_msgs/msg/JointState", DEPTH)
        recorder.add_metadata("scenario", {"name": "first"})
        recorder.add_metadata("scenario", {"name": "paper"})
        recorder.attach("scenario.yaml", b"plant:", "text/yaml")
        for number in numbers:
            recorder.write(channel, state(number), number)
            if number % flush_every == flush_every - 1:
                recorder.flush()


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    directory = tmp_path_factory.mktemp("bags") / "bag"
    record(directory, range(COUNT))
    return directory


@pytest.fixture(scope="module")
def scratch(tmp_path_factory):
    return tmp_path_factory.mktemp("scratch") / "scratch.mcap"


def test_messages_metadata_attachments_and_qos_come_as_they_were_written(bag):
    for path in (bag, bag / "bag_0.mcap"):
        with Recording(path) as recording:
            assert recording.topics == {JOINT_STATES: "sensor_msgs/msg/JointState"}
            assert recording.complete
            messages = [(JOINT_STATES, *each) for each in enumerate(STATES)]
            assert list(recording.messages(JOINT_STATES)) == messages
            assert recording.complete
            assert recording.metadata("scenario") == {"name": "paper"}
            assert recording.attachment("scenario.yaml") == b"plant:"
            (profile,) = yaml.safe_load(recording.offered_qos(JOINT_STATES))
            assert profile["depth"] == 10
            assert recording.metadata("other") is recording.attachment("other") is None
            assert recording.offered_qos("/other") == ""


def test_what_is_true_is_recorded_under_names_of_its_own(tmp_path):
    truth = "/feed_drive/true_joint_states", "/feed_drive/applied_force"
    messages = [(JOINT_STATES, 1, state(1)), (truth[0], 1, state(2))]
    write_bag(tmp_path / "bag", [*messages, (truth[1], 1, pack_wrench(1, -3.0))])
    with Recording(tmp_path / "bag") as recording:
        assert recording.joint_states.position.tolist() == [1.0]
        assert recording.true_joint_states.position.tolist() == [2.0]
        assert recording.applied_forces.force.tolist() == [-3.0]
        assert recording.control_forces.force.tolist() == []


def test_columns_are_those_of_the_messages_chunk_by_chunk_and_as_a_whole(tmp_path):
    """Forces come late and in bursts, so that chunks hold different numbers of either."""
    messages = []
    for number in range(COUNT):
        messages.append((JOINT_STATES, number, state(number)))
        if number % 7 == 6:
            late = range(number - 6, number + 1)
            messages += [(FORCES, stamp, pack_wrench(stamp, -stamp)) for stamp in late]
    write_bag(tmp_path / "bag", messages, flush_every=200)
    with Recording(tmp_path / "bag") as recording:
        blocks = list(recording.blocks())
        assert len(blocks) == len(messages) // 200 + 1
        position = [value for block in blocks for value in block.joint_states.position]
        assert position == recording.joint_states.position.tolist() == list(range(COUNT))
        force = [value for block in blocks for value in block.control_forces.force]
        assert force == recording.control_forces.force.tolist()
        assert [-value for value in force] == recording.control_forces.stamp.tolist()
        assert len(force) == COUNT // 7 * 7
        assert len(recording.applied_disturbances.stamp) == 0
        assert recording.missing == []


def test_invalid_messages_are_skipped_and_reported(tmp_path):
    data = (state(number) if number % 3 else b"rubbish" for number in range(9))
    write_bag(tmp_path / "bag", [(JOINT_STATES, *each) for each in enumerate(data)])
    with Recording(tmp_path / "bag") as recording:
        assert recording.joint_states.stamp.tolist() == [1, 2, 4, 5, 7, 8]
        (sentence,) = recording.missing
        assert sentence.startswith(f"3 messages on {JOINT_STATES} could not be read: a joint state")
        assert not recording.complete


def test_only_the_topics_asked_for_are_read(tmp_path):
    write_bag(tmp_path / "bag", [(t, stamp, bytes(12)) for stamp, t in enumerate("abcab")])
    with Recording(tmp_path / "bag") as recording:
        read = [(topic, stamp) for topic, stamp, _ in recording.messages("a", "b")]
        assert read == [("a", 0), ("b", 1), ("a", 3), ("b", 4)]
        assert [stamp for _, stamp, _ in recording.messages("c", "d")] == [2]
        assert list(recording.messages()) == []


def test_a_damaged_chunk_is_skipped_and_reported(bag, scratch):
    content = bytearray((bag / "bag_0.mcap").read_bytes())
    content[content.index(b"lz4", len(content) // 2) + 100] ^= 0xFF
    scratch.write_bytes(content)
    with Recording(scratch) as recording:
        assert recording.complete
        stamps = [stamp for _, stamp, _ in recording.messages(JOINT_STATES)]
        damage, gone = recording.missing
        assert "cannot be read" in damage
        assert f"100 messages recorded on {JOINT_STATES} are missing" in gone
    assert len(stamps) == COUNT - 100
    assert set(stamps) < set(range(COUNT))


NO_INDEX = {"index_types": IndexType.NONE, "use_statistics": False, "use_summary_offsets": False}
OPTIONS_OF_WRITERS = (
    {"use_chunking": False},
    {"compression": CompressionType.ZSTD},
    {"compression": CompressionType.NONE, "chunk_size": 1000},
    {"repeat_channels": False, "repeat_schemas": False},
    NO_INDEX,
    {**NO_INDEX, "repeat_channels": False, "repeat_schemas": False},
)


def test_files_of_other_writers_are_read_and_records_of_their_own_passed_over(scratch):
    own = struct.pack("<BQ", 0x99, 3) + b"own"
    for options, repetition in product(OPTIONS_OF_WRITERS, (0, 2)):
        with scratch.open("wb") as stream:
            writer = Writer(stream, **options)
            writer.start(profile="ros2")
            schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", b"")
            channel = writer.register_channel(JOINT_STATES, "cdr", schema)
            for number in range(COUNT):
                if repetition and number % 100 == 50:
                    writer.flush()
                    stream.write(own * repetition)
                writer.add_message(channel, number, state(number), number)
            writer.finish()
        with Recording(scratch) as recording:
            assert recording.topics == {JOINT_STATES: "sensor_msgs/msg/JointState"}
            assert recording.joint_states.stamp.tolist() == list(range(COUNT))
            assert recording.complete


def test_a_metadata_yaml_that_is_missing_or_unreadable_is_reported(bag, tmp_path):
    shutil.copytree(bag, tmp_path / "bag")
    for text in ("a: 2001-99-99", "[" * 5000, "- 1", "\xff", ""):
        (tmp_path / "bag" / "metadata.yaml").write_text(text, encoding="latin-1")
        with Recording(tmp_path / "bag") as recording:
            assert recording.missing == ["metadata.yaml cannot be read"]
    (tmp_path / "bag" / "metadata.yaml").unlink()
    with Recording(tmp_path / "bag") as recording:
        assert not recording.complete
        assert len(list(recording.messages(JOINT_STATES))) == COUNT


def test_a_split_bag_is_read_in_order(tmp_path):
    bag = tmp_path / "bag"
    bag.mkdir()
    for part in range(11):
        record(tmp_path / f"part{part}", [part])
        shutil.move(tmp_path / f"part{part}" / f"part{part}_0.mcap", bag / f"bag_{part}.mcap")
    with Recording(bag) as recording:
        assert [stamp for _, stamp, _ in recording.messages(JOINT_STATES)] == list(range(11))
        assert recording.metadata("scenario") == {"name": "paper"}


def rosbags_bag(path, plugin, packing=None):
    typestore = get_typestore(Stores.ROS2_JAZZY)
    writer = RosbagsWriter(path, version=9, storage_plugin=plugin)
    if packing is not None:
        writer.set_compression(packing, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(
            JOINT_STATES, "sensor_msgs/msg/JointState", typestore=typestore
        )
        writer.write(connection, 5, state(5))
    return path


@pytest.mark.parametrize("packing", [None, *CompressionMode])
def test_a_bag_of_rosbags_is_read_however_it_is_packed(tmp_path, packing):
    rosbags_bag(tmp_path / "bag", StoragePlugin.MCAP, packing)
    with Recording(tmp_path / "bag") as recording:
        assert recording.complete
        assert list(recording.messages(JOINT_STATES)) == [(JOINT_STATES, 5, state(5))]


def test_one_of_several_drives_is_chosen_by_its_namespace(tmp_path):
    messages = []
    for stamp in range(10):
        namespace = ("/one", "/two/deep")[stamp % 2]
        messages.append((f"{namespace}/joint_states", stamp, state(stamp)))
        messages.append((f"{namespace}/control_force", stamp, pack_wrench(stamp, stamp)))
    write_bag(tmp_path / "bag", messages, topics=["/one/frequency", "/two/deep/frequency"])
    for namespace, first in (("/one", 0), ("one", 0), ("/two/deep/", 1)):
        with Recording(tmp_path / "bag", namespace) as recording:
            assert recording.joint_states.stamp.tolist() == list(range(first, 10, 2))
            assert recording.control_forces.stamp.tolist() == list(range(first, 10, 2))
    with Recording(tmp_path / "bag", "/three") as recording:
        assert len(recording.joint_states.stamp) == 0
    with Recording(tmp_path / "bag") as recording:
        assert len(list(recording.messages(*recording.topics))) == 20
        with pytest.raises(BagError, match=r"2 drives; choose one .*: /one, /two/deep"):
            list(recording.blocks())


def test_forces_of_strangers_do_not_get_in_the_way(tmp_path):
    with Recorder(tmp_path / "bag") as recorder:
        recorder.add_topic("/joint_states", "std_msgs/msg/Float64", DEPTH)
        for topic, kind, data in (
            ("/one/joint_states", "sensor_msgs/msg/JointState", state(1)),
            ("/one/control_force", "geometry_msgs/msg/WrenchStamped", pack_wrench(1, 4.0)),
            ("/two/control_force", "geometry_msgs/msg/WrenchStamped", pack_wrench(1, 5.0)),
        ):
            recorder.write(recorder.add_topic(topic, kind, DEPTH), data, 1)
    with Recording(tmp_path / "bag") as recording:
        assert recording.control_forces.force.tolist() == [4.0]


def test_a_bag_that_is_given_twice_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match="bag is given twice"):
        runs_of([tmp_path / "bag", tmp_path / "other", tmp_path / "other" / ".." / "bag"])


def test_what_is_no_bag_is_refused(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "directory" / "directory.mcap").mkdir(parents=True)
    (tmp_path / "file.txt").write_text("not a bag, but longer than a bag's beginning")
    (tmp_path / "empty.mcap").touch()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "truncated.mcap").write_bytes(b"\x89MCAP")
    for complaint, *names in (
        ("does not exist", "nothing", "file.txt/bag", "nul\0nul", "long" * 100),
        ("holds no .mcap file", "empty"),
        ("not an MCAP file", "file.txt", "empty.mcap", "truncated.mcap"),
        ("cannot be opened", "directory"),
        ("not a regular file", "pipe"),
    ):
        for name in names:
            with pytest.raises(BagError, match=complaint):
                Recording(tmp_path / name)


def ros_1_bag(path):
    types = get_typestore(Stores.ROS1_NOETIC)
    kind = types.types["sensor_msgs/msg/JointState"]
    header = types.types["std_msgs/msg/Header"]
    time = types.types["builtin_interfaces/msg/Time"](*divmod(3_000_000_007, 10**9))
    none = np.array([])
    message = kind(header(1, time, ""), ["table"], np.array([1.25e-3]), none, none)
    path = path.with_suffix(".bag")
    with Ros1Writer(path) as writer:
        connection = writer.add_connection("/joint_states", kind.__msgtype__, typestore=types)
        writer.write(connection, 3_000_000_007, types.serialize_ros1(message, kind.__msgtype__))
    return path


@pytest.mark.process
def test_a_bag_of_sqlite_is_read_by_its_directory_and_by_its_file(tmp_path):
    bag = rosbags_bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    for path in (bag, next(bag.glob("*.db3"))):
        with Recording(path) as recording:
            assert recording.complete
            assert list(recording.messages(JOINT_STATES)) == [(JOINT_STATES, 5, state(5))]


@pytest.mark.process
def test_a_bag_of_ros_1_has_the_same_stamps_and_positions(tmp_path):
    with Recording(ros_1_bag(tmp_path / "bag")) as recording:
        assert recording.joint_states.stamp.tolist() == [3_000_000_007]
        assert recording.joint_states.position.tolist() == [1.25e-3]


@pytest.mark.process
@pytest.mark.parametrize(
    "write", [lambda path: rosbags_bag(path, StoragePlugin.SQLITE3), ros_1_bag]
)
def test_a_damaged_bag_is_refused_in_a_sentence(write, tmp_path):
    path = write(tmp_path / "bag")
    path = next(path.glob("*.db3")) if path.is_dir() else path
    content = path.read_bytes()
    path.write_bytes(content[:60] + content[200:])
    with pytest.raises(BagError, match="cannot be converted") as refused:
        Recording(path)
    assert "\n" not in str(refused.value)


def test_a_missing_library_for_a_bag_is_named(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rosbags.convert.cli", None)
    monkeypatch.setattr("resource.setrlimit", lambda *_: None)
    monkeypatch.setattr("os._exit", sys.exit)
    with pytest.raises(SystemExit):
        bag_formats._main(Path("bag"), Path("mcap"))
    assert "install rosbags" in capsys.readouterr().err
