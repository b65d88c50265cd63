"""A friction coefficient of zero is allowed: the belt has no effect, the slide vibrates freely."""

from dataclasses import replace
from math import cos, sin

import pytest

from stickslip_ros.physics.model.friction import Coulomb, Exponential, FrictionLaw, Linear, Stribeck
from stickslip_ros.physics.motion import RecordedMotion
from tests.physics.drives import PAPER

FRICTIONLESS = [
    Stribeck(0.0, 0.0, 0.5),
    Coulomb(0.0),
    Linear(0.0, 0.0),
    Exponential(0.0, 0.0, 0.5, 0.0),
]
laws = pytest.mark.parametrize("law", FRICTIONLESS, ids=lambda law: law.name)


@laws
@pytest.mark.parametrize("belt_speed", [0.2, 0.0, -0.5])
def test_it_passes_the_speed_of_the_belt_unmoved(law: FrictionLaw, belt_speed: float) -> None:
    drive = replace(PAPER, damping=0.0, belt_speed=belt_speed, friction=law)
    motion = RecordedMotion(drive, 1.0, 0.0)
    motion.advance(20.0)
    assert motion.position == pytest.approx(cos(20.0), rel=1e-12)
    assert motion.velocity == pytest.approx(-sin(20.0), rel=1e-12)
