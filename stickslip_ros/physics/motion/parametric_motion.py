"""The motion and its derivatives by its start and by the constants of the drive."""

from collections.abc import Sequence
from typing import Any

import heyoka as hy
import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.drive_system import POSITION, SPEED, STICK
from stickslip_ros.physics.model.hybrid import HybridSystem, Mode
from stickslip_ros.physics.model.scaled_drive import in_units_of
from stickslip_ros.physics.motion.compiled_flow import (
    CompiledFlow,
    Detail,
    sensitivity_arguments,
)
from stickslip_ros.physics.motion.motion import Motion

_GRAZING = 1e-12
"""Rate of a margin below which a motion grazes a guard: the instant has no derivative there."""


class ParametricMotion(Motion):
    """Motion with the derivatives of its state by the state at the start and by constants.

    The drive must have a spring. All derivatives are dimensionless, in the units of the drive.
    heyoka integrates the variational equations along with the motion. At a guard the derivatives
    jump by the saltation matrix (Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth
    Mechanical Systems, 2004, ch. 7), which has here a part for guards that depend on the constants.
    What a law computes from its constants apart from its equations, as the elastic limit of
    `ElastoPlastic`, is held.
    """

    _first_detail = Detail.SENSITIVITIES

    def __init__(self, drive: Drive, position: float, velocity: float) -> None:
        self._found: FloatArray = np.empty((0, 0))
        self._holder: CompiledFlow | None = None
        self._at_guard: FloatArray = np.empty(0)
        super().__init__(in_units_of(drive, drive), position, velocity)
        self._watched = True
        self._begin_again()

    def restart(
        self, position: float, velocity: float, memory: Sequence[float] | None = None
    ) -> None:
        """Set the state of the slide; derivatives are by this state from now on."""
        super().restart(position, velocity, memory)
        self._begin_again()

    def _begin_again(self) -> None:
        order, count = len(self._system.states), len(self._system.free_constants)
        self._found, self._holder = np.eye(order, order + count), None
        if self._mode.flow == STICK:  # it has the speed of the belt
            self._found[SPEED] = 0.0

    @property
    def derivatives(self) -> FloatArray:
        """Derivatives of the states (rows) by those at the start, then by `free_constants`."""
        if self._holder is None:
            return self._found
        order = len(self._system.states)
        return self._holder.state[order:].reshape(order, -1)

    @property
    def position_derivatives(self) -> FloatArray:
        """The first row of `derivatives`; a view that the next step overwrites."""
        return self.derivatives[POSITION]

    def _begin(self, now: float, end: float) -> float:
        if self._flow is not self._holder:
            assert self._flow is not None
            found = self.derivatives
            self._flow.state[len(found) :] = found.ravel()
            self._holder = self._flow
        return end

    def _reach_guard(self) -> None:
        self._at_guard = np.array(self._instant.state)

    def _pass(self, mode: Mode, guard: int | None, following: Mode | None, now: float) -> None:
        if guard is None or guard < 0 or following is None:
            return
        before, by_state, by_rest = self._gradients(mode, self._at_guard, guard)
        after, _, _ = self._gradients(following, np.array(self._instant.state), None)
        found = self.derivatives.copy()
        normal = by_state @ found
        normal[len(found) :] += by_rest[:-1]
        rate = float(by_state @ before + by_rest[-1])
        if abs(rate) > _GRAZING:
            found += np.outer((after - before) / rate, normal)
        self._found, self._holder = found, None

    def _gradients(
        self, mode: Mode, state: FloatArray, guard: int | None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the rates of a mode, and the gradients of a margin: by the states, by the rest.

        The rest are the free constants and the time.
        """
        compiled = _compiled(self._system, mode.flow)
        parameters = np.array(
            [*self._constants, *self._instant.inputs, *mode.switches, self._instant.time]
        )
        found = compiled(state, pars=parameters[: compiled.nparams])
        order, count = len(state), len(self._system.free_constants) + 1
        margins = found[order:].reshape(-1, order + count)
        row = margins[0 if guard is None else guard]
        return found[:order], row[:order], row[order:]


_functions: dict[tuple[int, str], Any] = {}


def _compiled(system: HybridSystem, name: str) -> Any:
    """Return the rates of a flow, and the gradients of its margins, as a compiled function."""
    key = (system.structure, name)
    if key not in _functions:
        flow = system.shared_flow(name)
        epoch = hy.par[system.index["epoch"]]  # added to the time everywhere
        by = [*sensitivity_arguments(system), epoch]
        expressions = [
            *flow.rates,
            *(hy.diff(guard.margin, each) for guard in flow.guards for each in by),
        ]
        still = [hy.subs(each, {hy.time: hy.expression(0.0)}) for each in expressions]
        _functions[key] = hy.cfunc(still, list(system.variables))
    return _functions[key]
