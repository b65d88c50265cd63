"""An axis on a guide: no spring holds the slide, and forces alone move it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import cos, expm1, inf, log, log1p, nextafter, pi, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.model.control import VelocityFeedback
from stickslip_ros.physics.model.courses import Sine
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import Coulomb, Directional, Exponential
from stickslip_ros.physics.motion import Motion, RecordedMotion
from tests.physics.drives import FEED_DRIVE

# Of Janot, Gautier, Brunot, 2019: friction in N over 1000 N, and an offset.
AXIS = Drive(
    mass=95.154,
    damping=0.0,
    stiffness=0.0,
    normal_force=1000.0,
    belt_speed=0.0,
    friction=Directional(
        Coulomb(static=0.020144, viscous=0.1667061), Coulomb(static=0.0206277, viscous=0.2404236)
    ),
    bias_force=3.1648,
)
FORWARD, BACKWARD = (20.144, 166.7061), (20.6277, 240.4236)
"""Coulomb friction (N) and viscous friction (N s/m) of either direction."""


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_push_dies_out_as_the_closed_form_says(sign: float) -> None:
    """From s v0 to rest by m v' = -s (F + V s v) + bias."""
    motion, start, speed = Motion(AXIS, 0.01, sign * 0.3), 0.01, 0.3
    coulomb, viscous = FORWARD if sign > 0.0 else BACKWARD
    net, rate = coulomb - sign * AXIS.bias_force, viscous / AXIS.mass
    stop = log1p(viscous * speed / net) / rate
    motion.advance(0.5 * stop)
    decayed = (speed + net / viscous) * (-expm1(-rate * 0.5 * stop))
    assert motion.velocity == pytest.approx(sign * (speed - decayed), rel=1e-13)
    path = decayed / rate - net / viscous * 0.5 * stop
    assert motion.position == pytest.approx(start + sign * path, rel=1e-13)
    motion.advance(stop)
    assert motion.sticking
    assert motion.velocity == 0.0
    path = (speed - net / viscous * log(1.0 + viscous * speed / net)) / rate
    assert motion.position == pytest.approx(start + sign * path, rel=1e-13)


@pytest.mark.parametrize("force", [100.0, -100.0])
def test_a_constant_force_leads_to_the_speed_at_which_friction_balances_it(force: float) -> None:
    motion = Motion(AXIS, 0.0, 0.0)
    motion.force = force
    motion.advance(60.0)
    coulomb, viscous = FORWARD if force > 0.0 else BACKWARD
    sign = 1.0 if force > 0.0 else -1.0
    net = force + AXIS.bias_force - sign * coulomb
    assert motion.velocity == pytest.approx(net / viscous, rel=1e-13)
    rate = viscous / AXIS.mass
    path = net / viscous * (60.0 + expm1(-rate * 60.0) / rate)
    assert motion.position == pytest.approx(path, rel=1e-13)


def test_it_breaks_loose_at_its_static_friction_in_either_direction() -> None:
    for sign, (coulomb, _) in ((1.0, FORWARD), (-1.0, BACKWARD)):
        for share in (1.0 - 1e-12, 1.0 + 1e-12):
            motion = Motion(AXIS, 0.2, 0.0)
            motion.force = sign * share * coulomb - AXIS.bias_force
            motion.advance(1.0)
            assert motion.sticking == (share < 1.0)
            assert (motion.position == 0.2) == (share < 1.0)


@pytest.mark.parametrize("law", [Coulomb(0.02), Exponential(0.02, 0.01, 0.1, 0.0)])
def test_a_force_that_is_just_too_large_does_not_stop_the_run(law: Coulomb | Exponential) -> None:
    motion = Motion(replace(AXIS, friction=law, bias_force=0.0), 0.1, 0.0)
    for _ in range(100):
        motion.force = nextafter(20.0, inf)
        motion.advance(1.0)
        motion.force = 20.0
        motion.advance(1.0)
    assert motion.position >= 0.1


HELD = [
    AXIS,
    replace(AXIS, friction=Exponential(0.03, 0.02, 0.01, 0.1), damping=20.0),
    replace(AXIS, load=Sine(amplitude=50.0, frequency=3.0)),
    replace(FEED_DRIVE, belt_speed=0.0),
    replace(FEED_DRIVE, belt_speed=0.0, bias_force=-40.0),
]
"""The last ones have a spring."""
HOUR = 3600.0  # s


