"""Every friction law, in each direction, against scipy's DOP853 with events of its own.

The reference has the equations as books have them: m x'' + c x' + k x = -N f + u, with f of the
sign of v = x' - v_b. It shares no expression with the package.
"""

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from math import exp, inf, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import (
    Coulomb,
    Directional,
    Exponential,
    FrictionLaw,
    Linear,
    Stribeck,
    Table,
)
from stickslip_ros.physics.motion import Motion

Curve = Callable[[float], float]
"""Size of the coefficient by abs(v)."""
Made = tuple[FrictionLaw, Curve]
Random = np.random.Generator


def coulomb(draw: Random, unit: float) -> Made:
    static, viscous = draw.uniform(0.2, 0.6), draw.uniform(0.0, 0.3) / unit
    return Coulomb(static, viscous), lambda w: static + viscous * w


def stribeck(draw: Random, unit: float) -> Made:
    static, drop, speed = draw.uniform(0.3, 0.6), draw.uniform(0.05, 0.2), draw.uniform(0.3, 1.0)
    speed *= unit
    a, b = 3.0 * drop / (2.0 * speed), drop / (2.0 * speed**3)
    return Stribeck(static, static - drop, speed), lambda w: static - a * w + b * w**3


def linear(draw: Random, unit: float) -> Made:
    static, slope = draw.uniform(0.3, 0.6), draw.uniform(0.0, 0.1) / unit
    return Linear(static, slope), lambda w: static - slope * w


def exponential(exponent: float) -> Callable[[Random, float], Made]:
    def made(draw: Random, unit: float) -> Made:
        static, kinetic = draw.uniform(0.4, 0.6), draw.uniform(0.1, 0.3)
        speed, viscous = draw.uniform(0.1, 0.5) * unit, draw.uniform(0.0, 0.2) / unit
        law = Exponential(static, kinetic, speed, viscous, exponent)
        return (
            law,
            lambda w: kinetic + (static - kinetic) * exp(-((w / speed) ** exponent)) + viscous * w,
        )

    return made


def table(draw: Random, unit: float) -> Made:
    speeds = [0.0, *np.cumsum(draw.uniform(0.05, 0.3, 6) * unit).tolist()]
    values = draw.uniform(0.2, 0.6, 7).tolist()
    curve = PchipInterpolator([*speeds, 2.0 * speeds[-1]], [*values, values[-1]])
    cubics = curve.c.T.tolist()

    def size(w: float) -> float:
        if w >= speeds[-1]:
            return values[-1]
        piece = bisect_right(speeds, w) - 1
        a, b, c, d = cubics[piece]
        q = w - speeds[piece]
        return ((a * q + b) * q + c) * q + d

    return Table(tuple(zip(speeds, values, strict=True))), size


MAKERS = {
    "coulomb": coulomb,
    "stribeck": stribeck,
    "linear": linear,
    "exponential": exponential(1.0),
    "exponential, exponent 1.5": exponential(1.5),
    "exponential, exponent 2": exponential(2.0),
    "table": table,
}


