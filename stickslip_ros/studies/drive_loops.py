"""The sampled loops of a drive at its feeds under a control law, and what they say of its gains."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import copysign, inf, log10, sqrt
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.control import ControlLaw, LinearFeedback, Washout
from stickslip_ros.model.drive import Drive, number_text
from stickslip_ros.model.drive_layout import POSITION, SPEED
from stickslip_ros.quantities import Quantity, quantities_of
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.controller_trial import Bench, Vibration
from stickslip_ros.studies.goal import Goal, Limit
from stickslip_ros.theory.hopf import hopf_distance, hopf_ratio
from stickslip_ros.theory.linear import jacobians
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop, why_no_linear_loop
from stickslip_ros.theory.loop_response import LoopResponse, PlantResponse
from stickslip_ros.theory.requirements import AUTONOMOUS, STATIC, require


@dataclass(frozen=True)
class Tuned:
    """The gains that were found for a law, and what the linear loops say of them."""

    law: ControlLaw
    """The law with its gains: the nearest ones if a limit is missed."""
    goal: Goal
    """The goal."""
    decay_rate: Annotated[float, Quantity("smallest decay rate", "1/s")]
    """Smallest decay rate at the feeds, 1/s."""
    delay_margin: Annotated[float | None, Quantity("delay margin", "s")] = None
    """Smallest delay margin, s; None if no delay turns the loop unstable."""
    phase_margin: Annotated[float | None, Quantity("phase margin", "rad")] = None
    """Smallest phase margin, rad; None without any."""
    gain_down: Annotated[float | None, Quantity("lower gain margin")] = None
    """Largest factor below one of the force at which a loop is unstable; None without any."""
    gain_up: Annotated[float | None, Quantity("upper gain margin")] = None
    """Smallest factor above one of the force at which a loop is unstable; None without any."""
    sensitivity_peak: Annotated[float | None, Quantity("peak of the sensitivity")] = None
    """Largest magnitude of the sensitivity."""
    peak_force: Annotated[float | None, Quantity("peak force, predicted", "N")] = None
    """Largest force, N, by disturbance, mean friction and noise, and of the washout law by the
    vibration that it catches."""
    mean_force: Annotated[float | None, Quantity("mean friction that the law carries", "N")] = None
    """Largest part of it that is constant, N."""
    noise_force: Annotated[float | None, Quantity("rms force by noise", "N")] = None
    """Largest rms force by noise and rounding of the encoder, N."""
    missed: tuple[Limit, ...] = ()
    """Limits that the gains miss."""
    remark: str | None = None
    """Which limits are missed, and by how much, or a caution; or None."""
    responses: tuple[LoopResponse, ...] = field(default=(), repr=False)
    """The linear loops at the feeds; empty of unstable ones."""

    @property
    def poles(self) -> dict[float, npt.NDArray[np.complex128]]:
        """Poles of the linear loop per sample, by belt speed, m/s."""
        poles: dict[float, npt.NDArray[np.complex128]] = {}
        for response in self.responses:
            values = np.linalg.eigvals(response.transitions)
            poles[response.plant.loop.drive.belt_speed] = values.astype(np.complex128)
        return poles


LINEAR = quantities_of(Tuned)
"""What the linear loops say, by name."""


def with_law(scenario: Scenario, law: str, constants: Mapping[str, float]) -> Scenario:
    """Return a scenario with a law that acts from the first sample on, and these constants.

    The reference is that of the scenario's own controller.
    """
    chosen, reference = scenario.with_controller(law), scenario.controller.reference
    node = chosen.controller.node
    values: dict[str, Any] = {f"{node}.{name}": value for name, value in constants.items()}
    values[f"{node}.start_after"] = 0.0
    chosen = replace(chosen.changed(values), plant=replace(chosen.plant, expects_control=True))
    if not chosen.controller.control_law.follows_reference:
        return chosen
    return replace(chosen, controller=replace(chosen.controller, reference=reference))


class DriveLoops:
    """The sampled loops of a drive at the feeds of a goal, its vibrations there, and its limits."""

    def __init__(self, scenario: Scenario, law: str, goal: Goal) -> None:
        """Take drive, rate, delay and sensor from a scenario.

        Constants of the law that are no gains are those of the scenario or follow from the drive.
        Raises InvalidInputError if the law has no gains to tune, or the theory of the sampled loop
        does not cover the drive.
        """
        known = with_law(scenario, law, {}).controller.control_law
        if not known.tuned:
            raise InvalidInputError(
                f"control law {law} has no gains to tune: its constants must be given, as by "
                f"`stickslip compare --given {law}`"
            )
        plant = scenario.plant
        drive, sensors = plant.as_drive(), (plant.sensor, plant.motor.sensor)
        require("the theory of the sampled loop", drive, AUTONOMOUS)
        self.goal, self.drive = goal, drive
        self.law = replace(known.for_drive(drive), force_limit=goal.force_limit)
        if isinstance(known, Washout):
            self.law = replace(self.law, cubic_gain=0.0)
        rate, (_, delay, *_) = plant.control_rate, plant.mean_sampling
        self.plants: list[PlantResponse] = []
        """The drive at each feed."""
        for feed in goal.feeds:
            at_feed = replace(drive, belt_speed=feed)
            reason = why_no_linear_loop(at_feed, *plant.mean_sampling)
            if reason is not None:
                raise InvalidInputError(f"gains of {law} by theory: {reason}")
            seen = sensors[: 1 if drive.motor is None else 2]
            spans = (sensor.spans // plant.answer_every for sensor in seen)
            loop = LinearSampledLoop(at_feed, rate, delay, _jacobian(at_feed), *spans)
            self.plants.append(PlantResponse.of_loop(loop))
        answered = plant.sensor.every(plant.answer_every)
        assert answered is not None  # or there was a reason
        self.bench = Bench(rate, plant.force_delay, answered)
        slopes = [float(plant.loop.jacobian[SPEED, SPEED]) for plant in self.plants]
        ends = sorted({int(np.argmin(slopes)), int(np.argmax(slopes))})
        self.deciding = self.plants
        """Those that decide: without a memory they differ in the slope only."""
        if not drive.friction.states:
            self.deciding = [self.plants[place] for place in ends]
        self._coarse = [plant.loop.coarsened() for plant in self.deciding]
        self.noises = [sqrt(s.position_resolution**2 / 12.0 + s.position_noise**2) for s in sensors]

    @cached_property
    def vibrations(self) -> list[Vibration]:
        """Vibrations without control, which the washout law has to catch; of others none."""
        drive = self.drive
        if not isinstance(self.law, Washout) or not drive.has_spring or drive.motor is not None:
            return []
        return [self.bench.vibration(replace(drive, belt_speed=feed)) for feed in self.goal.feeds]

    @property
    def diverges(self) -> str | None:
        """Why there is no limit cycle to suppress, or None."""
        for vibration in self.vibrations:
            if vibration.regime is Regime.UNBOUNDED:
                speed = number_text(self.drive, vibration.drive.belt_speed, "m/s")
                return (
                    f"without control the motion diverges at a belt speed of {speed}, so there is "
                    "no limit cycle to suppress"
                )
        return None

    def slowest(self, law: ControlLaw) -> LinearSampledLoop:
        """Return the loop in which a small deviation decays most slowly."""
        loops = (plant.loop for plant in self.plants)
        return min(loops, key=lambda loop: loop.decay_rate(linear_part(law, loop)))

    def decay_rates(self, laws: Sequence[ControlLaw]) -> FloatArray:
        """Return the smallest decay rate with each law, 1/s; approximate for a long delay."""
        forms = (linear_part(law, self._coarse[0]) for law in laws)
        stacked = LinearFeedback(*map(np.array, zip(*forms, strict=True)))
        return np.min([loop.decay_rates_of(stacked) for loop in self._coarse], axis=0)

    def judged(
        self, law: Any, plants: Sequence[PlantResponse], vibrations: Sequence[Vibration]
    ) -> Tuned:
        """Return what the loops of these plants say of a stable law that catches vibrations."""
        feedback = linear_part(law, plants[0].loop)
        responses = LoopResponse.of_plants(plants, feedback)
        noise = max(loop.noise_force(*self.noises) for loop in responses)
        peak = most = 0.0
        for loop in responses:
            step = loop.step_response()
            kicked = max(
                self.goal.step * float(np.abs(step).max()),
                self.goal.impulse * float(np.abs(np.diff(step, prepend=0.0)).max()),
            )
            mean = self.carried(loop)
            peak, most = max(peak, kicked + mean), max(most, mean)
        peak += 4.0 * noise
        peak = max([peak, *(vibration.peak_force(law) for vibration in vibrations)])
        below, above = zip(*(loop.gain_margins for loop in responses), strict=True)
        return Tuned(
            law,
            self.goal,
            min(loop.decay_rate for loop in responses),
            _least(loop.delay_margin for loop in responses),
            _least(loop.phase_margin for loop in responses),
            max((factor for factor in below if factor is not None), default=None),
            _least(above),
            max(loop.sensitivity_peak for loop in responses),
            peak,
            most,
            noise,
            responses=responses,
        )

    def carried(self, response: LoopResponse) -> float:
        """Return the constant force, N, that a law carries in steady feed, as friction is.

        The spring carries the rest; without one, or in front of a motor, it carries nothing.
        """
        drive = response.plant.loop.drive
        speed, motor = drive.belt_speed, drive.motor
        friction = float(drive.friction.at_rest(speed)) * drive.normal_force
        friction += drive.bias_force + drive.guide_damping * speed
        if motor is not None:
            return abs(friction + copysign(motor.friction, speed) + motor.damping * speed)
        if not drive.has_spring:
            return abs(friction)
        matrix, pushed = response.transitions, response.plant.loop.disturbed
        forced = np.pad(pushed, (0, len(matrix) - len(pushed)))
        rest = np.linalg.solve(np.eye(len(matrix)) - matrix, forced)
        share = abs(1.0 - float(rest[POSITION]))  # dimensionless: the force of the spring
        return abs(friction) * (share if share > 1e-9 else 0.0)

    def limits(self, law: ControlLaw, plants: Sequence[PlantResponse] | None = None) -> list[Limit]:
        """Return the limits of the goal with what a stable law has, by default at all feeds."""
        goal, tuned = self.goal, self.judged(law, plants or self.plants, self.vibrations)
        assert tuned.peak_force is not None
        assert tuned.noise_force is not None
        margin = min(1.0 / (tuned.gain_down or 1e-9), tuned.gain_up or inf)
        return [
            Limit(
                "the delay margin", tuned.delay_margin or inf, goal.delay_margin, "s", least=True
            ),
            Limit("the gain margin", margin, goal.gain_margin, "dB", least=True),
            Limit("the peak force", tuned.peak_force, goal.force_limit, "N"),
            Limit("the rms force by noise", tuned.noise_force, goal.noise_force, "N"),
            Limit("the decay rate", tuned.decay_rate, goal.decay_rate, "1/s", least=True),
        ]

    def missed(self, law: ControlLaw) -> tuple[Limit, ...]:
        """Return the limits that a law that makes the loops of this drive stable does not keep."""
        return tuple(limit for limit in self.limits(law) if limit.excess > 1e-9)

    @property
    def cubic_coefficient(self) -> float:
        """The coefficient of the falling cubic friction at high speed, N s^3/m^3, or zero."""
        drive, high = self.drive, 1e6
        coefficient = -float(drive.dimensionless.friction.coefficient(high, 1.0)) / high**3
        return coefficient * drive.force_scale / drive.speed_scale**3 if coefficient > 1e-6 else 0.0

    def calm(self) -> str:
        """Return that nothing vibrates, with the distance to where it does."""
        distances = {
            abs(log10(ratio)): hopf_distance(vibration.drive)
            for vibration in self.vibrations
            if (ratio := hopf_ratio(vibration.drive)) is not None
        }
        said = "nothing vibrates without control at these belt speeds"
        if not distances:
            return said
        nearest = min(distances)
        little = ", with a very small margin" if nearest < log10(1.05) else ""
        return f"{said}; {distances[nearest]}{little}"


def linear_part(law: ControlLaw, loop: LinearSampledLoop) -> LinearFeedback:
    """Return the linear part of a law at the rate of a loop.

    Raises InvalidInputError if the law has none.
    """
    part = law.linear_part(1.0 / loop.rate)
    if part is None:
        raise InvalidInputError(f"control law {law.name}: it has no linear part to tune")
    return part


def _jacobian(drive: Drive) -> FloatArray:
    """Return the dimensionless Jacobian in steady slip; without a spring at any of the rests."""
    if drive.has_spring:
        return jacobians(drive, None, np.array([drive.belt_speed / drive.speed_scale]))[0]
    require("gains without a spring", drive, STATIC)
    scaled = drive.dimensionless
    speeds = -scaled.belt_speed * np.array([1.0 - 1e-5, 1.0 + 1e-5])
    friction = scaled.friction.coefficient(speeds, np.sign(speeds))
    slope = float(np.diff(friction)[0] / np.diff(speeds)[0])
    return np.array([[0.0, 1.0], [0.0, slope - scaled.damping_coefficient]])


def _least(values: Any) -> float | None:
    return min((value for value in values if value is not None), default=None)
