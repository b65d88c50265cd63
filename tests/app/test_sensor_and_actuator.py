"""Sensors and actuators through commands, nodes, bags and studies."""

import numpy as np
import pytest

import stickslip_ros as ss


def test_python_has_truth_and_what_is_told() -> None:
    run = ss.simulate(
        ss.scenario("feed_drive", sensor_position_resolution=1e-4, sensor_velocity="difference"),
        duration=1.0,
    )
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


@pytest.mark.long
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
    """It stays within the limit of the actuator, even if the controller has none."""
    encoder = {"sensor_position_resolution": 1e-6, "sensor_velocity": "difference"}
    scenario = ss.scenario("feed_drive", **encoder, actuator_limit=200.0)
    (check,) = ss.design(scenario, belt_speed=(0.03, 0.03)).checks
    assert 0.0 < check.rest.amplitude < 5e-6
    assert 0.0 < check.rest.rms_force < check.rest.peak_force
    assert check.settling_time is not None
    assert check.peak_force < 200.0


@pytest.mark.long
def test_a_design_with_a_difference_over_more_samples_and_with_a_coarse_actuator() -> None:
    """By rounding, a difference over more samples gives less force."""
    encoder = {"sensor_position_resolution": 1e-6, "sensor_velocity": "difference"}
    forces: list[float] = []
    for spans in (1, 8):
        scenario = ss.scenario("feed_drive", **encoder, sensor_difference_samples=spans)
        (check,) = ss.design(scenario, belt_speed=(0.03, 0.03)).checks
        forces.append(check.rest.peak_force)
    assert forces[1] < 0.3 * forces[0]
    coarse = ss.scenario("feed_drive", actuator_limit=200.0, actuator_resolution=20.0)
    remark = ss.design(coarse, belt_speed=(0.04, 0.04)).remark
    assert "does not decay to 1 % with the noise and rounding of sensor and actuator" in remark
    (check,) = ss.design("feed_drive", belt_speed=(0.03, 0.03)).checks
    assert check.rest is None
