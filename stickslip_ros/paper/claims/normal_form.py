"""The coefficients of eq. 12 to 15 and 23 to 30 by definition, for any nonlinearity.

They belong to y1' = -w y2 + Q1, y2' = w y1 + Q2 and, in a loop with a filter, y3' = lambda3 y3 + Q3
(Hassard, Kazarinoff and Wan, Theory and Applications of Hopf Bifurcation, 1981, ch. 1 and 2). With
z = y1 + i y2 they are derivatives of Q1 + i Q2, or of Q3, by z, its conjugate and y3.
"""

from dataclasses import dataclass
from itertools import permutations
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.drive_system import SPEED
from stickslip_ros.physics.theory.hopf import first_lyapunov_coefficient
from stickslip_ros.physics.theory.linear import Expansion

_FREQUENCY, _THIRD_EIGENVALUE = 1.3, -0.7
"""Frequency and eigenvalue of the linear part of a sample; neither is one."""


@dataclass(frozen=True)
class Nonlinearity:
    """Second and third derivatives of Q at the origin, with their linear part."""

    second: FloatArray
    """Second derivatives, shape (n, n, n)."""
    third: FloatArray
    """Third derivatives, shape (n, n, n, n)."""
    frequency: float = 1.0
    third_eigenvalue: float = _THIRD_EIGENVALUE

    @classmethod
    def at(cls, expansion: Expansion) -> Self:
        """Return the nonlinearity of a loop at its Hopf point; in the plane y2 is the speed."""
        decomposed: Any = np.linalg.eig(expansion.jacobian)
        values, vectors = decomposed
        upper = int(np.argmax(values.imag))
        pair = vectors[:, upper] * (-0.5j / vectors[SPEED, upper])
        basis = [2.0 * pair.real, -2.0 * pair.imag]
        third = float(np.trace(expansion.jacobian))
        if len(values) > 2:
            real = vectors[:, int(np.argmin(np.abs(values.imag)))].real
            basis.append(real / real[SPEED])
        to_state = np.array(basis).T
        from_state = np.linalg.inv(to_state)
        second = np.einsum("ai,ijk,jb,kc", from_state, expansion.quadratic, to_state, to_state)
        cubic = np.einsum(
            "ai,ijkl,jb,kc,ld", from_state, expansion.cubic, to_state, to_state, to_state
        )
        return cls(second, cubic, float(values[upper].imag), third)

    def by(self, component: int, *variables: int) -> float:
        """Return the derivative of a component of Q by two or three variables, counted from 1."""
        tensor = self.second if len(variables) == 2 else self.third
        return float(tensor[component - 1][tuple(variable - 1 for variable in variables)])

    @property
    def g20(self) -> complex:
        """Second derivative of Q1 + i Q2 by z."""
        return self._plane(self._z, self._z)

    @property
    def g11(self) -> complex:
        """Second derivative of Q1 + i Q2 by z and its conjugate."""
        return self._plane(self._z, self._z.conj())

    @property
    def cubic(self) -> complex:
        """G21: the derivative by z, z and its conjugate."""
        return self._plane(self._z, self._z, self._z.conj())

    @property
    def g110(self) -> complex:
        """G110: the derivative by z and y3."""
        return self._plane(self._z, self._y3)

    @property
    def g101(self) -> complex:
        """G101: the derivative by the conjugate of z, and y3."""
        return self._plane(self._z.conj(), self._y3)

    @property
    def w20(self) -> complex:
        """Coefficient of z^2/2 in y3 on the centre manifold: (2 i w - lambda3) w20 = Q3_zz."""
        along = complex(self._along(self._z, self._z)[2])
        return along / (2j * self.frequency - self.third_eigenvalue)

    @property
    def w11(self) -> complex:
        """Coefficient of z times its conjugate: -lambda3 w11 = Q3_z conj(z)."""
        return complex(self._along(self._z, self._z.conj())[2]) / -self.third_eigenvalue

    @property
    def sigma(self) -> float:
        """First Lyapunov coefficient, by projection onto the eigenvectors."""
        n, w = len(self.second), self.frequency
        jacobian = np.diag([0.0, 0.0, self.third_eigenvalue])[:n, :n]
        jacobian[0, 1], jacobian[1, 0] = -w, w
        expansion = Expansion(np.zeros(n), jacobian, self.second, self.third, np.zeros((n, n)))
        found = first_lyapunov_coefficient(expansion)
        assert found is not None
        return found

    @property
    def _z(self) -> npt.NDArray[np.complex128]:
        return np.array([0.5, -0.5j, 0.0])[: len(self.second)]

    @property
    def _y3(self) -> npt.NDArray[np.complex128]:
        return np.array([0.0, 0.0, 1.0 + 0.0j])

    def _plane(self, *directions: npt.NDArray[np.complex128]) -> complex:
        along = self._along(*directions)
        return complex(along[0] + 1j * along[1])

    def _along(self, *directions: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
        along = (self.second if len(directions) == 2 else self.third).astype(np.complex128)
        for direction in directions:
            along = along @ direction
        return along


def samples(order: int) -> list[Nonlinearity]:
    """Return arbitrary nonlinearities of a system of that order, without zero derivatives."""
    random = np.random.default_rng(order)
    found: list[Nonlinearity] = []
    for _ in range(5):
        second = random.normal(size=(order,) * 3)
        third = random.normal(size=(order,) * 4)
        second = second + second.swapaxes(1, 2)
        third = np.sum([third.transpose(0, *axes) for axes in permutations((1, 2, 3))], axis=0)
        found.append(Nonlinearity(second, third, _FREQUENCY))
    return found
