"""Branches of equilibria and limit cycles over the belt speed."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Directional, Exponential, Linear, LuGre
from stickslip_ros.theory.bifurcation_branches import BifurcationBranches
from stickslip_ros.theory.limit_cycles import limit_cycles
from stickslip_ros.theory.sticking import sticking_onset
from tests.drives import FEED_DRIVE, LIMIT_CYCLES, PAPER

SUBCRITICAL = replace(PAPER, friction=Exponential(0.4, 0.25, 0.1, 0.0))
"""Below the fold of its cycles stick-slip is stable next to a stable equilibrium."""

CURVE = Exponential(static=0.4, kinetic=0.25, decay_speed=0.02)

HOPF_SPEED = 0.5 * sqrt(1.0 - 0.02 / 0.45)
"""Of the paper's drive, eq. 9."""


def test_the_branch_of_the_paper_goes_through_the_reference_cycles_to_the_hopf_point() -> None:
    speeds = np.array([cycle.belt_speed for cycle in LIMIT_CYCLES] + [0.6])
    found = BifurcationBranches.over(PAPER, speeds)
    (branch,) = found.cycles
    assert branch.stable
    for cycle in LIMIT_CYCLES:
        (row,) = np.flatnonzero(branch.belt_speeds == cycle.belt_speed)
        assert branch.least[row] == pytest.approx(cycle.midpoint - cycle.amplitude, rel=1e-7)
        assert branch.greatest[row] == pytest.approx(cycle.midpoint + cycle.amplitude, rel=1e-7)
        assert branch.sticks[row] == (cycle.stick_fraction > 0.0)
    rest = replace(PAPER, belt_speed=HOPF_SPEED).equilibrium_position
    assert branch.belt_speeds[-1] == pytest.approx(HOPF_SPEED, rel=1e-12)
    assert branch.least[-1] == branch.greatest[-1] == pytest.approx(rest, rel=1e-12)
    assert found.sticking_onset == sticking_onset(PAPER).exact


@pytest.fixture(scope="module")
def ahead() -> BifurcationBranches:
    return BifurcationBranches.over(PAPER, np.linspace(0.3, 0.6, 4))


def test_the_equilibrium_changes_stability_at_the_hopf_point(ahead: BifurcationBranches) -> None:
    found = ahead
    assert [branch.stable for branch in found.equilibria] == [False, True]
    unstable, stable = found.equilibria
    assert unstable.belt_speeds[0] == 0.3
    assert unstable.belt_speeds[-1] == stable.belt_speeds[0] == found.hopf_points[0].belt_speed
    assert stable.belt_speeds[-1] == 0.6
    for branch in found.equilibria:
        speeds = branch.belt_speeds
        cubic = 0.4 - 0.45 * speeds + 0.6 * speeds**3  # eq. 6
        assert np.allclose(branch.least, cubic, rtol=1e-12, atol=0.0)
        assert np.array_equal(branch.least, branch.greatest)


@pytest.mark.long
def test_an_unstable_branch_joins_the_hopf_point_and_the_fold() -> None:
    subcritical = BifurcationBranches.around(SUBCRITICAL, points=16)
    unstable, stable = sorted(subcritical.cycles, key=lambda branch: branch.stable)
    assert (unstable.stable, stable.stable) == (False, True)
    (hopf,) = subcritical.hopf_points
    (fold,) = subcritical.folds
    assert not hopf.supercritical
    assert unstable.belt_speeds[0] == hopf.belt_speed
    assert unstable.least[0] == unstable.greatest[0]
    assert unstable.belt_speeds[-1] == stable.belt_speeds[-1] == fold
    assert unstable.greatest[-1] == stable.greatest[-1]
    assert np.all(np.diff(unstable.greatest) > 0.0)
    # Here the fold is where the stable cycle touches the belt speed.
    assert fold == pytest.approx(subcritical.sticking_onset, rel=2e-3)
    end = float(subcritical.belt_speeds[-1])  # beyond the fold
    assert fold < end
    assert limit_cycles(replace(SUBCRITICAL, belt_speed=end)) == []


def test_a_range_without_the_hopf_point_has_open_ends() -> None:
    found = BifurcationBranches.over(PAPER, np.array([0.2, 0.25, 0.3]))
    (branch,) = found.cycles
    assert branch.belt_speeds.tolist() == [0.2, 0.25, 0.3]
    assert (found.hopf_points, found.sticking_onset, found.folds) == ((), None, [])


@pytest.mark.long
def test_a_reversed_belt_mirrors_the_branches(ahead: BifurcationBranches) -> None:
    back = BifurcationBranches.over(PAPER, -np.linspace(0.3, 0.6, 4)[::-1])
    assert back.hopf_points[0].belt_speed == -ahead.hopf_points[0].belt_speed
    assert back.sticking_onset == -(ahead.sticking_onset or 0.0)
    (one,), (other,) = ahead.cycles, back.cycles
    assert np.allclose(other.belt_speeds, -one.belt_speeds[::-1], rtol=1e-12)
    assert np.allclose(other.least, -one.greatest[::-1], rtol=1e-9)
    assert np.array_equal(other.sticks, one.sticks[::-1])


@pytest.mark.long
def test_cycles_without_a_hopf_point_meet_in_a_fold() -> None:
    drive = replace(PAPER, friction=Linear(0.4, 0.3))
    found = BifurcationBranches.over(drive, np.linspace(0.6, 1.0, 5))
    assert sorted(branch.stable for branch in found.cycles) == [False, True]
    assert len(found.folds) == 1
    assert [branch.stable for branch in found.equilibria] == [False]


@pytest.mark.long
def test_friction_with_a_memory_has_no_onset() -> None:
    drive = replace(FEED_DRIVE, friction=LuGre(CURVE, 1e5, 100.0))
    found = BifurcationBranches.over(drive, np.array([0.04, 0.1]))
    assert found.sticking_onset is None
    assert [branch.stable for branch in found.equilibria] == [False, True]
    assert sorted(branch.stable for branch in found.cycles) == [False, True]


@pytest.mark.parametrize(
    ("drive", "message"),
    [
        (replace(PAPER, stiffness=0.0), "needs a spring"),
        (
            replace(PAPER, friction=Directional(Coulomb(0.4), Coulomb(0.3))),
            "needs friction that is the same in both directions",
        ),
    ],
)
def test_other_drives_are_refused(drive: Drive, message: str) -> None:
    with pytest.raises(InvalidInputError, match=f"the bifurcation diagram {message}"):
        BifurcationBranches.over(drive, np.linspace(0.3, 0.6, 4))
    with pytest.raises(InvalidInputError, match=f"the bifurcation diagram {message}"):
        BifurcationBranches.around(drive)


@pytest.mark.parametrize("speeds", [[0.3], [0.4, 0.3], [-0.1, 0.1], [0.0, 0.1], [0.1, np.inf]])
def test_belt_speeds_must_ascend_on_one_side(speeds: list[float]) -> None:
    with pytest.raises(InvalidInputError, match="two belt speeds, ascending and of one sign"):
        BifurcationBranches.over(PAPER, np.array(speeds))
