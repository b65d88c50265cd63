"""Transitions from theory against closed forms and against the theory of one drive."""

from dataclasses import replace
from math import isnan, sqrt

import numpy as np
import pytest

from stickslip_ros.model.control import SlidingMode
from stickslip_ros.model.friction import Exponential
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.plan import Axis, Grid
from stickslip_ros.studies.settling import ControlledDrive
from stickslip_ros.studies.study import Study
from stickslip_ros.studies.transitions import (
    HOPF_POINT,
    STABILITY_LIMIT,
    STICKING_LIMIT,
    hopf_margin,
    sign_changes,
    transition_map,
    transitions,
)
from stickslip_ros.theory.linear import expand, hurwitz_determinants
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.theory.sticking import sticking_onset
from tests.drives import PAPER
from tests.studies.studies import CYCLE_LOST_SPEED, EXPONENTIAL, HOPF_SPEED

FREE = "plant.expects_control=false"


def found(over: str, *overrides: str, continuous: bool = False) -> dict[str, list[float]]:
    axis = Axis.parse(over)
    scenario = load_scenario("paper", list(overrides))
    return transitions(Study(scenario, Grid((axis,)), continuous=continuous), axis)


def test_over_the_belt_speed_in_either_direction_they_are_those_of_the_paper_s_drive() -> None:
    places = found("plant.belt_speed=-0.6:0.6:5", FREE)
    for name, expected in (
        (HOPF_POINT, sqrt((0.45 - 0.02) / 1.8)),
        (STICKING_LIMIT, sticking_onset(PAPER).exact),
    ):
        low, high = places[name]
        assert high == pytest.approx(expected, rel=1e-10)
        assert low == pytest.approx(-high, rel=1e-10)


def test_where_the_hopf_point_is_subcritical_sticking_ends_beyond_it() -> None:
    places = found("plant.belt_speed=0.8:2.2:5", *EXPONENTIAL)
    drive = replace(PAPER, damping=0.1, friction=Exponential(1.0, 0.5, 0.5, 0.0))
    assert places[HOPF_POINT] == pytest.approx([HOPF_SPEED], rel=1e-12)
    assert places[STICKING_LIMIT] == pytest.approx([sticking_onset(drive).exact], rel=1e-10)
    assert places[STICKING_LIMIT] == pytest.approx([CYCLE_LOST_SPEED], abs=5e-5)


def test_the_ends_of_every_range_that_sticks_are_found() -> None:
    places = found("plant.belt_speed=0.02:0.6:5", FREE, "plant.stiffness=1000")
    low, high = sticking_onset(replace(PAPER, stiffness=1000.0)).ranges
    assert places[STICKING_LIMIT] == pytest.approx([low[1], *high], rel=1e-10)


@pytest.mark.parametrize(
    ("parameter", "ends", "speed"),
    [
        ("damping", "0.01:0.4:5", 0.4),
        pytest.param("mass", "100:0.01:5:log", 0.45, marks=pytest.mark.long),
        pytest.param("normal_force", "0.01:100:5:log", 0.3, marks=pytest.mark.long),
    ],
)
def test_over_any_parameter_the_belt_then_has_the_speed_of_the_transition(
    parameter: str, ends: str, speed: float
) -> None:
    places = found(f"plant.{parameter}={ends}", FREE, f"plant.belt_speed={speed}")
    (value,) = places[STICKING_LIMIT]
    drive = replace(PAPER, belt_speed=speed, **{parameter: value})
    assert sticking_onset(drive).exact == pytest.approx(speed, rel=1e-9)
    if parameter == "damping":  # that of the law's slope
        assert places[HOPF_POINT] == pytest.approx([0.45 - 1.8 * 0.4**2], rel=1e-12)


def test_under_continuous_control_it_is_the_critical_gain_and_there_is_no_onset_of_sticking() -> (
    None
):
    overrides = ("plant.belt_speed=0.49", "plant.damping=0.01")
    places = found("washout_controller.linear_gain=-0.2:0.2:5", *overrides, continuous=True)
    assert places.keys() == {HOPF_POINT}
    assert places[HOPF_POINT] == pytest.approx([-0.0396], abs=5e-5)


def test_a_sampled_loop_has_the_limit_that_its_critical_gain_says() -> None:
    places = found("washout_controller.linear_gain=-1.5:0.5:5", "plant.force_delay=0.2")
    loop = LinearSampledLoop.from_drive(PAPER, 100.0, 0.2)
    assert places == {STABILITY_LIMIT: [pytest.approx(loop.critical_linear_gain(2.0), rel=1e-9)]}


@pytest.mark.parametrize(
    "override", ["plant.force_jitter=0.01", "washout_controller.force_limit=0.0"]
)
def test_of_a_loop_that_is_not_linear_and_steady_nothing_is_said(override: str) -> None:
    assert found("washout_controller.linear_gain=-1.5:0.5:5", override) == {}


