"""Basins against published shares, and the counting of attractors."""

from collections.abc import Sequence
from math import sqrt
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.basin import POSITION, VELOCITY, Basins, basin_study, default_axes
from stickslip_ros.studies.columns import Columns, Point
from stickslip_ros.studies.plan import Axis, Continuation, Grid, Plan, RandomSample
from stickslip_ros.studies.runner import compute_columns
from stickslip_ros.studies.settling import SettlingOptions
from stickslip_ros.theory.critical_gains import critical_gains
from tests.studies.studies import EXPONENTIAL, free, paper

PUBLISHED = {
    1.0: 1.0,
    1.1: 1.0,
    1.175: 0.9874,
    1.25: 0.9162,
    1.325: 0.8622,
    1.4: 0.7890,
    1.475: 0.7176,
    1.5: 0.6880,
    1.55: 0.6364,
    1.625: 0.5664,
    1.7: 0.5088,
    1.775: 0.4448,
    1.85: 0.0,
    2.0: 0.0,
}
"""Share of 5000 uniform starts that lead to the limit cycle, by belt speed, m/s (bSTAB, Stender
and Hoffmann, Nonlinear Dyn 107, 2022; the results as stored with pyBasin)."""

STARTS = (Axis(POSITION, -2.0, 2.0, 2), Axis(VELOCITY, 0.0, 2.0, 2))


def basins_of(scenario: Scenario, plan: Plan, *, continuous: bool = False) -> Basins:
    return Basins.from_columns(compute_columns(basin_study(scenario, plan, continuous=continuous)))


def basins_from(points: Sequence[Point]) -> Basins:
    columns = Columns.empty(RandomSample(STARTS, max(len(points), 1)))
    columns.enter(point._replace(number=number) for number, point in enumerate(points))
    return Basins.from_columns(columns)


def share(basins: Basins, *regimes: Regime) -> float:
    """Return the share of those regimes, all motions having settled."""
    assert all(attractor.steady for attractor in basins.attractors)
    return sum(a.share for a in basins.attractors if a.regime in regimes)


@pytest.mark.parametrize(
    ("belt_speed", "count"),
    [(1.5, 60), *(pytest.param(v, 200, marks=pytest.mark.long) for v in [*PUBLISHED][::2])],
)
def test_the_shares_are_the_published_ones(belt_speed: float, count: int) -> None:
    scenario = free(*EXPONENTIAL, f"plant.belt_speed={belt_speed}")
    basins = basins_of(scenario, RandomSample(STARTS, count, 1))
    cycle, expected = share(basins, Regime.STICK_SLIP), PUBLISHED[belt_speed]
    variance = expected * (1.0 - expected)
    assert abs(cycle - expected) <= 3.5 * sqrt(variance / count + variance / 5000)
    assert cycle + share(basins, Regime.EQUILIBRIUM) == pytest.approx(1.0)


def test_beyond_the_critical_cubic_gain_rest_cycle_and_running_away_coexist() -> None:
    corner = "washout_controller.corner_frequency=0.5"
    drive = paper().plant.as_drive()
    washout = paper(corner).washout_controller.control_law
    critical = critical_gains(drive, washout)
    linear, cubic = 1.1 * critical.linear, critical.cubic + 1.0
    scenario = paper(
        corner, f"washout_controller.linear_gain={linear}", f"washout_controller.cubic_gain={cubic}"
    )
    middle = drive.equilibrium_position
    plan = Grid((Axis(POSITION, middle - 0.8, middle + 0.8, 5), Axis(VELOCITY, -0.8, 0.8, 5)))
    basins = basins_of(scenario, plan, continuous=True)
    regimes = {Regime.EQUILIBRIUM, Regime.STICK_SLIP, Regime.UNBOUNDED}
    assert {attractor.regime for attractor in basins.attractors} == regimes
    assert all(attractor.steady for attractor in basins.attractors)
    # Where the bifurcation is supercritical, and with the same linear gain, there is no cycle.
    soft = scenario.changed({"washout_controller.cubic_gain": -1.0})
    (rest,) = basins_of(soft, plan, continuous=True).attractors
    assert rest.regime is Regime.EQUILIBRIUM


def point(
    regime: Regime | None,
    *,
    amplitude: float | None = None,
    midpoint: float | None = 0.5,
    steady: bool = True,
) -> Point:
    return Point(0, amplitude, amplitude, midpoint, 1.0, 1.0, 0.0, 6, regime, steady)


