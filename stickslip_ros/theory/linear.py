"""Expansion of the slip equations at the equilibrium: the derivatives of the right-hand side.

heyoka differentiates the equations of the `DriveSystem`, for any smooth friction law. Everything is
dimensionless (see `Drive`). The n states are X, Y, the memory of the law and, with continuous
control, its states, such as W of eq. 17. The actuator has no part in it. Displacement and
velocity of a motor of finite mass are the last two states.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations
from math import copysign
from typing import Any, Self

import heyoka as hy
import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import RunError
from stickslip_ros.model.actuator import IDEAL_ACTUATOR
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import MEMORY, SPEED
from stickslip_ros.model.drive_system import SLIP, DriveSystem
from stickslip_ros.model.plain_drive import drive_system
from stickslip_ros.motion.compilation import compiled_function
from stickslip_ros.motion.compiled_flow import evaluated, flow_rates
from stickslip_ros.theory.requirements import require_equilibrium

_ORDERS = (1, 2, 3)
"""Orders of the derivatives."""

_ITERATIONS = 50
_CONVERGED_STEP = 1e-14
"""Step, relative to the state or to one, below which Newton's method has converged."""


@dataclass(frozen=True)
class ComplexPair:
    """The complex pair of eigenvalues that decays slowest, or grows fastest."""

    growth: float
    """Real part."""
    frequency: float
    """Imaginary part, above zero."""
    right: npt.NDArray[np.complex128]
    """q with A q = (growth + i frequency) q."""
    left: npt.NDArray[np.complex128]
    """p with A^T p = (growth - i frequency) p, and p* q = 1."""

    @classmethod
    def of_matrix(cls, jacobian: FloatArray) -> Self | None:
        """Return the pair of a matrix; None if its eigenvalues are real."""
        decomposed: Any = np.linalg.eig(jacobian)
        values, right = decomposed
        upper = int(np.argmax(np.where(values.imag > 0.0, values.real, -np.inf)))
        if values[upper].imag <= 0.0:
            return None
        left = np.linalg.inv(right)[upper].conj()
        value = complex(values[upper])
        return cls(value.real, value.imag, right[:, upper], left)


@dataclass(frozen=True)
class Expansion:
    """Right-hand side f at the equilibrium to third order: f = A z + B(z, z)/2 + C(z, z, z)/6.

    z is the deviation of the state from the equilibrium. All values are dimensionless.
    """

    equilibrium: FloatArray
    """State in equilibrium: X = mu(-v0), eq. 6, and Y = 0; shape (n,)."""
    jacobian: FloatArray
    """A, eq. 7 and 20; shape (n, n)."""
    quadratic: FloatArray
    """B; shape (n, n, n), symmetric in the last two indices."""
    cubic: FloatArray
    """C; shape (n, n, n, n), symmetric in the last three indices."""
    jacobian_by_belt_speed: FloatArray
    """dA/dv0 along the equilibrium; shape (n, n)."""

    @cached_property
    def eigenvalues(self) -> npt.NDArray[np.complex128]:
        """Eigenvalues of A, sorted by decreasing real part, then imaginary part; shape (n,)."""
        values = np.linalg.eigvals(self.jacobian).astype(np.complex128)
        return np.array(sorted(values, key=lambda value: (-round(value.real, 14), -value.imag)))

    @cached_property
    def pair(self) -> ComplexPair | None:
        """The complex pair of A that decays slowest; None if all eigenvalues are real."""
        return ComplexPair.of_matrix(self.jacobian)

    @property
    def crossing_speed(self) -> float | None:
        """Slope d Re(l)/d v0 of the pair l, eq. 11 and 22; None if all eigenvalues are real."""
        if self.pair is None:
            return None
        left, right = self.pair.left.conj(), self.pair.right
        return float((left @ self.jacobian_by_belt_speed @ right).real)

    @property
    def first_lyapunov_coefficient(self) -> float | None:
        """Coefficient sigma of r' = alpha r + sigma r^3 at a Hopf point, r the speed amplitude.

        Below zero the Hopf point is supercritical. None if all eigenvalues are real. By projection
        onto the critical eigenvectors, for any order n: Kuznetsov, Elements of Applied Bifurcation
        Theory, section 5.4. His coefficient is that of the amplitude along the eigenvector and is
        divided by the frequency.
        """
        jacobian, quadratic, pair = self.jacobian, self.quadratic, self.pair
        if pair is None:
            return None
        q, conjugate = pair.right, pair.right.conj()
        mean = np.linalg.solve(jacobian, np.einsum("ijk,j,k", quadratic, q, conjugate))
        double = np.linalg.solve(
            2j * pair.frequency * np.eye(len(jacobian)) - jacobian,
            np.einsum("ijk,j,k", quadratic, q, q),
        )
        projected = pair.left.conj() @ (
            np.einsum("ijkl,j,k,l", self.cubic, q, q, conjugate)
            - 2.0 * np.einsum("ijk,j,k", quadratic, q, mean)
            + np.einsum("ijk,j,k", quadratic, conjugate, double)
        )
        return float(projected.real / (8.0 * abs(q[SPEED]) ** 2))

    @property
    def stable(self) -> bool | None:
        """Whether a small deviation decays, by the criterion of Routh and Hurwitz.

        None for a neutral equilibrium, where it neither decays nor grows.
        """
        values = self.eigenvalues
        if abs(values.real.max()) <= 1e-14 * np.abs(values).max():  # a growth by rounding
            return None
        return bool(np.all(hurwitz_determinants(self.jacobian) > 0.0))