def break_away(drive: Drive, sign: float, position: float) -> float:
    """Return the control force (N) with 0.9 of the least friction that holds the slide."""
    forward, backward = drive.friction.limits
    limit = (forward if sign > 0.0 else backward) * (drive.normal_force + drive.load.bounds[0])
    return sign * 0.9 * limit + drive.stiffness * position - drive.bias_force


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("drive", HELD)
def test_stick_is_stick(drive: Drive, sign: float) -> None:
    """An hour at 0.9 of the break-away force: no drift at all, in one step and in many."""
    start = 0.1 * sign
    for steps in (1, 100):
        motion = Motion(drive, start, 0.0)
        motion.force = break_away(drive, sign, start)
        before = motion.position
        assert before == pytest.approx(start, rel=1e-15)
        for _ in range(steps):
            motion.advance(HOUR / steps)
        assert motion.sticking
        assert (motion.position, motion.velocity) == (before, 0.0)


@pytest.mark.parametrize("drive", HELD)
def test_stick_is_stick_in_the_sampled_loop(drive: Drive) -> None:
    force = break_away(drive, 1.0, 0.1)
    loop = SampledLoop(Motion(drive, 0.1, 0.0), rate=5.0, start=0, force_delay=0.07)
    assert loop.offer(loop.sample.stamp, force)
    loop.advance()  # up to its arrival the first force is zero: the slide may move
    for _ in range(10):
        loop.offer(loop.sample.stamp, force)
        sample = loop.advance()
    loop.reset(0.1, 0.0)
    loop.offer(loop.sample.stamp, force)
    first = sample = loop.advance()
    for _ in range(round(HOUR * 5.0)):
        loop.offer(sample.stamp, force)
        sample = loop.advance()
        assert (sample.position, sample.velocity) == (first.position, 0.0)
    assert sample.stamp - first.stamp == HOUR * 1_000_000_000


def test_stick_is_stick_under_continuous_control() -> None:
    """A spring of the controller that pulls with 0.9 of the break-away force."""
    law = VelocityFeedback(velocity_gain=-100.0, position_gain=-1000.0)
    motion = Motion(AXIS, -(0.9 * 20.144 - AXIS.bias_force) / 1000.0, 0.0, control=law.continuous)
    before = motion.position
    for _ in range(60):
        motion.advance(60.0)
    assert motion.sticking
    assert (motion.position, motion.velocity) == (before, 0.0)


def test_energy_balances() -> None:
    """Work of the forces, less what friction takes on the way, is the kinetic energy."""
    drive = replace(AXIS, friction=Directional(Coulomb(0.020144), Coulomb(0.0206277)))
    motion = RecordedMotion(drive, 0.0, 0.1)
    rng = np.random.default_rng(5)
    work, dissipated = 0.5 * drive.mass * 0.1**2, 0.0
    for force in rng.uniform(-60.0, 60.0, 200).tolist():
        motion.force, start = force, motion.position
        motion.advance(0.1)
        work += (force + drive.bias_force) * (motion.position - start)
        path = np.diff(motion.take_breakpoints().position, prepend=start)
        dissipated += 20.144 * path[path > 0.0].sum() - 20.6277 * path[path < 0.0].sum()
        kinetic = 0.5 * drive.mass * motion.velocity**2
        assert kinetic + dissipated - work == pytest.approx(0.0, abs=1e-12 * dissipated)
    assert dissipated > 1.0  # J


STEP = 0.05  # s


