"""`stickslip set`, on nodes that run."""

import signal
import time
from pathlib import Path

import pytest

from stickslip_ros.record.reader import Recording
from tests.app.conftest import Run, Start
from tests.nodes.graph import PATIENCE


def test_parameters_of_running_nodes_are_set_or_refused(
    stickslip: Run, start_stickslip: Start, tmp_path: Path
) -> None:
    run = start_stickslip("run", "paper", "--composed", "--pace", "realtime", "--bag", "bag")
    deadline = time.monotonic() + PATIENCE
    while True:
        done = stickslip("set", "plant.belt_speed=0.3", "washout_controller.linear_gain=-0.5")
        if done.returncode == 0 or time.monotonic() > deadline:
            break
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "/feed_drive/plant: belt_speed = 0.3 m/s",
        "/feed_drive/washout_controller: linear_gain = -0.5 N s/m",
    ]

    refused = stickslip("set", "plant.belt_speed=0.2", "plant.friction.static=0.1")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "/feed_drive/plant: friction.minimum = 0.25 must not exceed" in refused.stderr

    idle = stickslip("set", "plant.friction.viscous=0.5")
    assert (idle.returncode, idle.stdout) == (0, "/feed_drive/plant: friction.viscous = 0.5 s/m\n")
    assert "friction.viscous is not used by the law stribeck; laws that use it: " in idle.stderr

    elsewhere = stickslip("set", "--namespace", "other", "plant.belt_speed=0.2")
    assert (elsewhere.returncode, elsewhere.stdout) == (1, "")
    (line,) = elsewhere.stderr.splitlines()
    assert "no node /other/plant is running; running: /feed_drive/plant" in line
    assert "`stickslip run` starts the nodes, --namespace names another namespace" in line

    run.send_signal(signal.SIGINT)
    run.communicate(timeout=PATIENCE)
    with Recording(tmp_path / "bag") as recording:
        speeds = set(recording.joint_states.belt_velocity)
    assert speeds <= {0.4, 0.3}
    assert 0.3 in speeds


@pytest.mark.process  # looks for a while
def test_without_a_node_it_says_how_to_start_one(stickslip: Run) -> None:
    done = stickslip("set", "plant.belt_speed=0.2")
    assert (done.returncode, done.stdout) == (1, "")
    assert "no node /feed_drive/plant is running: `stickslip run` starts the nodes" in done.stderr
