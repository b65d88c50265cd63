"""The theory of a scenario under any control law, and the reasons for what it lacks."""

from dataclasses import replace

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.control import CONTROL_LAWS
from stickslip_ros.physics.theory.hopf import hopf_points
from stickslip_ros.physics.theory.linear import expand
from stickslip_ros.physics.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.scenarios.parameters import controller_model
from stickslip_ros.studies.design import Task
from stickslip_ros.studies.stability import stability, why_no_figure
from tests.physics.drives import FEED_DRIVE
from tests.physics.parts import Switching

ONLY = "this exists for the washout law only, and the control law is velocity_feedback"
GAINS = ("critical_linear_gain", "first_lyapunov_coefficient", "critical_cubic_gain")


@pytest.fixture
def damped() -> Scenario:
    gain = ["velocity_feedback_controller.velocity_gain=-1000"]
    return load_scenario("feed_drive", controller="velocity_feedback").overridden(gain)


@pytest.fixture
def switching(monkeypatch: pytest.MonkeyPatch) -> Scenario:
    monkeypatch.setitem(CONTROL_LAWS, Switching.name, Switching)
    return replace(load_scenario("feed_drive"), controller=controller_model(Switching)())


def test_velocity_feedback_has_a_theory_without_gains(damped: Scenario) -> None:
    found, notes = stability(damped)
    closed, sampled = found["closed_loop"], found["sampled_loop"]
    more = replace(FEED_DRIVE, damping=FEED_DRIVE.damping + 1000.0)
    expansion = expand(more)
    assert expansion is not None
    expected = expansion.eigenvalues * more.angular_frequency
    assert closed["eigenvalues"] == [
        pytest.approx([value.real, value.imag], rel=1e-10) for value in expected
    ]
    assert closed["hopf_speeds"] == pytest.approx([point.belt_speed for point in hopf_points(more)])
    assert closed["hopf_speeds"][0] < found["open_loop"]["hopf_speeds"][0]
    loop = LinearSampledLoop.from_drive(FEED_DRIVE, 1000.0)
    assert loop is not None
    assert sampled["spectral_radius"] == loop.spectral_radius(damped.controller.as_law())
    assert sampled["decay_rate"] == pytest.approx(-expected[0].real, rel=0.1)
    assert sampled["stable"] is closed["stable"]
    assert all(closed[name] is None for name in GAINS)
    assert (sampled["critical_linear_gain"], sampled["stable_linear_gains"]) == (None, None)
    for name in GAINS:
        assert notes[f"closed_loop.{name}"] == ONLY
    for name in ("critical_linear_gain", "stable_linear_gains"):
        assert notes[f"sampled_loop.{name}"] == ONLY
    assert "critical_linear_gain" not in found["closed_forms"]
    assert why_no_figure(damped) == ONLY


def test_the_cycle_that_little_feedback_leaves(damped: Scenario) -> None:
    gain = ["velocity_feedback_controller.velocity_gain=-200"]
    found, notes = stability(damped.overridden(gain))
    (cycle,) = found["closed_loop"]["limit_cycles"]
    assert cycle["stable"]
    assert 0.0 < cycle["amplitude"] < found["open_loop"]["limit_cycles"][0]["amplitude"]
    assert "closed_loop.limit_cycles" not in notes


def test_a_law_without_equations_says_so(switching: Scenario) -> None:
    found, notes = stability(switching)
    assert "the control law switching has no equations" in notes["closed_loop"]
    assert notes["sampled_loop"] == ("the control law switching is not linear near the equilibrium")
    assert set(found["sampled_loop"].values()) == {None}
    assert found["closed_loop"]["eigenvalues"] is None
    assert found["open_loop"]["limit_cycles"]


def test_a_design_refuses_another_law_by_name(damped: Scenario) -> None:
    with pytest.raises(InvalidInputError) as refused:
        Task.from_scenario(damped)
    assert str(refused.value) == (
        "control law = velocity_feedback is refused: must be washout, whose gains a design proposes"
    )
