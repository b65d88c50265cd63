"""Stability and design as objects."""

import sys
from typing import Any

import numpy as np
import pytest

import stickslip_ros as ss
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.comparison import drawn
from tests.theory.closed_forms import CubicLoop

DELAYED = {"force_delay": 0.0025, "actuator_time_constant": 2e-3}
DIFFERENCE = {"sensor_velocity": "difference", "sensor_difference_samples": 3}


@pytest.mark.parametrize(
    ("name", "settings", "states"),
    [
        ("paper", {}, ("x", "y", "control.1")),
        ("feed_drive", DELAYED,
         ("x", "y", "actuator.force", "control.1", "force.1", "force.2", "force.3")),
        ("feed_drive", DIFFERENCE,
         ("x", "y", "control.1", "earlier_x.1", "earlier_x.2", "earlier_x.3")),
        ("feed_drive", {"friction_law": "dahl"}, ("x", "y", "friction.z", "control.1")),
    ],
)  # fmt: skip
def test_the_linear_loops_are_systems_with_the_poles_that_are_reported(
    name: str, settings: dict[str, Any], states: tuple[str, ...]
) -> None:
    scenario = ss.scenario(name, **settings)
    found = ss.stability(scenario)
    sampled, continuous, loop = found.sampled_system, found.continuous_system, found.to_control()
    assert sampled is not None
    assert continuous is not None
    assert sampled.states == states
    assert loop.dt == sampled.sample_period == 1.0 / scenario.plant.rate
    assert loop.nstates == len(states)
    radius = found.sampled_loop["spectral_radius"]
    assert np.abs(loop.poles()).max() == pytest.approx(radius, rel=1e-9)
    assert np.abs(sampled.eigenvalues).max() == pytest.approx(radius, rel=1e-9)
    poles = sorted(continuous.eigenvalues, key=lambda pole: (-pole.real, -pole.imag))
    assert found.closed_loop["eigenvalues"] == pytest.approx(np.array(poles), rel=1e-9)
    # A constant force deflects the spring: the law filters what is constant, and friction has no
    # part in a slide at rest.
    period = sampled.sample_period
    deflection = loop.dcgain()[0, 0]
    assert deflection == pytest.approx(1.0 / scenario.plant.stiffness, rel=1e-6)
    of_continuous = -continuous.C @ np.linalg.solve(continuous.A, continuous.B)
    assert of_continuous[:, 0] == pytest.approx([deflection, 0.0], rel=1e-6, abs=1e-12)
    moved = (sampled.C @ sampled.B)[:, 0]
    pushed = [0.5 * period**2, period] / np.array(scenario.plant.mass)
    assert moved == pytest.approx(pushed, rel=0.05)


def test_without_a_linear_loop_there_is_no_system(monkeypatch: pytest.MonkeyPatch) -> None:
    found = ss.stability(ss.scenario("paper", expects_control=False))
    assert (found.sampled_system, found.continuous_system) == (None, None)
    with pytest.raises(InvalidInputError, match="no linear sampled loop: the scenario has no cont"):
        found.to_control()
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(RunError, match=r"to_control needs control.*stickslip_ros\[analysis\]"):
        ss.stability("paper").to_control()


def test_what_cannot_be_drawn_or_designed_is_refused() -> None:
    scenario = load_scenario("feed_drive", controller="velocity_feedback")
    with pytest.raises(InvalidInputError, match="nothing to draw: this exists for the washout law"):
        ss.stability(scenario).plot()
    for speed in ("fast", (0.01, 0.02, 0.03), (0.05, 0.01), -0.04, ("a", "b")):
        with pytest.raises(InvalidInputError, match=r"belt.speeds? .*must be"):
            ss.design("feed_drive", belt_speed=speed)  # pyright: ignore


def test_the_critical_feed_speed_has_an_interval_for_a_spread_of_the_constants() -> None:
    drive = load_scenario("feed_drive", ["plant.expects_control=false"])
    found = ss.stability(drive, spread=0.5)
    speeds: list[float] = []
    for seed in range(100):
        varied = drive.changed(drawn(drive, seed, 0.5)).plant.as_drive()
        loop = CubicLoop.from_drive(varied)
        assert loop is not None
        speeds.append((loop.hopf_speed or 0.0) * varied.speed_scale)
    interval = np.quantile(speeds, [0.025, 0.975]).tolist()
    assert found.open_loop["critical_feed"]["interval"] == pytest.approx(interval, rel=1e-9)
    without = speeds.count(0.0)
    assert found.open_loop["critical_feed"]["without"] == without
    text = f"in 95 % of 100 drives with constants off by up to 50%; {without} of them have none"
    assert text in str(found)
    assert "critical_feed" not in ss.stability(drive).open_loop
    with pytest.raises(InvalidInputError, match=r"must be from 0 to 0\.9"):
        ss.stability(drive, spread=1.5)
