"""The theory beside the motion: what is computed, when, and what the charts show of it."""

import time
from collections.abc import Iterator
from multiprocessing import active_children
from typing import Any

import numpy as np
import pytest

from stickslip_ros.app.dashboard import theory as module
from stickslip_ros.app.dashboard.controls import (
    main_parameters,
    number_within,
    other_parameters,
    slider_range,
)
from stickslip_ros.app.dashboard.run_state import RunState
from stickslip_ros.app.dashboard.theory import (
    Theory,
    bifurcation,
    decay,
    friction_curve,
    stability_map,
)
from stickslip_ros.app.dashboard.theory_panel import (
    bifurcation_chart,
    decay_chart,
    friction_chart,
    stability_chart,
)
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.control import Washout
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.keywords import described
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS
from stickslip_ros.studies.stability import stability
from tests.nodes.graph import PATIENCE, wait_for

SCENARIO = load_scenario("feed_drive")
PLANT, GAINS = SCENARIO.plant.flat(), SCENARIO.controller.flat()
DRIVE = SCENARIO.plant.as_drive()


@pytest.fixture(scope="module")
def reference() -> dict[str, Any]:
    """Results of `stickslip stability` for the drive."""
    return stability(SCENARIO)[0]


@pytest.fixture
def run() -> RunState:
    """A drive that runs, as a listener knows it."""
    run = RunState("/test")
    run.parameters = {"plant": dict(PLANT), "washout_controller": dict(GAINS)}
    return run


@pytest.fixture
def theory(run: RunState) -> Iterator[Theory]:
    found = Theory(run)
    yield found
    found.close()


@pytest.mark.process
def test_a_long_computation_does_not_delay_the_end(
    run: RunState, monkeypatch: pytest.MonkeyPatch
) -> None:
    theory = Theory(run)
    monkeypatch.setattr(theory, "_inputs", lambda computation: (3600.0,))
    for result in theory._results.values():
        result.compute = time.sleep
    wait_for(lambda: theory.follow() or active_children(), "the computation has started")
    theory.close()
    wait_for(lambda: not active_children(), "the computation has ended")


def is_up_to_date(theory: Theory) -> bool:
    theory.follow()
    return not any(result.is_stale for result in theory._results.values())


def settle(theory: Theory) -> None:
    # It leaves the processor to others.
    wait_for(lambda: is_up_to_date(theory), "all is computed", 5.0 * PATIENCE)


def series(options: dict[str, Any], name: str) -> np.ndarray:
    """Return the points of all series of a name."""
    points = [each["data"] for each in options["series"] if each["name"] == name]
    assert points, name
    return np.array([point for part in points for point in part], dtype=float)


def test_decay_is_that_of_the_sampled_loop(reference: dict[str, Any]) -> None:
    found = decay(PLANT, "washout", GAINS)
    assert found.rate == pytest.approx(reference["sampled_loop"]["decay_rate"])
    assert max(s.real for s in found.controlled) == pytest.approx(-found.rate)
    eigenvalues = reference["open_loop"]["eigenvalues"].tolist()
    assert sorted(found.uncontrolled, key=str) == pytest.approx(sorted(eigenvalues, key=str))
    alone = decay(PLANT | {"expects_control": False}, "washout", GAINS)
    assert alone.controlled == []
    assert alone.rate is None
    drawn = series(decay_chart(found, DRIVE), "with control")
    assert drawn[:, 0].max() == pytest.approx(-found.rate, rel=1e-4)


def test_the_limit_in_the_map_is_the_critical_gain(reference: dict[str, Any]) -> None:
    found = stability_map(PLANT, "washout", GAINS)
    gains = Washout(GAINS["corner_frequency"], GAINS["linear_gain"], 0.0)
    options = stability_chart(found, DRIVE, gains)
    assert options["yAxis"]["name"] == "linear gain k1 (kN s/m)"
    limit = series(options, "limit of stability")
    limit = limit[np.argsort(limit[:, 0])]
    at_gains = 1e3 * np.interp(20.0, *limit.T)
    assert at_gains == pytest.approx(reference["sampled_loop"]["critical_linear_gain"], rel=0.01)
    assert series(options, "gains in use").tolist() == [[20.0, -3.0]]
    words = [each["label"]["formatter"] for each in options["series"] if "label" in each]
    assert words == ["stable", "unstable"]


def test_a_law_without_these_gains_has_no_map_and_still_a_decay_rate() -> None:
    values = CONTROLLER_PARAMETERS["velocity_feedback"].flat()
    with pytest.raises(InvalidInputError, match="velocity_feedback"):
        stability_map(PLANT, "velocity_feedback", values)
    assert decay(PLANT, "velocity_feedback", values).rate is not None


def check_diagram(options: dict[str, Any], reference: dict[str, Any]) -> None:
    """Check that a diagram has branches and the present belt speed."""
    (hopf,) = reference["open_loop"]["hopf_speeds"]
    stable = series(options, "stable equilibrium")
    assert stable[:, 0].min() == pytest.approx(1e3 * hopf, rel=1e-3)
    cycle = series(options, "stable cycle")
    (known,) = reference["open_loop"]["limit_cycles"]
    near = np.abs(cycle[:, 0] - 1e3 * DRIVE.belt_speed) < 3.0
    half = np.ptp(cycle[near][:, 1]) / 2.0
    assert half == pytest.approx(1e6 * known["amplitude"], rel=0.05)
    marks = options["series"][-1]["markLine"]["data"]
    assert {mark["label"]["formatter"]: mark["xAxis"] for mark in marks}["now"] == 40.0


