"""Studies: every point is a row, even a failed one, and does not depend on other points."""

import json
from dataclasses import replace
from math import inf, ulp

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.columns import Point
from stickslip_ros.studies.plan import Axis, Continuation, Grid
from stickslip_ros.studies.runner import compute_columns
from stickslip_ros.studies.settling import MotionState, SettlingOptions
from stickslip_ros.studies.study import Study, compute, sweep_study
from tests.studies.studies import CYCLE_LOST_SPEED, EXPONENTIAL, HOPF_SPEED, SHORT, free, paper

MINIMUM = Axis("plant.friction.minimum", 0.1, 0.6, 6)
"""Of which what is above the static coefficient, 0.4, is refused."""

SLOPE = Axis("plant.friction.slope", 0.1, 0.9, 5)
"""Of the linear law, the last being the paper's printed one, with which the drive runs away."""

DAMPING = Axis("plant.damping", 0.02, 1e9, 3)
"""Too much of it is too stiff to be followed."""

LINEAR = free("plant.friction.law=linear", "plant.belt_speed=0.2")

MIXED = [
    Study(free(), Grid((MINIMUM,)), SHORT),
    Study(LINEAR, Grid((SLOPE,)), SettlingOptions(40.0, 2)),
    Study(free(), Grid((DAMPING, Axis("plant.belt_speed", 0.2, 0.3, 2))), SHORT),
]


@pytest.fixture(autouse=True)
def _little_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stickslip_ros.motion.hybrid_motion._SPARE_STEPS", 1000)
    monkeypatch.setattr("stickslip_ros.motion.hybrid_motion.STEPS_PER_UNIT", 100)


def points(study: Study) -> list[Point]:
    return compute(study, range(study.plan.size), None).points


def test_a_refused_diverging_or_too_stiff_point_is_a_row_with_the_reason() -> None:
    minimum, slope, damping = (points(study) for study in MIXED)
    reasons = [point.reason for point in minimum]
    assert reasons[:4] == [None] * 4
    for value, reason in ((0.5, reasons[4]), (0.6, reasons[5])):
        assert reason is not None
        assert f"friction.minimum = {value} must not exceed friction.static = 0.4" in reason
    assert [point.reason for point in slope] == [None] * 4 + ["the motion diverges"]
    assert slope[-1].regime is Regime.UNBOUNDED
    assert slope[-1].turning_points == ()
    assert [point.reason for point in damping[:2]] == [None] * 2
    for point in damping[2:]:
        assert "too stiff" in (point.reason or "")
        assert point == Point(point.number, reason=point.reason)


CHAINS = [
    (replace(MINIMUM, first=0.6, last=0.3, count=4), Continuation.UP, free(), 2),
    (MINIMUM, Continuation.DOWN, free(), 2),
    (DAMPING, Continuation.DOWN, free(), 2),
    (SLOPE, Continuation.DOWN, LINEAR, 1),
]


@pytest.mark.parametrize(
    ("axis", "carry", "scenario", "failing"),
    CHAINS,
    ids=["out of bounds", "downwards", "too stiff", "runs away"],
)
def test_a_chain_restarts_after_a_failed_point(
    axis: Axis, carry: Continuation, scenario: Scenario, failing: int
) -> None:
    alone = Study(scenario, Grid((axis,)), SettlingOptions(40.0, 2))
    study = replace(alone, plan=Grid((axis,), carry))
    (chain,) = study.plan.chains()
    piece = compute(study, chain, None)
    assert all(point.reason is not None for point in piece.points[:failing])
    first, *_ = found = piece.points[failing:]
    assert all(point.reason is None for point in found)
    assert compute(alone, [first.number], None).points == [first]
    assert piece.end is not None
    only_failed = compute(study, chain[:failing], MotionState(1.0, 0.0))
    assert only_failed.end is None


def test_up_the_cycle_is_kept_until_it_is_lost_and_down_rest_to_the_hopf_point() -> None:
    """Belt speeds across the range in which rest and cycle coexist, up and then down."""
    count = 18
    axis = Axis("plant.belt_speed", 1.05, 1.9, count)
    found = compute_columns(sweep_study(free(*EXPONENTIAL), [axis], continuation=Continuation.BOTH))
    step = 0.85 / (count - 1)
    speed = axis.values()
    (up, down), (grown, amplitude), (settled, steady) = (
        np.split(column, 2) for column in (found.regime, found.amplitude, found.steady)
    )
    kept = (up == Regime.STICK_SLIP).sum()
    assert (up[:kept] == Regime.STICK_SLIP).all()
    assert (up[kept:] == Regime.EQUILIBRIUM).all()
    assert speed[kept - 1] < CYCLE_LOST_SPEED < speed[kept] + step
    assert (np.diff(grown[:kept]) > 0.0).all()
    assert settled.all()
    rests, cycles = steady & (down == Regime.EQUILIBRIUM), down == Regime.STICK_SLIP
    assert HOPF_SPEED < speed[rests][0] < HOPF_SPEED + step
    # Just below, where rest is barely unstable, the vibration has only begun to grow.
    assert speed[cycles][-1] > HOPF_SPEED - 4 * step
    assert (rests | cycles | ~steady).all()
    assert amplitude[cycles] == pytest.approx(grown[cycles], rel=1e-9)
    assert steady[cycles].all()


