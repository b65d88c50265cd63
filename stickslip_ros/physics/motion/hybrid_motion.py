"""Motion of a hybrid system: a state vector and a mode, integrated to machine precision."""

from array import array

import heyoka as hy

from stickslip_ros.physics.model.hybrid import HybridSystem, Instant, Leads, Mode
from stickslip_ros.physics.motion.compiled_flow import CompiledFlow, Detail, FlowLoans

STEPS_PER_UNIT = 10_000
"""Integration steps that a motion may take for each unit of time, in the long run."""
_SPARE_STEPS = 4_000_000
"""Steps that it may take in addition: seconds of work, a thousand times the usual number."""
_STEPS_PER_ADVANCE = 1_000
"""Extra steps for each advance, however short: milliseconds of work."""
_MOST_STEPS = 1e18
"""Largest number of steps that heyoka accepts."""
_STEPS_OF_A_PHASE = 10
"""Number of steps that the work around the integration of one phase is worth."""

_DIVERGED = -1
"""Stands for the guard where the rates are no longer finite."""

_NO_EVENT = hy.taylor_outcome.time_limit.value
_NOT_FINITE = hy.taylor_outcome.err_nf_state.value


class TooManyStepsError(Exception):
    """Raised when a motion is too stiff to be followed."""


class _PreparedFlow:
    """Flow of a system that a motion may enter: integrator with its constants, and guards."""

    __slots__ = ("epoch", "flow", "inputs", "leads", "mode", "switches")

    def __init__(
        self, system: HybridSystem, flow: CompiledFlow | None, leads: tuple[Leads, ...]
    ) -> None:
        self.flow = flow
        """Integrator; None if the flow has a closed form."""
        self.leads = leads
        """Where each guard leads."""
        self.mode: Mode | None = None
        """Mode whose switches the integrator has."""
        # heyoka keeps the parameters up to the last one that an equation uses.
        used = 0 if flow is None else len(flow.parameters)
        index = system.index
        self.inputs, self.switches = (
            [(number, index[name]) for number, name in enumerate(names) if index[name] < used]
            for names in (system.inputs, system.switches)
        )
        """Number, and index in the integrator's parameters, of inputs and switches."""
        self.epoch = index["epoch"] if index["epoch"] < used else None
        """Index of the time at the start of the integration."""
        if flow is not None:
            constants = array("d", list(system.constants.values())[:used])
            flow.parameters[: len(constants)] = memoryview(constants)


