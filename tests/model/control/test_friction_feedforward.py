import numpy as np
import pytest

from stickslip_ros.model.control import FrictionFeedforward
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import (
    Coulomb,
    Directional,
    Exponential,
    FrictionLaw,
    LuGre,
    Stribeck,
)
from tests.model.control.answers import (
    BELT_SPEED,
    PID_AND_CURVE,
    answers,
    assert_same,
    random_record,
)

LAW = FrictionFeedforward(**PID_AND_CURVE, exponent=1.7)


@pytest.mark.parametrize("seed", range(5))
def test_it_adds_the_friction_of_the_reference_to_pid_control(seed: int) -> None:
    record = random_record(seed)
    v = record.reference[1] - BELT_SPEED
    friction = np.sign(v) * (250.0 + 150.0 * np.exp(-(np.abs(v / 0.02) ** 1.7))) + 150.0 * v
    integral = 4e6 * np.cumsum(record.elapsed * record.error)
    pid = 3e5 * record.error + integral + 2e3 * record.rate
    assert_same(answers(LAW, record), pid + friction + 90.0 * record.reference[2])


@pytest.mark.parametrize(
    "law",
    [
        Exponential(0.4, kinetic=0.25, decay_speed=0.02, viscous=0.3, exponent=2.0),
        LuGre(Exponential(0.4, kinetic=0.25, decay_speed=0.02), bristle_stiffness=1e4),
        Directional(Coulomb(0.3, viscous=0.5), Coulomb(0.4)),
        Stribeck(0.4, 0.25, 0.05),
    ],
)
def test_it_takes_over_the_friction_of_a_drive(law: FrictionLaw) -> None:
    """An exponential law exactly; another one where its fall begins, has 1/e left and ends."""
    drive = Drive(90.0, 100.0, 1e6, 1000.0, 0.03, law)
    found = LAW.for_drive(drive)
    exact = not isinstance(law, Stribeck)
    speeds = np.array([1e-9, 0.004, 0.02, 0.05]) if exact else np.array([1e-9, 0.05])
    expected = -1000.0 * law.coefficient(speeds, np.ones(len(speeds)))
    forces = [found.size(v) + found.viscous_damping * v for v in speeds.tolist()]
    np.testing.assert_allclose(forces, expected, rtol=1e-6 if exact else 0.15)
    assert found.nominal_mass == 90.0
