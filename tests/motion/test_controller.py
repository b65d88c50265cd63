"""A controller gives samples to its law: time, limits, references, changes."""

import pickle
from dataclasses import dataclass, replace
from math import inf, nan
from typing import ClassVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.errors import RunError
from stickslip_ros.model.constants import constant
from stickslip_ros.model.control import (
    NO_REFERENCE,
    ControlLaw,
    Reference,
    VelocityFeedback,
    Washout,
)
from stickslip_ros.model.control.base import State
from stickslip_ros.model.signals import ramp
from stickslip_ros.motion import Motion
from stickslip_ros.motion.controller import Controller, ReferenceSource, answer, no_reference
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.samples import Sample
from tests.drives import PAPER

MILLISECOND = 10**6


@dataclass(frozen=True)
class Integral(ControlLaw):
    """Force proportional to the integral of the position error; counts its samples."""

    name: ClassVar[str] = "integral"
    follows_reference: ClassVar[bool] = True
    gain: float = constant(1.0, "Gain.", "N/m s")

    def initial_state(self, sample: Sample, reference: Reference) -> State:
        return (0.0, (reference.position or 0.0) - sample.position, 0.0)

    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        integral, error, count = state
        integral += error * elapsed
        error = (reference.position or 0.0) - sample.position
        return self.gain * integral, (integral, error, count + 1.0)


@dataclass(frozen=True)
class Constant(ControlLaw):
    """Constant force."""

    name: ClassVar[str] = "constant"
    value: float = constant(1.0, "Force.", "N")

    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        assert reference is NO_REFERENCE
        return self.value, state


LAWS = [Washout(2.0, -1.0, -1.0), VelocityFeedback(-1.0, -0.5), Integral(2.0)]
laws = pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
RAMP = ramp(1.0, start=0.5e-3, duration=4e-3).reference

