"""Compiled derivatives of the flows of a hybrid system, for each structure once."""

from collections.abc import Sequence
from itertools import permutations
from typing import Any

import heyoka as hy
import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.hybrid import HybridSystem, Mode


class FlowRates:
    """Rates of a flow, their Jacobian, and the gradients of its guards, at a state."""

    def __init__(self, system: HybridSystem, name: str) -> None:
        """Compile them; the flow must not depend on the time."""
        flow, variables = system.shared_flow(name), system.variables
        margins = [guard.margin for guard in flow.guards]
        rows = [*flow.rates, *margins, *flow.slaved.values()]
        self.slaved = tuple(flow.slaved)
        """Indices of the slaved states; their gradients come after those of the margins."""
        gradients = [hy.diff(row, variable) for row in rows for variable in variables]
        self._order = len(variables)
        self._compiled = hy.cfunc([*flow.rates, *gradients], list(variables))

    def at(self, state: FloatArray, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the rates, as the state (n, ...), and their gradients and those of the margins.

        The gradients have the shape (rates and margins, n, ...).
        """
        found = _evaluated(self._compiled, state, parameters)
        order = self._order
        return found[:order], found[order:].reshape(-1, order, *state.shape[1:])


_rates: dict[tuple[int, str], FlowRates] = {}


def flow_rates(system: HybridSystem, name: str) -> FlowRates:
    """Return the compiled rates of a flow."""
    key = (system.structure, name)
    if key not in _rates:
        _rates[key] = FlowRates(system, name)
    return _rates[key]


class FlowTensors:
    """Derivatives of a flow's rates of orders 1 to 3, by the states and by one constant."""

    HIGHEST_ORDER = 3

    def __init__(self, system: HybridSystem, name: str, constant: str) -> None:
        """Compile the derivatives by the states and then by the `constant`."""
        self.order = len(system.states)
        self._parameters = len(system.index)
        by = [*system.variables, hy.par[system.index[constant]]]
        rates = list(system.shared_flow(name).rates)
        tensors = hy.diff_tensors(rates, diff_args=by, diff_order=self.HIGHEST_ORDER)
        self._places: list[tuple[int, ...]] = []
        expressions: list[Any] = []
        for order in range(1, self.HIGHEST_ORDER + 1):
            for (component, *powers), expression in tensors.get_derivatives(order):
                axes = [axis for axis, power in enumerate(powers) for _ in range(power)]
                self._places.append((component, *axes))
                expressions.append(expression)
        self._compiled = hy.cfunc(expressions, list(system.variables))

    def at(self, states: FloatArray, parameters: FloatArray) -> list[FloatArray]:
        """Return the derivatives of each order at m states.

        The states have the shape (n, m), the parameters (number of parameters, m). The first axis
        of a result is the component, and the last one has length m. The axes between are the states
        and then the constant.
        """
        found = _evaluated(self._compiled, states, parameters)
        points = states.shape[1]
        tensors = [
            np.zeros((self.order, *[self.order + 1] * order, points))
            for order in range(1, self.HIGHEST_ORDER + 1)
        ]
        for (component, *axes), value in zip(self._places, found, strict=True):
            for order in set(permutations(axes)):
                tensors[len(axes) - 1][component, *order] = value
        return tensors


_tensors: dict[tuple[int, str, str], FlowTensors] = {}


def flow_tensors(system: HybridSystem, name: str, constant: str) -> FlowTensors:
    """Return the compiled derivatives of a flow by the states and a constant."""
    key = (system.structure, name, constant)
    if key not in _tensors:
        _tensors[key] = FlowTensors(system, name, constant)
    return _tensors[key]


def parameter_values(system: HybridSystem, mode: Mode, inputs: Sequence[float]) -> FloatArray:
    """Return the values of a system's parameters in a mode, in the order of its expressions."""
    return np.array([*system.constants.values(), *inputs, *mode.switches, 0.0])


def _evaluated(compiled: Any, state: FloatArray, parameters: FloatArray) -> FloatArray:
    used = parameters[: compiled.nparams]
    return compiled(np.ascontiguousarray(state), pars=np.ascontiguousarray(used))
