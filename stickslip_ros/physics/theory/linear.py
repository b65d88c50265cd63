"""Expansion of the slip equations at the equilibrium: the derivatives of the right-hand side.

heyoka differentiates the symbolic equations, for any friction law. Everything is dimensionless
(see `Drive`); n is 2 for the open loop, with the state (X, Y), and 3 with continuous control,
with the filter state W, too.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import permutations
from math import copysign
from typing import Any

import heyoka as hy
import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.equations import Equations, W, WashoutGains, X, Y
from stickslip_ros.physics.model.friction import FrictionLaw

_HIGHEST_ORDER = 3


@dataclass(frozen=True)
class Expansion:
    """Right-hand side f at the equilibrium to third order: f = A z + B(z, z)/2 + C(z, z, z)/6.

    z is the deviation of the state from the equilibrium. All values are dimensionless.
    """

    equilibrium: FloatArray
    """State in equilibrium: X = mu(-v0), eq. 6, Y = 0, W = 0; shape (n,)."""
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
        found = np.linalg.eigvals(self.jacobian).astype(np.complex128)
        return np.array(sorted(found, key=lambda value: (-round(value.real, 14), -value.imag)))

    @property
    def stable(self) -> bool:
        """Whether a small deviation decays, by the criterion of Routh and Hurwitz."""
        return bool(np.all(hurwitz_determinants(self.jacobian) > 0.0))


def expand(drive: Drive, gains: WashoutGains | None = None) -> Expansion | None:
    """Return the expansion of the equations of motion at the equilibrium.

    Parameters
    ----------
    drive : Drive
        Drive in SI units.
    gains : WashoutGains, optional
        Continuous controller of eq. 19 in SI units. By default the loop is open.

    Returns
    -------
    Expansion or None
        Dimensionless expansion. None if the belt is at rest: friction then holds the slide anywhere
        within its limit, and the motion around is not smooth.

    Examples
    --------
    The system of the paper is unstable without control:

    >>> from stickslip_ros.physics.model.drive import Drive
    >>> from stickslip_ros.physics.model.friction import Stribeck
    >>> from stickslip_ros.physics.theory.linear import expand
    >>> drive = Drive(mass=1.0, damping=0.02, stiffness=1.0, normal_force=1.0,
    ...               belt_speed=0.4, friction=Stribeck(0.4, 0.25, 0.5))
    >>> expansion = expand(drive)
    >>> expansion.stable
    False
    >>> round(float(expansion.eigenvalues[0].real), 6)
    0.071
    """
    if drive.belt_speed == 0.0:
        return None
    position, (first, second, third) = _at_equilibrium(
        drive, gains, np.array([drive.belt_speed / drive.speed_scale])
    )
    n = len(first)
    first, second, third = first[..., 0], second[..., 0], third[..., 0]
    moves = -np.linalg.solve(first[:, :n], first[:, n])
    return Expansion(
        equilibrium=np.concatenate([position, np.zeros(n - 1)]),
        jacobian=first[:, :n],
        quadratic=second[:, :n, :n],
        cubic=third[:, :n, :n, :n],
        jacobian_by_belt_speed=second[:, :n, n] + second[:, :n, :n] @ moves,
    )


def jacobians(drive: Drive, gains: WashoutGains | None, belt_speeds: FloatArray) -> FloatArray:
    """Return A, shape (m, n, n), at m dimensionless belt speeds of one sign."""
    _, (first, *_) = _at_equilibrium(drive, gains, belt_speeds)
    return np.moveaxis(first[:, : len(first)], -1, 0)


def hurwitz_determinants(jacobian: FloatArray) -> FloatArray:
    """Return the Routh-Hurwitz determinants of Jacobians (..., n, n): shape (..., n).

    With the characteristic polynomial l^n + c1 l^(n-1) + ... + cn they are c2, c1, or for order 3
    c3, c1, c1 c2 - c3. All are above zero if the equilibrium is stable. At a Hopf point the last
    one is zero, and the others are above zero.
    """
    trace = np.trace(jacobian, axis1=-2, axis2=-1)
    determinant = np.linalg.det(jacobian)
    if jacobian.shape[-1] == 2:
        return np.stack([determinant, -trace], axis=-1)
    minors = sum(
        jacobian[..., i, i] * jacobian[..., j, j] - jacobian[..., i, j] * jacobian[..., j, i]
        for i, j in ((0, 1), (0, 2), (1, 2))
    )
    return np.stack([-determinant, -trace, determinant - trace * minors], axis=-1)


class _SmoothField:
    """Compiled derivatives of the slip equations of one law, by the state and the belt speed."""

    def __init__(self, law: type[FrictionLaw], continuous_control: bool) -> None:
        self.equations = Equations(law, continuous_control)
        state = [X, Y, W] if continuous_control else [X, Y]
        self.order = len(state)
        by = [*state, hy.par[self.equations.index["belt_speed"]]]
        right_hand_side = [rate for _, rate in self.equations.slip]
        tensors = hy.diff_tensors(right_hand_side, diff_args=by, diff_order=_HIGHEST_ORDER)
        self._places: list[tuple[int, ...]] = []
        expressions: list[Any] = []
        for order in range(1, _HIGHEST_ORDER + 1):
            for (component, *powers), expression in tensors.get_derivatives(order):
                axes = [axis for axis, power in enumerate(powers) for _ in range(power)]
                self._places.append((component, *axes))
                expressions.append(expression)
        self._compiled = hy.cfunc(expressions, state)

    def derivatives(
        self, states: FloatArray, values: Mapping[str, float | FloatArray]
    ) -> list[FloatArray]:
        """Return the derivatives of orders 1 to 3 at states of shape (n, m).

        `values` are the parameter values of the equations, by name. The first axis of a result is
        the component, and the last one has length m. The axes between are the state and then the
        belt speed.
        """
        points = states.shape[1]
        parameters = np.zeros((len(self.equations.index), points))
        for name, value in values.items():
            parameters[self.equations.index[name]] = value
        found = self._compiled(states, pars=parameters[: self._compiled.nparams])
        tensors = [
            np.zeros((self.order, *[self.order + 1] * order, points))
            for order in range(1, _HIGHEST_ORDER + 1)
        ]
        for (component, *axes), value in zip(self._places, found, strict=True):
            for order in set(permutations(axes)):
                tensors[len(axes) - 1][component, *order] = value
        return tensors


_smooth_field = lru_cache(maxsize=None)(_SmoothField)


def _at_equilibrium(
    drive: Drive, gains: WashoutGains | None, belt_speeds: FloatArray
) -> tuple[FloatArray, list[FloatArray]]:
    """Return X in equilibrium at belt speeds of one sign, shape (m,), and the derivatives there."""
    field = _smooth_field(type(drive.friction), gains is not None)
    sign = -copysign(1.0, belt_speeds[0])
    law = drive.friction.scaled(drive.speed_scale)
    positions = law.at_rest(belt_speeds)
    states = np.zeros((field.order, len(belt_speeds)))
    states[0] = positions
    values: dict[str, float | FloatArray] = {
        **field.equations.parameters(drive), "belt_speed": belt_speeds, "sign": sign, "force": 0.0
    }  # fmt: skip
    if gains is not None:
        values |= vars(gains.scaled(drive))
    return positions, field.derivatives(states, values)
