"""Comparison of control laws: its cases, their outcomes, and that it is resumed."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stickslip_ros as ss
from stickslip_ros.api.comparison import ComparedLaws
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.control import VelocityFeedback
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.studies.case_outcome import Disturbance, Outcome, simulate_case
from stickslip_ros.studies.comparison import Cases, Comparison, Outcomes, compared, drawn
from stickslip_ros.studies.plan import Axis
from stickslip_ros.studies.study import compute

INTERVALS = {0: (0.858, 1.0), 3: (0.676, 0.973), 9: (0.406, 0.812)}
"""Of Clopper and Pearson, 95 %, by the number of 24 cases that are lost."""
LAWS = "washout,velocity_feedback"
GAINS = {
    "washout": {"corner_frequency": 20.0, "linear_gain": -6000.0},
    "velocity_feedback": {"velocity_gain": -6000.0},
}


def feed_drive(*overrides: str) -> Scenario:
    return load_scenario("feed_drive", ["plant.sensor.position_resolution=1e-7", *overrides])


def comparison(seeds: int = 2, **options: Any) -> Comparison:
    scenario = feed_drive()
    texts = ("step", "sine=20N@5Hz")
    found = tuple(Disturbance.parse(text, scenario) for text in texts)
    return Comparison(scenario, Cases(GAINS, None, found, seeds, duration=0.6, **options))


def outcome(scenario: Scenario, disturbance: str = "step", duration: float = 3.0) -> Any:
    parsed = Disturbance.parse(disturbance, scenario)
    disturbed = scenario.changed(parsed.parameters(duration))
    return simulate_case(disturbed, duration, parsed, 0.05)


def test_the_verdict_names_all_laws_that_the_cases_do_not_tell_apart() -> None:
    study = comparison(seeds=12)
    for lost, told in ((0, False), (3, False), (9, True)):
        outcomes = Outcomes(study.plan.size)
        held = np.arange(study.plan.size) >= lost  # of the 24 cases of the washout law
        outcomes.enter(Outcome(k, held=bool(own)) for k, own in enumerate(held))
        found = ComparedLaws(study, outcomes, {})
        *_, worst = found.ranks
        assert worst.held_interval == pytest.approx(INTERVALS[lost], abs=5e-4)
        assert ("washout" in found.verdict) is not told
        every = ", ".join(rank.law for rank in found.ranks) + " hold"
        shown = every if lost == 0 else "velocity_feedback holds"
        assert f"{shown} 100.0% (85.8% to 100.0%)" in found.verdict
        assert ("not told apart" in found.verdict) is not told
        assert found.verdict in str(found)
        printed = found.to_dict()["ranks"][-1]
        assert printed["held_interval"] == [*worst.held_interval]


def test_a_drive_that_is_damped_is_held_and_one_that_is_not_sticks() -> None:
    gain = "velocity_feedback_controller.velocity_gain"
    scenario = load_scenario("feed_drive", [f"{gain}=-3000"], controller="velocity_feedback")
    held = outcome(scenario)
    assert held.held
    assert (held.sticking, held.at_limit) == (0.0, 0.0)
    assert held.rms_velocity < 1e-4
    assert held.set_point == pytest.approx(scenario.plant.as_drive().equilibrium_position, rel=1e-4)
    loose = outcome(scenario.changed({gain: 0.0}))
    assert not loose.held
    assert loose.sticking > 0.05
    assert loose.settling_time is None


def test_a_position_loop_carries_the_mean_friction_apart_from_the_force_beyond_it() -> None:
    node = "pid_controller"
    values = {f"{node}.position_gain": 5e5, f"{node}.integral_gain": 5e6}
    values[f"{node}.velocity_gain"] = 6000.0
    scenario = load_scenario("feed_drive", controller="pid").changed(values)
    found, drive = outcome(scenario), scenario.plant.as_drive()
    friction = drive.stiffness * drive.equilibrium_position
    assert found.held
    assert found.mean_force == pytest.approx(-friction, rel=1e-2)
    assert found.rms_force < 1e-2 * friction
    assert found.set_point == pytest.approx(0.0, abs=2e-6)


def test_positioning_on_a_guide_at_rest_tells_the_final_error() -> None:
    reference = {"kind": "step", "amplitude": 1e-3}
    scenario = load_scenario("axis", controller="pid").changed(
        {f"pid_controller.reference.{name}": value for name, value in reference.items()}
        | {"pid_controller.position_gain": 1e6, "pid_controller.velocity_gain": 1e4}
        | {"pid_controller.integral_gain": 0.0, "plant.bias_force": 0.0}
    )
    found = outcome(scenario, "none", 1.0)
    # PD control stops where friction holds.
    assert 0.0 < found.final_error <= 0.0206277 * 1000.0 / 1e6 + 12e-6
    assert (found.hunting_amplitude, found.hunting_period) == (0.0, None)
    assert found.held


def test_laws_are_ranked_by_the_error_where_the_reference_turns() -> None:
    drive = load_scenario("axis", controller="pid").changed(
        {"plant.disturbance.kind": "none", "pid_controller.reference.kind": "sine"}
        | {"pid_controller.reference.amplitude": 5e-3, "pid_controller.reference.frequency": 1.0}
        | {"pid_controller.position_gain": 1e6, "pid_controller.velocity_gain": 1e4}
    )
    options: Any = {"disturbances": "none", "given": "pid", "duration": 1.9}
    found = ss.compare(drive, "pid,disturbance_observer", rank_by="reversal_height", **options)
    heights = [rank.means["reversal_height"][0] for rank in found.ranks]
    assert 1e-6 < heights[0] < heights[1]
    assert f"{found.ranks[0].law} has the least error at reversals" in found.verdict
    assert "rest at reversals" in str(found)
    found = ss.compare(drive, "pid", rank_by="peak_force", **options)
    assert found.to_dict()["ranks"][0]["reversal_height"] in heights
    found = ss.compare(drive, "pid", rank_by="reversal_height", **options | {"duration": 0.2})
    assert found.verdict == "the error at reversals is not known of any law"
    with pytest.raises(InvalidInputError, match="rank_by = 'rms_velocity' is invalid"):
        ss.compare(drive, "pid", rank_by="rms_velocity", **options)


def test_all_laws_meet_the_same_drives_and_the_same_noise() -> None:
    study = comparison(seeds=3, spread=0.2)
    cases = [study.plan.case(number) for number in range(study.plan.size)]
    plants: dict[Any, list[Any]] = {}
    for number, case in enumerate(cases):
        plants.setdefault(case[1:], []).append(study.scenario_of(number).plant)
    assert all(one == other for one, other in plants.values())
    drives = {plant[0].as_drive() for plant in plants.values()}
    assert len(drives) == 3
    nominal = study.scenario.plant.flat()
    factors = [
        value / nominal[name.removeprefix("plant.")]
        for seed in range(100)
        for name, value in drawn(study.scenario, seed, 0.2).items()
    ]
    assert 0.8 <= min(factors) < 0.81
    assert 1.19 < max(factors) <= 1.2


def test_a_case_that_fails_is_a_row_with_its_reason() -> None:
    study = comparison()
    wrong = {"washout": {"corner_frequency": -1.0}}
    found = compute(replace(study, plan=replace(study.plan, laws=wrong)), [0], None).points[0]
    assert (found.held, found.rms_velocity) == (False, None)
    assert "corner_frequency = -1.0 is invalid" in found.reason


def test_the_best_law_comes_first_and_ties_are_told_by_the_velocity() -> None:
    drive = feed_drive().changed({"plant.rate": 1000.0})
    found = ss.compare(drive, LAWS, disturbances="step,sine", seeds=2, spread=0.2, duration=1.5)
    first, second = found.ranks
    assert (first.held, -first.means["rms_velocity"][0]) >= (
        second.held, -second.means["rms_velocity"][0],
    )  # fmt: skip
    assert first.means["rms_velocity"][1] > 0.0
    assert isinstance(found.tuned["velocity_feedback"].law, VelocityFeedback)
    assert len(found.to_pandas()) == found.study.plan.size == 8
    assert len(found.to_dict()["ranks"]) == 2
    assert np.shape(found.held_at_points("washout")) == (1,)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"controllers": "washout,washout"}, "must be different names"),
        ({"disturbances": "step=3m"}, "must be a number in N"),
        ({"seeds": 0}, "must be from 1"),
        ({"spread": 1.5}, "must be from 0 to 0.9"),
        ({"given": "pid"}, "must be among washout"),
    ],
)
def test_what_is_not_allowed_is_refused(arguments: dict[str, Any], message: str) -> None:
    given = {"controllers": "washout", "given": "washout", **arguments}
    with pytest.raises(InvalidInputError, match=message):
        compared(feed_drive(), given.pop("controllers"), [], **given)


def test_gains_are_for_all_belt_speeds_that_vary() -> None:
    axis = Axis("plant.belt_speed", 0.02, 0.04, 2)
    study, tuned = compared(feed_drive(), "velocity_feedback", [axis], disturbances="none")
    first, *_, last = tuned["velocity_feedback"].goal.feeds
    assert (first, last) == (0.02, 0.04)
    assert study.plan.size == 2
