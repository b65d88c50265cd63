"""The motion diverges if friction falls faster than the damping rises."""

from dataclasses import replace
from math import inf, isfinite

import pytest

from stickslip_ros.model.friction import Coulomb, Exponential, FrictionLaw, Linear
from stickslip_ros.motion import Motion, RecordedMotion
from tests.drives import PAPER

LAWS = [
    PAPER.friction,
    Coulomb(0.4),
    Linear(static=0.4, slope=0.3),
    Exponential(static=0.4, kinetic=0.25, decay_speed=0.5, viscous=0.1),
]

# The paper's printed slope, twice the tangent of its cubic law.
STEEP = replace(PAPER, belt_speed=0.2, friction=Linear(static=0.4, slope=0.9))


@pytest.mark.parametrize("unit", [1.0, 1e-3], ids=["paper", "SI"])
def test_it_is_found_to_run_away_at_a_thousand_times_the_speed_scale(unit: float) -> None:
    # A normal force of 1e-3 makes the speed scale 1e-3 too.
    drive = replace(
        STEEP,
        normal_force=unit,
        belt_speed=0.2 * unit,
        friction=Linear(static=0.4, slope=0.9 / unit),
    )
    motion = RecordedMotion(drive, 0.0, 0.0)
    motion.advance(60.0)
    assert motion.unbounded
    assert abs(motion.velocity) == pytest.approx(1e3 * unit, rel=1e-9)
    stopped_at = motion.position
    motion.advance(10.0)
    assert motion.position == stopped_at


def test_a_restart_forgets_it() -> None:
    motion = Motion(STEEP, 0.0, 0.0)
    motion.advance(60.0)
    motion.restart(0.0, 0.2)
    assert not motion.unbounded
    motion.advance(0.5)
    assert motion.position == pytest.approx(0.1, rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("force", "sign"), [(1e20, 1.0), (1.7e308, -1.0), (inf, -1.0)])
def test_an_enormous_force_makes_it_run_away_and_no_figure_overflow(
    law: FrictionLaw, force: float, sign: float
) -> None:
    motion = Motion(replace(PAPER, friction=law), 0.0, 0.0)
    motion.force = sign * force
    motion.advance(0.01)
    assert motion.unbounded
    assert motion.velocity == pytest.approx(sign * 1e3)
    assert abs(motion.position) < 1e-3
    assert isfinite(motion.friction_force)
