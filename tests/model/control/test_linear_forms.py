"""The linear form of each law against finite differences of its answers."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.arrays import FloatArray
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
from stickslip_ros.samples import Sample

DRIVE = Drive(100.0, 200.0, 1e6, 1000.0, 0.03, Stribeck(0.4, 0.25, 0.05))
PID: dict[str, Any] = {"position_gain": 2e5, "integral_gain": 3e6, "velocity_gain": 4e3}
LAWS = [
    Washout(20.0, linear_gain=-3000.0, cubic_gain=0.0),
    VelocityFeedback(velocity_gain=-3000.0),
    Pid(**PID),
    FrictionFeedforward(**PID, kinetic_force=0.0, static_force=0.0),
    DisturbanceObserver(nominal_mass=80.0, bandwidth=50.0, position_gain=1e5, velocity_gain=3e3),
    SlidingMode(nominal_mass=50.0, slope=30.0, switching_force=600.0, boundary_layer=0.1),
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
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
    own = {*(law.name for law in LAWS), "cascade"}  # in test_cascade.py
    assert own == {name for name, form in defaults.items() if form}
