"""Compiled flows: heyoka integrators for one flow of a hybrid system, lent to one motion at a time.

What is compiled depends on the structure of a system only. A motion borrows an integrator for each
flow that it enters and gives it back when it ends, so that the next motion of this structure needs
no compilation. An integrator is never shared by two motions. Compiled derivatives are shared.
"""

from array import array
from collections import defaultdict
from collections.abc import Sequence
from copy import copy
from enum import Enum
from itertools import permutations
from typing import Any

import heyoka as hy
import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.hybrid import HybridSystem, Mode

# heyoka warns on standard output, which is for results, where a marker's polynomial is only
# rounding, as in equilibrium.
hy.set_logger_level_error()

Marks = list[tuple[float, float, float]]
"""Time, and the first two states, at the zeros of a flow's marks."""


class Detail(Enum):
    """Values that are integrated and found along with the states."""

    STATES = "states"
    """Nothing."""
    MARKS = "marks"
    """Zeros of the flow's marks."""
    DERIVATIVES = "derivatives"
    """The marks, and the derivatives of the states by those at the start."""
    SENSITIVITIES = "sensitivities"
    """The derivatives of the states by those at the start, and by the free constants."""

    @property
    def integrates_derivatives(self) -> bool:
        """Whether the integrator has derivatives: then no mode has a closed form."""
        return self in (Detail.DERIVATIVES, Detail.SENSITIVITIES)


class CompiledFlow:
    """Compiled integrator with views of its arrays, which cost as much to create as a short step.

    Reading or writing an element of a memoryview takes half the time of an array's.
    """

    __slots__ = (
        "epoch",
        "inputs",
        "marks",
        "mode",
        "parameters",
        "state",
        "switches",
        "taylor",
        "variables",
    )

    def __init__(self, taylor: Any, system: HybridSystem) -> None:
        """Wrap a heyoka integrator whose variables begin with the states of a system."""
        self.taylor = taylor
        self.state = taylor.state
        """States and derivatives."""
        self.variables: memoryview[float] = self.state[: len(system.states)].data
        self.parameters: memoryview[float] = taylor.pars.data
        # heyoka copies its callbacks with the integrator.
        self.marks = [event.callback.found for event in taylor.nt_events]
        self.mode: Mode | None = None
        """Mode whose switches are among the parameters."""
        # heyoka keeps the parameters up to the last one that an equation uses.
        used, index = len(self.parameters), system.index
        self.inputs, self.switches = (
            [(number, index[name]) for number, name in enumerate(names) if index[name] < used]
            for names in (system.inputs, system.switches)
        )
        """Number, and index in the parameters, of the inputs and switches that are used."""
        self.epoch = index["epoch"] if index["epoch"] < used else None
        """Index of the time at the start of the integration."""

    def load(self, constants: "array[float]") -> None:
        """Set the constants of a system of this structure."""
        used = min(len(self.parameters), len(constants))
        self.parameters[:used] = memoryview(constants)[:used]
        self.mode = None

    def another(self, system: HybridSystem) -> "CompiledFlow":
        """Return an independent integrator of the same flow; it needs no compilation."""
        return CompiledFlow(copy(self.taylor), system)

    def take_marks(self) -> Marks:
        """Return the marks since the last call, in order of time."""
        found: Marks = sorted(mark for marks in self.marks for mark in marks)
        for marks in self.marks:
            marks.clear()
        return found


_Key = tuple[int, str, Detail]

_originals: dict[_Key, CompiledFlow] = {}
_shelves: dict[_Key, list[CompiledFlow]] = defaultdict(list)


class IntegratorPool:
    """The integrators that one motion has borrowed; they are given back when it ends."""

    def __init__(self) -> None:
        self._borrowed: dict[_Key, tuple[CompiledFlow, list[CompiledFlow]]] = {}

    def flow(self, system: HybridSystem, name: str, detail: Detail) -> CompiledFlow:
        """Return the integrator of a flow, compiled if there is none of this structure yet."""
        key = (system.structure, name, detail)
        if key not in self._borrowed:
            if detail is Detail.MARKS and not system.shared_flow(name).marks:
                return self.flow(system, name, Detail.STATES)
            shelf = _shelves[key]
            try:
                flow = shelf.pop()
            except IndexError:
                flow = _original(system, name, detail).another(system)
            self._borrowed[key] = flow, shelf
        return self._borrowed[key][0]

    def __del__(self) -> None:
        for flow, shelf in self._borrowed.values():
            shelf.append(flow)


def _original(system: HybridSystem, name: str, detail: Detail) -> CompiledFlow:
    key = (system.structure, name, detail)
    if key not in _originals:
        _originals[key] = _compile(system, name, detail)
    return _originals[key]


def _compile(system: HybridSystem, name: str, detail: Detail) -> CompiledFlow:
    flow = system.shared_flow(name)
    equations = list(zip(system.variables, flow.rates, strict=True))
    if detail is Detail.DERIVATIVES:
        equations = hy.var_ode_sys(equations, hy.var_args.vars, order=1)
    elif detail is Detail.SENSITIVITIES:
        equations = hy.var_ode_sys(equations, sensitivity_arguments(system), order=1)
    downward = hy.event_direction.negative
    watched = detail in (Detail.MARKS, Detail.DERIVATIVES)
    # The compiler rounds by all that it compiles together.
    marks = flow.marks if watched or system.many_steps else ()
    taylor = hy.taylor_adaptive(
        equations,
        [0.0] * len(system.states),
        t_events=[hy.t_event(guard.margin, direction=downward) for guard in flow.guards],
        nt_events=[
            hy.nt_event(mark, callback=_Finder(zero_speed=number == 0, keep=watched))
            for number, mark in enumerate((*marks, *flow.step_limiters))
        ],
        fast_math=True,  # a quarter faster; the error stays below 2e-12 over 190 periods
    )
    return CompiledFlow(taylor, system)


def sensitivity_arguments(system: HybridSystem) -> list[Any]:
    """Return what `Detail.SENSITIVITIES` has derivatives by: the states, the free constants."""
    constants = [hy.par[system.index[name]] for name in system.free_constants]
    return [*system.variables, *constants]


class _Finder:
    """Callback of a mark, with what it has found."""

    def __init__(self, *, zero_speed: bool, keep: bool) -> None:
        """Keep zeros of a mark, or not; at one of the speed (`zero_speed`) it is exactly zero."""
        self.found: Marks = []
        self._zero_speed, self._keep = zero_speed, keep

    def __call__(self, integrator: Any, now: float, _: int) -> None:
        if not self._keep:
            return
        x, y = integrator.update_d_output(now)[:2].tolist()
        self.found.append((now, x, 0.0 if self._zero_speed else y))


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
