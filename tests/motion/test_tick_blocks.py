"""Blocks of ticks: the same motion as tick by tick, and the same answers."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typing_extensions import override

from benchmarks.random_drives import random_law
from stickslip_ros.errors import RunError
from stickslip_ros.measures import CycleMeter
from stickslip_ros.model.actuator import Actuator
from stickslip_ros.model.control import ControlLaw, Pid, VelocityFeedback, Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import (
    Coulomb,
    Directional,
    Exponential,
    FrictionLaw,
    Stiction,
    Stribeck,
)
from stickslip_ros.model.sensor import Sensor
from stickslip_ros.model.signals import sine
from stickslip_ros.motion import RecordedMotion, simulation
from stickslip_ros.motion.controller import Controller
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.motion.simulation import simulate_sampled
from stickslip_ros.motion.tick_blocks import TickBlocks
from tests.examples import examples

RATE = 1000.0
LAWS = ("stribeck", "coulomb", "linear", "stiction", "directional")


def drive_of(law: str, step: float, seed: int) -> Drive:
    """Return a random drive, whose belt may move backward, or rest; `step` is omega T."""
    draw = np.random.default_rng(seed)
    mass, normal = 10.0 ** draw.uniform(-1.0, 3.0, 2)
    stiffness = mass * (step * RATE) ** 2
    speed = normal / np.sqrt(mass * stiffness)
    damping = draw.uniform(0.0, 0.2) * np.sqrt(mass * stiffness)
    belt_speed = float(draw.choice([0.0, -1.0, 1.0, 1.0, 1.0]) * draw.uniform(0.02, 0.6) * speed)
    friction = friction_of(law, draw, speed)
    return Drive(mass, damping, stiffness, normal, belt_speed, friction)


def friction_of(law: str, draw: np.random.Generator, speed: float) -> FrictionLaw:
    if law == "stiction":
        return Stiction(0.4, 0.25, 0.1 / speed)
    if law == "directional":
        return Directional(Stribeck(0.4, 0.25, 0.5 * speed), Stribeck(0.35, 0.3, 0.6 * speed))
    return random_law(law, draw, speed)[0]


def law_of(name: str, drive: Drive, limit: float) -> ControlLaw:
    unit = drive.normal_force / drive.speed_scale
    limit *= drive.normal_force
    if name == "washout":
        corner, cubic = 0.3 * drive.angular_frequency, -0.5 * unit / drive.speed_scale**2
        later = 10.0 / drive.angular_frequency
        return Washout(corner, -0.1 * unit, cubic, start_after=later, force_limit=limit)
    gain = 0.05 if name == "unstable" else -0.03
    return VelocityFeedback(gain * unit, 0.05 * drive.stiffness, force_limit=limit)


@dataclass
class Run:
    """A run of the sampled loop, in blocks or tick by tick."""

    motion: RecordedMotion
    loop: SampledLoop
    controller: Controller
    forces: list[float]
    in_blocks: int
    """Number of ticks in blocks."""

    @property
    def numbers(self) -> list[float]:
        """Forces, state of slide and controller, and friction, in the scales of the drive."""
        drive, motion = self.motion.drive, self.motion
        weight, speed = drive.normal_force, drive.speed_scale
        return [
            *(force / weight for force in (*self.forces, self.loop.sample.friction_force)),
            *(force / weight for force in (motion.friction_force, motion.force)),
            motion.position / drive.length_scale,
            *(each / speed for each in (motion.velocity, *self.controller.state)),
        ]

    @property
    def exact(self) -> list[object]:
        """What does not depend on the integration."""
        loop, motion = self.loop, self.motion
        sample, answers = loop.sample, loop.answers
        return [
            *(sample.stamp, sample.belt_position, sample.belt_velocity, loop.sample_number),
            *(loop.answered, answers.controller_present, answers.late_forces, answers.dropped),
            *(motion.sticking, motion.unbounded, motion.clock.signal_time, motion.core.mode),
        ]


def run(drive: Drive, law: ControlLaw, samples: int, *, blocks: bool) -> Run:
    motion = RecordedMotion(drive, 0.1 * drive.length_scale, 0.0)
    motion.recording = False
    found = Run(motion, SampledLoop(motion, RATE, 10**9), Controller(law), [], 0)
    meter = CycleMeter(4)

    class Counted(TickBlocks):
        @override
        def advance(self, most: int) -> list[float]:
            forces = super().advance(most) if blocks else []
            found.in_blocks += len(forces)
            return forces

    def take(times: Sequence[float], forces: list[float]) -> None:
        found.forces.extend(forces)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation, "TickBlocks", Counted)
        patch.setattr(simulation, "LEAST_TICKS", 0)
        patch.setattr(meter.drift.force, "feed", take)
        simulate_sampled(found.loop, motion, found.controller, samples / RATE, meter)
    return found


@given(
    st.sampled_from(LAWS),
    st.sampled_from(["washout", "velocity", "unstable"]),
    st.sampled_from([np.inf, 0.01]),
    st.sampled_from([0.01, 0.15]),
    st.integers(0, 1000),
)
@examples(quick=3, thorough=12)
def test_the_motion_is_that_of_single_ticks(
    friction: str, control: str, limit: float, step: float, seed: int
) -> None:
    drive = drive_of(friction, step, seed)
    law = law_of(control, drive, limit)
    ours, single = (run(drive, law, 2500, blocks=blocks) for blocks in (True, False))
    assert ours.exact == single.exact
    assert ours.numbers == pytest.approx(single.numbers, rel=1e-12, abs=1e-12)
    # Each law has a few guards in a cycle, and these drives leave much of a cycle between them.
    assert ours.in_blocks > len(ours.forces) // 8


def test_a_law_that_fails_does_so_at_the_same_sample() -> None:
    drive = Drive(1.0, 1.0, 100.0, 1e6, 1e3, Stribeck(0.4, 0.25, 5e4))
    law, failures = VelocityFeedback(1e308, start_after=0.5), list[str]()
    for blocks in (True, False):
        with pytest.raises(RunError) as failure:
            run(drive, law, 2500, blocks=blocks)
        failures.append(str(failure.value))
    assert failures[0] == failures[1]


class Foreign(Washout):
    """Law whose force is its own."""

    @override
    def force(self, filtered: Any) -> Any:
        return abs(filtered)


@dataclass(frozen=True)
class Tanh(Coulomb):
    """Law that is no polynomial, and gives no characteristic speed."""

    @override
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        return -self.static * sign / (1.0 + relative_speed * relative_speed)


PLAIN = drive_of("stribeck", 0.01, 1)
OTHERS: dict[str, tuple[Drive, ControlLaw | None, dict[str, Any]]] = {
    "no control": (PLAIN, None, {}),
    "law that decides": (PLAIN, Pid(), {}),
    "law of others": (PLAIN, Foreign(), {}),
    "feedback of the motor": (PLAIN, Washout(feedback="motor"), {}),
    "delay": (PLAIN, Washout(), {"force_delay": 1e-3}),
    "jitter": (PLAIN, Washout(), {"force_jitter": 1e-3}),
    "sensor": (PLAIN, Washout(), {"sensor": Sensor(velocity_noise=1e-3)}),
    "disturbance": (PLAIN, Washout(), {"disturbance": sine(1.0, frequency=1.0)}),
    "stamps that are rounded": (PLAIN, Washout(), {"rate": 300.0}),
    "long ticks": (PLAIN, Washout(), {"rate": 1.0}),
    "limited actuator": (replace(PLAIN, actuator=Actuator(limit=1.0)), Washout(), {}),
    "belt that moves": (replace(PLAIN, belt=sine(0.01, frequency=1.0)), Washout(), {}),
    "exponential": (replace(PLAIN, friction=Exponential(0.4, 0.25, 0.1)), Washout(), {}),
    "no polynomial": (replace(PLAIN, friction=Tanh(0.4)), Washout(), {}),
}


@pytest.mark.parametrize("name", [*OTHERS, "recorded"])
def test_what_a_block_lacks_goes_tick_by_tick(name: str) -> None:
    drive, law, options = OTHERS.get(name, (PLAIN, Washout(), {}))
    options = {**options}
    motion = RecordedMotion(drive, 0.0, 0.0)
    motion.recording = name == "recorded"
    loop = SampledLoop(motion, options.pop("rate", RATE), 10**9, **options)
    assert TickBlocks.for_loop(loop, motion, None if law is None else Controller(law)) is None