SMALL = point(Regime.PURE_SLIP, amplitude=0.3)
LARGE = point(Regime.STICK_SLIP, amplitude=1.2)
SHIFTED = point(Regime.PURE_SLIP, amplitude=0.3, midpoint=0.55)
REST = point(Regime.EQUILIBRIUM, amplitude=1e-9)
AWAY = point(Regime.UNBOUNDED, midpoint=None)
RUNNING_DOWN = point(Regime.EQUILIBRIUM, amplitude=1e-4, steady=False)
GROWING = point(Regime.PURE_SLIP, amplitude=0.7, steady=False)
FAILED = point(None, midpoint=None, steady=False)
KINDS = [SMALL, LARGE, SHIFTED, REST, AWAY, RUNNING_DOWN, GROWING, FAILED]


def blurred(kind: Point, share: float) -> Point:
    """Return the point with amplitude and midpoint off by a share of the amplitude."""
    if kind.amplitude is None or kind.midpoint is None:
        return kind
    off = share * kind.amplitude
    return kind._replace(amplitude=kind.amplitude + off, midpoint=kind.midpoint - off)


@given(
    counts=st.lists(st.integers(1, 9), min_size=len(KINDS), max_size=len(KINDS), unique=True),
    random=st.randoms(use_true_random=False),
)
def test_the_order_of_the_points_changes_no_count(counts: list[int], random: Random) -> None:
    points = [
        blurred(kind, random.uniform(-0.009, 0.009))
        for kind, count in zip(KINDS, counts, strict=True)
        for _ in range(count)
    ]
    places = list(range(len(points)))
    random.shuffle(places)
    basins = basins_from([points[place] for place in places])
    total = sum(counts)
    assert [attractor.count for attractor in basins.attractors] == sorted(counts, reverse=True)
    for attractor in basins.attractors:
        assert attractor.share == attractor.count / total
        assert attractor.standard_error == pytest.approx(
            sqrt(attractor.share * (1.0 - attractor.share) / total), rel=1e-12
        )
    by_kind = iter(basins.places[np.argsort(places)].tolist())
    for kind, count in zip(KINDS, counts, strict=True):
        (place,) = {next(by_kind) for _ in range(count)}
        attractor = basins.attractors[place]
        assert (attractor.count, attractor.regime) == (count, kind.regime)


def test_what_is_not_known_and_what_is_not_steady_stand_apart() -> None:
    later = point(Regime.PURE_SLIP, amplitude=0.1, steady=False)
    stopped = point(None, amplitude=0.2, steady=False)
    basins = basins_from([GROWING, later, FAILED, stopped, SMALL, SMALL, SMALL])
    assert [(a.regime, a.steady, a.count) for a in basins.attractors] == [
        (Regime.PURE_SLIP, True, 3),
        (Regime.PURE_SLIP, False, 2),
        (None, False, 2),
    ]
    assert [attractor.amplitude for attractor in basins.attractors] == [0.3, None, None]


def test_a_basin_over_anything_else_is_refused() -> None:
    speed = Axis("plant.belt_speed", 0.1, 0.2, 2)
    for axes in ((STARTS[0],), (STARTS[0], speed), (*STARTS, speed)):
        named = ", ".join(axis.parameter for axis in axes)
        for plan in (Grid(axes), RandomSample(axes, 5)):
            with pytest.raises(InvalidInputError, match=f"{POSITION} and {VELOCITY}, not {named}"):
                basin_study(free(), plan)
    with pytest.raises(InvalidInputError, match="a basin is over"):
        basin_study(free(), Grid(STARTS, Continuation.UP))


@pytest.mark.parametrize(
    "overrides",
    [("plant.normal_force=1000", "plant.mass=100", "plant.stiffness=1e6"),
     ("plant.belt_speed=-0.4",), ("plant.belt_speed=0.0",), EXPONENTIAL],
)  # fmt: skip
def test_by_default_starts_reach_beyond_the_vibration(overrides: Sequence[str]) -> None:
    scenario = free(*overrides)
    position, velocity = default_axes(scenario, 3)
    study = basin_study(scenario, Grid((position, velocity)), settling=SettlingOptions(100.0))
    for measures in compute_columns(study).points():
        assert position.first < measures.midpoint - measures.amplitude
        assert position.last > measures.midpoint + measures.amplitude
        assert velocity.last > (measures.velocity_amplitude or 0.0)
    drive = scenario.plant.as_drive()
    assert position.value(1) == pytest.approx(drive.equilibrium_position, abs=1e-12)
    assert velocity.value(1) == 0.0