def expand(drive: Drive, control: ContinuousControl | None = None) -> Expansion | None:
    """Return the expansion of the equations of motion at the equilibrium.

    It covers every friction law, static or with a memory, at constant belt speed and normal force.

    Parameters
    ----------
    drive : Drive
        Drive in SI units.
    control : ContinuousControl, optional
        Continuous control in SI units, such as that of eq. 19. By default the loop is open.

    Returns
    -------
    Expansion or None
        Dimensionless expansion. None if the belt is at rest: friction then holds the slide anywhere
        within its limit, and the motion around is not smooth.

    Raises
    ------
    InvalidInputError
        If belt or load follow a signal, or the drive has no spring.
    RunError
        If the equilibrium of a law with a memory is not found.
    """
    require_equilibrium("the expansion at the equilibrium", drive, control)
    if drive.belt_speed == 0.0:
        return None
    states, (first, second, third) = _at_equilibrium(
        drive, control, np.array([drive.belt_speed / drive.speed_scale])
    )
    n = len(first)
    first, second, third = first[..., 0], second[..., 0], third[..., 0]
    moves = -np.linalg.solve(first[:, :n], first[:, n])
    return Expansion(
        equilibrium=states[:, 0],
        jacobian=first[:, :n],
        quadratic=second[:, :n, :n],
        cubic=third[:, :n, :n, :n],
        jacobian_by_belt_speed=second[:, :n, n] + second[:, :n, :n] @ moves,
    )


def jacobians(
    drive: Drive, control: ContinuousControl | None, belt_speeds: FloatArray
) -> FloatArray:
    """Return A, shape (m, n, n), at m dimensionless belt speeds of one sign.

    Without control a motor is held at rest by a force that balances the others.
    """
    _, (first, *_) = _at_equilibrium(drive, control, belt_speeds)
    return np.moveaxis(first[:, : len(first)], -1, 0)


def hurwitz_determinants(jacobian: FloatArray) -> FloatArray:
    """Return the Routh-Hurwitz determinants of Jacobians (..., n, n): shape (..., n).

    With the characteristic polynomial l^n + c1 l^(n-1) + ... + cn, here by the Faddeev-LeVerrier
    algorithm, they are c2, c1, or for order 3 c3, c1, c1 c2 - c3, and in general cn and the leading
    principal minors of Hurwitz's matrix of orders 1 to n-1. All are above zero if the equilibrium
    is stable. At a Hopf point the last one is zero, and the others are above zero.
    """
    order = jacobian.shape[-1]
    identity = np.eye(order)
    power, coefficients = np.broadcast_to(identity, jacobian.shape), [np.ones(jacobian.shape[:-2])]
    for number in range(1, order + 1):
        product = jacobian @ power
        coefficients.append(-np.trace(product, axis1=-2, axis2=-1) / number)
        power = product + coefficients[-1][..., np.newaxis, np.newaxis] * identity
    hurwitz = np.zeros(jacobian.shape)
    for row in range(order):
        for column in range(order):
            if 0 <= 2 * column - row + 1 <= order:
                hurwitz[..., row, column] = coefficients[2 * column - row + 1]
    minors = [np.linalg.det(hurwitz[..., :size, :size]) for size in range(1, order)]
    return np.stack([coefficients[order], *minors], axis=-1)


