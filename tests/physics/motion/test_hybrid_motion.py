"""Properties of the motion of a hybrid system, with laws and courses of the tests."""

from itertools import pairwise
from math import nextafter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.equations import WashoutGains
from stickslip_ros.physics.model.friction import Stribeck
from stickslip_ros.physics.motion import Motion, compiled_flow
from stickslip_ros.physics.motion.recorded_motion import RecordedMotion
from stickslip_ros.physics.motion.variational import SensitiveMotion
from tests.examples import examples
from tests.physics.parts import Dahl, Iwan, OneSided, Ramp, Swing

LAWS = [Stribeck(0.4, 0.25, 0.5), Dahl(static=0.4), OneSided(static=0.3), Iwan(static=0.4)]
SWINGS = [
    {},
    {"belt": Swing(0.1, 0.2)},
    {"load": Swing(0.3, 0.1)},
    {"belt": Ramp(), "load": Ramp(0.4)},
]


def drive(law, belt_speed=0.3, **courses) -> Drive:
    return Drive(1.0, 0.05, 1.0, 1.0, belt_speed, law, **courses)


drives = st.builds(
    lambda law, speed, courses: drive(law, speed, **courses),
    st.sampled_from(LAWS),
    st.sampled_from([-0.4, 0.0, 0.3]),
    st.sampled_from(SWINGS),
)
starts = st.tuples(st.floats(-1.0, 1.0), st.sampled_from([-0.4, 0.0, 0.3]) | st.floats(-1.0, 1.0))


@given(drives, starts, st.lists(st.floats(0.0, 1.0), max_size=4))
@examples(quick=20, thorough=300)
def test_cuts_change_nothing(tested: Drive, start: tuple[float, float], cuts: list[float]) -> None:
    whole, cut = Motion(tested, *start), Motion(tested, *start)
    whole.advance(5.0)
    for before, after in pairwise([0.0, *sorted(cuts), 1.0]):
        cut.advance(5.0 * (after - before))
    assert cut.position == pytest.approx(whole.position, abs=1e-9)
    assert cut.velocity == pytest.approx(whole.velocity, abs=1e-9)


@given(drives, starts)
@examples(quick=20, thorough=300)
def test_borrowed_integrators_have_no_memory(tested: Drive, start: tuple[float, float]) -> None:
    def end() -> tuple[float, float]:
        motion = Motion(tested, *start)
        motion.advance(5.0)
        return motion.position, motion.velocity

    first = end()
    Motion(tested, 0.5, -0.7).advance(3.3)
    assert end() == first


@given(drives, starts)
@examples(quick=20, thorough=300)
def test_phases_are_few(tested: Drive, start: tuple[float, float]) -> None:
    check_phases(tested, *start)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("belt_speed", [-0.4, 0.0, 0.3])
def test_phases_are_few_from_a_guard(law, belt_speed: float) -> None:
    forward, backward = law.limits
    for limit in (-forward, backward):
        at = limit - 0.05 * belt_speed
        for position in (at, nextafter(at, 9.0), nextafter(at, -9.0)):
            check_phases(drive(law, belt_speed), position, belt_speed)


def check_phases(tested: Drive, position: float, velocity: float) -> None:
    """Count the phases of ten natural periods; their ends never go back in time."""
    ends = []

    class Counted(RecordedMotion):
        def _phase(self, epoch: float, now: float, end: float) -> float:
            reached = super()._phase(epoch, now, end)
            assert now <= reached <= end
            ends.append(reached)
            return reached

    Counted(tested, position, velocity).advance(20.0 * np.pi)
    assert len(ends) < 1200


def test_an_ended_motion_gives_its_integrator_back(monkeypatch: pytest.MonkeyPatch) -> None:
    Motion(drive(LAWS[0]), 0.0, 0.0).advance(5.0)
    monkeypatch.setattr(compiled_flow, "_compile", lambda *_: pytest.fail("compiles again"))
    Motion(drive(LAWS[0], 0.2), 0.0, 0.0).advance(5.0)


@pytest.mark.parametrize("law", LAWS[1:], ids=lambda law: law.name)
def test_transition_is_that_of_finite_differences(law) -> None:
    motion = SensitiveMotion(drive(law))
    start = np.array([0.1, 0.5, *([0.001] * (motion.order - 2))])

    def end(state):
        motion.start(state)
        motion.advance(2.0)
        return motion.state

    columns = [(end(start + h) - end(start - h)) / 2e-6 for h in 1e-6 * np.eye(motion.order)]
    end(start)
    np.testing.assert_allclose(motion.transition, np.transpose(columns), rtol=1e-5, atol=1e-7)


@given(drives, starts)
@examples(quick=10, thorough=200)
def test_no_guard_is_passed_over(tested: Drive, start: tuple[float, float]) -> None:
    motion = Motion(tested, *start)
    for number in range(1, 201):
        motion.advance(0.05)
        time = 0.05 * number
        belt, load = (
            course.value(time, course.switches_at(time)) for course in (tested.belt, tested.load)
        )
        forward, backward = tested.friction.limits
        relative_speed = motion.velocity - tested.belt_speed - belt
        if motion.sticking:
            assert abs(relative_speed) < 1e-9
            assert -forward * (1.0 + load) - 1e-9 <= motion.friction_force
            assert motion.friction_force <= backward * (1.0 + load) + 1e-9
        elif not tested.friction.states and abs(relative_speed) > 1e-9:
            assert motion.friction_force * relative_speed < 0.0
        if isinstance(tested.friction, Dahl | Iwan):
            assert abs(motion.friction_force) <= 0.4 * (1.0 + load) + 1e-9


NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


@given(drives, starts, st.sampled_from([None, WashoutGains(0.5, -0.1, -0.05)]))
@examples(quick=10, thorough=100)
def test_energy_gained_is_the_work_done(
    tested: Drive, start: tuple[float, float], control: WashoutGains | None
) -> None:
    recorded = RecordedMotion(tested, *start, control=control)
    recorded.advance(5.0)
    corners = np.clip(recorded.take_breakpoints().time, 0.0, 5.0)
    ends = np.unique([*corners, *np.linspace(0.0, 5.0, 201)])
    motion, time, work = Motion(tested, *start, control=control), 0.0, 0.0
    for before, after in pairwise(ends.tolist()):
        for node, weight in zip((1.0 + NODES) / 2.0, WEIGHTS / 2.0, strict=True):
            instant = before + node * (after - before)
            motion.advance(instant - time)
            time, speed = instant, motion.velocity
            force = motion.friction_force + motion.applied_force - tested.damping * speed
            work += weight * (after - before) * force * speed
    motion.advance(5.0 - time)
    energies = [(x * x + v * v) / 2.0 for x, v in (start, (motion.position, motion.velocity))]
    assert energies[1] - energies[0] == pytest.approx(work, abs=1e-8)


@pytest.mark.parametrize(("position", "sticks"), [(0.59, 1), (0.61, 0), (-0.29, 1), (-0.31, 0)])
def test_each_direction_has_its_limit(position: float, sticks: int) -> None:
    assert Motion(drive(OneSided(static=0.3), 0.0), position, 0.0).sticking == bool(sticks)
