"""Compiled flows: heyoka integrators for one flow of a hybrid system, lent to one motion at a time.

What is compiled depends on the structure of a system only. A motion borrows an integrator for each
flow that it enters and gives it back when it ends, so that the next motion of this structure needs
no compilation. An integrator is never shared by two motions. Compiled derivatives are shared.
"""

from array import array
from collections import defaultdict
from collections.abc import Sequence
from copy import copy
from enum import Flag, auto
from functools import partial
from math import e, inf
from typing import Any

import heyoka as hy
import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.hybrid import HybridSystem, Instant, Mode, Transition
from stickslip_ros.motion.compilation import compiled_function, compiled_integrator

_LARGEST_MAGNITUDE = 1e12
"""Largest magnitude of states and margins, which are mostly of the order of one."""

_MOST_NODES_UNROLLED = 4000
"""Nodes of rates and margins above which the code keeps its loops; with derivatives half as many.

Unrolled code runs up to six times faster, but takes many seconds to compile if it is that large.
"""

_ROUGH_TOLERANCE, _MOST_ROUGH_UNROLLED = 1e-9, 64
"""Error of a step, relative to the largest variable, with a little more than half of the orders,
and the number of variables above which its code keeps its loops."""

Marks = list[tuple[float, float, float]]
"""Time, and the first two states, at the zeros of a flow's marks."""


class Detail(Flag):
    """Values that are integrated and found along with the states; they may be combined."""

    STATES = 0
    """Nothing else."""
    MARKS = auto()
    """Zeros of the flow's marks."""
    DERIVATIVES = auto()
    """Derivatives of the states by those at the start and by the free constants.

    No mode has a closed form then.
    """
    ROUGH = auto()
    """Steps with errors above rounding, but far below those of measurements: half of the work."""


class CompiledFlow:
    """Compiled integrator with views of its arrays, which cost as much to create as a short step.

    Reading or writing an element of a memoryview takes half the time of an array's.
    """

    def __init__(self, taylor: Any, system: HybridSystem) -> None:
        """Wrap a heyoka integrator whose variables begin with the states of a system."""
        self.taylor = taylor
        self.state = taylor.state
        """States and derivatives."""
        self.variables: memoryview[float] = self.state[: len(system.states)].data
        self.parameters: memoryview[float] = taylor.pars.data
        self.last_orders: memoryview[float] = taylor.tc[: len(system.states), -1].data
        """Last Taylor coefficient of each variable, of the last step."""
        # heyoka copies its callbacks with the integrator.
        self.marks = [event.callback.marks for event in taylor.nt_events]
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

    def load(self, system: HybridSystem) -> None:
        """Set the constants to those of a system of this structure."""
        used = array("d", list(system.constants.values())[: len(self.parameters)])
        self.parameters[: len(used)] = used
        self.mode = None

    def take_over(self, instant: Instant, mode: Mode) -> None:
        """Continue an instant in a mode: its state lies in this integrator from now on."""
        for number, index in self.inputs:
            self.parameters[index] = instant.inputs[number]
        if mode is not self.mode:
            self.mode = mode
            for number, index in self.switches:
                self.parameters[index] = mode.switches[number]
        if instant.state is not self.variables:
            self.variables[:] = instant.state
            instant.state = self.variables

    def undo_step(self) -> None:
        """Take the states back to the start of the last step, of which the series is kept."""
        self.variables[:] = array("d", self.taylor.tc[: len(self.variables), 0])

    def phase_bound(self) -> float:
        """Return an end of the integration that would have shortened no step of the last one.

        A guard has ended the last step within its length h, which is unknown. By the last of the
        orders p of the series c, heyoka has h <= (s / max |c_p|)^(1/p) / e^2 with the largest s of
        1 and the magnitudes of states and margins (Jorba and Zou, 2005).
        """
        taylor, last = self.taylor, max(map(abs, self.last_orders.tolist()))
        step = (_LARGEST_MAGNITUDE / last) ** (1.0 / taylor.order) / e**2 if last else inf
        return taylor.time - taylor.last_h + step

    def take_marks(self) -> Marks:
        """Return the marks since the last call, in order of time."""
        in_order: Marks = sorted(mark for marks in self.marks for mark in marks)
        for marks in self.marks:
            marks.clear()
        return in_order


_Key = tuple[int, str, int]

_shelves: dict[_Key, list[CompiledFlow]] = defaultdict(list)

_Loaded = tuple[CompiledFlow | None, tuple[Transition, ...]]
"""Integrator with the constants of the system, None with a closed form; where its guards lead."""


