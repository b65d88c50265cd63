import shutil
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from stickslip_ros.bags.messages import joint_state_columns, pack_joint_state, wrench_columns
from stickslip_ros.bags.reader import Recording
from stickslip_ros.bags.recorder import QosProfile, Recorder
from stickslip_ros.errors import BagError

JOINT_STATES = "/feed_drive/joint_states"
FORCES = "/feed_drive/control_force"
QOS = QosProfile(depth=10)
COUNT = 600


def state(number):
    return pack_joint_state(number, (number, 0.0), (0.0, 0.4), (0.0, 0.0))


STATES = [state(number) for number in range(COUNT)]


def record(directory, numbers, flush_every=100):
    with Recorder(directory) as recorder:
        channel = recorder.add_topic(JOINT_STATES, "sensor_msgs/msg/JointState", QOS)
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


def test_messages_come_as_they_were_written(bag):
    for path in (bag, bag / "bag_0.mcap"):
        with Recording(path) as recording:
            assert recording.topics == {JOINT_STATES: "sensor_msgs/msg/JointState"}
            assert recording.complete
            assert list(recording.messages(JOINT_STATES)) == [
                (JOINT_STATES, number, state) for number, state in enumerate(STATES)
            ]
            assert recording.complete


def test_metadata_and_attachments_are_found(bag):
    with Recording(bag) as recording:
        assert recording.metadata("scenario") == {"name": "paper"}
        assert recording.attachment("scenario.yaml") == b"plant:"
        assert recording.metadata("other") is None
        assert recording.attachment("other") is None


@given(st.integers(1, 2 * COUNT))
def test_blocks_make_up_the_recording(bag, size):
    with Recording(bag) as recording:
        blocks = list(recording.blocks(JOINT_STATES, size=size))
    lengths = [len(block[JOINT_STATES].stamps) for block in blocks]
    assert sum(lengths) == COUNT
    assert all(length == size for length in lengths[:-1])
    columns = [joint_state_columns(block[JOINT_STATES].messages) for block in blocks]
    assert [position for column in columns for position in column.position] == list(range(COUNT))
    assert [stamp for block in blocks for stamp in block[JOINT_STATES].stamps] == list(range(COUNT))


def test_only_the_topics_asked_for_are_read(tmp_path):
    with Recorder(tmp_path / "bag") as recorder:
        channels = {
            topic: recorder.add_topic(topic, "std_msgs/msg/Float64", QOS) for topic in "abc"
        }
        for stamp, topic in enumerate("abcab"):
            recorder.write(channels[topic], bytes(12), stamp)
    with Recording(tmp_path / "bag") as recording:
        read = [(topic, stamp) for topic, stamp, _ in recording.messages("a", "b")]
        assert read == [("a", 0), ("b", 1), ("a", 3), ("b", 4)]
        (block,) = recording.blocks("a", "c", "d")
        assert {topic: part.stamps for topic, part in block.items()} == {
            "a": [0, 3],
            "c": [2],
            "d": [],
        }
        assert len(wrench_columns(block["d"].messages).stamp) == 0
        assert list(recording.messages()) == []


@given(st.data())
def test_a_cut_file_gives_its_whole_chunks(bag, scratch, data):
    content = (bag / "bag_0.mcap").read_bytes()
    scratch.write_bytes(content[: data.draw(st.integers(8, len(content) - 1))])
    with Recording(scratch) as recording:
        assert not recording.complete
        stamps = [stamp for _, stamp, _ in recording.messages(JOINT_STATES)]
        assert not recording.complete
        assert stamps == list(range(len(stamps)))
        assert len(stamps) % 100 == 0
        if stamps:
            assert recording.metadata("scenario") == {"name": "paper"}
            assert recording.attachment("scenario.yaml") == b"plant:"
        else:
            assert set(recording.topics) <= {JOINT_STATES}


def test_a_recording_can_be_read_while_it_is_made(tmp_path):
    with Recorder(tmp_path / "bag") as recorder:
        with Recording(tmp_path / "bag") as recording:
            assert recording.topics == {}
            assert not recording.complete
        channel = recorder.add_topic("/a", "std_msgs/msg/Float64", QOS)
        recorder.write(channel, bytes(12), 5)
        recorder.flush()
        with Recording(tmp_path / "bag") as recording:
            assert list(recording.messages("/a")) == [("/a", 5, bytes(12))]
            assert not recording.complete