@dataclass
class ScipyAxis:
    """m x'' + c x' = -N(t) f(v) + u + bias while it slips, by DOP853 with events.

    `sizes` are those of the coefficient over the size of the relative speed, forward and backward.
    """

    mass: float
    damping: float
    bias: float
    sizes: Sequence[Callable[[float], float]]
    normal: Callable[[float], float]
    belt: Callable[[float], float]
    belt_rate: Callable[[float], float]

    def run(self, position: float, velocity: float, forces: Sequence[float]) -> FloatArray:
        """Return displacement and velocity every `STEP`, with a force (N) in each."""
        found: list[FloatArray] = []
        now, state = 0.0, np.array([position, velocity])
        mode = int(np.sign(velocity - self.belt(0.0)))
        for number, force in enumerate(forces, start=1):
            end = number * STEP
            if mode == 0 or state[1] == self.belt(now):
                mode = self._at_belt_speed(now, force, None)
            while now < end:
                # A slide that starts to slip starts on its event.
                starts = mode != 0 and abs(state[1] - self.belt(now)) < 1e-12
                until = min(end, now + 1e-4) if starts else end
                solution = solve_ivp(
                    self._rates(mode, force), (now, until), state, "DOP853", rtol=1e-12,
                    atol=1e-14, events=None if starts else self._events(mode, force), max_step=0.02,
                )  # fmt: skip
                now, state = float(solution.t[-1]), solution.y[:, -1].copy()
                if solution.status == 1:
                    state[1] = self.belt(now)
                    mode = self._at_belt_speed(now, force, mode)
            found.append(state.copy())
        return np.array(found)

    def _size(self, sign: int, speed: float) -> float:
        return self.sizes[0 if sign > 0 else 1](sign * speed)

    def _held(self, time: float, force: float) -> float:
        moving = self.mass * self.belt_rate(time) + self.damping * self.belt(time)
        return moving - force - self.bias

    def _at_belt_speed(self, time: float, force: float, before: int | None) -> int:
        held, normal = self._held(time, force), self.normal(time)
        if before == 0:  # it has just reached one of its limits
            return -1 if held > 0.0 else 1
        if held > normal * self._size(-1, 0.0):
            return -1
        return 1 if held < -normal * self._size(1, 0.0) else 0

    def _rates(self, mode: int, force: float) -> Callable[[float, FloatArray], list[float]]:
        def rates(time: float, state: FloatArray) -> list[float]:
            if mode == 0:
                return [state[1], self.belt_rate(time)]
            friction = mode * self.normal(time) * self._size(mode, state[1] - self.belt(time))
            net = force + self.bias - self.damping * state[1] - friction
            return [state[1], net / self.mass]

        return rates

    def _events(self, mode: int, force: float) -> list[Callable[[float, FloatArray], float]]:
        events: list[Callable[[float, FloatArray], float]] = [
            lambda time, _: self.normal(time) * self._size(-1, 0.0) - self._held(time, force),
            lambda time, _: self.normal(time) * self._size(1, 0.0) + self._held(time, force),
        ]
        if mode != 0:
            events = [lambda time, state: mode * (state[1] - self.belt(time))]
        for event in events:
            event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
        return events


@pytest.mark.parametrize("belt_moves", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_random_axes_move_as_another_integrator_says(seed: int, belt_moves: bool) -> None:
    """Random masses, laws and held forces; with a belt and a load that swing too."""
    rng = np.random.default_rng([seed, belt_moves])
    mass, normal = (10.0 ** rng.uniform(-1.0, 3.0, 2)).tolist()
    unit = normal / mass  # acceleration at a coefficient of one
    damping, bias = 0.2 * mass * rng.random(), 0.1 * normal * rng.uniform(-1.0, 1.0)
    laws: list[Exponential] = []
    sizes: list[Callable[[float], float]] = []
    for _ in range(2):
        static, kinetic = sorted(rng.uniform(0.2, 0.6, 2).tolist(), reverse=True)
        decay, viscous = unit * rng.uniform(0.05, 0.3), rng.uniform(0.0, 0.3) / unit
        laws.append(Exponential(static, kinetic, decay, viscous))
        sizes.append(
            lambda speed, s=static, k=kinetic, d=decay, v=viscous: float(
                k + (s - k) * np.exp(-speed / d) + v * speed
            )
        )
    swing, weight = (0.3 * unit, 0.2 * normal) if belt_moves else (0.0, 0.0)
    slow, quick = 2.0 * pi * 0.4, 2.0 * pi * 1.3
    drive = Drive(
        mass, damping, 0.0, normal, 0.0, Directional(*laws), bias_force=bias,
        **({"belt": Sine(swing, frequency=0.4), "load": Sine(weight, frequency=1.3)}
        if belt_moves else {}),
    )  # fmt: skip
    other = ScipyAxis(
        mass, damping, bias, sizes,
        lambda time: normal + weight * sin(quick * time),
        lambda time: swing * sin(slow * time),
        lambda time: swing * slow * cos(slow * time),
    )  # fmt: skip
    forces = np.repeat(normal * rng.uniform(-0.9, 0.9, 30), rng.integers(5, 20, 30)).tolist()
    start = 0.2 * unit * rng.uniform(-1.0, 1.0)
    expected = other.run(0.1, start, forces)
    motion, found = Motion(drive, 0.1, start), list[tuple[float, float]]()
    for force in forces:
        motion.force = force
        motion.advance(STEP)
        found.append((motion.position, motion.velocity))
    sticks = np.array(found)[:, 1] == 0.0
    assert belt_moves or 0.02 < np.mean(sticks) < 0.98
    scale = np.abs(expected).max(axis=0)
    assert np.array(found) / scale == pytest.approx(expected / scale, abs=1e-9)
