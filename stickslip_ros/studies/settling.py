"""What a drive settles on from one start: the points that sweeps and basins are made of."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.loop.simulation import measure_block, simulate_sampled
from stickslip_ros.physics.loop.washout import Washout, WashoutParameters
from stickslip_ros.physics.measures.cycle_measures import LEAST_CYCLES, CycleMeter, Measures, Regime
from stickslip_ros.physics.measures.observer import MeasuredMotion
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.motion.motion import Motion
from stickslip_ros.physics.theory.cycle_bounds import loading_time, release_position
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.scenarios.parameters import PlantParameters
from stickslip_ros.studies.options import LONGEST, SettlingCourse

CYCLES = (Regime.STICK_SLIP, Regime.PURE_SLIP)
"""Regimes that have an amplitude to be steady."""

_RESTS = (Regime.EQUILIBRIUM, Regime.STUCK)


@dataclass(frozen=True)
class MotionState:
    """Where a motion stands; SI units."""

    position: float
    velocity: float
    low_passed: float | None = None
    """What the washout filter holds back of the speed, m/s; None: all of it, the filter rests."""


@dataclass(frozen=True)
class ControlledDrive:
    """A drive, and how it is controlled and sampled, if it is."""

    drive: Drive
    washout: WashoutParameters | None = None
    """The controller; None: there is none."""
    sampled: PlantParameters | None = None
    """How the loop is sampled; None: not at all, control being continuous (eq. 19)."""

    @classmethod
    def from_scenario(cls, scenario: Scenario, *, continuous: bool = False) -> "ControlledDrive":
        """Return the case of a scenario, its control `continuous` if asked for.

        Without controller and disturbance there is nothing to sample: the motion is the same.
        Raises InvalidInputError for what continuous control does not have.
        """
        plant = scenario.plant
        washout = scenario.washout_controller.as_washout() if plant.expects_control else None
        if continuous:
            check_continuous(scenario)
        drive = plant.as_drive()
        if washout is not None and washout.start_after > LONGEST * drive.natural_period:
            raise InvalidInputError(
                f"washout_controller.start_after = {washout.start_after:g} s: in a study it must "
                f"be at most {LONGEST:g} natural periods"
            )
        disturbed = plant.disturbance.kind != "none"
        sampled = not continuous and (washout is not None or disturbed)
        return cls(drive, washout, plant if sampled else None)


def check_continuous(scenario: Scenario) -> None:
    """Raise InvalidInputError for what continuous control does not have."""
    plant, washout = scenario.plant, scenario.washout_controller
    for name, value, needed in (
        ("washout_controller.force_limit", washout.force_limit, float("inf")),
        ("plant.force_delay", plant.force_delay, 0.0),
        ("plant.force_jitter", plant.force_jitter, 0.0),
        ("plant.disturbance.kind", str(plant.disturbance.kind), "none"),
    ):
        if value != needed:
            raise InvalidInputError(
                f"continuous control knows no {name}: it is {value}, and must be {needed}"
            )


class Settled(NamedTuple):
    """What is left of a motion after its transient."""

    measures: Measures
    turning_points: FloatArray
    """Displacements at which the velocity is zero, m: the Poincare section x' = 0. In equilibrium
    the one place of rest; none where the motion runs away."""
    end: MotionState
    """Where the motion ended."""

    @property
    def steady(self) -> bool:
        """Whether the motion has settled: its measures say so, or it rests behind its transient."""
        return _is_settled(self.measures)


class Settler:
    """Follows one motion after another; what they are like does not depend on those before.

    Compiling an integrator costs more than most motions: it is done once for each friction law.
    """

    def __init__(self) -> None:
        self._motions: dict[bool, Motion] = {}

    def settle(self, case: ControlledDrive, start: MotionState, course: SettlingCourse) -> Settled:
        """Follow the motion from `start` and measure what is left after the transient.

        Raises RunError for a motion too stiff to be followed.
        """
        drive, washout = case.drive, case.washout
        continuous = washout is not None and case.sampled is None
        motion = self._motions.get(continuous)
        if motion is None:
            motion = Motion(drive, 0.0, 0.0, continuous_control=continuous, record=True)
            self._motions[continuous] = motion
        motion.recording = False
        motion.begin(drive, start.position, start.velocity)
        loading = 0.0 if drive.belt_speed == 0.0 else loading_time(drive)
        transient = course.transient * drive.natural_period
        controlled = washout is not None or case.sampled is not None
        if controlled:  # without, the slide rides a slow belt in one step
            loading = min(loading, 50.0 * drive.natural_period)
            transient += loading
        # One cycle is under way when it begins, and one when it ends.
        cycles = max(course.cycles, LEAST_CYCLES) + 2
        block = cycles * drive.natural_period
        law = loop = None
        if case.sampled is not None:
            loop = case.sampled.as_loop(motion)
            block = max(block, loop.period)
            if washout is not None:
                law = Washout(washout, start.low_passed)
                simulate_sampled(loop, motion, law, washout.start_after, CycleMeter(1))

            def advance(duration: float, section: _Section) -> None:
                simulate_sampled(loop, motion, law, duration, section.meter, observer=section)
        else:
            if washout is not None:
                _begin_control(motion, washout, start)

            def advance(duration: float, section: _Section) -> None:
                motion.advance(duration)
                measure_block(motion, section.meter, section)

        def observe() -> _Section:
            motion.recording = False
            section = _Section(course.cycles)
            advance(transient, section)
            if motion.sticking and not controlled and drive.belt_speed != 0.0:
                left = (release_position(drive) - motion.position) / drive.belt_speed
                if left > drive.natural_period:  # the transient is but begun
                    motion.advance(left)
                    motion.advance(transient)
            motion.recording = True
            longest = cycles * (drive.natural_period + loading)
            done, step = 0.0, block
            while not motion.unbounded and done < longest and not (done and section.done):
                advance(step, section)
                done, step = done + step, done + step  # a slow belt's cycles are that long
            if motion.unbounded:
                section.meter.report_run_away()
            return section

        section = observe()
        for _ in range(course.patience - 1):
            before, section = section.meter.measures(), observe()
            measures = section.meter.measures()
            if _is_settled(measures) and _alike(before, measures):
                break
        low_passed = motion.low_passed if continuous else None
        if law is not None and loop is not None:
            law.answer(loop.sample.stamp, loop.sample.velocity)
            low_passed = law.low_passed
        return section.settled(MotionState(motion.position, motion.velocity, low_passed))


def _begin_control(motion: Motion, washout: WashoutParameters, start: MotionState) -> None:
    """Let the filter run for `start_after`, and the controller act from then on."""
    gains = (washout.linear_gain, washout.cubic_gain)
    motion.set_gains(
        washout.corner_frequency, *(gains if washout.start_after == 0.0 else (0.0, 0.0))
    )
    motion.low_passed = start.velocity if start.low_passed is None else start.low_passed
    if washout.start_after > 0.0:
        motion.advance(washout.start_after)
        motion.set_gains(washout.corner_frequency, *gains)


def _is_settled(measures: Measures) -> bool:
    """Return whether a motion is steady; one that rests behind a transient is."""
    if measures.steady is None:
        return measures.regime in _RESTS
    return measures.steady


def _alike(before: Measures, after: Measures) -> bool:
    """Return whether regime and amplitude are the same."""
    one, other = before.amplitude, after.amplitude
    if before.regime is not after.regime or one is None or other is None:
        return before.regime is after.regime
    return after.regime not in CYCLES or abs(other - one) <= 1e-4 * other


class _Section:
    """Measures a motion, keeps its Poincare section, and counts the cycles that are measured."""

    def __init__(self, cycles: int) -> None:
        self.meter = CycleMeter(cycles)
        self._missing = max(cycles, LEAST_CYCLES)
        self._sections = [np.empty(0)]

    def take_motion(self, motion: MeasuredMotion) -> None:
        """Keep where the slide turned, as an observer."""
        breakpoints = motion.breakpoints
        self._sections.append(breakpoints.position[breakpoints.velocity == 0.0])
        self._missing -= len(motion.cycles)

    @property
    def done(self) -> bool:
        """Whether there are cycles enough, or no more will come."""
        return self._missing <= 0 or self.meter.measures().regime in _RESTS

    def settled(self, end: MotionState) -> Settled:
        """Return what was found, the motion having come to `end`."""
        measures = self.meter.measures()
        section = np.concatenate(self._sections)
        if measures.regime is Regime.UNBOUNDED:
            section = np.empty(0)
        elif measures.regime is Regime.EQUILIBRIUM:
            section = np.array([measures.midpoint])
        return Settled(measures, section, end)