@dataclass
class Reference:
    """SI units; `ahead` holds for v > 0 and `back` for v < 0."""

    drive: Drive
    ahead: Curve
    back: Curve
    force: float

    def states(self, x: float, y: float, times: FloatArray) -> FloatArray:
        """Return x and x' at increasing times; the motion starts at time 0."""
        found = np.empty((len(times), 2))
        now, end = 0.0, float(times[-1])
        belt, sign = self.drive.belt_speed, self._sign(x, y)
        while now < end:
            if sign == 0.0:
                until = min(end, now + self._stick_time(x))
                rows = (times >= now) & (times <= until)
                found[rows, 0], found[rows, 1] = x + belt * (times[rows] - now), belt
                now, x, y = until, x + belt * (until - now), belt
                sign = -float(np.copysign(1.0, belt))
                continue
            # An event that is zero at the start would be found there.
            until = min(end, now + 1e-3 / self.drive.angular_frequency) if y == belt else end
            solution = self._slip(sign, now, until, x, y, events=y != belt)
            rows = (times >= now) & (times <= solution.t[-1])
            if rows.any():
                found[rows] = solution.sol(times[rows]).T
            now, (x, y) = float(solution.t[-1]), solution.y[:, -1].tolist()
            if solution.status == 1:
                y = belt
                sign = self._sign(x, y)
        return found

    def _sign(self, x: float, y: float) -> float:
        drive = self.drive
        if y != drive.belt_speed:
            return 1.0 if y > drive.belt_speed else -1.0
        held = drive.damping * y + drive.stiffness * x - self.force
        if held > drive.normal_force * self.back(0.0):
            return -1.0
        return 1.0 if held < -drive.normal_force * self.ahead(0.0) else 0.0

    def _stick_time(self, x: float) -> float:
        drive, belt = self.drive, self.drive.belt_speed
        if belt == 0.0:
            return inf
        limit = drive.normal_force * (self.back(0.0) if belt > 0.0 else -self.ahead(0.0))
        release = (limit + self.force - drive.damping * belt) / drive.stiffness
        return max(0.0, (release - x) / belt)

    def _slip(self, sign: float, now: float, end: float, x: float, y: float, *, events: bool):
        drive = self.drive
        curve = self.ahead if sign > 0.0 else self.back

        def rates(_: float, state: FloatArray) -> list[float]:
            x, y = state.tolist()
            size = curve(max(sign * (y - drive.belt_speed), 0.0))
            force = self.force - sign * drive.normal_force * size
            return [y, (force - drive.damping * y - drive.stiffness * x) / drive.mass]

        def reaches_belt(_: float, state: FloatArray) -> float:
            return sign * (state[1] - drive.belt_speed) / drive.speed_scale

        reaches_belt.terminal = True
        reaches_belt.direction = -1.0
        return solve_ivp(
            rates,
            (now, end),
            [x, y],
            method="DOP853",
            dense_output=True,
            events=[reaches_belt] if events else None,
            rtol=1e-11,
            atol=1e-13 * np.array([drive.length_scale, drive.speed_scale]),
            max_step=0.2 / drive.angular_frequency,
        )


def random_drive(maker: Callable[[Random, float], Made], seed: int, *, directional: bool):
    """Return a drive with its reference; every other belt moves backward."""
    draw = np.random.default_rng(seed)
    mass, frequency = 10.0 ** draw.uniform(-2.0, 3.0), 10.0 ** draw.uniform(-1.0, 3.0)
    normal_force, stiffness = 10.0 ** draw.uniform(-2.0, 4.0), mass * frequency**2
    unit = normal_force / stiffness * frequency
    law, ahead = maker(draw, unit)
    back = ahead
    if directional:
        reverse, back = maker(draw, unit)
        law = Directional(law, reverse)
    drive = Drive(
        mass,
        draw.uniform(0.02, 0.2) * sqrt(stiffness * mass),
        stiffness,
        normal_force,
        draw.uniform(0.1, 0.4) * unit * (-1.0) ** seed,
        law,
    )
    return drive, Reference(drive, ahead, back, draw.uniform(-0.3, 0.3) * normal_force)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("directional", [False, True], ids=["", "by direction"])
@pytest.mark.parametrize("maker", MAKERS.values(), ids=MAKERS)
def test_the_motion_is_that_of_an_independent_solver(
    maker: Callable[[Random, float], Made], seed: int, *, directional: bool
) -> None:
    drive, reference = random_drive(maker, seed, directional=directional)
    times = np.linspace(0.0, 20.0 * 2.0 * pi / drive.angular_frequency, 201)
    expected = reference.states(0.0, 0.0, times)
    motion = Motion(drive, 0.0, 0.0)
    motion.force = reference.force
    found = [(motion.position, motion.velocity)]
    for step in np.diff(times).tolist():
        motion.advance(step)
        found.append((motion.position, motion.velocity))
    scales = np.ptp(expected, axis=0)
    assert np.all(np.abs(np.array(found) - expected) <= 1e-7 * scales)