class IntegratorPool:
    """The integrators that one motion has borrowed; they are given back when it ends."""

    def __init__(self, detail: Detail) -> None:
        """Borrow integrators of this detail; `use` tells of which system."""
        self._borrowed: dict[_Key, tuple[CompiledFlow, list[CompiledFlow]]] = {}
        self._loaded: dict[Detail, dict[str, _Loaded]] = {}
        self.set_detail(detail)

    def use(self, system: HybridSystem) -> None:
        """Continue with the constants of a system."""
        self._system = system
        self._loaded.clear()
        self.set_detail(self._detail)

    def set_detail(self, detail: Detail) -> None:
        """Continue with another detail."""
        self._detail = detail
        self.derive = Detail.DERIVATIVES in detail
        """Whether derivatives are integrated."""
        self.phased = self.derive and Detail.ROUGH not in detail
        """Whether each phase counts, however short: no short step is prepared."""
        self._by_flow = self._loaded.setdefault(detail, {})

    def set_constant(self, name: str, value: float) -> None:
        """Set a constant of the system, also in the integrators."""
        self._system.constants[name], index = value, self._system.index[name]
        for by_flow in self._loaded.values():
            for flow, _ in by_flow.values():
                if flow is not None and index < len(flow.parameters):
                    flow.parameters[index] = value

    def flow_of(self, mode: Mode) -> _Loaded:
        """Return the integrator of a mode, unless that has a closed form, and its transitions."""
        name, system, flow = mode.flow, self._system, None
        if name not in self._by_flow:
            if self.derive or name != system.closed_flow:
                flow = self._borrow(name, self._detail)
                flow.load(system)
            self._by_flow[name] = flow, system.shared_flow(name).transitions
        return self._by_flow[name]

    def _borrow(self, name: str, detail: Detail) -> CompiledFlow:
        """Return the integrator of a flow, compiled if there is none of this structure yet."""
        system = self._system
        key = (system.structure, name, detail.value)
        if key in self._borrowed:
            return self._borrowed[key][0]
        if detail is Detail.MARKS and not system.shared_flow(name).marks:
            return self._borrow(name, Detail.STATES)
        shelf = _shelves[key]
        try:
            flow = shelf.pop()
        except IndexError:
            taylor = system.shared(key, partial(_compile, system, name, detail))
            flow = CompiledFlow(copy(taylor), system)
        self._borrowed[key] = flow, shelf
        return flow

    def __del__(self) -> None:
        for flow, shelf in self._borrowed.values():
            flow.take_marks()  # of a phase that an error has ended
            shelf.append(flow)


def _compile(system: HybridSystem, name: str, detail: Detail) -> Any:
    flow = system.shared_flow(name)
    equations: Any = list(zip(system.variables, flow.rates, strict=True))
    nodes = sum(len(guard.margin) for guard in flow.guards)
    rough, watched = Detail.ROUGH in detail, Detail.MARKS in detail
    if Detail.DERIVATIVES in detail:
        equations = hy.var_ode_sys(equations, _variations(system), order=1)
        nodes += sum(len(rate) for _, rate in equations.sys)
        many = nodes > _MOST_NODES_UNROLLED // 2
        keeps_loops = len(equations.sys) > _MOST_ROUGH_UNROLLED if rough else many
    else:
        keeps_loops = nodes + sum(map(len, flow.rates)) > _MOST_NODES_UNROLLED
    downward = hy.event_direction.negative
    # The compiler rounds by all that it compiles together.
    marks = flow.marks if watched or (system.many_steps and not rough) else ()
    return compiled_integrator(
        equations,
        [0.0] * len(system.states),
        t_events=[hy.t_event(guard.margin, direction=downward) for guard in flow.guards],
        nt_events=[
            hy.nt_event(mark, callback=_Finder(zero_speed=number == 0, keep=watched))
            for number, mark in enumerate((*marks, *flow.step_limiters))
        ],
        compact_mode=keeps_loops,
        tol=_ROUGH_TOLERANCE if rough else 0.0,
        fast_math=True,  # a quarter faster; the error stays below 2e-12 over 190 periods
    )


def _variations(system: HybridSystem) -> list[Any]:
    """Return what `Detail.DERIVATIVES` has derivatives by: the states, the free constants."""
    constants = [hy.par[system.index[name]] for name in system.free_constants]
    return [*system.variables, *constants]


class _Finder:
    """Callback of a mark, with what it has found."""

    def __init__(self, *, zero_speed: bool, keep: bool) -> None:
        """Keep zeros of a mark, or not; at one of the speed (`zero_speed`) it is exactly zero."""
        self.marks: Marks = []
        self._zero_speed, self._keep = zero_speed, keep

    def __call__(self, integrator: Any, now: float, _: int) -> None:
        if self._keep:
            x, y = integrator.update_d_output(now).tolist()[:2]
            self.marks.append((now, x, 0.0 if self._zero_speed else y))


def flow_rates(
    system: HybridSystem, name: str, state: FloatArray, parameters: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the rates of a flow at the start of an integration, and gradients.

    State and rates have the shape (n, ...). The gradients are those of the rates, then of the
    margins: a row has the derivatives by the states, the free constants and the time, and the shape
    is (rates and margins; derivatives; ...).
    """
    compiled = system.shared(("rates", name), partial(_compiled_rates, system, name))
    values, order = evaluated(compiled, state, parameters), len(system.states)
    count = order + len(system.free_constants) + 1
    return values[:order], values[order:].reshape(-1, count, *state.shape[1:])


def _compiled_rates(system: HybridSystem, name: str) -> Any:
    flow, still = system.shared_flow(name), {hy.time: hy.expression(0.0)}
    by = [*_variations(system), hy.par[system.index["epoch"]]]  # added to the time everywhere
    rows = [*flow.rates, *(guard.margin for guard in flow.guards)]
    terms = [*flow.rates, *(hy.diff(row, variable) for row in rows for variable in by)]
    return compiled_function([hy.subs(term, still) for term in terms], list(system.variables))


def parameter_values(
    system: HybridSystem, mode: Mode, inputs: Sequence[float], time: float = 0.0
) -> FloatArray:
    """Return the values of a system's parameters in a mode, in the order of its expressions."""
    return np.array([*system.constants.values(), *inputs, *mode.switches, time])


def evaluated(compiled: Any, state: FloatArray, parameters: FloatArray) -> FloatArray:
    """Return the values of a compiled function of states and of as many parameters as it uses."""
    used = parameters[: compiled.nparams]
    return compiled(np.ascontiguousarray(state), pars=np.ascontiguousarray(used))
