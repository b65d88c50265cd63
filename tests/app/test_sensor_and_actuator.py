"""Sensors and actuators through commands, nodes, bags and studies."""

import json
from pathlib import Path

import numpy as np
import pytest

import stickslip_ros as ss
from stickslip_ros.bags.reader import Recording
from tests.app.conftest import Run

ROUGH = {
    "plant.sensor.position_resolution": "1e-6",
    "plant.sensor.position_noise": "1e-7",
    "plant.sensor.velocity": "difference",
    "plant.sensor.difference_samples": "4",
    "plant.sensor.seed": "3",
    "plant.actuator.limit": "100",
    "plant.actuator.resolution": "0.5",
    "plant.actuator.time_constant": "0.001",
    "washout_controller.start_after": "1.0",
}
OPTIONS = [f"-p={name}={value}" for name, value in ROUGH.items()]


@pytest.mark.process
@pytest.mark.parametrize("how", ["--composed", "processes"])
def test_nodes_in_lockstep_give_what_simulate_does(
    stickslip: Run, tmp_path: Path, how: str
) -> None:
    given = ["feed_drive", *OPTIONS, "--duration", "1.5"]
    nodes = ["--composed"] if how == "--composed" else []
    truth = "-p=plant.publish_truth=true"
    done = stickslip("run", *given, truth, "--pace", "lockstep", "--bag", "bag", "--json", *nodes)
    assert done.returncode == 0, done.stderr
    simulated = stickslip("simulate", *given, "--out", "motion.csv", "--json")
    assert simulated.returncode == 0, simulated.stderr
    table = np.genfromtxt(tmp_path / "motion.csv", delimiter=",", names=True)
    with Recording(tmp_path / "bag") as recording:
        told, true = recording.joint_states, recording.true_joint_states
        commands, applied = recording.control_forces, recording.applied_forces
    assert told.position.tolist() == table["measured_position"].tolist()
    assert told.velocity.tolist() == table["measured_velocity"].tolist()
    for name in ("position", "velocity", "friction_force", "belt_position"):
        assert getattr(true, name).tolist() == table[name].tolist(), name
    assert commands.force.tolist() == table["control_force"].tolist()
    assert np.abs(commands.force).max() > 100.0
    assert 50.0 < np.abs(applied.force).max() <= 100.0
    assert len(applied) == len(true) == len(told)
    report = json.loads(done.stdout)["report"]
    again = json.loads(stickslip("report", "bag", "--json").stdout)
    found = json.loads(simulated.stdout)
    for name in ("amplitude", "period", "stick_fraction", "regime"):
        assert report[name] == again[name] == found[name], name
    assert found["truth"]["regime"] == "stick_slip"


@pytest.mark.parametrize(
    ("override", "part"),
    [("sensor.position_noise=1e-6", "sensor"), ("actuator.limit=300", "actuator")],
)
def test_continuous_control_has_neither(stickslip: Run, override: str, part: str) -> None:
    done = stickslip("simulate", "feed_drive", "-p", f"plant.{override}", "--continuous-control")
    assert (done.returncode, done.stdout) == (2, "")
    name = override.partition("=")[0]
    assert f"plant.{name} = " in done.stderr
    assert f"is refused: continuous control has no {part}" in done.stderr
    assert done.stderr.count("\n") == 1


def test_off_they_change_no_bit(stickslip: Run) -> None:
    """Also with constants that have no effect on their own."""
    plain = stickslip("simulate", "feed_drive", "--duration", "1", "--json")
    idle = ["-p=plant.sensor.seed=5", "-p=plant.sensor.difference_samples=3"]
    again = stickslip("simulate", "feed_drive", "--duration", "1", "--json", *idle)
    one, other = json.loads(plain.stdout), json.loads(again.stdout)
    assert other["truth"] is None
    for name in ("amplitude", "period", "stick_fraction", "velocity_amplitude"):
        assert one[name] == other[name]


