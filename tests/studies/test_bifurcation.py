"""Bifurcation diagrams against the reference limit cycles and closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import Coulomb, Exponential, Linear
from stickslip_ros.studies.bifurcation import BifurcationDiagram, bifurcation_diagram
from stickslip_ros.studies.settling import SettlingCourse
from tests.physics.drives import FEED_DRIVE, LIMIT_CYCLES, PAPER

RUNS_AWAY = replace(PAPER, belt_speed=0.2, friction=Linear(0.4, 0.9))
RESTING_BELT = replace(PAPER, belt_speed=0.0)


def at_speeds(*speeds: float) -> list[Drive]:
    return [replace(PAPER, belt_speed=speed) for speed in speeds]


def points(diagram: BifurcationDiagram, row: int) -> FloatArray:
    return diagram.position[diagram.row == row]


def test_turning_points_are_those_of_the_limit_cycles() -> None:
    diagram = bifurcation_diagram(at_speeds(*(cycle.belt_speed for cycle in LIMIT_CYCLES)))
    for row, cycle in enumerate(LIMIT_CYCLES):
        found = points(diagram, row)
        assert len(found) >= 10
        assert np.abs(found - cycle.midpoint) == pytest.approx(cycle.amplitude, abs=1e-8)
        assert np.diff(np.sign(np.diff(found))).all()
        measures = diagram.measures[row]
        assert measures.amplitude == pytest.approx(cycle.amplitude, rel=1e-8)
        assert measures.stick_fraction == pytest.approx(cycle.stick_fraction, abs=1e-8)
        assert measures.regime is (
            Regime.STICK_SLIP if cycle.stick_fraction > 0.0 else Regime.PURE_SLIP
        )


def test_lengths_are_in_metres() -> None:
    (at_04,) = (cycle for cycle in LIMIT_CYCLES if cycle.belt_speed == 0.4)
    diagram = bifurcation_diagram([FEED_DRIVE])
    assert diagram.position.max() == pytest.approx(1e-3 * (at_04.midpoint + at_04.amplitude))


def test_equilibrium_is_one_point() -> None:
    diagram = bifurcation_diagram(at_speeds(0.6, 0.8))
    assert [measures.regime for measures in diagram.measures] == [Regime.EQUILIBRIUM] * 2
    assert diagram.row.tolist() == [0, 1]
    assert diagram.position == pytest.approx([0.4 - 0.45 * v + 0.6 * v**3 for v in (0.6, 0.8)])


def test_a_reversed_belt_mirrors_the_diagram() -> None:
    diagram = bifurcation_diagram(at_speeds(0.3, -0.3))
    assert points(diagram, 1) == pytest.approx(-points(diagram, 0), abs=1e-9)


def test_a_diverging_motion_has_no_points_and_does_not_affect_other_rows() -> None:
    drives = [*at_speeds(0.3), RUNS_AWAY, *at_speeds(0.3), RUNS_AWAY]
    diagram = bifurcation_diagram(drives)
    assert [measures.regime for measures in diagram.measures[1::2]] == [Regime.UNBOUNDED] * 2
    assert sorted(set(diagram.row.tolist())) == [0, 2]
    assert points(diagram, 2).tolist() == points(diagram, 0).tolist()


def test_a_motion_may_run_away_after_the_transient() -> None:
    diagram = bifurcation_diagram([RUNS_AWAY], course=SettlingCourse(1.0, 10))
    assert diagram.measures[0].regime is Regime.UNBOUNDED
    assert len(diagram.position) == 0


def test_no_row_depends_on_the_one_before() -> None:
    laws = [Coulomb(0.4), Exponential(0.4, 0.25, 0.1, 0.0), PAPER.friction, Linear(0.4, 0.45)]
    drives = [replace(PAPER, belt_speed=0.2, friction=law, stiffness=2.0) for law in laws]
    drives += [RESTING_BELT, *at_speeds(0.3)]
    together = bifurcation_diagram(drives)
    for row, drive in enumerate(drives):
        alone = bifurcation_diagram([drive])
        assert alone.measures[0].amplitude == together.measures[row].amplitude
        assert alone.position.tolist() == points(together, row).tolist()


def test_on_a_resting_belt_the_slide_stays_where_it_is() -> None:
    diagram = bifurcation_diagram([RESTING_BELT])
    assert diagram.measures[0].regime is Regime.STUCK
    assert set(diagram.position.tolist()) == {0.0}


def test_progress_ends_with_the_last_drive() -> None:
    shares: list[float] = []
    bifurcation_diagram(at_speeds(0.6, 0.7, 0.8, 0.9), shares.append)
    assert shares == [0.25, 0.5, 0.75, 1.0]


def test_no_drives_make_an_empty_diagram() -> None:
    diagram = bifurcation_diagram([])
    assert diagram.measures == ()
    assert len(diagram.row) == len(diagram.position) == 0