def test_a_disturbance_moves_the_cycle_but_not_the_hopf_point() -> None:
    places = found("plant.belt_speed=0.02:0.6:5", FREE, "plant.disturbance.kind=sine")
    assert places.keys() == {HOPF_POINT}


def test_values_that_are_out_of_bounds_are_passed_over() -> None:
    """The static coefficient must not be below the minimum, 0.25."""
    places = found("plant.friction.static=0.1:0.6:5", FREE, "plant.belt_speed=0.46")
    assert places[HOPF_POINT] == pytest.approx([0.25 + 0.02 / (3.0 * (1.0 - 0.92**2))])


def test_a_gain_that_only_its_last_determinant_likes_is_not_stable() -> None:
    """With such a corner frequency and gain, c1 and c2 are below zero and their product above."""
    overrides = ["washout_controller.corner_frequency=20", "washout_controller.linear_gain=60"]
    scenario = load_scenario("paper", [*overrides, "plant.belt_speed=0.2"])
    case = ControlledDrive.from_scenario(scenario, continuous=True)
    expansion = expand(case.drive, case.law.continuous)
    assert hurwitz_determinants(expansion.jacobian)[-1] > 0.0
    assert not expansion.stable
    assert hopf_margin(case) < 0.0


def test_a_sign_change_at_a_value_itself_is_found_once() -> None:
    assert list(sign_changes(lambda x: x * (x - 0.4), [-1.0, 0.0, 0.3, 1.0])) == [
        pytest.approx(0.0, abs=1e-15),
        pytest.approx(0.4),
    ]
    assert list(sign_changes(lambda x: x * x, [-1.0, 0.0, 1.0])) == []


@pytest.mark.usefixtures("coarse_maps")
def test_a_map_has_the_sides_of_the_transitions() -> None:
    axes = Axis.parse("plant.belt_speed=0.1:0.6:2"), Axis.parse("plant.damping=0.01:0.4:2")
    study = Study(load_scenario("paper", [FREE]), Grid(axes))
    over = transition_map(study, axes)
    speed, damping = over.first[:, np.newaxis], over.second[np.newaxis, :]
    hopf_speed_squared = (0.45 - damping) / 1.8
    assert over.margins.keys() == {HOPF_POINT, STICKING_LIMIT}
    assert np.array_equal(over.margins[HOPF_POINT] > 0.0, speed**2 > hopf_speed_squared)
    onsets = np.array(
        [sticking_onset(replace(PAPER, damping=value)).exact or 0.0 for value in over.second]
    )
    assert np.array_equal(over.margins[STICKING_LIMIT] > 0.0, speed < onsets)


@pytest.mark.usefixtures("coarse_maps")
def test_a_map_has_the_ends_of_every_range_that_sticks() -> None:
    axes = Axis.parse("plant.stiffness=800:1200:3"), Axis.parse("plant.belt_speed=0.02:0.6:2")
    over = transition_map(Study(load_scenario("paper", [FREE]), Grid(axes)), axes)
    for row in (0, -1):
        ranges = sticking_onset(replace(PAPER, stiffness=float(over.first[row]))).ranges
        assert len(ranges) == 2
        inside = [(low < over.second) & (over.second < high) for low, high in ranges]
        sticks = np.any(inside, axis=0)
        assert np.array_equal(over.margins[STICKING_LIMIT][row] > 0.0, sticks)


@pytest.mark.usefixtures("coarse_maps")
def test_a_map_of_a_sampled_loop_with_a_long_delay_has_the_sides_of_its_limit() -> None:
    axes = (
        Axis.parse("plant.force_delay=0.3:0.6:2"),
        Axis.parse("washout_controller.linear_gain=-3:0:2"),
    )
    over = transition_map(Study(load_scenario("paper"), Grid(axes)), axes)
    assert over.margins.keys() == {STABILITY_LIMIT}
    for row in (0, -1):
        loop = LinearSampledLoop.from_drive(PAPER, 100.0, float(over.first[row]))
        (interval,) = loop.stable_linear_gains(2.0)
        inside = (over.second > interval.low) & (over.second < interval.high)
        changed = np.flatnonzero(inside != (over.margins[STABILITY_LIMIT][row] > 0.0))
        assert len(changed) <= 1  # the loop that is nearly the same has nearly the same limit


def test_a_law_that_is_not_linear_has_no_margin() -> None:
    plant = load_scenario("paper").plant
    drive, law = plant.as_drive(), SlidingMode(boundary_layer=0.0)
    assert isnan(hopf_margin(ControlledDrive(drive, law, plant)))
    assert isnan(hopf_margin(ControlledDrive(drive, law)))