steps = st.lists(
    st.tuples(st.integers(1, 10**9), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
    min_size=1,
    max_size=15,
)


def at(stamp: int, position: float = 0.0, velocity: float = 0.0) -> Sample:
    return Sample(stamp, position, velocity, 0.0, 0.0, 0.0)


def samples_of(moves: list[tuple[int, float, float]]) -> list[Sample]:
    stamp, samples = 0, list[Sample]()
    for elapsed, position, velocity in moves:
        stamp += elapsed
        samples.append(at(stamp, position, velocity))
    return samples


@laws
@given(moves=steps)
def test_it_gives_the_law_its_state_and_the_time_between_samples(
    law: ControlLaw, moves: list[tuple[int, float, float]]
) -> None:
    controller = Controller(law, RAMP)
    state: State = ()
    samples = samples_of(moves)
    for number, sample in enumerate(samples):
        since = (sample.stamp - samples[0].stamp) * 1e-9
        reference = RAMP(since) if law.follows_reference else NO_REFERENCE
        elapsed = moves[number][0] * 1e-9 if number > 0 else 0.0
        if number == 0:
            state = law.initial_state(sample, reference)
        force, state = law.respond(state, elapsed, sample, reference)
        assert controller.answer(sample) == force
        assert (controller.state, controller.reference) == (state, reference)


@laws
@given(moves=steps, limit=st.sampled_from([0.0, 0.1, 0.5, inf]), start=st.floats(0.0, 3.0))
def test_force_limit_and_start_after_hold_for_any_law(
    law: ControlLaw, moves: list[tuple[int, float, float]], limit: float, start: float
) -> None:
    free = Controller(law, RAMP)
    limited = Controller(replace(law, force_limit=limit, start_after=start), RAMP)
    samples = samples_of(moves)
    for sample in samples:
        force = free.answer(sample)
        since = (sample.stamp - samples[0].stamp) * 1e-9
        acts = since >= start - 1e-9  # a stamp is a whole number of nanoseconds
        assert limited.answer(sample) == (max(-limit, min(limit, force)) if acts else 0.0)
        assert limited.state == free.state


@laws
@given(moves=steps, stamps=st.lists(st.integers(-(10**9), 16 * 10**9), max_size=3))
def test_a_restart_is_a_fresh_controller(
    law: ControlLaw, moves: list[tuple[int, float, float]], stamps: list[int]
) -> None:
    """Time goes back before the beginning, after any samples, and the law starts again."""
    law = replace(law, start_after=0.3)
    used, fresh = Controller(law, RAMP), Controller(law, RAMP)
    for stamp in stamps:
        used.answer(at(stamp + 10**12, 0.7, -0.4))
    if not stamps:
        return
    for sample in samples_of(moves):
        assert used.answer(sample) == fresh.answer(sample)
    if len(moves) > 1:
        assert (used.state, used.reference) == (fresh.state, fresh.reference)


@laws
@given(moves=steps, older=st.integers(0, 10**10))
def test_a_single_older_sample_leaves_it_alone(
    law: ControlLaw, moves: list[tuple[int, float, float]], older: int
) -> None:
    undisturbed, disturbed = Controller(law, RAMP), Controller(law, RAMP)
    samples = samples_of(moves)
    for number, sample in enumerate(samples):
        expected = undisturbed.answer(sample)
        assert disturbed.answer(sample) == expected
        if number == len(samples) // 2:
            stray = min(older, sample.stamp)
            found = disturbed.answer(at(stray, 3.0, 3.0))
            starts = stray <= samples[0].stamp and stray < sample.stamp
            alone = Controller(law, RAMP).answer(at(stray, 3.0, 3.0))
            assert found == (alone if starts else None)
        assert disturbed.state == undisturbed.state


@laws
def test_two_older_samples_with_a_newer_one_between_leave_it_alone(law: ControlLaw) -> None:
    undisturbed, disturbed = Controller(law, RAMP), Controller(law, RAMP)
    for number in range(1, 8):
        sample = at(number * MILLISECOND, 0.1 * number, -0.2 * number)
        assert disturbed.answer(sample) == undisturbed.answer(sample)
        assert disturbed.state == undisturbed.state
        if number > 2:
            assert disturbed.answer(at((number - 1) * MILLISECOND, 3.0, 3.0)) is None


@pytest.mark.parametrize(
    ("law", "changed"),
    [
        (Washout(2.0, -1.0, 0.0), Washout(9.0, -2.0, -1.0, force_limit=1.0)),
        (Integral(2.0), Integral(-1.0, start_after=2e-3)),
    ],
)
def test_a_law_that_is_replaced_at_work_keeps_its_state(
    law: ControlLaw, changed: ControlLaw
) -> None:
    controller = Controller(law, RAMP)
    for number in range(4):
        controller.answer(at(number * MILLISECOND, 0.1 * number, 0.2 * number))
    state = controller.state
    controller.law = changed
    assert controller.state == state != ()
    sample = at(4 * MILLISECOND, 0.3, 0.1)
    force, _ = changed.respond(state, 1e-3, sample, RAMP(4e-3))
    assert controller.answer(sample) == max(-changed.force_limit, min(changed.force_limit, force))


def test_the_first_state_is_the_given_one_and_only_at_the_first_start() -> None:
    controller = Controller(Washout(2.0, -1.0, 0.0), state=(0.3, 0.0))
    assert controller.state == (0.3, 0.0)
    assert controller.answer(at(10**9, velocity=0.5)) == -0.2
    assert controller.state == (0.3, 0.5)
    controller.answer(at(1, velocity=0.5))
    controller.answer(at(2, velocity=0.5))
    assert controller.state == (0.5, 0.5)


@pytest.mark.parametrize("reference", [no_reference, RAMP])
@laws
def test_a_controller_at_work_goes_to_another_process(
    law: ControlLaw, reference: ReferenceSource
) -> None:
    assert pickle.loads(pickle.dumps(law)) == law
    controller = Controller(law, reference)
    for number in range(3):
        controller.answer(at(number * MILLISECOND, 0.1, 0.2 * number))
    copy: Controller = pickle.loads(pickle.dumps(controller))
    for number in range(2, 6):
        sample = at(number * MILLISECOND, -0.1, 0.1 * number)
        assert copy.answer(sample) == controller.answer(sample)
    assert copy.state == controller.state


def test_a_law_that_follows_no_reference_receives_none() -> None:
    assert Controller(Constant(3.0), RAMP).answer(at(1)) == 3.0
    assert Controller(Constant(-inf, force_limit=5.0)).answer(at(1)) == -5.0
    assert answer(SampledLoop(Motion(PAPER, 0.0, 0.0), 100.0, 0), None) == 0.0


@pytest.mark.parametrize(("force", "limit"), [(nan, 5.0), (inf, inf)])
def test_a_force_that_is_not_finite_is_not_applied(force: float, limit: float) -> None:
    loop = SampledLoop(Motion(PAPER, 0.0, 0.0), 100.0, 0)
    with pytest.raises(RunError) as failed:
        answer(loop, Controller(Constant(force, force_limit=limit)))
    reason = f"its force is {force}, which must be a finite number"
    assert str(failed.value) == f"the control law constant fails at 0 s: {reason}"
    assert not loop.answered


@dataclass(frozen=True)
class Fragile(ControlLaw):
    """Time since the start; fails while the slide moves."""

    name: ClassVar[str] = "fragile"

    def initial_state(self, sample: Sample, reference: Reference) -> State:
        return (0.0 / (sample.velocity - 1.0),)

    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        time = state[0] + elapsed / (sample.velocity == 0.0)
        return time, (time,)


def test_the_sample_after_a_failure_continues_from_the_last_good_one() -> None:
    controller = Controller(Fragile())
    with pytest.raises(RunError, match="fails at 0 s: ZeroDivisionError"):
        controller.answer(at(0, velocity=1.0))
    assert controller.answer(at(1000 * MILLISECOND)) == 0.0
    with pytest.raises(RunError, match=r"fails at 1\.5 s: ZeroDivisionError"):
        controller.answer(at(2500 * MILLISECOND, velocity=0.5))
    assert controller.answer(at(3000 * MILLISECOND)) == 2.0


@pytest.mark.parametrize("rate", [3000, 7000, 9999])
def test_a_force_acts_at_the_sample_that_is_its_start(rate: int) -> None:
    """The stamp of that sample is rounded to a whole nanosecond, up or down."""
    law = VelocityFeedback(-1.0, start_after=1.0 / rate)
    stamps = [0, round(1e9 / rate)]
    samples = [Sample(stamp, 0.0, 1.0, 0.0, 0.0, 0.0) for stamp in stamps]
    controller = Controller(law)
    assert [controller.answer(each) for each in samples] == [0.0, -1.0]
