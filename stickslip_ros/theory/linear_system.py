"""Linear systems near the equilibrium as matrices: from a disturbance force to the motion."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.actuator import IDEAL_ACTUATOR
from stickslip_ros.model.control import ContinuousControl, ControlLaw, LinearFeedback
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import POSITION, SPEED
from stickslip_ros.model.plain_drive import drive_system
from stickslip_ros.theory.linear import expand
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """State space of a loop near its equilibrium, with n states, one input and two outputs.

    z' = A z + B u and y = C z + D u, where z' is the rate of z or, with a sample period, z at the
    next sample. The state z is the deviation from the equilibrium, dimensionless as in `Drive`. The
    input u is a disturbance force on the slide, N, which is held from sample to sample. The outputs
    y are the deviations of displacement, m, and velocity, m/s.
    """

    states: tuple[str, ...]
    """Names of the states: displacement `x` and velocity `y`, the memory of the friction law, the
    states of the control law, and of a sampled loop those of the actuator, the forces under way and
    the earlier displacements, the newest first."""
    A: FloatArray
    """Shape (n, n); rates are in 1/s."""
    B: FloatArray
    """Shape (n, 1)."""
    C: FloatArray
    """Shape (2, n)."""
    D: FloatArray
    """Shape (2, 1)."""
    sample_period: float
    """Sample period, s; 0 for a continuous loop."""

    @property
    def eigenvalues(self) -> npt.NDArray[np.complex128]:
        """Eigenvalues of A, the poles: in 1/s, or per sample; shape (n,)."""
        return np.linalg.eigvals(self.A).astype(np.complex128)


def continuous_system(drive: Drive, control: ContinuousControl | None) -> LinearSystem | None:
    """Return the linear loop with continuous control, both in SI units; None at a belt at rest."""
    expansion = expand(drive, control)
    if expansion is None:
        return None
    names = drive_system(replace(drive, actuator=IDEAL_ACTUATOR), control).states
    forced = np.eye(len(names))[SPEED]
    frequency = drive.angular_frequency
    return _system(drive, names, expansion.jacobian * frequency, forced * frequency, 0.0)


def sampled_system(loop: LinearSampledLoop, law: ControlLaw | LinearFeedback) -> LinearSystem:
    """Return the linear loop with sampled control.

    Raises InvalidInputError if the law is not linear near the equilibrium.
    """
    drive, matrix, disturbed = loop.drive, loop.transition_matrix(law), loop.disturbed
    law_order = len(matrix) - len(disturbed) - loop.under_way - sum(loop.spans)
    names = (
        *drive_system(replace(drive, actuator=IDEAL_ACTUATOR)).states,
        *(f"actuator.{name}" for name in drive.actuator.states),
        *(f"control.{number}" for number in range(1, law_order + 1)),
        *(f"force.{number}" for number in range(1, loop.under_way + 1)),
        *(f"earlier_x.{number}" for number in range(1, loop.spans[0] + 1)),
        *(f"earlier_motor.x.{number}" for number in range(1, loop.spans[1] + 1)),
    )
    forced = np.pad(disturbed, (0, len(matrix) - len(disturbed)))
    return _system(drive, names, matrix, forced, 1.0 / loop.rate)


def _system(
    drive: Drive, names: tuple[str, ...], matrix: FloatArray, forced: FloatArray, period: float
) -> LinearSystem:
    """Return the system with a matrix, and the effect of a disturbance force of one."""
    outputs = np.zeros((2, len(names)))
    outputs[0, POSITION], outputs[1, SPEED] = drive.length_scale, drive.speed_scale
    inputs = forced[:, np.newaxis] / drive.force_scale
    return LinearSystem(names, matrix, inputs, outputs, np.zeros((2, 1)), period)
