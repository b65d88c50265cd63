"""Rates of a flow, their gradients, and the equilibrium of a law with a memory."""

import numpy as np

from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.drive_system import SLIP, DriveSystem
from stickslip_ros.physics.model.hybrid import Mode
from stickslip_ros.physics.motion.derivatives import flow_rates, parameter_values
from stickslip_ros.physics.theory.linear import expand
from tests.physics.parts import Dahl

DRIVE = Drive(1.0, 0.05, 1.0, 1.0, 0.3, Dahl(static=0.4))


def test_gradients_are_those_of_finite_differences() -> None:
    system = DriveSystem(DRIVE)
    parameters = parameter_values(system, Mode(SLIP, (-1.0,)), [0.1])
    flow, state = flow_rates(system, SLIP), np.array([0.2, 0.1, -0.01])
    _, gradients = flow.at(state, parameters)
    steps = 1e-6 * np.eye(3)
    found = [
        (flow.at(state + h, parameters)[0] - flow.at(state - h, parameters)[0]) / 2e-6
        for h in steps
    ]
    np.testing.assert_allclose(gradients[:3], np.transpose(found), atol=1e-8)


def test_rates_are_zero_at_the_equilibrium_of_a_memory() -> None:
    expansion = expand(DRIVE)
    assert expansion is not None
    np.testing.assert_allclose(expansion.equilibrium, [0.4, 0.0, -0.02], atol=1e-12)
    system = DriveSystem(DRIVE)
    parameters = parameter_values(system, Mode(SLIP, (-1.0,)), [0.0])
    rates, _ = flow_rates(system, SLIP).at(expansion.equilibrium, parameters)
    np.testing.assert_allclose(rates, 0.0, atol=1e-12)
