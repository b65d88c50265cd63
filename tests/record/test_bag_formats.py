"""Bags of other formats, as rosbags writes them: what is read of them, and what is refused."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores, get_typestore

from stickslip_ros.errors import BagError
from stickslip_ros.record import bag_formats
from stickslip_ros.record.reader import Recording
from tests.record.test_reader import JOINT_STATES, rosbags_bag, state

STAMP, POSITION = 3_000_000_007, 1.25e-3


def _sqlite(path: Path) -> Path:
    rosbags_bag(path, StoragePlugin.SQLITE3)
    return path


def _ros_1(path: Path) -> Path:
    types = get_typestore(Stores.ROS1_NOETIC)
    kind = types.types["sensor_msgs/msg/JointState"]
    header = types.types["std_msgs/msg/Header"]
    time = types.types["builtin_interfaces/msg/Time"](*divmod(STAMP, 10**9))
    none = np.array([])
    message = kind(header(1, time, ""), ["table"], np.array([POSITION]), none, none)
    path = path.with_suffix(".bag")
    with Writer(path) as writer:
        connection = writer.add_connection("/joint_states", kind.__msgtype__, typestore=types)
        writer.write(connection, STAMP, types.serialize_ros1(message, kind.__msgtype__))
    return path


@pytest.mark.process
def test_a_bag_of_sqlite_is_read_by_its_directory_and_by_its_file(tmp_path: Path) -> None:
    bag = _sqlite(tmp_path / "bag")
    for path in (bag, next(bag.glob("*.db3"))):
        with Recording(path) as recording:
            assert recording.complete
            assert list(recording.messages(JOINT_STATES)) == [(JOINT_STATES, 5, state(5))]


@pytest.mark.process
def test_a_bag_of_ros_1_has_the_same_stamps_and_positions(tmp_path: Path) -> None:
    with Recording(_ros_1(tmp_path / "bag")) as recording:
        assert recording.joint_states.stamp.tolist() == [STAMP]
        assert recording.joint_states.position.tolist() == [POSITION]


@pytest.mark.process
@pytest.mark.parametrize("write", [_sqlite, _ros_1])
def test_a_damaged_bag_is_refused_in_a_sentence(
    write: Callable[[Path], Path], tmp_path: Path
) -> None:
    path = write(tmp_path / "bag")
    path = next(path.glob("*.db3")) if path.is_dir() else path
    content = path.read_bytes()
    path.write_bytes(content[:60] + content[200:])
    with pytest.raises(BagError, match="cannot be converted") as refused:
        Recording(path)
    assert "\n" not in str(refused.value)


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.convert.cli", None)
    monkeypatch.setattr("resource.setrlimit", lambda *_: None)
    with pytest.raises(SystemExit, match="install rosbags"):
        bag_formats._main(Path("bag"), Path("mcap"))
