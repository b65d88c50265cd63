"""The motion that a drive settles on from one start: a point of a sweep or basin study."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import inf
from operator import attrgetter
from typing import Any, NamedTuple, Self

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import LEAST_CYCLES, RESTS, Measures, Regime, Trend
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.measures.sample_meter import MeasuredMotion
from stickslip_ros.model.constants import constants_of
from stickslip_ros.model.control import ControlLaw
from stickslip_ros.model.drive import Drive
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.motion.controller import Controller, ReferenceSource, answer, no_reference
from stickslip_ros.motion.simulation import measure_block, simulate_sampled
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.studies.options import DEFAULT_PERIODS, LONGEST, SettlingOptions
from stickslip_ros.theory.cycle_bounds import loading_time, release_position

CYCLES = (Regime.STICK_SLIP, Regime.PURE_SLIP)
"""Regimes of a limit cycle, which has an amplitude."""

_LEAST_CYCLES = LEAST_CYCLES + 1
"""Number of cycles from which it is known how much they will still change."""


@dataclass(frozen=True)
class MotionState:
    """State of a motion; SI units."""

    position: float
    """Displacement, m."""
    velocity: float
    """Velocity, m/s."""
    control: tuple[float, ...] | None = None
    """State of the control law; None: its initial state."""
    memory: tuple[float, ...] | None = None
    """Memory of the friction law; None: its initial memory."""
    motor: tuple[float, ...] | None = None
    """Displacement, m, and velocity, m/s, of a motor; None: at rest at the reference."""

    @classmethod
    def from_json(cls, values: Sequence[Any]) -> Self:
        """Return the state of the values of a tuple that went through JSON."""
        position, velocity, *parts = values
        return cls(position, velocity, *(None if item is None else tuple(item) for item in parts))


@dataclass(frozen=True)
class ControlledDrive:
    """A drive with its control and sampling, if any."""

    drive: Drive
    law: ControlLaw | None = None
    """The control law; None: no control."""
    sampled: PlantParameters | None = None
    """Sampling of the loop; None: no sampling, and continuous control (eq. 19)."""
    reference: ReferenceSource = no_reference
    """Reference of the control law."""
    duration: float = inf
    """Duration of the scenario, s: the scale of time of a drive without a spring."""
    meter: Callable[[int], CycleMeter] = field(default=CycleMeter, compare=False)
    """Returns what measures the last cycles, given their number."""

    @classmethod
    def from_scenario(cls, scenario: Scenario, *, continuous: bool = False) -> "ControlledDrive":
        """Return the case of a scenario, with sampled or `continuous` control.

        Without controller and disturbance the loop is not sampled, since the motion is the same.
        Raises InvalidInputError if continuous control does not support the scenario.
        """
        plant = scenario.plant
        law = scenario.control_law
        check_motor(scenario)
        if continuous:
            check_continuous(scenario)
        drive = plant.as_drive()
        period = unit_period(drive, plant.duration)
        if law is not None and law.start_after > LONGEST * period:
            raise InvalidInputError(
                f"{scenario.controller.node}.start_after = {law.start_after:g} s: in a study it "
                f"must be at most {LONGEST:g} natural periods"
            )
        disturbed = plant.disturbance.kind != "none"
        sampled = not continuous and (law is not None or disturbed)
        reference: ReferenceSource = no_reference
        if law is not None and law.follows_reference:
            check_reference(scenario)
            reference = scenario.controller.reference.signal(period=0.0).reference
        loop = plant if sampled else None
        return cls(drive, law, loop, reference, plant.duration, scenario.cycle_meter)

    @property
    def period(self) -> float:
        """Unit of the durations of a study, s; see `unit_period`."""
        return unit_period(self.drive, self.duration)


def unit_period(drive: Drive, duration: float) -> float:
    """Return the natural period, s, or without a spring the duration (s) over `DEFAULT_PERIODS`.

    Raises InvalidInputError if neither is finite.
    """
    if drive.has_spring:
        return drive.natural_period
    if not 0.0 < duration < inf:
        raise InvalidInputError(
            f"plant.duration = {duration:g} s is invalid: must be finite and above 0 s with "
            "plant.stiffness = 0 N/m, because a drive without a spring has no natural period"
        )
    return duration / DEFAULT_PERIODS


def check_reference(scenario: Scenario) -> None:
    """Raise InvalidInputError if the controller needs a reference from a topic."""
    kind = scenario.controller.reference.kind
    if scenario.plant.expects_control and kind == "topic":
        raise InvalidInputError(
            f"{scenario.controller.node}.reference.kind = {kind} is refused: without nodes there "
            "are no topics"
        )


def check_motor(scenario: Scenario) -> None:
    """Raise InvalidInputError if the controller feeds back a motor that is ideal."""
    law = scenario.control_law
    if law is not None and law.of_motor and scenario.plant.motor.kind == "ideal":
        raise InvalidInputError(
            f"{scenario.controller.node}.{law.of_motor[0]} = motor needs plant.motor.kind = mass; "
            "it is ideal"
        )


def check_continuous(scenario: Scenario) -> None:
    """Raise InvalidInputError if continuous control does not support the scenario."""
    plant, controller = scenario.plant, scenario.controller
    law = scenario.control_law
    if law is not None and law.continuous is None:
        raise InvalidInputError(
            f"the control law {law.name} is defined for samples only: it has no continuous form"
        )
    for group in ("sensor", "motor.sensor", "actuator"):
        part = attrgetter(group)(plant)
        for name, described in constants_of(type(part)).items():
            value = getattr(part, name)
            if value != described.default:
                raise InvalidInputError(
                    f"plant.{group}.{name} = {value} is refused: continuous control has no "
                    f"{group.rpartition('.')[2]}"
                )
    limit = float("inf") if law is None else law.force_limit
    for name, value, needed in (
        (f"{controller.node}.force_limit", limit, float("inf")),
        ("plant.force_delay", plant.force_delay, 0.0),
        ("plant.force_jitter", plant.force_jitter, 0.0),
        ("plant.disturbance.kind", plant.disturbance.kind, "none"),
    ):
        if value != needed:
            raise InvalidInputError(
                f"{name} = {value} is refused: with continuous control it must be {needed}"
            )


class Settled(NamedTuple):
    """A motion after its transient."""

    measures: Measures
    turning_points: FloatArray
    """Displacements at which the velocity is zero, m: the Poincare section x' = 0. In equilibrium
    the rest position only; none if the motion diverges."""
    end: MotionState
    """State in which the motion ended."""

    @property
    def steady(self) -> bool:
        """Whether the motion has settled: by its measures, or at rest after its transient."""
        return _is_settled(self.measures)


def settle(case: ControlledDrive, start: MotionState, settling: SettlingOptions) -> Settled:
    """Simulate the motion from `start` and measure it after the transient.

    Raises RunError if the motion is too stiff to integrate.
    """
    drive, period = case.drive, case.period
    controlled = case.law is not None or case.sampled is not None
    run = _ControlledMotion(case, start)
    motion = run.motion
    loads = drive.belt_speed != 0.0 and drive.has_spring
    loading = loading_time(drive) if loads else 0.0
    transient = settling.transient * period
    if controlled:  # otherwise one step covers the stick phase on a slow belt
        loading = min(loading, 50.0 * period)
        transient += loading
    # The first and the last cycle are incomplete.
    cycles = max(settling.cycles, _LEAST_CYCLES) + 2
    block, longest = cycles * period, cycles * (period + loading)
    if not drive.has_spring:  # forces alone make its cycles
        block = longest = case.duration
    if run.loop is not None:
        block = max(block, run.loop.period)

    def observe() -> _Section:
        motion.recording = False
        section = _Section(case.meter(settling.cycles), settling.cycles, once=not drive.has_spring)
        run.advance(transient, section)
        if motion.sticking and not controlled and loads and drive.motor is None:
            left = (release_position(drive) - motion.position) / drive.belt_speed
            if left > period:  # the transient has only started
                motion.advance(left)
                motion.advance(transient)
        motion.recording = True
        done, step = 0.0, block
        while not motion.unbounded and done < longest and not (done and section.done):
            run.advance(step, section)
            done, step = done + step, done + step  # cycles on a slow belt are that long
        if motion.unbounded:
            section.meter.unbounded = True
        return section

    section, measures = observe(), None
    for number in range(1, settling.patience + settling.extensions):
        before, measures = measures, section.measures
        if number < settling.patience:
            alike = before is not None and _alike(before, measures, section.meter.drift.resolution)
            if _is_settled(measures) and alike:
                break
        elif measures.trend not in (Trend.GROWING, Trend.DECAYING) or not section.meter.repeats:
            break
        section = observe()
    return section.settled(run.end())


class _ControlledMotion:
    """The motion of a case from a start, after its control has started to act."""

    def __init__(self, case: ControlledDrive, start: MotionState) -> None:
        drive, law = case.drive, case.law
        control = law.continuous if law is not None and case.sampled is None else None
        motion = RecordedMotion(drive, start.position, start.velocity, control, recording=False)
        kept = start.memory is not None and len(start.memory) == len(drive.friction.states)
        if kept or start.motor is not None:
            memory = start.memory if kept else None
            motion.restart(start.position, start.velocity, memory, start.motor)
        self.motion = motion
        self.loop = None if case.sampled is None else case.sampled.as_loop(motion)
        self._controller: Controller | None = None
        if self.loop is not None and law is not None:
            self._controller = Controller(law, case.reference, start.control)
            after = law.start_after
            simulate_sampled(self.loop, motion, self._controller, after, CycleMeter(1))
        elif law is not None and control is not None:
            # The states of the control run alone until its force acts.
            motion.control = control if law.start_after == 0.0 else control.silenced()
            if start.control is not None:
                motion.control_state = start.control
            if law.start_after > 0.0:
                motion.advance(law.start_after)
                motion.control = control

    def advance(self, duration: float, section: "_Section") -> None:
        """Advance by a duration, s, and let a section take what is recorded."""
        meter, controller = section.meter, self._controller
        if self.loop is not None:
            simulate_sampled(self.loop, self.motion, controller, duration, meter, observer=section)
            return
        self.motion.advance(duration)
        if self.motion.recording:
            measure_block(self.motion, meter, section)

    def end(self) -> MotionState:
        """Return the state at the end, after a last answer of a sampled controller."""
        motion, controller = self.motion, self._controller
        state = None if motion.control is None else motion.control_state
        if controller is not None and self.loop is not None:
            answer(self.loop, controller)
            state = tuple(map(float, controller.state))  # also those of a law that uses numpy
        return MotionState(motion.position, motion.velocity, state, motion.memory, motion.motor)


def _is_settled(measures: Measures) -> bool:
    """Return whether a motion is steady; a motion at rest after its transient is."""
    return measures.regime in RESTS if measures.steady is None else measures.steady


def _alike(before: Measures, after: Measures, resolution: float) -> bool:
    """Return whether regime and amplitude agree, these within the resolution (m) of the sensor."""
    one, other = before.amplitude, after.amplitude
    if before.regime is not after.regime or one is None or other is None:
        return before.regime is after.regime
    return after.regime not in CYCLES or abs(other - one) <= max(1e-4 * other, resolution)


class _Section:
    """Measures a motion, keeps its Poincare section, and counts the measured cycles."""

    def __init__(self, meter: CycleMeter, cycles: int, *, once: bool) -> None:
        """Measure at least `cycles`; keep a turning point `once` if the slide sticks there."""
        self.meter = meter
        self._missing, self._once = max(cycles, _LEAST_CYCLES), once
        self._sections = [np.empty(0)]
        self._measures: Measures | None = None

    def take_motion(self, motion: MeasuredMotion) -> None:
        """Keep the turning points of the slide, as an observer."""
        breakpoints = motion.breakpoints
        turns = breakpoints.position[breakpoints.velocity == 0.0]
        if self._once:
            turns = turns[np.diff(turns, prepend=np.nan) != 0.0]
        self._sections.append(turns)
        self._missing -= len(motion.cycles)
        self._measures = None

    @property
    def measures(self) -> Measures:
        """The measures so far."""
        if self._measures is None or self.meter.unbounded:
            self._measures = self.meter.measures()
        return self._measures

    @property
    def done(self) -> bool:
        """Whether there are enough cycles, or no more will follow."""
        return self._missing <= 0 or self.measures.regime in RESTS

    def settled(self, end: MotionState) -> Settled:
        """Return the settled motion, which ended in the state `end`."""
        measures = self.measures
        section = np.concatenate(self._sections)
        if measures.regime is Regime.UNBOUNDED:
            section = np.empty(0)
        elif measures.regime in (Regime.EQUILIBRIUM, Regime.HELD):
            section = np.array([measures.midpoint])
        return Settled(measures, section, end)
