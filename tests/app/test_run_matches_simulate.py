"""Nodes in lockstep give what `stickslip simulate` does, bit for bit."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.record.reader import Recording
from tests.app.conftest import Run

LATE = "-p washout_controller.start_after=1.0 --duration 1.5"
ENCODER = (
    "-p plant.sensor.position_resolution=1e-6 -p plant.sensor.position_noise=1e-7 "
    "-p plant.sensor.velocity=difference -p plant.sensor.difference_samples=4 "
)
DRIVE = (
    "-p plant.sensor.seed=3 "
    "-p plant.actuator.limit=100 -p plant.actuator.resolution=0.5 "
    "-p plant.actuator.time_constant=0.001"
)
RUNS: Mapping[str, str] = {
    "moving belt": "feed_profile --duration 1.8",
    "load": "vibrating_load --duration 1.8",
    "no spring": "axis -p plant.initial.position=1e-3 --duration 1.5",
    "motor": "feed_drive_motor -p plant.motor.sensor.position_resolution=1e-6 --duration 1.5",
    "bristles": f"feed_drive -p plant.friction.law=lugre {LATE}",
    "sensor and actuator": f"feed_drive {ENCODER} {DRIVE} {LATE}",
}
"""In one process; test_reproducible.py compares it with several."""
SLOW = (
    "-p plant.rate=1kHz -p plant.answer_every=10 -p plant.force_delay=3.5ms "
    "-p plant.initial.position=0.3mm "
    "-p washout_controller.start_after=0 -p washout_controller.cubic_gain=0 --duration 1.2"
)
QUICK = {"moving belt", "sensor and actuator"}


@pytest.mark.process
def test_a_slower_controller_acts_alike_over_topics_and_in_simulate_and_as_theory_says(
    stickslip: Run, tmp_path: Path
) -> None:
    """It answers each tenth sample, after 3.5 ms; the deviation decays by the spectral radius."""
    drive = f"feed_drive {SLOW}".split()
    run = stickslip.json("run", *drive, "--composed", "--pace", "lockstep", "--bag", "bag")
    assert (run["lost_samples"], run["late_forces"], run["samples"]) == (0, 0, 1201)
    assert run["report"]["dropped_forces"] == 0
    stickslip.json("simulate", *drive, "--out", "motion.csv")
    table = np.genfromtxt(tmp_path / "motion.csv", delimiter=",", names=True)
    with Recording(tmp_path / "bag") as recording:
        states, forces = recording.joint_states, recording.control_forces
    assert states.position.tolist() == table["position"].tolist()
    assert forces.force.tolist() == table["control_force"][::10].tolist()
    assert forces.stamp.tolist() == states.stamp[::10].tolist()
    assert (table["control_force"][9::10] == table["control_force"][:-1:10]).all()
    theory = stickslip.json("stability", *drive[:-2])
    deviation = states.position[400::10] - theory["equilibrium_position"]
    before = np.column_stack([deviation[1:-1], deviation[:-2]])
    _, product = np.linalg.lstsq(before, deviation[2:])[0]
    assert np.sqrt(-product) == pytest.approx(theory["sampled_loop"]["spectral_radius"], rel=1e-3)


@pytest.mark.process
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.long] * (name not in QUICK)) for name in RUNS]
)
def test_nodes_in_lockstep_give_what_simulate_does(
    stickslip: Run, tmp_path: Path, name: str
) -> None:
    drive = RUNS[name].split()
    truth = ("--composed", "--pace", "lockstep", "-p", "plant.publish_truth=true")
    run = stickslip.json("run", *drive, *truth, "--bag", "bag")
    assert (run["lost_samples"], run["late_forces"]) == (0, 0)
    simulated = stickslip.json("simulate", *drive, "--out", "motion.csv")
    table = np.genfromtxt(tmp_path / "motion.csv", delimiter=",", names=True)
    with Recording(tmp_path / "bag") as recording:
        told, true = recording.joint_states, recording.true_joint_states
        commands, applied = recording.control_forces, recording.applied_forces
        stick_speed = recording.metadata("stickslip_ros/analyzer")["stick_speed"]
    assert len(true) == len(told) == len(table) == run["samples"] > 1500
    assert (told.stamp - told.stamp[0]).tolist() == np.rint(1e9 * table["time"]).tolist()
    for column in ("position", "velocity", "friction_force", "belt_position", "belt_velocity"):
        assert getattr(true, column).tolist() == table[column].tolist(), column
    measured = "measured_" if "sensor" in name else ""
    assert told.position.tolist() == table[f"{measured}position"].tolist()
    assert told.velocity.tolist() == table[f"{measured}velocity"].tolist()
    assert commands.force.tolist() == table["control_force"].tolist()
    if measured:
        assert simulated["truth"]["regime"] == "stick_slip"
        assert 50.0 < np.abs(applied.force).max() <= 100.0 < np.abs(commands.force).max()
    assert (stick_speed == "0.0004") == (name == "bristles")
    found = stickslip.json("report", "bag")
    for measure in ("amplitude", "period", "stick_fraction", "regime"):
        assert found[measure] == run["report"][measure], measure
        if measured:
            assert found[measure] == simulated[measure], measure