def _at_equilibrium(
    drive: Drive, control: ContinuousControl | None, belt_speeds: FloatArray
) -> tuple[FloatArray, list[FloatArray]]:
    """Return the equilibria at m belt speeds of one sign, (n, m), and the derivatives there."""
    system = drive_system(replace(drive, actuator=IDEAL_ACTUATOR), control)
    values = np.zeros((len(system.index), len(belt_speeds)))
    values[: len(system.constants)] = np.array([*system.constants.values()])[:, np.newaxis]
    values[system.index["belt_speed"]] = belt_speeds
    sign = -copysign(1.0, belt_speeds[0])
    for name in {"sign", "motor.sign"} & system.index.keys():
        values[system.index[name]] = sign
    law = system.drive.friction
    for column, speed in enumerate(belt_speeds.tolist() if law.switches else ()):
        switches = law.switches_at(-speed, sign, law.memory_at(-speed, sign))
        for name, value in zip(law.switches, switches, strict=True):
            values[system.index[f"law.{name}"], column] = value
    states = equilibria(system, values)
    return states, _tensors(system, states, values)


def _tensors(system: DriveSystem, states: FloatArray, parameters: FloatArray) -> list[FloatArray]:
    """Return the derivatives of the rates in slip, of orders 1 to 3, at m states (n, m).

    The first axis of a result is the component, and the last one has length m. The axes between are
    the states and then the belt speed.
    """
    places, compiled = system.shared("tensors", lambda: _compiled_tensors(system))
    values = evaluated(compiled, states, parameters)
    return [values[rows] for rows in places]


def _compiled_tensors(system: DriveSystem) -> tuple[list[npt.NDArray[np.intp]], Any]:
    """Return, by order, where in the compiled function each derivative is; and that function."""
    by = [*system.variables, hy.par[system.index["belt_speed"]]]
    rates = list(system.shared_flow(SLIP).rates)
    tensors = hy.diff_tensors(rates, diff_args=by, diff_order=_ORDERS[-1])
    places = [np.zeros((len(rates), *[len(by)] * order), np.intp) for order in _ORDERS]
    expressions: list[Any] = []
    for order, rows in zip(_ORDERS, places, strict=True):
        for (component, *powers), expression in tensors.get_derivatives(order):
            axes = [axis for axis, power in enumerate(powers) for _ in range(power)]
            for permuted in set(permutations(axes)):
                rows[component, *permuted] = len(expressions)
            expressions.append(expression)
    return places, compiled_function(expressions, list(system.variables))


def equilibria(system: DriveSystem, parameters: FloatArray) -> FloatArray:
    """Return the equilibria for m columns of parameter values, shape (n, m), dimensionless.

    By Newton's method from rest at X = 0 with the law's memory of steady slip; for a static law the
    first step is exact. A motor without control rests there, too. The values are in the order of
    `system.index`. Raises RunError if the iteration does not converge.
    """
    order, index, law = len(system.states), system.index, system.drive.friction
    free = np.arange(order)
    if system.control is None:
        free = np.delete(free, system.slots.motor)
    states = np.zeros((order, parameters.shape[1]))
    if law.states:
        speeds, signs = -parameters[index["belt_speed"]], parameters[index["sign"]]
        memory = [
            law.memory_at(*slip) for slip in zip(speeds.tolist(), signs.tolist(), strict=True)
        ]
        states[MEMORY : MEMORY + len(law.states)] = np.array(memory).T
    for _ in range(_ITERATIONS):
        rate, gradients = flow_rates(system, SLIP, states, parameters)
        jacobians = np.moveaxis(gradients[np.ix_(free, free)], -1, 0)
        try:
            step = np.linalg.solve(jacobians, -rate[free].T[..., np.newaxis])[..., 0].T
        except np.linalg.LinAlgError:
            break
        states[free] += step
        # X' is zero there. Rounding, which differs between processors, would give it a sign.
        states[[SPEED, *range(order)[system.slots.motor][1:]]] = 0.0
        if np.all(np.abs(step) <= _CONVERGED_STEP * np.maximum(1.0, np.abs(states).max(axis=0))):
            return states
    raise RunError(f"the friction law {law.name}: the equilibrium was not found")
