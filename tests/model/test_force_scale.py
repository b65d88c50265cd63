"""Only the friction N mu acts: how normal force and coefficients share it does not matter."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import (
    Coulomb,
    Dahl,
    Directional,
    ElastoPlastic,
    Exponential,
    FrictionLaw,
    Linear,
    LuGre,
    MaxwellSlip,
    Stiction,
    Stribeck,
    Table,
)
from stickslip_ros.motion import Motion

CURVE = Exponential(0.3, 0.2, decay_speed=0.02, viscous=0.1, exponent=1.0)
LAWS: tuple[FrictionLaw, ...] = (
    Coulomb(0.3, viscous=0.1),
    Linear(0.3, slope=0.4),
    CURVE,
    Stiction(0.3, 0.2, viscous=0.1),
    Stribeck(0.3, 0.2, minimum_speed=0.05),
    Table(((0.0, 0.3), (0.02, 0.22), (0.1, 0.2), (1.0, 0.25))),
    Dahl(0.3, bristle_stiffness=5e3),
    LuGre(CURVE, bristle_stiffness=5e3, bristle_damping=2.0),
    ElastoPlastic(CURVE, bristle_stiffness=5e3),
    MaxwellSlip(CURVE, bristle_stiffness=5e3, elements=2),
    Directional(Stiction(0.3, 0.2), Stiction(0.25, 0.2)),
)


def moved(drive: Drive) -> tuple[float, float]:
    motion = Motion(drive, 0.0, 0.0)
    motion.force = 20.0
    motion.advance(0.2)
    return motion.position, motion.velocity


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{type(law).__name__}")
@pytest.mark.parametrize("normal_force", [1e-3, 1.0, 1e6])
def test_a_drive_moves_alike(law: FrictionLaw, normal_force: float) -> None:
    usual = Drive(100.0, 20.0, 1e6, 1000.0, 0.03, friction=law, bias_force=5.0)
    other = law.multiplied(1000.0 / normal_force)
    assert other is not None
    changed = replace(usual, normal_force=normal_force, friction=other)
    assert moved(changed) == pytest.approx(moved(usual), rel=1e-9)
    assert changed.equilibrium_position == pytest.approx(usual.equilibrium_position, rel=1e-12)


@given(st.floats(-3.0, 6.0))
def test_the_unit_of_force_is_of_the_size_of_friction(exponent: float) -> None:
    normal_force = 10.0**exponent
    drive = Drive(normal_force=normal_force, friction=Coulomb(400.0 / normal_force))
    assert 400.0 / 8.0 <= drive.force_scale <= 400.0 * 2.0**10
    assert drive.dimensionless.friction.static * drive.force_scale == pytest.approx(400.0)


def test_usual_coefficients_leave_the_normal_force_as_the_unit() -> None:
    assert Drive(normal_force=1000.0, friction=Stribeck(0.4, 0.25, 0.05)).force_scale == 1000.0
