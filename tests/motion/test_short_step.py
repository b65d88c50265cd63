"""Short steps: the same motion, to the last bit, as with the general case alone."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks import random_drives
from stickslip_ros.model.control import Washout
from stickslip_ros.model.sensor import Sensor
from stickslip_ros.motion import RecordedMotion, hybrid_motion
from stickslip_ros.motion.controller import Controller
from stickslip_ros.motion.sampled_loop import SampledLoop
from tests.examples import examples

PARTS: dict[str, dict[str, Any]] = {
    "plain": {},
    "sensor": {"sensor": Sensor(position_resolution=1e-4, velocity_noise=1e-3, seed=3)},
    "delay": {"force_delay": 1e-3, "force_jitter": 2e-3},
}


def general(*_: object) -> hybrid_motion.ShortStep:
    return lambda duration, force: False


def observed(law: str, kind: str, place: str, seed: int, part: str, *, runs: bool) -> list[object]:
    """Return samples, forces and breakpoints of a controlled loop, half of them recorded."""
    drive = random_drives.drive_of_place(seed, law, kind, place)
    motion = RecordedMotion(drive.drive, drive.position, drive.velocity)
    options: dict[str, Any] = {**PARTS[part], "disturbance": drive.force.packaged}
    loop = SampledLoop(motion, 1.0 / drive.sample, 10**9, **options)
    unit = drive.plain.normal_force / drive.plain.speed_scale
    washout = Washout(0.3 * drive.plain.angular_frequency, -0.2 * unit, 0.0)
    controller, found = Controller(washout), list[object]()
    forces = loop.run(controller.answer)
    for number in range(400):
        motion.recording = number >= 200
        if runs:
            force = next(forces)
        else:
            sample = loop.sample
            force = controller.answer(sample)
            assert force is not None
            loop.offer(sample.stamp, force)
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
@examples(quick=4, thorough=50)
def test_the_motion_is_that_of_the_general_case(
    law: str, kind: str, place: str, seed: int, part: str
) -> None:
    found = observed(law, kind, place, seed, part, runs=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hybrid_motion, "short_step", general)
        assert found == observed(law, kind, place, seed, part, runs=False)
