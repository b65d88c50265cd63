"""Drives with courses and measured curves, through commands, nodes and bags."""

from pathlib import Path

import pytest

import stickslip_ros as ss
from stickslip_ros.bags.reader import Recording
from tests.app.conftest import Run


@pytest.mark.process
@pytest.mark.parametrize("how", ["composed", "processes"])
@pytest.mark.parametrize("scenario", ["feed_profile", "vibrating_load"])
def test_nodes_in_lockstep_give_what_simulate_does(
    stickslip: Run, tmp_path: Path, scenario: str, how: str
) -> None:
    arguments = (scenario, "--pace", "lockstep", "--duration", "1.8", "--bag", "bag", "--json")
    done = stickslip("run", *arguments, *(["--composed"] if how == "composed" else []))
    assert done.returncode == 0, done.stderr
    simulated = ss.simulate(scenario, duration=1.8).trajectory
    with Recording(tmp_path / "bag") as recording:
        states = recording.joint_states
    assert len(states) == len(simulated)
    for name in ("position", "velocity", "friction_force", "belt_position", "belt_velocity"):
        assert getattr(states, name).tolist() == getattr(simulated, name).tolist(), name
    assert len(set(simulated.belt_velocity.tolist())) > (100 if scenario == "feed_profile" else 0)


def test_a_file_that_has_vanished_is_refused_in_one_line(stickslip: Run, tmp_path: Path) -> None:
    (tmp_path / "belt.csv").write_text("0,0\n0.3,0\n0.5,0.005\n")
    moving = ("-p", "plant.belt.kind=table", "-p", "plant.belt.file=belt.csv")
    arguments = ("simulate", "feed_drive", *moving, "--duration", "0.6", "--json")
    assert stickslip(*arguments).returncode == 0
    (tmp_path / "belt.csv").unlink()
    refused = stickslip(*arguments)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr.endswith(
        "is refused: the file cannot be read: No such file or directory\n"
    )
    assert refused.stderr.count("\n") == 1
