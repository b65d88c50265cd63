"""Equilibria of a drive: the states in which the slip equations have no rate."""

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import RunError
from stickslip_ros.physics.model.drive_system import MEMORY, SLIP, SPEED, DriveSystem
from stickslip_ros.physics.motion.derivatives import flow_rates

_ITERATIONS = 50
_CLOSE = 1e-14
"""Step, relative to the state or to one, below which Newton's method has converged."""


def equilibria(system: DriveSystem, parameters: FloatArray) -> FloatArray:
    """Return the equilibria for m columns of parameter values, shape (n, m), dimensionless.

    By Newton's method from rest at X = 0 with the law's memory of steady slip; for a static law the
    first step is exact.

    Parameters
    ----------
    system : DriveSystem
        Drive, with or without continuous control.
    parameters : ndarray
        Values in the order of `system.index`, shape (number of parameters, m).

    Returns
    -------
    ndarray
        States, shape (n, m).

    Raises
    ------
    RunError
        If the iteration does not converge.
    """
    rates, index, law = flow_rates(system, SLIP), system.index, system.drive.friction
    order = len(system.states)
    states = np.zeros((order, parameters.shape[1]))
    if law.states:
        speeds, signs = -parameters[index["belt_speed"]], parameters[index["sign"]]
        memory = [
            law.memory_at(*each) for each in zip(speeds.tolist(), signs.tolist(), strict=True)
        ]
        states[MEMORY : MEMORY + len(law.states)] = np.array(memory).T
    for _ in range(_ITERATIONS):
        rate, gradients = rates.at(states, parameters)
        jacobians = np.moveaxis(gradients[:order], -1, 0)
        try:
            step = np.linalg.solve(jacobians, -rate.T[..., np.newaxis])[..., 0].T
        except np.linalg.LinAlgError:
            break
        states += step
        # X' is zero there. Rounding, which differs between processors, would give it a sign.
        states[SPEED] = 0.0
        if np.all(np.abs(step) <= _CLOSE * np.maximum(1.0, np.abs(states).max(axis=0))):
            return states
    raise RunError(f"the friction law {law.name}: the equilibrium was not found")
