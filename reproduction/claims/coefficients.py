"""The coefficients of the normal form, eq. 12 to 15 and, with the filter, eq. 23 to 30.

By definition, for any nonlinearity, they belong to y1' = -w y2 + Q1, y2' = w y1 + Q2 and, in a loop
with a filter, y3' = lambda3 y3 + Q3 (Hassard, Kazarinoff and Wan, Theory and Applications of Hopf
Bifurcation, 1981, ch. 1 and 2). With z = y1 + i y2 they are derivatives of Q1 + i Q2, or of Q3, by
z, its conjugate and y3.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import permutations
from operator import attrgetter
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from reproduction.claims.paper_values import (
    DAMPING,
    FILTER,
    OPEN,
    PRINTED_HOPF_SPEED,
    STUDIED_SPEED,
    TAKEN_DAMPING,
    at,
    critical,
    for_both,
    known,
    number_for_both,
)
from reproduction.claims.verdict import Computations, Evidence, Formula, Number, Observation
from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.drive_layout import SPEED
from stickslip_ros.theory.linear import Expansion

computes = Computations()

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
        return known(expansion.first_lyapunov_coefficient)

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


def _at_hopf_point(damping: float) -> Nonlinearity:
    """Return the nonlinearity of the open loop at v_b1."""
    return Nonlinearity.at(at(at(1.0, damping).hopf.belt_speed, damping).expansion)


def _at_critical_gain(damping: float, cubic: float = 0.0) -> Nonlinearity:
    """Return the nonlinearity at the belt speed and the critical gain of section 4.1."""
    gains = replace(FILTER, linear_gain=critical(STUDIED_SPEED, damping).linear, cubic_gain=cubic)
    return Nonlinearity.at(at(STUDIED_SPEED, damping, gains).expansion)


def _on_samples(
    order: int,
    printed: Callable[[Nonlinearity], complex] | None,
    true: Callable[[Nonlinearity], complex],
    corrections: Mapping[str, Callable[[Nonlinearity], complex]],
    **values: Any,
) -> Formula:
    """Return a formula of a coefficient, by its values for arbitrary nonlinearities."""
    tried = samples(order)
    return Formula(
        None if printed is None else [printed(q) for q in tried],
        [true(q) for q in tried],
        {what: [corrected(q) for q in tried] for what, corrected in corrections.items()},
        **values,
    )


def _beat(q: Nonlinearity) -> complex:
    """Return the term of the second derivatives in eq. 15 and 30, without the i in front."""
    return q.g20 * q.g11 / (2.0 * q.frequency)


@computes("eq-12-value", attrgetter("g20"))
@computes("eq-13-value", attrgetter("g11"))
def _(_: Evidence, coefficient: Callable[[Nonlinearity], complex]) -> Number:
    """Return four times the imaginary part of g20 or g11, which are imaginary at v_b1."""
    return number_for_both(
        lambda damping: 4.0 * coefficient(_at_hopf_point(damping)).imag,
        product=3.6 * PRINTED_HOPF_SPEED,
    )


def _printed_g20(q: Nonlinearity, mixed: int) -> complex:
    real = q.by(1, 1, 1) - q.by(1, 2, 2) + 2.0 * q.by(mixed, 1, 2)
    return (real + 1j * (q.by(2, 1, 1) - q.by(2, 2, 2) - 2.0 * q.by(1, 1, 2))) / 4.0


computes["eq-12-formula"] = computes["eq-23-formula"] = lambda _: _on_samples(
    2,
    lambda q: _printed_g20(q, 1),
    lambda q: q.g20,
    {"With Q2 in place of Q1 in the real part's last term": lambda q: _printed_g20(q, 2)},
)
computes["eq-13-formula"] = computes["eq-24-formula"] = lambda _: _on_samples(
    2,
    lambda q: (q.by(1, 1, 1) + q.by(1, 2, 2) + 1j * (q.by(2, 1, 1) + q.by(2, 2, 2))) / 4.0,
    lambda q: q.g11,
    {},
)
computes["eq-14-real"] = lambda _: _on_samples(
    2,
    lambda q: (q.by(1, 1, 1, 1) + q.by(1, 1, 2, 2) + q.by(2, 1, 1, 2) + q.by(2, 2, 2, 2)) / 8.0,
    lambda q: q.cubic.real,
    {},
)
computes["eq-14-imaginary"] = lambda _: _on_samples(
    2,
    lambda q: (q.by(2, 1, 1, 1) - q.by(2, 1, 2, 2) - 2.0 * q.by(1, 1, 1, 2)) / 8.0,
    lambda q: q.cubic.imag,
    {
        "With (Q2_111 + Q2_122 - Q1_112 - Q1_222) / 8": lambda q: (
            (q.by(2, 1, 1, 1) + q.by(2, 1, 2, 2) - q.by(1, 1, 1, 2) - q.by(1, 2, 2, 2)) / 8.0
        )
    },
)
computes["eq-14-value"] = lambda _: Number(_at_hopf_point(DAMPING).cubic.real)


@computes("eq-15-formula")
def _(_: Evidence) -> Formula:
    at_hopf = _at_hopf_point(DAMPING)
    without = (at_hopf.g20 * at_hopf.g11 / 2.0 + at_hopf.cubic / 2.0).real
    return _on_samples(
        2,
        lambda q: _beat(q).real * q.cubic.real / 2.0,
        lambda q: q.sigma,
        {
            "With a sum in place of the product": lambda q: (_beat(q) + q.cubic / 2.0).real,
            "With i in front of g20 g11, and a sum in place of the product,": lambda q: (
                (1j * _beat(q) + q.cubic / 2.0).real
            ),
        },
        without=without,
    )


computes["eq-15-value"] = lambda _: Number(
    known(at(OPEN.hopf.belt_speed).expansion.first_lyapunov_coefficient)
)
computes["eq-15-imaginary"] = lambda _: number_for_both(
    lambda damping: ((q := _at_hopf_point(damping)).g20 * q.g11).real / 2.0
)


@computes("eq-23-value", attrgetter("g20"))
@computes("eq-24-value", attrgetter("g11"))
def _(_: Evidence, coefficient: Callable[[Nonlinearity], complex]) -> Number:
    """Return four times the magnitude of g20 or g11 in the closed loop."""
    taken = 4.0 * coefficient(_at_critical_gain(TAKEN_DAMPING))
    return number_for_both(
        lambda damping: 4.0 * abs(coefficient(_at_critical_gain(damping))), coefficient=taken
    )


def _mixed(q: Nonlinearity, sign: float, plane: int) -> complex:
    """Return G110 (sign +1) or G101 (-1), Q2 derived by y1 or y2, and Q1 too."""
    real = q.by(1, 1, 3) + sign * q.by(2, plane, 3)
    return (real + 1j * (q.by(2, 1, 3) - sign * q.by(1, plane, 3))) / 2.0


@computes("eq-25-formula", attrgetter("g110"), 1.0)
@computes("eq-26-formula", attrgetter("g101"), -1.0)
def _(_: Evidence, true: Callable[[Nonlinearity], complex], sign: float) -> Formula:
    corrected = "With Q2_23 in the real and Q1_23 in the imaginary part"
    return _on_samples(
        3, lambda q: _mixed(q, sign, 1), true, {corrected: lambda q: _mixed(q, sign, 2)}
    )


@computes("eq-25-value", attrgetter("g110"))
@computes("eq-26-value", attrgetter("g101"))
@computes("eq-27-value", attrgetter("w20"))
@computes("eq-28-value", attrgetter("w11"))
def _(_: Evidence, coefficient: Callable[[Nonlinearity], complex]) -> Observation:
    here, taken = for_both(lambda damping: coefficient(_at_critical_gain(damping)))
    return Observation(max(abs(here), abs(taken)) < 1e-9, taken=taken, here=here)


computes["eq-27-formula"] = lambda _: _on_samples(
    3,
    None,
    lambda q: q.w20,
    {
        "With 2 i omega(mu_0) - lambda_3(mu_0) in the denominator and Q3_12 for Q3_13": lambda q: (
            (q.by(3, 1, 1) - q.by(3, 2, 2) - 2j * q.by(3, 1, 2))
            / (4.0 * (2j * q.frequency - q.third_eigenvalue))
        )
    },
)


def _printed_w11(q: Nonlinearity) -> float:
    return (q.by(3, 1, 1) + q.by(3, 2, 2)) / (4.0 * q.third_eigenvalue)


computes["eq-28-formula"] = lambda _: _on_samples(
    3, _printed_w11, lambda q: q.w11, {"With the opposite sign": lambda q: -_printed_w11(q)}
)
computes["eq-29-constant"] = lambda _: number_for_both(
    lambda damping: _at_critical_gain(damping).cubic.real
)


@computes("eq-29-gain")
def _(_: Evidence) -> Number:
    def slope(damping: float) -> float:
        return (_at_critical_gain(damping, 1.0).cubic - _at_critical_gain(damping, 0.0).cubic).real

    passed = 1j / (1j + FILTER.corner_frequency)
    return number_for_both(slope, share=abs(passed), phase=np.angle(passed, deg=True))


computes["eq-30-formula"] = lambda _: _on_samples(
    3,
    lambda q: (_beat(q) + (q.cubic + q.g101 * q.g20) / 2.0).real,
    lambda q: q.sigma,
    {
        "With i in front of g20 g11, with 2 G110 w11 added and w20 for g20": lambda q: (
            (1j * _beat(q) + (q.cubic + 2.0 * q.g110 * q.w11 + q.g101 * q.w20) / 2.0).real
        )
    },
)
computes["eq-30-value"] = lambda _: number_for_both(
    lambda damping: critical(STUDIED_SPEED, damping).first_lyapunov_coefficient
)


@computes("eq-30-sign")
def _(_: Evidence) -> Observation:
    found = for_both(lambda damping: critical(STUDIED_SPEED, damping).first_lyapunov_coefficient)
    return Observation(max(found) < 0.0, found=found)


computes["eq-30-imaginary"] = lambda _: number_for_both(
    lambda damping: _beat(_at_critical_gain(damping)).real
)
