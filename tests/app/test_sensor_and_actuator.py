"""Sensors and actuators in Python: what they tell, and what a design leaves with them."""

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
def test_a_design_with_a_coarse_actuator() -> None:
    coarse = ss.scenario("feed_drive", actuator_limit=200.0, actuator_resolution=20.0)
    remark = ss.design(coarse, belt_speed=(0.04, 0.04)).remark
    assert "does not decay to 1 % with the noise and rounding of sensor and actuator" in remark
    (check,) = ss.design("feed_drive", belt_speed=(0.03, 0.03)).checks
    assert check.rest is None
