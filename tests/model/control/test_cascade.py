"""The cascade: against an independent statement of it, and its two halves."""

import numpy as np
import pytest

from stickslip_ros.model.control import NO_REFERENCE, Cascade, Reference, Washout
from stickslip_ros.motion.controller import Controller
from stickslip_ros.samples import MotorSample, Sample

PERIOD = 1e-3
MOVES = np.random.default_rng(5).normal(size=(20, 4)) * [1e-4, 0.01, 1e-4, 0.01]
GAINS = {"position_gain": 30.0, "velocity_gain": 2000.0, "integral_gain": 5e4}
WASHOUT = {"corner_frequency": 20.0, "linear_gain": -3000.0, "cubic_gain": -1e4}


def sample(number: int, scale: float = 1.0) -> Sample:
    x, y, far, rate = (scale * MOVES[number]).tolist()
    return Sample(round(number * PERIOD * 1e9), x, y, 0.0, 0.0, 0.0, MotorSample(far, rate))


def forces(law: Cascade | Washout, scale: float = 1.0) -> list[float]:
    controller = Controller(law)
    return [controller.answer(sample(number, scale)) or 0.0 for number in range(len(MOVES))]


@pytest.mark.parametrize("place", ["table", "motor"])
def test_it_is_a_position_loop_around_a_velocity_loop(place: str) -> None:
    law = Cascade(**GAINS, feedback=place, velocity_feedback="motor")
    x, rate = MOVES[:, 0 if place == "table" else 2], MOVES[:, 3]
    error = -30.0 * x - rate
    integral = np.concatenate([[0.0], np.cumsum(5e4 * error[:-1] * PERIOD)])
    np.testing.assert_allclose(forces(law), 2000.0 * error + integral, rtol=1e-12)


@pytest.mark.parametrize("place", ["table", "motor"])
def test_the_force_of_its_washout_is_added(place: str) -> None:
    both = forces(Cascade(**GAINS, **WASHOUT, washout_feedback=place))
    apart = np.add(forces(Cascade(**GAINS)), forces(Washout(**WASHOUT, feedback=place)))
    np.testing.assert_allclose(both, apart, rtol=1e-12)


def test_it_feeds_the_reference_forward() -> None:
    law = Cascade(**GAINS, feed_forward_mass=100.0)
    at_rest = Sample(0, 0.0, 0.0, 0.0, 0.0, 0.0)
    state = law.initial_state(at_rest, NO_REFERENCE)
    force, _ = law.respond(state, 0.0, at_rest, Reference(1e-3, 0.01, 2.0))
    assert force == pytest.approx(2000.0 * (30.0 * 1e-3 + 0.01) + 100.0 * 2.0, rel=1e-14)


def test_its_integral_does_not_grow_beyond_the_limit_of_its_force() -> None:
    law = Cascade(**GAINS, force_limit=50.0)
    ahead = [Sample(n * 1_000_000, 1e-3, 0.0, 0.0, 0.0, 0.0) for n in range(2000)]
    controller = Controller(law)
    assert {controller.answer(each) for each in ahead} == {-50.0}
    assert abs(controller.state[0]) <= 1.5  # the growth of one sample
    freed = Controller(Cascade(**GAINS))
    assert [freed.answer(each) for each in ahead][-1] == pytest.approx(-60.0 - 1.5 * 1999)


@pytest.mark.parametrize("places", ["table table table", "motor motor table", "table motor motor"])
def test_its_linear_form_is_that_of_its_answers(places: str) -> None:
    names = ("feedback", "velocity_feedback", "washout_feedback")
    law = Cascade(**GAINS, **WASHOUT, **dict(zip(names, places.split(), strict=True)))
    linear, z, expected = law.linear_feedback(PERIOD), np.zeros(3), []
    for number, move in enumerate(MOVES):
        if number == 0:  # the washout starts at rest
            z[2] = move[1 if law.washout_feedback == "table" else 3]
        expected.append(linear.output @ z + linear.direct @ move)
        z = linear.state @ z + linear.input @ move
    small = 1e-5
    np.testing.assert_allclose(np.array(forces(law, small)) / small, expected, rtol=1e-6)


def test_its_equations_are_those_of_ever_shorter_samples() -> None:
    law = Cascade(**GAINS, **WASHOUT, feedback="motor", washout_feedback="motor")
    times = np.linspace(0.0, 0.1, 20001)
    state, control = (0.0, 0.0, 0.0, 0.0), [0.0, 0.0]
    for number, time in enumerate(times.tolist()):
        x, far = 1e-4 * np.sin(50.0 * time), 2e-4 * np.sin(30.0 * time)
        y, rate = 5e-3 * np.cos(50.0 * time), 6e-3 * np.cos(30.0 * time)
        told = Sample(0, x, y, 0.0, 0.0, 0.0, MotorSample(far, rate))
        if number == 0:
            state = law.initial_state(told, NO_REFERENCE)
            control = list(law.rest((x, far), (y, rate)))
        elapsed = float(times[1]) if number else 0.0
        force, state = law.respond(state, elapsed, told, NO_REFERENCE)
        if number:
            rates = law.state_rates((x, far), (y, rate), control)
            control = [a + b * elapsed for a, b in zip(control, rates, strict=True)]
    assert law.control_force((x, far), (y, rate), control) == pytest.approx(force, rel=1e-3)