def test_the_friction_curve_has_the_operating_point() -> None:
    options = friction_chart(friction_curve(PLANT), DRIVE)
    curve, point = series(options, "in steady slip"), series(options, "steady sliding")
    assert np.ptp(curve[:, 1]) == pytest.approx(2.0 * PLANT["friction.static"], rel=1e-3)
    assert point[0, 0] == -40.0
    assert np.interp(-40.0, *curve.T) == pytest.approx(point[0, 1], rel=1e-3)
    memory = load_scenario("feed_drive", ["plant.friction.law=lugre"]).plant
    names = [
        s["name"]
        for s in friction_chart(friction_curve(memory.flat()), memory.as_drive())["series"]
    ]
    assert "motion" in names
    with pytest.raises(InvalidInputError, match="takes up to minutes"):
        bifurcation(memory.flat())


@pytest.mark.process
@pytest.mark.timeout(600)
def test_only_what_a_parameter_changes_is_computed_again(
    run: RunState, theory: Theory, reference: dict[str, Any]
) -> None:
    settle(theory)
    check_diagram(bifurcation_chart(theory.result(bifurcation).value, DRIVE), reference)
    versions = {each: theory.result(each).version for each in (bifurcation, stability_map, decay)}
    assert set(versions.values()) == {1}
    # The same values as another message brings them: a NaN that is not the same object.
    unset = {name: float("nan") for name, value in PLANT.items() if value != value}
    assert unset
    run.parameters = run.parameters | {"plant": PLANT | unset}
    assert is_up_to_date(theory)
    slower = run.parameters["plant"] | {"belt_speed": 0.039}
    run.parameters = run.parameters | {"plant": slower}
    settle(theory)
    assert theory.result(bifurcation).version == 1
    assert theory.result(stability_map).version == 2
    gains = run.parameters["washout_controller"] | {"linear_gain": -2900.0}
    run.parameters = run.parameters | {"washout_controller": gains}
    settle(theory)
    assert theory.result(stability_map).version == 2
    assert theory.result(decay).version == 3
    loose = run.parameters["plant"] | {"stiffness": 0.0}
    run.parameters = run.parameters | {"plant": loose}
    settle(theory)
    for each in (bifurcation, stability_map, decay):  # what the theory does not cover is said
        assert theory.result(each).value is None
        assert "spring" in theory.result(each).refusal
    assert theory.result(friction_curve).value is not None


def test_nothing_is_computed_while_a_slider_moves(
    run: RunState, theory: Theory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "monotonic", lambda: now)
    now = 100.0
    theory.follow()
    now += 0.2
    run.parameters = run.parameters | {"plant": PLANT | {"belt_speed": 0.03}}
    theory.follow()
    now += 0.2
    theory.follow()
    assert theory.result(decay).version == 0
    monkeypatch.setattr(module, "monotonic", time.monotonic)


def test_an_unknown_drive_has_no_theory(run: RunState, theory: Theory) -> None:
    run.parameters = {"plant": {}, "washout_controller": {}}
    assert is_up_to_date(theory)


def test_a_slider_has_room_on_both_sides_of_any_value() -> None:
    for name, value, low, high in (
        ("plant.belt_speed", 0.04, 0.0, 0.125),
        ("plant.belt_speed", 0.045, 0.0, 0.125),
        ("washout_controller.linear_gain", -3000.0, -8192.0, 2048.0),
        ("washout_controller.corner_frequency", 20.0, 0.0, 64.0),
    ):
        assert slider_range(value, described(name))[:2] == (low, high)
    for value in (0.0, -0.0, 5e-324, -5e-324, 1e-30, 1e30, -1e30):
        low, high, step = slider_range(value, described("plant.belt_speed"))
        assert low < high
        assert step > 0.0


def test_a_number_far_from_the_scale_of_the_drive_is_refused_with_the_bound() -> None:
    drive = SCENARIO.plant.as_drive()
    for text, now, allowed in (
        ("-5e9", 0.04, "at most 1 m/s in size"),
        ("1.01", 0.0, "at most 1 m/s in size"),
        ("60", 5.0, "at most 50 m/s in size"),
        ("0,02", 0.04, "a number with a decimal point in m/s"),
    ):
        with pytest.raises(
            InvalidInputError, match=f"belt_speed = .* is invalid: must be {allowed}"
        ):
            number_within("belt_speed", text, "m/s", drive, now)
    assert number_within("belt_speed", "-1", "m/s", drive, 0.04) == -1.0
    assert number_within("belt_speed", "40", "m/s", drive, 5.0) == 40.0
    assert number_within("start_after", "1e6", "s", drive) == 1e6
    assert number_within("force_limit", "inf", "N", drive) == float("inf")
    assert number_within("belt_speed", "1e9", "m/s", None) == 1e9  # a drive that is not known


def test_a_slider_for_each_own_constant_of_a_law() -> None:
    names = ["corner_frequency", "linear_gain", "cubic_gain"]
    assert main_parameters("washout") == ["plant.belt_speed"] + [
        f"washout_controller.{name}" for name in names
    ]
    others = other_parameters("washout")
    assert "plant.damping" in others
    assert not {*others} & {*main_parameters("washout")}
