"""Motion of a hybrid system: a state vector and a mode, integrated to machine precision."""

from array import array
from math import inf
from typing import Any

import heyoka as hy

from stickslip_ros.model.hybrid import HybridSystem, Instant, Mode, Transition
from stickslip_ros.motion.compiled_flow import CompiledFlow, Detail, IntegratorPool
from stickslip_ros.motion.recurrence import Recurrence
from stickslip_ros.motion.short_step import (
    LONGEST_STEP,
    NO_EVENT,
    STEPS_PER_ADVANCE,
    ShortStep,
    short_step,
)

STEPS_PER_UNIT = 10_000
"""Integration steps that a motion may take for each unit of time, in the long run."""
_SPARE_STEPS = 4_000_000
"""Steps that it may take in addition: seconds of work."""
_STEPS_OF_A_PHASE = 50
"""Number of steps that the work around the integration of one phase is worth."""
_SHORTEST_REPEATED = 16.0
"""Duration of an advance above which its phases may be known: others have two cycles or fewer."""

_DIVERGENCE = -1
"""Stands for a guard where the rates exceed any bound."""

_STEP_LIMIT = hy.taylor_outcome.step_limit.value
_NOT_FINITE = hy.taylor_outcome.err_nf_state.value


_Prepared = tuple[CompiledFlow | None, tuple[Transition, ...]]
"""Integrator with the constants of the system, None with a closed form; where its guards lead."""


class TooManyStepsError(Exception):
    """Raised when a motion is too stiff to be followed."""