@pytest.mark.parametrize(
    ("scenario", "axis", "critical"),
    [
        # The slope of the friction at 0.4 m/s.
        (free(), Axis("plant.damping", 0.3, 0.0, 16), 0.162),
        # By Routh and Hurwitz.
        pytest.param(
            paper(),
            Axis("washout_controller.linear_gain", -1.6, 0.0, 17),
            -0.9352960893854753,
            marks=pytest.mark.long,
        ),
    ],
)
def test_rest_is_not_carried_on_to_where_it_is_unstable(
    scenario: Scenario, axis: Axis, critical: float
) -> None:
    # Neither parameter moves the equilibrium: nothing but a push takes the slide off it.
    study = sweep_study(scenario, [axis], continuation=Continuation.BOTH, continuous=True)
    found = compute_columns(study)
    step = abs(axis.last - axis.first) / (axis.count - 1)
    stable = (found.values[axis.parameter] - critical) * (axis.first - critical) > 0.0
    near = np.abs(found.values[axis.parameter] - critical) < 1.5 * step
    assert (found.regime[stable & ~near] == Regime.EQUILIBRIUM).all()
    assert found.steady[stable & ~near].all()
    assert set(found.regime[~stable & ~near]) == {Regime.PURE_SLIP, Regime.STICK_SLIP}
    up, down = np.split(found.amplitude, 2)
    away = ~np.split(stable | near, 2)[0]
    assert up[away] == pytest.approx(down[away], rel=1e-6)


numbers = st.one_of(st.none(), st.floats(allow_nan=False))


@given(
    point=st.builds(
        Point,
        st.integers(0),
        *[numbers] * 6,
        st.integers(0),
        st.none() | st.sampled_from(Regime),
        st.booleans(),
        st.lists(st.floats(allow_nan=False)).map(tuple),
        st.none() | st.text(),
    )
)
@example(Point(0, 0.1 + 0.2, ulp(0.0), inf, -0.0, 1e22, turning_points=(-0.0, ulp(0.0))))
def test_a_point_is_the_same_read_back(point: Point) -> None:
    read = Point.from_json(json.loads(json.dumps(point)))
    assert repr(read) == repr(point)  # to the last bit, which a sign of zero is too
    assert type(read.regime) is type(point.regime)


def test_a_study_without_a_point_that_can_be_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"minimum = 0\.5 must not exceed friction\.static"):
        Study(free(), Grid((replace(MINIMUM, first=0.5),)), SHORT).check()
    Study(free(), Grid((MINIMUM,)), SHORT).check()


@pytest.mark.parametrize("carry", [None, Continuation.BOTH])
def test_a_study_of_which_only_one_corner_can_be_is_not_refused(carry: Continuation | None) -> None:
    for static in ((0.2, 0.4), (0.4, 0.2)):
        for minimum in ((0.3, 0.5), (0.5, 0.3)):
            axes = Axis("plant.friction.static", *static, 3), Axis(MINIMUM.parameter, *minimum, 3)
            study = Study(free(), Grid(axes, carry), SHORT)
            study.check()
            corners = compute(study, [*study.plan.corners()], None).points
            assert sum(point.reason is None for point in corners) == 1


def test_control_that_starts_late_acts_from_the_second_point_of_a_chain_on() -> None:
    """After 500 s without control, the vibration decays further from point to point."""
    washout = ("washout_controller.start_after=500", "washout_controller.linear_gain=-2")
    late = paper("plant.rate=20", *washout)
    chain = Grid((Axis("plant.belt_speed", 0.3, 0.31, 2),), Continuation.UP)
    first, second = compute_columns(Study(late, chain, SettlingOptions(20.0, 2))).points()
    assert first.amplitude > 0.25
    assert second.amplitude < 0.8 * first.amplitude


def test_where_no_cycle_ends_in_the_measured_time_a_point_says_so() -> None:
    fast = Grid((Axis("plant.belt_speed", 40.0, 44.0, 2),))
    for point in compute_columns(Study(free(), fast, SettlingOptions(0.0, 1))).points():
        assert point.regime is None
        assert point.reason == "no whole cycle in the measured time"
