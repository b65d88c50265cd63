"""Motion of a drive as a hybrid system: a state and a mode, integrated to machine precision."""

from array import array
from math import inf

import heyoka as hy

from stickslip_ros.model.drive_system import DriveSystem
from stickslip_ros.model.hybrid import Instant, Mode
from stickslip_ros.model.rounding import TIME_ROUNDING
from stickslip_ros.motion.compiled_flow import CompiledFlow, Detail, IntegratorPool
from stickslip_ros.motion.phase import DIVERGENCE, Phase, PhaseObserver
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

_STEP_LIMIT = hy.taylor_outcome.step_limit.value
_NOT_FINITE = hy.taylor_outcome.err_nf_state.value


class TooManyStepsError(Exception):
    """Raised when a motion is too stiff to be followed."""


class StepBudget:
    """Steps that a motion may take: so many for each unit of time, and some to spare."""

    def __init__(self) -> None:
        self.taken = 0
        """Number of steps so far."""
        self.left = _SPARE_STEPS
        """Number of steps that it may take now."""
        self.per_unit = inf
        """Steps for each unit of time, if these are fewer than `STEPS_PER_UNIT`."""

    def take(self, steps: int, elapsed: float) -> None:
        """Count steps that took the motion on for a time; raise TooManyStepsError beyond a bound.

        A motion that stays within it in the long run may save steps for a while that needs more.
        """
        self.taken += steps
        per_unit = min(STEPS_PER_UNIT, self.per_unit)
        left = self.left - steps + (per_unit * elapsed if elapsed > 0.0 else 0.0)  # not NaN
        self.left = _SPARE_STEPS if left > _SPARE_STEPS else int(left)
        if left < 1.0:
            raise TooManyStepsError


