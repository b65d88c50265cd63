"""Properties of every control law that has equations, or a linear form."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures import CycleMeter
from stickslip_ros.model.control import (
    CONTROL_LAWS,
    NO_REFERENCE,
    ControlLaw,
    DisturbanceObserver,
    FrictionFeedforward,
    Pid,
    SlidingMode,
    VelocityFeedback,
    Washout,
)
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Stribeck
from stickslip_ros.motion import Motion, RecordedMotion
from stickslip_ros.motion.controller import Controller
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.motion.simulation import simulate_continuous, simulate_sampled
from stickslip_ros.samples import Sample
from tests.drives import FEED_DRIVE

Law = Washout | VelocityFeedback
LAWS: list[Law] = [Washout(20.0, -3000.0, -1e4), VelocityFeedback(-500.0, 2e4)]
laws = pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
REST = (2.584e-4, 0.0)


def at(position: float, velocity: float, stamp: int = 0) -> Sample:
    return Sample(stamp, position, velocity, 0.0, 0.0, 0.0)


def test_all_laws_with_equations_are_tested() -> None:
    """`test_cascade.py` has the law that feeds back two bodies."""
    found = [name for name, law in CONTROL_LAWS.items() if law().continuous is not None]
    assert {*(law.name for law in LAWS), "cascade"} == {*found}


@laws
def test_at_rest_its_states_stay_and_silenced_it_has_the_same_and_no_force(law: Law) -> None:
    rest, own = law.rest(*REST), [0.1] * len(law.states)
    assert list(law.state_rates(*REST, rest)) == [0.0] * len(own)
    silent = law.silenced()
    assert silent.control_force(0.3, 0.2, own) == 0.0
    assert list(silent.state_rates(0.3, 0.2, own)) == list(law.state_rates(0.3, 0.2, own))


@laws
def test_its_bound_is_no_less_than_the_energy_that_it_gives(law: Law) -> None:
    """For a slide that swings about the equilibrium."""
    phase = np.linspace(0.0, 2.0 * np.pi, 4001)[:-1]
    omega = 90.0
    for size in (0.01, 0.1):
        speed, position = size * np.cos(phase), size / omega * np.sin(phase)
        states: list[FloatArray] = []
        if isinstance(law, Washout):  # w' = y - d w, periodic
            response = size / (law.corner_frequency + 1j * omega)
            states = [np.real(response * np.exp(1j * phase))]
        given_energy = np.mean(law.control_force(position, speed, states) * speed)
        allowed = np.mean(law.bound(speed) * speed)
        assert given_energy <= allowed + 1e-12 * abs(allowed)


@laws
def test_the_faster_it_is_sampled_the_nearer_it_is_to_its_equations(law: Law) -> None:
    def run(rate: float | None) -> Motion:
        motion = RecordedMotion(FEED_DRIVE, 0.0, 0.0, law if rate is None else None)
        if rate is None:
            simulate_continuous(motion, law, 0.2, CycleMeter(20))
        else:
            loop = SampledLoop(motion, rate, 10**9)
            simulate_sampled(loop, motion, Controller(law), 0.2, CycleMeter(20))
        return motion

    exact = run(None)
    errors = [
        abs(motion.position - exact.position) * 100.0 + abs(motion.velocity - exact.velocity)
        for motion in map(run, (5e3, 2e4))
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


@laws
def test_its_state_goes_from_the_motion_to_the_controller_and_back(law: Law) -> None:
    """The state of the equations, in the units of the sampled law."""
    motion = Motion(FEED_DRIVE, 1e-4, -0.05, law.continuous)
    motion.advance(0.013)
    state = motion.control_state
    force = motion.applied_force
    controller = Controller(law, state=(*state, 0.0)[: len(law.state_units)] if state else None)
    sample = at(motion.position, motion.velocity)
    assert controller.answer(sample) == pytest.approx(force, rel=1e-9)
    motion.advance(0.01)
    motion.control_state = state
    assert motion.control_state == pytest.approx(state, rel=1e-15)


@laws
def test_a_change_of_drive_or_constants_keeps_its_state(law: Law) -> None:
    motion = Motion(FEED_DRIVE, 1e-4, -0.05, law.continuous)
    motion.advance(0.013)
    state, place = motion.control_state, (motion.position, motion.velocity)
    for drive in (replace(FEED_DRIVE, mass=30.0), replace(FEED_DRIVE, normal_force=400.0)):
        motion.drive = drive
        assert motion.control_state == pytest.approx(state, rel=1e-14)
    motion.control = law.silenced()
    assert motion.control_state == pytest.approx(state, rel=1e-14)
    assert (motion.position, motion.velocity) == pytest.approx(place, rel=1e-14)
    assert motion.applied_force == 0.0
    motion.control = Washout(50.0, -1.0, 0.0) if motion.control_state else law
    assert motion.control_state == pytest.approx(state, rel=1e-14)


DRIVE = Drive(100.0, 200.0, 1e6, 1000.0, 0.03, Stribeck(0.4, 0.25, 0.05))
PID: dict[str, Any] = {"position_gain": 2e5, "integral_gain": 3e6, "velocity_gain": 4e3}
LINEAR = [
    Washout(20.0, linear_gain=-3000.0, cubic_gain=0.0),
    VelocityFeedback(velocity_gain=-3000.0),
    Pid(**PID),
    FrictionFeedforward(**PID, kinetic_force=0.0, static_force=0.0),
    DisturbanceObserver(nominal_mass=80.0, bandwidth=50.0, position_gain=1e5, velocity_gain=3e3),
    SlidingMode(nominal_mass=50.0, slope=30.0, switching_force=600.0, boundary_layer=0.1),
]


@pytest.mark.parametrize("law", LINEAR, ids=lambda law: law.name)
@given(st.floats(1e-5, 0.5))
def test_the_form_is_the_derivative_of_the_answers(law: ControlLaw, period: float) -> None:
    """From sample to sample, forces and states are those of finite differences."""
    linear = law.linear_feedback(period)
    assert linear is not None
    order, rest = len(linear.state), DRIVE.equilibrium_position
    assert linear.state.shape == (order, order)
    assert linear.input.shape == (order, 2)
    assert (linear.output.shape, linear.direct.shape) == ((order,), (2,))
    moves: FloatArray = np.random.default_rng(1).normal(size=(7, 2)) * [1e-4, 0.01]
    moves[0] = 0.0  # no time has passed before the first sample

    def forces(size: float) -> FloatArray:
        state = law.initial_state(Sample(0, rest, 0.0, 0.0, 0.0, 0.0), NO_REFERENCE)
        found: list[float] = []
        for number, (x, y) in enumerate(size * moves):
            elapsed = period if number > 0 else 0.0
            sample = Sample(0, rest + x, y, 0.0, 0.0, 0.0)
            force, state = law.respond(state, elapsed, sample, NO_REFERENCE)
            found.append(force)
        return np.array(found)

    size = 1e-4
    differences = (forces(size) - forces(-size)) / (2.0 * size)
    z, expected = np.zeros(order), list[float]()
    for move in moves:
        expected.append(float(linear.output @ z + linear.direct @ move))
        z = linear.state @ z + linear.input @ move
    np.testing.assert_allclose(differences, expected, rtol=1e-6, atol=1e-6)


def test_all_laws_with_a_linear_form_are_tested() -> None:
    defaults = {name: law().linear_feedback(1e-3) for name, law in CONTROL_LAWS.items()}
    own = {*(law.name for law in LINEAR), "cascade"}  # in test_cascade.py
    assert own == {name for name, form in defaults.items() if form}
