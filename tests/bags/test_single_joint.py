"""Bags of other machines: joint states of a single joint, the belt's speed given."""

from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

import stickslip_ros as ss
from benchmarks.measures_under_noise import motion
from stickslip_ros.bags import Recording
from stickslip_ros.bags.report import report_of_recording
from stickslip_ros.errors import BagError
from stickslip_ros.physics.measures.slips import SlipThreshold
from tests.bags.runs import write_bag

BELT = 0.04


def record(directory: Path, noise: float, *, velocities: bool, name: str = "axis_x") -> Path:
    """Record the motion of feed_drive as a joint of another machine tells it."""
    position, velocity, _ = motion(BELT)
    position = position[:2000] + noise * np.random.default_rng(1).standard_normal(2000)
    messages = []
    for number, (x, v) in enumerate(zip(position.tolist(), velocity.tolist(), strict=False)):
        message = JointState(name=[name], position=[x], velocity=[v] if velocities else [])
        stamp = 10**9 + number * 1_000_000
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        messages.append(("/machine/joint_states", stamp, serialize_message(message)))
    write_bag(directory, messages)
    return directory


@pytest.mark.parametrize(("noise", "velocities"), [(1e-6, False), (0.0, True)])
def test_a_single_joint_is_the_slide(tmp_path: Path, noise: float, velocities: bool) -> None:
    bag = record(tmp_path / "bag", noise, velocities=velocities)
    run = ss.read_bag(bag, belt_speed=BELT, slips=SlipThreshold(1e-4))
    report = run.report
    assert run.measures.regime == report["regime"] == "stick_slip"
    assert (report["samples"], report["complete"]) == (2000, True)
    assert report["stick_fraction"] == pytest.approx(0.1001, abs=2e-3)
    assert report["period"] == pytest.approx(0.0639242, rel=1e-5)
    assert (report["position_noise"] is not None) == (noise > 0.0)
    assert report["slips"]["count"] == pytest.approx(2.0 / 0.0639, abs=1)
    with Recording(bag, belt_speed=BELT) as recording:
        whole = recording.joint_states
        pieces = [block.joint_states for block in recording.blocks()]
    joined = pieces[0].followed_by(*pieces[1:])
    assert joined.velocity == pytest.approx(whole.velocity)
    assert np.all(whole.belt_velocity == BELT)
    if not velocities:
        assert whole.velocity[1:] == pytest.approx(np.diff(whole.position) / 1e-3, rel=1e-6)


def test_without_a_belt_speed_the_reason_is_told(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", 0.0, velocities=True)
    with pytest.raises(BagError, match="or the belt speed must be given for a single joint"):
        report_of_recording(bag)


def test_the_joint_of_our_plant_needs_no_option() -> None:
    reference = Path(__file__).parents[2] / "bags" / "reference"
    assert report_of_recording(reference, belt_speed=1.0) == report_of_recording(reference)