def test_python_has_truth_and_what_is_told() -> None:
    run = ss.simulate(
        ss.scenario("feed_drive", sensor_position_resolution=1e-4, sensor_velocity="difference"),
        duration=1.0,
    )
    assert run.truth is not None
    assert run.truth.amplitude == ss.simulate("feed_drive", duration=1.0).measures.amplitude
    table = run.to_pandas()
    told = table["measured_position"].to_numpy()
    assert told == pytest.approx(table["position"].to_numpy(), abs=0.5001e-4)
    assert told / 1e-4 == pytest.approx(np.rint(told / 1e-4), abs=1e-9)
    assert table.attrs["units"]["measured_velocity"] == "m/s"
    assert repr(run).splitlines()[1].split() == ["measured", "true"]


def test_a_study_measures_the_motion() -> None:
    """The sensor acts through the control only."""
    rough = ss.scenario("feed_drive", sensor_position_resolution=1e-4, expects_control=False)
    plain = ss.scenario("feed_drive", expects_control=False)
    speeds = {"belt_speed": (0.03, 0.04, 2)}
    found = [ss.sweep(each, transient=20.0, **speeds).to_pandas() for each in (rough, plain)]
    assert found[0]["amplitude"].tolist() == found[1]["amplitude"].tolist()


def test_the_washout_holds_the_drive_with_an_encoder_and_not_with_a_slow_actuator() -> None:
    given = {"sensor_position_resolution": 1e-6, "sensor_velocity": "difference"}
    held = {**given, "actuator_time_constant": 1e-3}
    lost = {**given, "actuator_time_constant": 0.03}
    amplitudes = {}
    for name, values in (("held", held), ("lost", lost)):
        scenario = ss.scenario("feed_drive", start_after=0.0, **values)
        found = ss.sweep(scenario, transient=100.0, belt_speed=(0.04, 0.041, 2)).to_pandas()
        amplitudes[name] = found["amplitude"].max()
    assert amplitudes["held"] < 2e-6
    assert amplitudes["lost"] > 1e-4


def test_stability_has_lag_and_difference_and_says_what_it_omits() -> None:
    scenario = ss.scenario("feed_drive")
    plain = ss.stability(scenario)
    given = {"sensor_velocity": "difference", "sensor_difference_samples": 8}
    slow = ss.stability(ss.scenario(scenario, **given, actuator_time_constant=1e-3))
    rough = ss.stability(ss.scenario(scenario, **given, sensor_position_resolution=1e-6))
    gains = [each.sampled_loop["stable_linear_gains"][0][0] for each in (plain, slow)]
    assert abs(gains[1]) < 0.5 * abs(gains[0])
    assert "sampled_loop" not in slow.notes
    omitted = "sensor.position_resolution is omitted: the loop is linear here"
    assert rough.notes["sampled_loop"] == omitted
    assert slow.notes["closed_loop"].startswith("sensor and actuator are omitted")


def test_a_design_is_tried_with_them_and_tells_what_they_leave() -> None:
    """A difference over more samples gives less force by rounding."""
    given = {"sensor_position_resolution": 1e-6, "sensor_velocity": "difference"}
    forces: list[float] = []
    for spans in (1, 8):
        scenario = ss.scenario("feed_drive", **given, sensor_difference_samples=spans)
        proposal = ss.design(scenario, belt_speed=(0.03, 0.03))
        (check,) = proposal.checks
        assert check.rest is not None
        assert 0.0 < check.rest.amplitude < 5e-6
        assert 0.0 < check.rest.rms_force < check.rest.peak_force
        assert check.settling_time is not None
        forces.append(check.rest.peak_force)
    assert forces[1] < 0.3 * forces[0]
    (check,) = ss.design("feed_drive", belt_speed=(0.03, 0.03)).checks
    assert check.rest is None


def test_a_design_stays_within_the_limit_of_the_actuator() -> None:
    """Even where the controller has none, or a larger one."""
    scenario = ss.scenario("feed_drive", actuator_limit=200.0, actuator_resolution=0.5)
    (check,) = ss.design(scenario, belt_speed=(0.04, 0.04)).checks
    assert check.settling_time is not None
    assert check.peak_force is not None
    assert check.peak_force < 200.0
    coarse = ss.scenario(scenario, actuator_resolution=20.0)
    remark = ss.design(coarse, belt_speed=(0.04, 0.04)).remark
    assert "does not decay to 1 % with the noise and rounding of sensor and actuator" in remark