@given(st.data())
def test_a_damaged_file_gives_nothing_wrong(bag, scratch, data):
    content = bytearray((bag / "bag_0.mcap").read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    scratch.write_bytes(content)
    with suppress(BagError), Recording(scratch) as recording:
        for _, stamp, message in recording.messages(*recording.topics):
            assert message == STATES[stamp]
        recording.metadata("scenario")
        recording.attachment("scenario.yaml")


def test_a_damaged_chunk_is_left_out_and_told(bag, scratch):
    content = bytearray((bag / "bag_0.mcap").read_bytes())
    content[len(content) // 2] ^= 0xFF
    scratch.write_bytes(content)
    with Recording(scratch) as recording:
        assert recording.complete
        stamps = [stamp for _, stamp, _ in recording.messages(JOINT_STATES)]
        assert not recording.complete
    assert len(stamps) == COUNT - 100
    assert set(stamps) < set(range(COUNT))


def test_a_bag_without_metadata_yaml_is_not_complete(bag, tmp_path):
    shutil.copytree(bag, tmp_path / "bag")
    (tmp_path / "bag" / "metadata.yaml").unlink()
    with Recording(tmp_path / "bag") as recording:
        assert not recording.complete
        assert len(list(recording.messages(JOINT_STATES))) == COUNT


@pytest.mark.parametrize(
    "options",
    [
        {"use_chunking": False},
        {"compression": CompressionType.ZSTD},
        {"compression": CompressionType.NONE, "chunk_size": 1000},
        {"repeat_channels": False, "repeat_schemas": False},
        {"index_types": IndexType.NONE, "use_statistics": False, "use_summary_offsets": False},
        {
            "index_types": IndexType.NONE,
            "use_statistics": False,
            "use_summary_offsets": False,
            "repeat_channels": False,
            "repeat_schemas": False,
        },
    ],
)
def test_files_of_other_writers_are_read(scratch, options):
    with scratch.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="ros2")
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", b"")
        channel = writer.register_channel(JOINT_STATES, "cdr", schema)
        for number in range(COUNT):
            writer.add_message(channel, number, state(number), number)
        writer.finish()
    with Recording(scratch) as recording:
        assert recording.topics == {JOINT_STATES: "sensor_msgs/msg/JointState"}
        assert [stamp for _, stamp, _ in recording.messages(JOINT_STATES)] == list(range(COUNT))
        assert recording.complete


def test_a_split_bag_is_read_in_order(tmp_path):
    bag = tmp_path / "bag"
    bag.mkdir()
    for part in range(11):
        record(tmp_path / f"part{part}", [part])
        shutil.move(tmp_path / f"part{part}" / f"part{part}_0.mcap", bag / f"bag_{part}.mcap")
    with Recording(bag) as recording:
        assert [stamp for _, stamp, _ in recording.messages(JOINT_STATES)] == list(range(11))
        assert recording.metadata("scenario") == {"name": "paper"}


def rosbags_bag(path, plugin):
    typestore = get_typestore(Stores.ROS2_JAZZY)
    with RosbagsWriter(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection(
            JOINT_STATES, "sensor_msgs/msg/JointState", typestore=typestore
        )
        writer.write(connection, 5, state(5))


def test_a_bag_of_rosbags_is_read(tmp_path):
    rosbags_bag(tmp_path / "bag", StoragePlugin.MCAP)
    with Recording(tmp_path / "bag") as recording:
        assert recording.complete
        assert list(recording.messages(JOINT_STATES)) == [(JOINT_STATES, 5, state(5))]


def test_topics_are_found_by_type_and_last_part(tmp_path):
    with Recorder(tmp_path / "bag") as recorder:
        for topic, type_name in {
            "/one/joint_states": "sensor_msgs/msg/JointState",
            "/one/control_force": "geometry_msgs/msg/WrenchStamped",
            "/one/applied_disturbance": "geometry_msgs/msg/WrenchStamped",
            "/two/applied_disturbance": "geometry_msgs/msg/WrenchStamped",
            "/limit_cycle/frequency": "std_msgs/msg/Float64",
            "/joint_states": "std_msgs/msg/Float64",
        }.items():
            recorder.add_topic(topic, type_name, QOS)
    with Recording(tmp_path / "bag") as recording:
        wrench = "geometry_msgs/msg/WrenchStamped"
        find = recording.topic_of_type
        assert find("sensor_msgs/msg/JointState", "joint_states") == "/one/joint_states"
        assert find(wrench, "control_force") == "/one/control_force"
        assert find(wrench, "two/applied_disturbance") == "/two/applied_disturbance"
        assert find(wrench, "/one/control_force") == "/one/control_force"
        assert find("std_msgs/msg/Float64", "frequency") == "/limit_cycle/frequency"
        assert find("std_msgs/msg/Float64", "joint_states") == "/joint_states"
        with pytest.raises(BagError, match="2 topics 'applied_disturbance'"):
            find(wrench, "applied_disturbance")
        with pytest.raises(BagError, match=r"no topics 'force'.*/one/control_force \(geometry"):
            find(wrench, "force")


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("nothing", "does not exist"),
        ("empty", "holds no .mcap file"),
        ("file.txt", "not an MCAP file"),
        ("empty.mcap", "not an MCAP file"),
        ("truncated.mcap", "not an MCAP file"),
        ("sqlite", "stored as sqlite3"),
        ("sqlite/sqlite.db3", "stored as sqlite3"),
        ("file.txt/bag", "does not exist"),
        ("nul\0nul", "does not exist"),
        ("long" * 100, "does not exist"),
        ("directory", "cannot be opened"),
    ],
)
def test_what_is_no_bag_is_refused(tmp_path, name, complaint):
    rosbags_bag(tmp_path / "sqlite", StoragePlugin.SQLITE3)
    (tmp_path / "empty").mkdir()
    (tmp_path / "directory" / "directory.mcap").mkdir(parents=True)
    (tmp_path / "file.txt").write_text("not a bag, but longer than a bag's beginning")
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "truncated.mcap").write_bytes(b"\x89MCAP")
    with pytest.raises(BagError, match=complaint):
        Recording(tmp_path / name)
