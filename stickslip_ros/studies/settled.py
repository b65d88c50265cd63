"""What a drive settles on from one start: the points that sweeps and basins are made of."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.drive import Drive
from stickslip_ros.physics.knots import FloatArray, Knots
from stickslip_ros.physics.measures import Cycle, CycleMeter, Measures, Regime
from stickslip_ros.physics.motion import Motion
from stickslip_ros.physics.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.physics.simulation import simulate_sampled
from stickslip_ros.physics.theory.returns import loading_time
from stickslip_ros.physics.washout import Washout, WashoutParameters
from stickslip_ros.scenario.files import Scenario
from stickslip_ros.scenario.parameters import PlantParameters

STEADY = 1e-3
"""Share by which the amplitudes of the cycles measured may differ in a motion that has settled."""

_LONGEST_LOADING = 50.0
"""Natural periods beyond which a slow belt's loading of the spring is not waited for."""


@dataclass(frozen=True)
class State:
    """Where a motion stands; SI units."""

    position: float
    velocity: float
    low_passed: float | None = None
    """What the washout filter holds back of the speed, m/s; None: all of it, the filter rests."""


@dataclass(frozen=True)
class Course:
    """How long a motion is followed.

    In cycles: natural periods, each with the time besides in which the belt loads the spring, 50
    natural periods at most.
    """

    transient: float = 200.0
    """Cycles that are passed over."""
    measured: float = 6.0
    """Cycles that are looked at then."""

    def seconds(self, drive: Drive) -> tuple[float, float]:
        """Return how long the transient and the measurement are for a drive, s."""
        cycle = natural = drive.natural_period
        if drive.belt_speed != 0.0:
            cycle += min(loading_time(drive), _LONGEST_LOADING * natural)
        return self.transient * cycle, self.measured * cycle


@dataclass(frozen=True)
class Case:
    """A drive, and how it is controlled and sampled, if it is."""

    drive: Drive
    washout: WashoutParameters | None = None
    """The controller; None: there is none."""
    sampled: PlantParameters | None = None
    """How the loop is sampled; None: not at all, control being continuous (eq. 19)."""

    @classmethod
    def of(cls, scenario: Scenario, *, continuous: bool = False) -> "Case":
        """Return the case of a scenario, its control `continuous` if asked for.

        Without controller and disturbance there is nothing to sample: the motion is the same.
        Raises InvalidInputError for what continuous control does not have.
        """
        plant = scenario.plant
        washout = scenario.washout_controller.as_washout() if plant.expects_control else None
        if continuous:
            check_continuous(scenario)
        disturbed = plant.disturbance.kind != "none"
        sampled = not continuous and (washout is not None or disturbed)
        return cls(plant.as_drive(), washout, plant if sampled else None)


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
                f"--continuous-control knows no {name}: it is {value}, and must be {needed}"
            )


def sampled_loop(plant: PlantParameters, motion: Motion) -> SampledLoop:
    """Return the loop over `motion` as the plant node has it in lockstep."""
    return SampledLoop(
        motion,
        plant.rate,
        LOCKSTEP_START,
        force_delay=plant.force_delay,
        force_jitter=plant.force_jitter,
        force_jitter_seed=plant.force_jitter_seed,
        expects_control=plant.expects_control,
        disturbance=plant.as_disturbance(),
    )


class Settled(NamedTuple):
    """What is left of a motion after its transient."""

    measures: Measures
    turning_points: FloatArray
    """Displacements at which the velocity is zero, m: the Poincare section x' = 0. In equilibrium
    the one place of rest; none where the motion runs away."""
    steady: bool
    """Whether the amplitude no longer changed, by more than a thousandth."""
    end: State
    """Where the motion ended."""


class Settler:
    """Follows one motion after another; what they are like does not depend on those before.

    Compiling an integrator costs more than most motions: it is done once for each friction law.
    """

    def __init__(self) -> None:
        self._motions: dict[bool, Motion] = {}

    def settle(self, case: Case, start: State, transient: float, measured: float) -> Settled:
        """Follow the motion from `start` for `transient` (s) and measure it for `measured` (s).

        The transient begins when the controller does, which may be later (`start_after`). Raises
        RunError for a motion too stiff to be followed.
        """
        continuous = case.washout is not None and case.sampled is None
        motion = self._motion(case.drive, continuous)
        motion.recording = False
        motion.begin(case.drive, start.position, start.velocity)
        washout = case.washout
        meter = _SectionMeter()
        if case.sampled is not None:
            loop = sampled_loop(case.sampled, motion)
            law = Washout(washout, start.low_passed) if washout else None
            if washout is not None:
                transient += washout.start_after
            simulate_sampled(loop, motion, law, transient, meter)
            motion.recording = True
            simulate_sampled(loop, motion, law, measured, meter)
            low_passed = law.low_passed if law else None
        else:
            if washout is not None:
                _begin_control(motion, washout, start)
            motion.advance(transient)
            motion.recording = True
            motion.advance(measured)
            meter.feed(motion.take_knots(), case.drive.belt_speed)
            low_passed = motion.low_passed if continuous else None
        if motion.unbounded:
            meter.report_run_away()
        return meter.settled(State(motion.position, motion.velocity, low_passed))

    def _motion(self, drive: Drive, continuous: bool) -> Motion:
        if continuous not in self._motions:
            self._motions[continuous] = Motion(
                drive, 0.0, 0.0, continuous_control=continuous, record=True
            )
        return self._motions[continuous]


def _begin_control(motion: Motion, washout: WashoutParameters, start: State) -> None:
    """Let the filter run for `start_after`, and the controller act from then on."""
    motion.set_gains(washout.corner_frequency, 0.0, 0.0)
    motion.low_passed = start.velocity if start.low_passed is None else start.low_passed
    motion.advance(washout.start_after)
    motion.set_gains(washout.corner_frequency, washout.linear_gain, washout.cubic_gain)


class _SectionMeter(CycleMeter):
    """Keeps the Poincare section, and the first of the cycles that are measured."""

    def __init__(self) -> None:
        super().__init__(window=1_000_000)
        self._sections = [np.empty(0)]
        self._amplitudes: list[float] = []

    def feed(self, knots: Knots, belt_speed: float) -> list[Cycle]:
        """Take the knots that follow, as any meter does."""
        self._sections.append(knots.position[knots.velocity == 0.0])
        cycles = super().feed(knots, belt_speed)
        self._amplitudes += [cycle.amplitude for cycle in cycles]
        return cycles

    def settled(self, end: State) -> Settled:
        """Return what was found, the motion having come to `end`."""
        measures = self.measures()
        section, steady = np.concatenate(self._sections), True
        if measures.regime is Regime.UNBOUNDED:
            section = np.empty(0)
        elif measures.regime is Regime.EQUILIBRIUM:
            section = np.array([measures.midpoint])
        elif measures.regime is not Regime.STUCK:
            amplitudes = np.array(self._amplitudes)
            steady = len(amplitudes) > 1 and bool(np.ptp(amplitudes) <= STEADY * amplitudes.max())
        return Settled(measures, section, steady, end)