class HybridMotion:
    """Motion of a hybrid system: phases in its modes, and the transitions between them.

    heyoka's adaptive Taylor method integrates the flow of a mode and finds the instant at which the
    margin of a guard falls to zero; the guard then leads to the next mode. A mode with a closed
    form is not integrated. All values are dimensionless.
    """

    def __init__(
        self, system: HybridSystem, state: list[float], detail: Detail = Detail.STATES
    ) -> None:
        """Start at time zero with all inputs at zero."""
        self.unbounded = False
        """Whether the motion is unbounded; then it does not advance any further."""
        self._steps_left = _SPARE_STEPS
        self._detail, self._watched = detail, detail is not Detail.STATES
        self._loans = FlowLoans()
        self._flow: CompiledFlow | None = None
        self._instant = Instant(memoryview(array("d")), [0.0] * len(system.inputs))
        self._use(system)
        self._set_state(state)

    def _use(self, system: HybridSystem) -> None:
        """Continue with a system that has the same states; its mode is found by `_set_state`."""
        self._system = system
        self._clocked, self._limits_steps = not system.autonomous, system.limits_steps
        self._prepared: dict[str, _PreparedFlow] = {}

    def _set_detail(self, detail: Detail) -> None:
        """Continue with another detail."""
        self._detail, self._watched = detail, detail is not Detail.STATES
        self._prepared.clear()
        self._enter(self._mode)

    def _set_state(self, state: list[float]) -> None:
        """Start again in the mode that a state gives."""
        self._instant.state = memoryview(array("d", state))
        self._enter(self._system.settled(None, self._instant))
        self.unbounded = self._system.is_unbounded(self._instant)

    def _enter(self, mode: Mode) -> None:
        """Continue in a mode."""
        self._mode = mode
        try:
            prepared = self._prepared[mode.flow]
        except KeyError:
            prepared = self._prepare(mode)
        self._entered, self._flow = prepared, prepared.flow
        if self._flow is None:
            return
        instant, parameters = self._instant, self._flow.parameters
        self._system.separate(mode, instant)
        for number, index in prepared.inputs:
            parameters[index] = instant.inputs[number]
        if mode is not prepared.mode:
            prepared.mode = mode
            for number, index in prepared.switches:
                parameters[index] = mode.switches[number]
        variables = self._flow.variables
        if instant.state is not variables:
            variables[:] = instant.state
            instant.state = variables

    def _prepare(self, mode: Mode) -> "_PreparedFlow":
        """Load the constants into the integrator of a mode's flow, unless it has a closed form."""
        name, system, flow = mode.flow, self._system, None
        if self._detail is Detail.DERIVATIVES or not system.has_closed_form(mode):
            flow = self._loans.flow(system, name, self._detail)
        leads = tuple(guard.leads for guard in system.shared_flow(name).guards)
        prepared = self._prepared[name] = _PreparedFlow(system, flow, leads)
        return prepared

    def _set_input(self, number: int, value: float) -> None:
        """Hold an input at a value from now on."""
        self._instant.inputs[number] = value
        if self._flow is not None:
            for used, index in self._entered.inputs:
                if used == number:
                    self._flow.parameters[index] = value

    def _advance(self, duration: float) -> None:
        """Integrate over a duration; stop early if the motion becomes unbounded."""
        system, instant, watched = self._system, self._instant, self._watched
        # Without `min` and further calls: each costs a twentieth of a step of the sampled loop.
        if self._steps_left > _SPARE_STEPS:
            self._steps_left = _SPARE_STEPS
        steps = STEPS_PER_UNIT * duration
        self._steps_left += _STEPS_PER_ADVANCE + int(steps if steps < _MOST_STEPS else _MOST_STEPS)
        mode = system.settled(self._mode, instant)
        if mode is not self._mode:
            self._enter(mode)
        epoch, now = instant.time, 0.0
        while now < duration and not self.unbounded:
            end = self._begin(now, duration) if watched else duration
            flow, guard = self._flow, None
            if flow is None:
                guard, elapsed = system.closed_form(mode, instant, end - now)
                now = end if guard is None else now + elapsed
            else:
                taylor = flow.taylor
                taylor.time = now
                if self._clocked and self._entered.epoch is not None:
                    flow.parameters[self._entered.epoch] = epoch
                if self._limits_steps:
                    longest = system.longest_step(instant)
                    reached = taylor.propagate_until(end, self._steps_left, longest)
                else:
                    reached = taylor.propagate_until(end, self._steps_left)
                outcome = reached[0].value
                self._steps_left -= reached[3] + _STEPS_OF_A_PHASE
                if outcome == _NO_EVENT:
                    now = end
                else:
                    taylor.reset_cooldowns()  # the next integration is another phase
                    if outcome == _NOT_FINITE:
                        guard = self._overflow(flow)
                    elif self._steps_left <= 0:
                        flow.take_marks()  # of a phase that is not reported
                        raise TooManyStepsError
                    else:
                        guard, now = -outcome - 1, taylor.time
            if self._clocked:
                instant.time = epoch + now
            following: Mode | None = mode
            if guard is not None:
                leads = self._entered.leads[guard] if guard != _DIVERGED else _to_the_end
                following = leads(system, mode, instant)
                if following is not None and system.has_parts:
                    following = system.past(following, instant)
            if watched:
                self._pass(mode, guard, following, now)
            if following is None:
                self.unbounded = True
            elif guard is not None:
                mode = following
                self._enter(mode)

    def _begin(self, now: float, end: float) -> float:
        """Take note of the start of a phase; return its latest end. Not called without detail."""
        return end

    def _pass(self, mode: Mode, guard: int | None, following: Mode | None, now: float) -> None:
        """Take note of the end of a phase in `mode`, at a guard or not.

        `now` is the time since the last advance. It is not called without any detail.
        """

    def _overflow(self, flow: CompiledFlow) -> int:
        """End a motion whose rates are no longer finite: its cause exceeds any bound immediately.

        The series of the last step still has the state at its start.
        """
        flow.variables[:] = array("d", flow.taylor.tc[: len(flow.variables), 0])
        self._mode = self._system.overflow(self._mode, self._instant)
        return _DIVERGED


def _to_the_end(system: HybridSystem, mode: Mode, instant: Instant) -> None:
    """Lead to the end of the motion, as a guard does."""