class HybridMotion:
    """Motion of a hybrid system: phases in its modes, and the transitions between them.

    heyoka's adaptive Taylor method integrates the flow of a mode and finds the instant at which the
    margin of a guard falls to zero; the guard then leads to the next mode. A mode with a closed
    form is not integrated. A phase of an autonomous system that starts as an earlier one did, to
    the last bit, is not integrated again. All values are dimensionless.
    """

    def __init__(
        self, system: HybridSystem, state: list[float], detail: Detail = Detail.STATES
    ) -> None:
        """Start at time zero with all inputs at zero."""
        self.unbounded = False
        """Whether the motion is unbounded; then it does not advance any further."""
        self._steps, self._steps_left = 0, _SPARE_STEPS
        self._steps_per_unit = inf
        """Steps for each unit of time, if these are fewer than `STEPS_PER_UNIT`."""
        self._detail, self._watched = detail, bool(detail)
        self._derives = Detail.DERIVATIVES in detail
        self._integrators = IntegratorPool()
        self._flow: CompiledFlow | None = None
        self._short_step: ShortStep | None = None
        self._begun = 0.0
        """Time of the motion, in the present advance, at which that of the integrator is zero."""
        self._instant = Instant(memoryview(array("d")), [0.0] * len(system.inputs))
        self._use(system)
        self._set_state(state)

    def _use(self, system: HybridSystem) -> None:
        """Continue with a system that has the same states; its mode is found by `_set_state`."""
        self._system = system
        self._clocked, self._switch_time = not system.autonomous, inf
        self._prepared_by_detail: dict[Detail, dict[str, _Prepared]] = {}
        self._prepared = self._prepared_by_detail.setdefault(self._detail, {})

    def _set_constant(self, name: str, value: float) -> None:
        """Set a constant of the system."""
        if self._system.constants[name] == value:
            return
        self._system.constants[name], index = value, self._system.index[name]
        for prepared in self._prepared_by_detail.values():
            for flow, _ in prepared.values():
                if flow is not None and index < len(flow.parameters):
                    flow.parameters[index] = value

    def _set_detail(self, detail: Detail) -> None:
        """Continue with another detail."""
        self._detail, self._watched = detail, bool(detail)
        self._derives = Detail.DERIVATIVES in detail
        self._prepared = self._prepared_by_detail.setdefault(detail, {})
        self._enter(self._mode)

    def _set_state(self, state: list[float]) -> None:
        """Start again in the mode that a state gives."""
        self._instant.state = memoryview(array("d", state))
        self._enter(self._system.settled(None, self._instant))
        self.unbounded = self._system.is_unbounded(self._instant)

    def _enter(self, mode: Mode) -> None:
        """Continue in a mode."""
        self._mode, self._short_step = mode, None
        if self._clocked:
            self._switch_time = self._system.next_switch_time(mode)
        prepared = self._prepared.get(mode.flow) or self._prepare(mode)
        self._flow, self._transitions = prepared
        flow = prepared[0]
        if flow is None:
            return
        instant, parameters = self._instant, flow.parameters
        self._system.nudge_off_guard(mode, instant)
        for number, index in flow.inputs:
            parameters[index] = instant.inputs[number]
        if mode is not flow.mode:
            flow.mode = mode
            for number, index in flow.switches:
                parameters[index] = mode.switches[number]
        variables = flow.variables
        if instant.state is not variables:
            variables[:] = instant.state
            instant.state = variables

    def _prepare(self, mode: Mode) -> _Prepared:
        """Load the constants into the integrator of a mode's flow, unless it has a closed form."""
        name, system, flow = mode.flow, self._system, None
        if self._derives or not system.has_closed_form(mode):
            flow = self._integrators.flow(system, name, self._detail)
            flow.load(system)
        prepared = self._prepared[name] = flow, system.shared_flow(name).transitions
        return prepared

    def _advance(self, duration: float) -> None:
        """Integrate over a duration; stop early if the motion becomes unbounded."""
        step = self._short_step
        if step is None and duration <= _SHORTEST_REPEATED and not self._derives:
            step = self._short_step = short_step(
                self._system, self._mode, self._instant, self._flow, self._switch_time
            )
        if step is not None and step(duration, None):
            self._pass_shortly(duration)
            return
        system, instant, watched = self._system, self._instant, self._watched
        self._steps_left += STEPS_PER_ADVANCE
        mode = system.settled(self._mode, instant)
        if mode is not self._mode:
            self._enter(mode)
        epoch, now, elapsed, self._begun = instant.time, 0.0, 0.0, 0.0
        limits_steps, clocked, has_parts = system.limits_steps, self._clocked, system.has_parts
        longest = LONGEST_STEP if duration > LONGEST_STEP and not clocked else inf
        repeats = duration > _SHORTEST_REPEATED and not (clocked or self._derives)
        recurrence = Recurrence() if repeats else None
        while now < duration:
            end, corner = duration, self._switch_time - epoch
            if corner < end:
                end = corner
            if watched:
                end = self._begin(now, end)
            flow, guard = self._flow, None
            if flow is None:
                guard, elapsed = system.closed_form(mode, instant, end - now)
                now = end if guard is None else now + elapsed
                self._take_steps(_STEPS_OF_A_PHASE, elapsed)
            else:
                taylor = flow.taylor
                if clocked:
                    taylor.time = now
                    if flow.epoch is not None:
                        flow.parameters[flow.epoch] = epoch
                else:  # a phase does not depend on when it starts
                    self._begun = now
                    taylor.time = 0.0
                until = end - self._begun
                if limits_steps:
                    longest = min(system.longest_step(instant), LONGEST_STEP)
                outcome = self._propagate(flow, until, longest)
                elapsed = taylor.time
                if outcome == NO_EVENT:
                    now = end
                else:
                    taylor.reset_cooldowns()  # the next integration is another phase
                    if outcome == _NOT_FINITE:
                        self._overflow(flow)
                        guard = _DIVERGENCE
                    elif outcome == _STEP_LIMIT:  # the rates leave a step no length
                        guard, now = _DIVERGENCE, self._begun + elapsed
                    else:
                        guard, now = -outcome - 1, self._begun + elapsed
            if guard is None:
                following = mode
                if now >= corner:
                    instant.time = self._switch_time
                    following = system.switch_inputs(mode, instant)
                if watched:
                    self._pass(mode, None, following, now)
                if following is not mode:
                    mode = following
                    self._enter(mode)
                continue
            if clocked:
                instant.time = epoch + now
            if watched:
                self._reach_guard()
            following = (
                None if guard == _DIVERGENCE else self._transitions[guard](system, mode, instant)
            )
            if has_parts and following is not None:
                following = system.apply_pending_guards(following, instant)
            if watched:
                self._pass(mode, guard, following, now)
            if following is None:
                self.unbounded, self._short_step = True, None
                break
            mode = following
            if recurrence is not None:
                bound = elapsed if flow is None else min(flow.phase_bound(), elapsed + longest)
                if recurrence.is_known(mode, instant.state, elapsed, bound, self._kept()):
                    now = self._repeat(recurrence, now, duration)
                    mode, recurrence = self._mode, None
                    continue
            self._enter(mode)

    def _propagate(self, flow: CompiledFlow, until: float, longest: float) -> int:
        """Integrate up to a time or a guard; return the outcome."""
        taylor, work = flow.taylor, _STEPS_OF_A_PHASE
        while True:
            before, most = taylor.time, self._steps_left
            reached = taylor.propagate_until(until, most, longest)
            outcome, steps = reached[0].value, reached[3]
            try:
                self._take_steps(work + steps, taylor.time - before)
            except TooManyStepsError:
                taylor.reset_cooldowns()
                flow.take_marks()  # of a phase that is not reported
                raise
            if outcome != _STEP_LIMIT or steps < most:
                return outcome
            work = 0

    def _take_steps(self, steps: int, elapsed: float) -> None:
        """Count steps that took the motion on for a time; raise TooManyStepsError beyond a bound.

        A motion that stays within it in the long run may save steps for a while that needs more.
        """
        self._steps += steps
        per_unit = min(STEPS_PER_UNIT, self._steps_per_unit)
        left = self._steps_left - steps + (per_unit * elapsed if elapsed > 0.0 else 0.0)  # not NaN
        self._steps_left = _SPARE_STEPS if left > _SPARE_STEPS else int(left)
        if left < 1.0:
            raise TooManyStepsError

    def _repeat(self, recurrence: Recurrence, now: float, latest: float) -> float:
        """Continue with the known phases that `latest` does not shorten; return the time then."""
        for phase in recurrence.phases():
            begun, after = now, now + phase.duration
            if now + phase.bound >= latest:
                self._instant.state[:] = memoryview(phase.state).cast("d")
                self._enter(phase.mode)
                return now
            now = after
            if self._watched:
                self._recall(phase.kept, begun, now)
        raise AssertionError("the phases have no end")

    def _kept(self) -> Any:
        """Return what `_recall` needs of the phase that has passed; by default nothing."""
        return None

    def _recall(self, kept: Any, begun: float, now: float) -> None:
        """Take note of a phase again, from `begun` to `now`; not called without any detail."""

    def _begin(self, now: float, end: float) -> float:
        """Take note of the start of a phase; return its latest end. Not called without detail."""
        return end

    def _reach_guard(self) -> None:
        """Take note of the state at a guard: the mode that follows may set a part of it."""

    def _pass(self, mode: Mode, guard: int | None, following: Mode | None, now: float) -> None:
        """Take note of the end of a phase in `mode`, at a guard or not.

        `now` is the time since the last advance. It is not called without any detail.
        """

    def _pass_shortly(self, duration: float) -> None:
        """Take note of a short step."""
        if self._watched:
            self._begun = 0.0
            self._pass(self._mode, None, self._mode, duration)

    def _overflow(self, flow: CompiledFlow) -> None:
        """End a motion whose rates are no longer finite: its cause exceeds any bound immediately.

        The series of the last step still has the state at its start.
        """
        flow.variables[:] = array("d", flow.taylor.tc[: len(flow.variables), 0])
        self._mode = self._system.overflow(self._mode, self._instant)