class HybridMotion:
    """Motion of a hybrid system: phases in its modes, and the transitions between them.

    heyoka's adaptive Taylor method integrates the flow of a mode and finds the instant at which the
    margin of a guard falls to zero; the guard then leads to the next mode. A mode with a closed
    form is not integrated. A phase of an autonomous system that starts as an earlier one did, to
    the last bit, is not integrated again. All values are dimensionless.

    The state is one of a mode: `enter` hands it to the integrator of the mode, in which it lies
    until the next one is entered. Keep no view of it.
    """

    def __init__(self, system: DriveSystem, state: list[float], detail: Detail) -> None:
        """Start at time zero with all inputs at zero."""
        self.budget = StepBudget()
        """Work that the motion may still take."""
        self.observer: PhaseObserver | None = None
        """Takes note of the phases, if there is one."""
        self._integrators = IntegratorPool(detail)
        self.change(system, state, [0.0] * len(system.inputs), 0.0)

    def change(
        self, system: DriveSystem, state: list[float], inputs: list[float], time: float
    ) -> None:
        """Continue with another system, from its state and its inputs on."""
        self.system = system
        """System in motion."""
        self.clocked = not system.autonomous
        """Whether the flows depend on the time."""
        self._corner = inf
        self._integrators.use(system)
        self.instant = Instant(memoryview(array("d", state)), inputs, time)
        """State, inputs and time of the system."""
        self._start()

    def start(self, state: list[float], time: float) -> None:
        """Start again in the mode that a state gives; the inputs stay as they are."""
        self.instant.state, self.instant.time = memoryview(array("d", state)), time
        self._start()

    def _start(self) -> None:
        self.enter(self.system.starting_mode(self.instant))
        self.unbounded = self.system.is_unbounded(self.instant)
        """Whether the motion is unbounded; then it does not advance any further."""

    def set_constant(self, name: str, value: float) -> None:
        """Set a constant of the system."""
        if self.system.constants[name] != value:
            self._integrators.set_constant(name, value)

    def watch(self, observer: PhaseObserver | None, detail: Detail) -> None:
        """Continue with another observer and detail."""
        self.observer = observer
        self._integrators.set_detail(detail)
        self.enter(self.mode)
        self.note_start()

    def note_start(self) -> None:
        """Let the observer, if there is one, take note of a start."""
        if self.observer is not None:
            self.observer.start(self.system, self.mode, self.instant)

    def hold(self, number: int, value: float) -> None:
        """Hold an input at a value."""
        self.instant.inputs[number] = value
        if self.flow is not None:
            for used, index in self.flow.inputs:
                if used == number:
                    self.flow.parameters[index] = value

    def set_time(self, time: float) -> None:
        """Set the time, and enter the mode that follows a corner there, or within its rounding."""
        self.instant.time = time
        if time + TIME_ROUNDING * time >= self._corner:
            self.enter(self.system.switch_inputs(self.mode, self.instant))

    def enter(self, mode: Mode) -> None:
        """Continue in a mode, off its guards."""
        self.mode = mode
        """Mode of the system."""
        self._short_step: ShortStep | None = None
        if self.clocked:
            self._corner = self.system.next_switch_time(mode)
        self.flow, self._transitions = self._integrators.flow_of(mode)
        """Integrator of the mode; None with a closed form."""
        if self.flow is not None:
            self.system.nudge_off_guard(mode, self.instant)
            self.flow.take_over(self.instant, mode)

    def step_shortly(self, duration: float, force: float | None = None) -> bool:
        """Advance within the present phase by a step that is prepared; return if that was possible.

        `force` replaces the first input.
        """
        step = self._short_step
        if step is None or not step(duration, force):
            return False
        if self.observer is not None and not self._integrators.derive:
            self._report(self.observer, Phase(self.mode, duration, None, self.mode))
        return True

    def advance(self, duration: float) -> None:
        """Integrate over a duration; stop early if the motion becomes unbounded.

        Raises TooManyStepsError beyond the budget.
        """
        derives = self._integrators.derive
        short = duration <= _SHORTEST_REPEATED and not self._integrators.phased
        if self._short_step is None and short:
            self._short_step = short_step(
                self.system, self.mode, self.instant, self.flow, self._corner
            )
            if derives and self.observer is not None:
                self.observer.begin(self.mode, self.flow, 0.0, duration)
        if self.step_shortly(duration):
            return
        self.budget.left += STEPS_PER_ADVANCE
        mode = self.system.settled(self.mode, self.instant)
        if mode is not self.mode:
            self.enter(mode)
        recurrence = None
        if duration > _SHORTEST_REPEATED and not (self.clocked or derives):
            recurrence = Recurrence()
        longest = LONGEST_STEP if duration > LONGEST_STEP and not self.clocked else inf
        epoch, now = self.instant.time, 0.0
        while now < duration:
            phase = self._pass_phase(now, min(duration, self._corner - epoch), epoch, longest)
            now, following = phase.end, self._follow(phase, epoch)
            if self.observer is not None:
                self._report(self.observer, phase)
            if following is None:
                self.unbounded, self._short_step = True, None
                return
            if phase.guard is None:
                if following is not phase.mode:
                    self.enter(following)
            elif recurrence and self._recurs(recurrence, phase, following):
                now, recurrence = self._repeat(recurrence, now, duration), None
            else:
                self.enter(following)

    def _pass_phase(self, now: float, end: float, epoch: float, longest: float) -> Phase:
        """Advance in the mode from a time to a guard, or to `end`, in steps up to the longest."""
        mode, flow = self.mode, self.flow
        if self.observer is not None:
            end = self.observer.begin(mode, flow, now, end)
        if flow is None:
            guard, elapsed = self.system.closed_form(mode, self.instant, end - now)
            self.budget.take(_STEPS_OF_A_PHASE, elapsed)
            end = end if guard is None else now + elapsed
            return Phase(mode, end, guard, duration=elapsed, bound=elapsed)
        taylor, origin = flow.taylor, now
        if self.clocked:
            origin = 0.0
            if flow.epoch is not None:
                flow.parameters[flow.epoch] = epoch
        taylor.time = now - origin
        if self.system.limits_steps:
            longest = min(self.system.longest_step(self.instant), LONGEST_STEP)
        outcome = self._propagate(flow, end - origin, longest)
        if outcome == NO_EVENT:
            return Phase(mode, end, origin=origin)
        taylor.reset_cooldowns()  # the next integration is another phase
        if outcome == _NOT_FINITE:
            # Its cause exceeds any bound immediately.
            flow.undo_step()
            self.mode = self.system.overflow(mode, self.instant)
            return Phase(mode, now, DIVERGENCE)
        elapsed = taylor.time
        if outcome == _STEP_LIMIT:  # the rates leave a step no length
            return Phase(mode, origin + elapsed, DIVERGENCE, origin=origin)
        guard, bound = -outcome - 1, elapsed + longest
        end = origin + elapsed
        return Phase(mode, end, guard, origin=origin, duration=elapsed, bound=bound)

    def _follow(self, phase: Phase, epoch: float) -> Mode | None:
        """Make the transition at the end of a phase; return the mode that follows."""
        system, instant, mode, guard = self.system, self.instant, phase.mode, phase.guard
        following: Mode | None = None
        if guard is None:
            following = mode
            if phase.end >= self._corner - epoch:
                instant.time = self._corner
                following = system.switch_inputs(mode, instant)
        else:
            if self.clocked:
                instant.time = epoch + phase.end
            if self.observer is not None:
                phase.state_at_guard = instant.state.tolist()
            if guard != DIVERGENCE:
                following = self._transitions[guard](system, mode, instant)
            if following is not None and system.has_parts:
                following = system.apply_pending_guards(following, instant)
        phase.following = following
        return following

    def _report(self, observer: PhaseObserver, phase: Phase) -> None:
        """Let an observer take a phase that has just passed."""
        marks = () if self.flow is None else self.flow.take_marks()
        phase.points = (*marks, (None, self.instant.state[0], self.instant.state[1]))
        observer.take(phase, self.system, self.instant)

    def _propagate(self, flow: CompiledFlow, until: float, longest: float) -> int:
        """Integrate up to a time or a guard; return the outcome."""
        taylor, work = flow.taylor, _STEPS_OF_A_PHASE
        while True:
            before, most = taylor.time, self.budget.left
            reached = taylor.propagate_until(until, most, longest)
            outcome, steps = reached[0].value, reached[3]
            try:
                self.budget.take(work + steps, taylor.time - before)
            except TooManyStepsError:
                taylor.reset_cooldowns()
                flow.take_marks()  # of a phase that is not reported
                raise
            if outcome != _STEP_LIMIT or steps < most:
                return outcome
            work = 0

    def _recurs(self, recurrence: Recurrence, phase: Phase, following: Mode) -> bool:
        """Note a phase; return whether the one that follows is known."""
        if self.flow is not None:
            phase.bound = min(self.flow.phase_bound(), phase.bound)
        return recurrence.is_known(phase, following, self.instant.state)

    def _repeat(self, recurrence: Recurrence, now: float, latest: float) -> float:
        """Continue with the known phases that `latest` does not shorten; return the time then."""
        for known in recurrence.phases():
            phase = known.phase
            if now + phase.bound >= latest:
                self.instant.state[:] = memoryview(known.state).cast("d")
                self.enter(known.mode)
                return now
            phase.origin, phase.end = now, now + phase.duration
            now = phase.end
            if self.observer is not None:
                self.observer.take(phase, self.system, self.instant)
        raise AssertionError("the phases have no end")
