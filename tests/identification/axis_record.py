"""Records of an axis without a spring under position control, as a machine would log them."""

from functools import cache

import numpy as np

from stickslip_ros.identification.record import Record
from stickslip_ros.identification.servo import Servo, closed_loop
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Directional, FrictionLaw, Table

SERVO = Servo(position_gain=1.2e6, velocity_gain=9e3, difference_samples=2, limit=float("inf"))
COULOMB = Directional(Coulomb(static=20.0, viscous=150.0), Coulomb(static=25.0, viscous=200.0))
_SPEEDS = (0.0, *np.geomspace(1e-3, 0.12, 40).tolist())
SATURATING = Table(
    tuple((w, 12.0 + 10.0 * (1.0 - float(np.exp(-w / 0.012))) + 150.0 * w) for w in _SPEEDS)
)


def axis(friction: FrictionLaw) -> Drive:
    """Return an axis of 95 kg."""
    return Drive(
        mass=95.0, damping=0.0, stiffness=0.0, normal_force=1.0, belt_speed=0.0, friction=friction
    )


@cache
def record(law: str, duration: float = 12.0, seed: int = 0) -> Record:
    """Return a run along strokes of several speeds, with an encoder of 50 nm."""
    random = np.random.default_rng(seed)
    count = round(duration / 1e-3)
    speed, place = np.zeros(count), 0
    while place < count:
        length = int(random.uniform(400, 900))
        speed[place : place + length] = random.choice([-1.0, 1.0]) * random.choice(
            [0.02, 0.05, 0.1]
        )
        place += length
    smooth = np.convolve(speed, np.hanning(200) / np.hanning(200).sum(), "same")
    reference = 1e-3 * np.cumsum(smooth)
    friction = COULOMB if law == "coulomb" else SATURATING
    still = np.zeros(count)
    start = Record("axis", 1e-3, still, still, reference=reference)
    position, force = closed_loop(start, axis(friction), SERVO, 0.0)
    measured = np.rint(position / 5e-8) * 5e-8
    return Record("axis", 1e-3, measured, still, force=force, reference=reference)
