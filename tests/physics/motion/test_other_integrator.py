"""The motion against scipy's DOP853, with independently written equations and sticking rules."""

from collections.abc import Callable
from dataclasses import replace
from math import exp

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stickslip_ros.physics.model.friction import Coulomb, Exponential, FrictionLaw, Linear, Stribeck
from stickslip_ros.physics.motion import Motion, RecordedMotion
from tests.physics.drives import PAPER

Coefficient = Callable[[float, float], float]

LAWS: list[tuple[FrictionLaw, Coefficient]] = [
    (Stribeck(0.4, 0.25, 0.5), lambda v, s: -0.4 * s + 0.45 * v - 0.6 * v**3),
    (Coulomb(0.4), lambda v, s: -0.4 * s),
    (Linear(0.4, 0.1), lambda v, s: -0.4 * s + 0.1 * v),
    (
        Exponential(0.4, 0.25, 0.3, 0.02),
        lambda v, s: -s * (0.25 + 0.15 * exp(-abs(v) / 0.3) + 0.02 * abs(v)),
    ),
]
DAMPING, STATIC = 0.02, 0.4


class Solver:
    """X'' + 0.02 X' + X = mu + U, piece by piece; `switches` are where stick and slip end."""

    def __init__(self, coefficient: Coefficient, belt: float, x: float, y: float) -> None:
        self.coefficient, self.belt = coefficient, belt
        self.x, self.y, self.now = x, y, 0.0
        self.switches: list[float] = []

    def advance(self, force: float, duration: float) -> None:
        end = self.now + duration
        while self.now < end:
            reaction = self.x + DAMPING * self.belt - force
            if self.y != self.belt:
                self._slip(force, float(np.sign(self.y - self.belt)), end)
            elif abs(reaction) > STATIC - 1e-12:
                self._slip(force, -float(np.sign(reaction)), end)
            else:
                self._stick(force, end)

    def _stick(self, force: float, end: float) -> None:
        limit = np.copysign(STATIC, self.belt) + force - DAMPING * self.belt
        until = min(end, self.now + (limit - self.x) / self.belt)
        self.x += self.belt * (until - self.now)
        self.now = until
        if until < end:
            self.switches.append(until)

    def _slip(self, force: float, sign: float, end: float) -> None:
        def slope(_: float, state: np.ndarray) -> list[float]:
            x, y = state
            return [y, self.coefficient(y - self.belt, sign) - DAMPING * y - x + force]

        def reaches_belt(_: float, state: np.ndarray) -> float:
            return sign * (state[1] - self.belt)

        reaches_belt.terminal = True
        reaches_belt.direction = -1.0
        solution = solve_ivp(
            slope,
            (self.now, end),
            [self.x, self.y],
            method="DOP853",
            rtol=1e-11,
            atol=1e-13,
            events=reaches_belt,
        )
        self.now = float(solution.t[-1])
        self.x, self.y = solution.y[:, -1].tolist()
        if solution.status == 1:
            self.y = self.belt
            self.switches.append(self.now)


@pytest.mark.parametrize(("law", "coefficient"), LAWS, ids=lambda part: getattr(part, "name", ""))
@pytest.mark.parametrize("belt", [0.3, -0.3])
def test_same_motion(law: FrictionLaw, coefficient: Coefficient, belt: float) -> None:
    motion = RecordedMotion(replace(PAPER, belt_speed=belt, friction=law), 0.1, 0.9)
    solver = Solver(coefficient, belt, 0.1, 0.9)
    for force, duration in [(0.0, 9.0), (0.5, 4.0), (-0.7, 5.0), (0.1, 7.0)]:
        motion.force = force
        motion.advance(duration)
        solver.advance(force, duration)
        assert motion.position == pytest.approx(solver.x, rel=0.0, abs=1e-9)
        assert motion.velocity == pytest.approx(solver.y, rel=0.0, abs=1e-9)
    breakpoints = motion.take_breakpoints()
    # Where stick begins and ends, and where the slide passes the speed of the belt.
    ends = np.append(breakpoints.sticking[1:] != breakpoints.sticking[:-1], False)
    passed = np.append((breakpoints.velocity[1:-1] == belt) & ~breakpoints.sticking[1:-1], False)
    switches = np.unique(breakpoints.time[ends | np.append(False, passed)])
    assert len(solver.switches) > 4
    for expected in solver.switches:
        assert np.abs(switches - expected).min() < 1e-9


@pytest.mark.parametrize("decay_speed", [0.1, 0.01, 0.001])
def test_a_law_that_changes_suddenly_is_not_stepped_over(decay_speed: float) -> None:
    """The steps of the integrator fit what comes, be they asked for in one go or one by one."""
    law = Exponential(0.4, 0.25, decay_speed, 0.0)
    in_one_go = Motion(replace(PAPER, belt_speed=0.2, friction=law), 0.0, 0.0)
    one_by_one = Motion(replace(PAPER, belt_speed=0.2, friction=law), 0.0, 0.0)
    in_one_go.advance(100.0)
    for _ in range(10_000):
        one_by_one.advance(0.01)
    assert in_one_go.position == pytest.approx(one_by_one.position, rel=0.0, abs=1e-9)
    assert in_one_go.velocity == pytest.approx(one_by_one.velocity, rel=0.0, abs=1e-9)
