"""A motion with recurrence and short steps is that of the general case."""

from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks import random_drives, random_memory_drives
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.hybrid import Mode
from stickslip_ros.model.sensor import Sensor
from stickslip_ros.motion import RecordedMotion, hybrid_motion
from stickslip_ros.motion.controller import Controller, answer
from stickslip_ros.motion.recurrence import Recurrence
from stickslip_ros.motion.sampled_loop import SampledLoop
from tests.drives import PAPER
from tests.examples import examples


def drive_of(law: str, seed: int) -> Drive:
    """Return a random drive whose belt has a constant speed."""
    if law in random_drives.LAWS:
        return random_drives.drive_of_place(seed, law, "step", "disturbance").drive
    return random_memory_drives.random_memory_drive(law, seed).drive


class Unknown(Recurrence):
    """Knows no phase: all are integrated."""

    def is_known(self, phase: Any, mode: Any, state: Any) -> bool:
        return False


@contextmanager
def integrating_all() -> Generator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hybrid_motion, "Recurrence", Unknown)
        yield


def motion_of(drive: Drive, control: Washout | None) -> RecordedMotion:
    """Return the motion after four advances, of which three are recorded."""
    motion = RecordedMotion(drive, 0.0, 0.0, control)
    motion.recording = False
    period = drive.natural_period
    motion.advance(60.0 * period)
    motion.recording = True
    motion.advance(30.0 * period)
    motion.advance(13.37 * period)
    motion.advance(6.0 * period)
    return motion


@given(
    st.sampled_from([*random_drives.LAWS, *random_memory_drives.LAWS]),
    st.integers(0, 1000),
    st.none() | st.tuples(st.floats(0.1, 2.0), st.floats(-0.5, 0.2)),
)
@examples(quick=3, thorough=12)
def test_what_recurs_is_equal_to_the_last_bit(
    law: str, seed: int, gains: tuple[float, float] | None
) -> None:
    drive, control = drive_of(law, seed), None
    if gains is not None:
        corner, gain = gains
        scale = drive.normal_force / drive.speed_scale
        control = Washout(corner * drive.angular_frequency, gain * scale).continuous
    one = motion_of(drive, control)
    with integrating_all():
        other = motion_of(drive, control)
    for name in ("position", "velocity", "sticking", "memory", "control_state"):
        assert getattr(one, name) == getattr(other, name)
    found, known = one.take_breakpoints(), other.take_breakpoints()
    for name in ("time", "position", "velocity", "sticking"):
        np.testing.assert_array_equal(getattr(found, name), getattr(known, name))


def test_a_settled_cycle_is_not_integrated_again() -> None:
    motion = RecordedMotion(PAPER, 0.0, 0.0)
    motion.recording = False
    motion.advance(100.0)
    entered = list[Mode]()
    enter = motion.core.enter

    def counting(mode: Mode) -> None:
        entered.append(mode)
        enter(mode)

    motion.core.enter = counting
    motion.advance(1000.0)
    known = len(entered)
    with integrating_all():
        motion.advance(1000.0)
    assert 10 * known < 2 * (len(entered) - known)


def test_no_step_is_longer_than_the_bound_of_its_phase() -> None:
    motion = RecordedMotion(PAPER, 0.0, 0.0)
    flow = motion.core.flow
    assert flow is not None
    for _ in range(50):
        _, length = flow.taylor.step()
        bound = flow.phase_bound() - flow.taylor.time
        assert 0.0 <= bound < 10.0 * length


PARTS: dict[str, dict[str, Any]] = {
    "plain": {},
    "sensor": {"sensor": Sensor(position_resolution=1e-4, velocity_noise=1e-3, seed=3)},
    "delay": {"force_delay": 1e-3, "force_jitter": 2e-3},
}


def general(*_: object) -> hybrid_motion.ShortStep:
    return lambda duration, force: False


def observed(law: str, kind: str, place: str, seed: int, part: str) -> list[object]:
    """Return samples, forces and breakpoints of a controlled loop, half of them recorded."""
    drive = random_drives.drive_of_place(seed, law, kind, place)
    motion = RecordedMotion(drive.drive, drive.position, drive.velocity)
    options: dict[str, Any] = {**PARTS[part], "disturbance": drive.force.packaged}
    loop = SampledLoop(motion, 1.0 / drive.sample, 10**9, **options)
    unit = drive.plain.normal_force / drive.plain.speed_scale
    washout = Washout(0.3 * drive.plain.angular_frequency, -0.2 * unit, 0.0)
    controller, found = Controller(washout), list[object]()
    for number in range(400):
        motion.recording = number >= 200
        force = answer(loop, controller)
        loop.advance()
        found += [force, loop.sample, loop.true_sample]
    points = motion.take_breakpoints()
    found += [points.time.tolist(), points.position.tolist(), points.velocity.tolist()]
    return found


@given(
    st.sampled_from(random_drives.LAWS),
    st.sampled_from(random_drives.KINDS),
    st.sampled_from(random_drives.PLACES),
    st.integers(0, 1000),
    st.sampled_from([*PARTS]),
)
@examples(quick=4, thorough=12)
def test_the_motion_is_that_of_the_general_case(
    law: str, kind: str, place: str, seed: int, part: str
) -> None:
    found = observed(law, kind, place, seed, part)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hybrid_motion, "short_step", general)
        assert found == observed(law, kind, place, seed, part)
