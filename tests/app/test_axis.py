"""The scenario `axis`, and any other drive without a spring, in the commands."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import stickslip_ros as ss
from stickslip_ros.bags.reader import Recording
from tests.app.conftest import Run


def found(stickslip: Run, *arguments: str) -> Any:
    done = stickslip(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    assert "nan" not in done.stdout.lower()
    return json.loads(done.stdout)


def test_the_servo_gives_way_by_what_exceeds_the_friction(stickslip: Run, tmp_path: Path) -> None:
    measures = found(stickslip, "simulate", "axis", "--plot", "axis.png")
    # The largest force less the mean friction, over the gain of the position.
    amplitude = (60.0 - (20.144 + 20.6277) / 2.0) / 1370728.4554
    assert measures["amplitude"] == pytest.approx(amplitude, rel=0.01)
    assert measures["period"] == pytest.approx(1.0, rel=1e-9)
    assert (measures["regime"], measures["steady"]) == ("stick_slip", True)
    assert (tmp_path / "axis.png").stat().st_size > 10_000


def test_the_bias_force_is_all_that_friction_holds_without_control(stickslip: Run) -> None:
    still = ("simulate", "axis", "--no-control", "-p", "plant.disturbance.kind=none")
    measures = found(stickslip, *still)
    assert (measures["regime"], measures["midpoint"]) == ("stuck", 0.0)
    done = stickslip(*still, "-p", "plant.bias_force=20.2")
    assert "regime              no whole cycle" in done.stdout
    assert "neither turned back twice nor settled" in done.stdout


@pytest.mark.process
def test_nodes_in_lockstep_give_what_simulate_does(stickslip: Run, tmp_path: Path) -> None:
    arguments = ("axis", "-p", "plant.initial.position=1e-3", "--duration", "3")
    run = found(stickslip, "run", *arguments, "--composed", "--bag", "bag")
    assert (run["lost_samples"], run["late_forces"]) == (0, 0)
    simulated = ss.simulate(ss.scenario("axis", initial_position=1e-3), duration=3).trajectory
    with Recording(tmp_path / "bag") as recording:
        states = recording.joint_states
    assert len(states) == 3001
    assert states.position.tolist() == simulated.position.tolist()
    assert states.velocity.tolist() == simulated.velocity.tolist()
    assert states.friction_force.tolist() == simulated.friction_force.tolist()
    report = found(stickslip, "report", "bag", "--plot", "bag.png")
    assert report["regime"] == "stick_slip"


def test_a_sweep_measures_the_forced_cycles(stickslip: Run) -> None:
    over = "plant.disturbance.amplitude=10:60:2"
    points = found(stickslip, "sweep", "axis", "--over", over)
    assert points["regime"] == ["stuck", "stick_slip"]
    assert points["amplitude"] == pytest.approx([0.0, 28.98e-6], rel=1e-3)
    still, moving = ([round(each, 12) for each in turns] for turns in points["turning_points"])
    assert (len(set(still)), len(set(moving))) == (1, 2)
    assert len(moving) < 40  # a rest is one turning point


def test_a_basin_of_given_starts(stickslip: Run, tmp_path: Path) -> None:
    starts = ("--position", "-1e-3:1e-3:2", "--velocity", "-0.01:0.01:2")
    basins = found(stickslip, "basin", "axis", *starts, "--plot", "basin.png")
    (attractor,) = basins["attractors"]
    assert (attractor["regime"], attractor["count"]) == ("stick_slip", 4)
    assert (tmp_path / "basin.png").exists()


LOOSE = ("feed_drive", "-p", "plant.stiffness=0")
FREE = "needs a spring: the drive has stiffness = 0 N/m"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("stability", "axis"), FREE),
        (("stability", *LOOSE), FREE),
        (("design", *LOOSE, "--belt-speed", "0.02:0.04"), FREE),
        (("basin", "axis"), "without a spring no range of starts follows from the drive"),
        (("simulate", *LOOSE), "plant.duration = inf s is refused: must be finite and above 0 s"),
        (
            ("sweep", *LOOSE, "--over", "plant.damping=1:2:2"),
            "because a drive without a spring has no natural period",
        ),
        (("simulate", "axis", "-p", "plant.stiffness=1e-31"), "must be 0 or at least 1e-30"),
    ],
)
def test_what_needs_a_spring_says_so(
    stickslip: Run, arguments: Sequence[str], sentence: str
) -> None:
    done = stickslip(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert sentence in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("flags", [(), ("--continuous-control",), ("--no-control",)])
def test_a_drive_on_a_belt_goes_with_it(stickslip: Run, flags: Sequence[str]) -> None:
    loose = ("simulate", *LOOSE, "--duration", "2", "--plot", "loose.png")
    done = stickslip(*loose, *flags)
    assert done.returncode == 0, done.stderr
    assert "no whole cycle was completed in 2 s: " in done.stdout
