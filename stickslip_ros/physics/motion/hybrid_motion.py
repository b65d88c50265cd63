"""Motion of a hybrid system: a state vector and a mode, integrated to machine precision."""

from array import array

import heyoka as hy

from stickslip_ros.physics.model.hybrid import HybridSystem, Instant, Mode
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


_LoadedFlow = tuple[CompiledFlow, range, range, bool]
"""Integrator, indices of the inputs and switches that it uses, and whether it uses the time."""


class TooManyStepsError(Exception):
    """Raised when a motion is too stiff to be followed."""


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
        """Continue with a system that has the same states; the mode must be settled anew."""
        self._system = system
        constants = system.constants.values()
        self._first_input = len(constants)
        self._first_switch = self._first_input + len(system.inputs)
        self._epoch = self._first_switch + len(system.switches)
        others = [0.0] * (self._epoch + 1 - len(constants))
        self._parameters = memoryview(array("d", (*constants, *others)))
        self._loaded: dict[str, _LoadedFlow] = {}

    def _set_detail(self, detail: Detail) -> None:
        """Continue with another detail."""
        self._detail, self._watched = detail, detail is not Detail.STATES
        self._loaded.clear()
        self._enter(self._mode)

    def _set_state(self, state: list[float]) -> None:
        """Start again in the mode that a state gives."""
        self._instant.state = memoryview(array("d", state))
        self._enter(self._system.settled(None, self._instant))
        self.unbounded = self._system.is_unbounded(self._instant)

    def _enter(self, mode: Mode) -> None:
        """Continue in a mode."""
        self._mode = mode
        system, instant = self._system, self._instant
        if self._detail is not Detail.DERIVATIVES and system.has_closed_form(mode):
            self._flow = None
            return
        system.separate(mode, instant)
        loaded = self._loaded.get(mode.flow)
        if loaded is None:
            loaded = self._load(mode.flow)
        self._flow, self._inputs, self._switches, self._timed = loaded
        parameters, switches, first = self._flow.parameters, mode.switches, self._first_switch
        for number in self._switches:
            parameters[number] = switches[number - first]
        variables = self._flow.variables
        variables[:] = instant.state
        instant.state = variables

    def _load(self, name: str) -> _LoadedFlow:
        """Load the constants into the integrator of a flow."""
        flow = self._loans.flow(self._system, name, self._detail)
        # heyoka keeps the parameters up to the last one that an equation uses.
        count = len(flow.parameters)
        flow.parameters[:] = self._parameters[:count]
        loaded = (
            flow,
            range(self._first_input, min(self._first_switch, count)),
            range(self._first_switch, min(self._epoch, count)),
            count > self._epoch,
        )
        self._loaded[name] = loaded
        return loaded

    def _advance(self, duration: float) -> None:
        """Integrate over a duration; stop early if the motion becomes unbounded."""
        # Without `min`: two calls cost a twentieth of a step of the sampled loop.
        if self._steps_left > _SPARE_STEPS:
            self._steps_left = _SPARE_STEPS
        steps = STEPS_PER_UNIT * duration
        self._steps_left += _STEPS_PER_ADVANCE + int(steps if steps < _MOST_STEPS else _MOST_STEPS)
        instant = self._instant
        mode = self._system.settled(self._mode, instant)
        if mode is not self._mode:
            self._enter(mode)
        epoch, now = instant.time, 0.0
        while now < duration and not self.unbounded:
            now = self._phase(epoch, now, duration)
        instant.time = epoch + duration

    def _phase(self, epoch: float, now: float, end: float) -> float:
        """Move in the present mode up to a guard, or to `end`; return the time."""
        system, instant, mode, flow = self._system, self._instant, self._mode, self._flow
        if flow is None:
            guard, elapsed = system.closed_form(mode, instant, end - now)
            now = end if guard is None else now + elapsed
        else:
            guard, now = self._propagate(flow, epoch, now, end)
        instant.time = epoch + now
        if guard is None:
            if self._watched:
                self._pass(mode, None, mode, now)
            return now
        following = None if guard == _DIVERGED else system.leads(guard, mode, instant)
        if self._watched:
            self._pass(mode, guard, following, now)
        if following is None:
            self.unbounded = True
        else:
            self._enter(following)
        return now

    def _pass(self, mode: Mode, guard: int | None, following: Mode | None, now: float) -> None:
        """Take note of the end of a phase in `mode`, at a guard or not.

        `now` is the time since the last advance. It is not called without any detail.
        """

    def _propagate(
        self, flow: CompiledFlow, epoch: float, now: float, end: float
    ) -> tuple[int | None, float]:
        """Integrate the flow from `now` to `end`; return the guard that ended it, and the time."""
        taylor, instant = flow.taylor, self._instant
        for number in self._inputs:
            flow.parameters[number] = instant.inputs[number - self._first_input]
        if self._timed:
            flow.parameters[self._epoch] = epoch
        taylor.time = now
        before = flow.variables.tolist()
        if self._system.limits_steps:
            longest = self._system.longest_step(instant)
            reached = taylor.propagate_until(end, self._steps_left, longest)
        else:
            reached = taylor.propagate_until(end, self._steps_left)
        outcome = reached[0].value
        self._steps_left -= reached[3] + _STEPS_OF_A_PHASE
        if outcome == _NO_EVENT:
            return None, end
        taylor.reset_cooldowns()  # the next integration is another phase
        if outcome == _NOT_FINITE:  # what causes this exceeds any bound immediately
            flow.variables[:] = array("d", before)
            self._mode = self._system.overflow(self._mode, instant)
            return _DIVERGED, now
        if self._steps_left <= 0:
            flow.take_marks()  # of a phase that is not reported
            raise TooManyStepsError
        return -outcome - 1, float(taylor.time)
