"""The actuator in the loop: commands are limited when they arrive, and may lag."""

from dataclasses import replace
from math import exp

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.model.actuator import Actuator
from stickslip_ros.physics.model.signals import step
from stickslip_ros.physics.motion import Motion
from tests.examples import examples
from tests.physics.drives import PAPER
from tests.physics.parts import lag

SECOND = 10**9


def commands(number: int) -> float:
    return 0.5 * (-1.0) ** number * (1.0 + 0.1 * number)


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 2.25])
def test_a_command_is_limited_when_it_arrives_and_then_held(delay: float) -> None:
    """Delay in periods; the arrived force acts, and none before the first."""
    motion = Motion(replace(PAPER, actuator=Actuator(limit=0.6)), 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND, force_delay=delay / 10.0)
    acting: list[float] = []
    for number in range(8):
        loop.offer(loop.sample.stamp, commands(number))
        loop.advance()
        acting.append(motion.force)
    arrived = int(delay)
    sent = [max(-0.6, min(0.6, commands(number))) for number in range(8)]
    assert acting == [0.0] * arrived + sent[: 8 - arrived]


def test_a_disturbance_is_not_limited() -> None:
    motion = Motion(replace(PAPER, actuator=Actuator(limit=0.1)), 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND, disturbance=step(5.0))
    loop.offer(SECOND, 3.0)
    loop.advance()
    assert motion.force == 5.1


@pytest.mark.parametrize("time_constant", [0.0, 0.05])
def test_a_new_actuator_limits_from_the_next_command_on(time_constant: float) -> None:
    motion = Motion(replace(PAPER, actuator=lag(time_constant)), 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND)
    forces: list[float] = []
    for number, largest in enumerate((0.4, 0.2, 5.0, 5.0)):
        loop.offer(loop.sample.stamp, 3.0)
        actuator = Actuator(limit=largest, time_constant=time_constant)
        loop.change_drive(replace(PAPER, actuator=actuator))
        loop.advance()
        forces.append(motion.force)
        assert loop.sample_number == number + 1
    assert forces == [3.0, 0.4, 0.2, 3.0]


@given(
    st.sampled_from([0.0, 0.3, 1.7]), st.sampled_from([0.0, 2.5]), st.floats(0.02, 0.5), st.data()
)
@examples(quick=15, thorough=100)
def test_a_lag_behind_delay_and_jitter_is_that_of_the_switched_command(
    delay: float, jitter: float, time_constant: float, data: st.DataObject
) -> None:
    """Delay and jitter in periods. The force is that of u' = (held - u)/lag, by hand."""
    seed = data.draw(st.integers(0, 1000))
    disturbance = data.draw(st.floats(-0.2, 0.2))
    drive = replace(PAPER, actuator=lag(time_constant))

    class Switched(Motion):
        """Keeps how long which command was held."""

        def advance(self, duration: float) -> None:
            pieces.append((self.force, self.disturbance, duration))
            super().advance(duration)

    pieces: list[tuple[float, float, float]] = []
    motion = Switched(drive, 0.0, 0.0)
    loop = SampledLoop(
        motion,
        10.0,
        SECOND,
        force_delay=delay / 10.0,
        force_jitter=jitter / 10.0,
        force_jitter_seed=seed,
    )
    loop.disturb(disturbance)
    for number in range(10):
        loop.offer(loop.sample.stamp, commands(number))
        loop.advance()
    hand, force = Motion(drive, 0.0, 0.0), 0.0
    for command, extra, duration in pieces:
        hand.set_forces(command, extra)
        hand.advance(duration)
        force = command + (force - command) * exp(-duration / time_constant)
        assert hand.applied_force - extra == pytest.approx(force, abs=1e-12)
    assert sum(duration for *_, duration in pieces) == pytest.approx(1.0)
    assert {command for command, *_ in pieces} <= {0.0, *map(commands, range(10))}
    assert {extra for _, extra, _ in pieces} == {0.0, disturbance}
    assert (motion.position, motion.velocity) == (hand.position, hand.velocity)


def test_a_reset_puts_the_lag_at_rest() -> None:
    motion = Motion(replace(PAPER, actuator=lag(0.5)), 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND)
    for _ in range(10):
        loop.offer(loop.sample.stamp, 1.0)
        loop.advance()
    assert motion.applied_force > 0.8
    loop.reset(0.1, 0.0)
    loop.offer(loop.sample.stamp, 1.0)
    loop.advance()
    assert motion.applied_force == 0.0


def test_a_new_drive_keeps_the_lag_in_the_loop() -> None:
    motion = Motion(replace(PAPER, actuator=lag(0.5)), 0.0, 0.0)
    loop = SampledLoop(motion, 10.0, SECOND)
    for number in range(10):
        loop.offer(loop.sample.stamp, 1.0)
        if number == 4:
            loop.change_drive(replace(PAPER, normal_force=3.0, actuator=lag(0.5)))
        loop.advance()
    assert motion.applied_force == pytest.approx(1.0 - exp(-2.0), rel=1e-12)
