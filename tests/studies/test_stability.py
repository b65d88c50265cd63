"""The theory of a scenario under any control law, and the reasons for what it lacks."""

from dataclasses import replace

import pytest

from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.show.stability_figure import why_no_figure
from stickslip_ros.show.study_tables import stability_tables
from stickslip_ros.studies.stability import Notes, Section, stability
from stickslip_ros.theory.hopf import hopf_points
from stickslip_ros.theory.linear import expand
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop
from tests.drives import FEED_DRIVE

ONLY = "this exists for the washout law only, and the control law is velocity_feedback"
GAINS = ("critical_linear_gain", "first_lyapunov_coefficient", "critical_cubic_gain")


@pytest.fixture
def damped() -> Scenario:
    gain = ["velocity_feedback_controller.velocity_gain=-1000"]
    return load_scenario("feed_drive", controller="velocity_feedback").overridden(gain)


def test_velocity_feedback_has_a_theory_without_gains(damped: Scenario) -> None:
    found, notes = stability(damped)
    closed, sampled = found["closed_loop"], found["sampled_loop"]
    more = replace(FEED_DRIVE, damping=FEED_DRIVE.damping + 1000.0)
    expansion = expand(more)
    expected = expansion.eigenvalues * more.angular_frequency
    assert closed["eigenvalues"] == pytest.approx(expected, rel=1e-10)
    assert closed["hopf_speeds"] == pytest.approx([point.belt_speed for point in hopf_points(more)])
    assert closed["hopf_speeds"][0] < found["open_loop"]["hopf_speeds"][0]
    loop = LinearSampledLoop.from_drive(FEED_DRIVE, 1000.0)
    assert sampled["spectral_radius"] == loop.spectral_radius(damped.controller.control_law)
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


def test_a_law_without_equations_says_so() -> None:
    sharp = ["sliding_mode_controller.boundary_layer=0"]
    found, notes = stability(load_scenario("feed_drive", sharp, controller="sliding_mode"))
    assert "the control law sliding_mode has no equations" in notes["closed_loop"]
    assert notes["sampled_loop"].startswith("the control law sliding_mode is not linear near")
    assert set(found["sampled_loop"].values()) == {None}
    assert found["closed_loop"]["eigenvalues"] is None
    assert found["open_loop"]["limit_cycles"]


def test_the_equilibrium_under_control_is_told_beside_that_without() -> None:
    gain = ["velocity_feedback_controller.position_gain=-200000"]
    scenario = load_scenario("feed_drive", gain, controller="velocity_feedback")
    found, notes = stability(scenario)
    drive = scenario.plant.as_drive()
    assert found["open_loop"]["equilibrium_position"] == drive.equilibrium_position
    closed = drive.equilibrium_position * drive.stiffness / (drive.stiffness + 200000.0)
    assert found["closed_loop"]["equilibrium_position"] == pytest.approx(closed)
    shown = "\n".join(str(part) for part in _lines(scenario, found, notes))
    assert "258.4 µm" in shown
    assert "215.3 µm" in shown
    assert "growth rate" in shown
    assert "decay rate" not in shown
    lowest = found["sticking"]["searched_speeds"][0]
    assert found["sticking"]["speed_ranges"][0][0] == lowest
    assert f"up to 43.95 mm/s (searched from {1e3 * lowest:.4g} mm/s)" in shown


def _lines(scenario: Scenario, found: Section, notes: Notes) -> list[str]:
    tables = stability_tables(scenario, found, notes)
    return [line for part in tables if not isinstance(part, str) for line in part.lines()]


def test_the_table_has_what_there_is_and_what_a_lyapunov_coefficient_means() -> None:
    scenario = load_scenario("feed_drive", ["plant.expects_control=false"])
    found, notes = stability(scenario)
    lines = _lines(scenario, found, notes)
    assert not [line for line in lines if line.endswith("-")]
    assert "sampled loop" not in lines
    said = [part for part in stability_tables(scenario, found, notes) if isinstance(part, str)]
    assert any(each.endswith(": the scenario has no controller") for each in said)
    gentle = "-0.225 (no hysteresis: the vibration starts gently)"
    assert [line.endswith(gentle) for line in lines if "Lyapunov" in line] == [True]
    found["open_loop"]["first_lyapunov_coefficients"] = [0.5, None]
    jump = "0.5 (hysteresis: the vibration starts with a jump), -"
    assert any(line.endswith(jump) for line in _lines(scenario, found, notes))
