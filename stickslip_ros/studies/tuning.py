"""Gains of a control law by one rule, from the sampled loops at all feeds.

The smallest decay rate at these feeds is made as large as it gets while the delay margin is at
least that of the goal, and force and noise stay within its limits.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, log, sqrt
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import constants_of
from stickslip_ros.model.control import ControlLaw
from stickslip_ros.model.drive import Drive
from stickslip_ros.quantities import Quantity, quantities_of
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.gain_search import Loops, fastest, linear_part, rounded
from stickslip_ros.theory.linear import jacobians
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop, why_no_linear_loop
from stickslip_ros.theory.linear_system import sampled_system
from stickslip_ros.theory.loop_response import LoopResponse, PlantResponse
from stickslip_ros.theory.requirements import AUTONOMOUS, STATIC, require

_STARTS = 300
"""Random gains from which the search starts."""
_RANGE = 2.5
"""Gains are searched within this many decades on either side of the scales of the drive."""
_NOISE_SHARE = 0.05
"""Largest rms force by noise, as a share of the limit, or of the static friction if it is less."""


@dataclass(frozen=True)
class Goal:
    """What gains are to achieve; SI units."""

    feeds: tuple[float, ...]
    """Belt speeds, m/s."""
    force_limit: float
    """Largest force, N: of the law, or of a weaker actuator."""
    disturbance: float
    """Step of a disturbance force, N, under which the force stays within the limit."""
    delay_margin: float
    """Least delay margin, s."""

    @classmethod
    def from_scenario(
        cls, scenario: Scenario, feeds: Sequence[float], disturbance: float, force_limit: float
    ) -> "Goal":
        """Return the goal at some feeds (m/s): a delay margin of two sample periods."""
        limit = min(force_limit, scenario.plant.actuator.limit)
        return cls(tuple(feeds), limit, disturbance, 2.0 / scenario.plant.rate)


@dataclass(frozen=True)
class Tuned:
    """The gains that were found for a law, and what the linear loops say of them."""

    law: ControlLaw
    """The law with its gains."""
    goal: Goal
    """The goal."""
    decay_rate: Annotated[float, Quantity("smallest decay rate", "1/s")]
    """Smallest decay rate at the feeds, 1/s."""
    delay_margin: Annotated[float | None, Quantity("delay margin", "s")]
    """Smallest delay margin, s; None if no delay turns the loop unstable."""
    phase_margin: Annotated[float | None, Quantity("phase margin", "rad")]
    """Smallest phase margin, rad; None without any."""
    gain_down: Annotated[float | None, Quantity("lower gain margin")]
    """Largest factor below one of the force at which a loop is unstable; None without any."""
    gain_up: Annotated[float | None, Quantity("upper gain margin")]
    """Smallest factor above one of the force at which a loop is unstable; None without any."""
    sensitivity_peak: Annotated[float, Quantity("peak of the sensitivity")]
    """Largest magnitude of the sensitivity."""
    peak_force: Annotated[float, Quantity("peak force by step, mean friction and noise", "N")]
    """Largest force by disturbance, mean friction and noise, N."""
    noise_force: Annotated[float, Quantity("rms force by noise", "N")]
    """Largest rms force by noise and rounding of the encoder, N."""
    remark: str | None
    """What of the goal is not met, or None."""
    responses: tuple[LoopResponse, ...]
    """The linear loops at the feeds."""

    @property
    def poles(self) -> dict[float, npt.NDArray[np.complex128]]:
        """Poles of the linear loop per sample, by belt speed, m/s."""
        poles: dict[float, npt.NDArray[np.complex128]] = {}
        for response in self.responses:
            loop = response.plant.loop
            matrix = loop.transition_matrix(response.feedback)
            poles[loop.drive.belt_speed] = np.linalg.eigvals(matrix).astype(np.complex128)
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


class _Rule:
    """Loops at the feeds, and the value of gains."""

    def __init__(self, scenario: Scenario, law: ControlLaw, goal: Goal) -> None:
        self.goal, self.law = goal, law
        plant = scenario.plant
        drive, sensors = plant.as_drive(), (plant.sensor, plant.motor.sensor)
        require("the theory of the sampled loop", drive, AUTONOMOUS)
        delay = plant.force_delay + plant.force_jitter / 2.0
        self.plants: list[PlantResponse] = []
        for feed in goal.feeds:
            at_feed = replace(drive, belt_speed=feed)
            reason = why_no_linear_loop(at_feed, plant.rate, delay)
            if reason is not None:
                raise InvalidInputError(f"gains of {law.name} by theory: {reason}")
            spans = (sensor.spans for sensor in sensors[: 1 if drive.motor is None else 2])
            loop = LinearSampledLoop(at_feed, plant.rate, delay, _jacobian(at_feed), *spans)
            self.plants.append(PlantResponse.of(loop))
        self.loops = Loops([member.loop for member in self.plants])
        self.deciding = [self.plants[place] for place in self.loops.ends]
        self.noises = [sqrt(s.position_resolution**2 / 12.0 + s.position_noise**2) for s in sensors]
        self.friction = max(drive.friction.limits) * drive.normal_force
        constants = constants_of(type(law))
        self.units = [1.0 / drive.scales.factor(constants[name].unit) for name in law.tuned]
        self.signs = [-1.0 if constants[name].default < 0.0 else 1.0 for name in law.tuned]

    def with_gains(self, point: FloatArray) -> ControlLaw:
        """Return the law with gains of these magnitudes, in logarithms of the drive's scales."""
        values = np.exp(point) * self.units * self.signs
        gains: dict[str, Any] = dict(
            zip(self.law.tuned, map(rounded, values.tolist()), strict=True)
        )
        return replace(self.law, **gains)

    def judged(self, law: ControlLaw, plants: Sequence[PlantResponse]) -> Tuned:
        """Return what the loops of these plants say of a stable law."""
        feedback = linear_part(law, plants[0].loop)
        responses = tuple(LoopResponse(plant, feedback) for plant in plants)
        steps = [loop.step_response() for loop in responses]
        noise = max(loop.noise_force(*self.noises) for loop in responses)
        peak = max(
            self.goal.disturbance * float(np.abs(step).max()) + self.friction * share
            for step, share in zip(steps, (self.carried(loop) for loop in responses), strict=True)
        )
        below, above = zip(*(loop.gain_margins for loop in responses), strict=True)
        return Tuned(
            law,
            self.goal,
            min(plant.loop.decay_rate(feedback) for plant in plants),
            _least(loop.delay_margin for loop in responses),
            _least(loop.phase_margin for loop in responses),
            max((factor for factor in below if factor is not None), default=None),
            _least(above),
            max(loop.sensitivity_peak for loop in responses),
            peak + 4.0 * noise,
            noise,
            None,
            responses,
        )

    def carried(self, response: LoopResponse) -> float:
        """Return the share of a constant force on the slide, such as friction, that a law carries.

        The spring carries the rest; without one, or in front of a motor, it carries nothing.
        """
        drive = response.plant.loop.drive
        if drive.motor is not None or not drive.has_spring:
            return 1.0
        system = sampled_system(response.plant.loop, response.feedback)
        rest = system.C @ np.linalg.solve(np.eye(len(system.A)) - system.A, system.B)
        return abs(1.0 - drive.stiffness * float(rest[0, 0]))

    def excess(self, tuned: Tuned) -> dict[str, float]:
        """Return by how much, as logarithms, a law exceeds each limit of the goal."""
        goal = self.goal
        noise = _NOISE_SHARE * min(goal.force_limit, self.friction)
        ratios = {
            "the delay margin": goal.delay_margin / (tuned.delay_margin or inf),
            "the peak force": tuned.peak_force / goal.force_limit,
            "the rms force by noise": tuned.noise_force / noise,
        }
        return {name: log(ratio) for name, ratio in ratios.items() if ratio > 1.0}


def tune(scenario: Scenario, law: str, goal: Goal) -> Tuned:
    """Return the gains of a law for a scenario by the rule, see the module.

    Drive, rate, delay and sensor are the scenario's. Constants of the law that are no gains are
    those of the scenario or follow from the drive. The remark of the result says what of the goal
    it does not meet. Raises InvalidInputError if the law has no gains to tune, or no gains make all
    loops stable.
    """
    known = with_law(scenario, law, {}).controller.control_law
    if not known.tuned:
        raise InvalidInputError(f"control law {law}: it names no gains to tune, so give them")
    start = replace(known.for_drive(scenario.plant.as_drive()), force_limit=goal.force_limit)
    rule = _Rule(scenario, start, goal)
    starts = log(10.0) * np.random.default_rng(1).uniform(
        -_RANGE, _RANGE, (_STARTS, len(start.tuned))
    )

    def excess(law: ControlLaw) -> Iterable[float]:
        return rule.excess(rule.judged(law, rule.deciding)).values()

    best = fastest(rule.loops, starts, rule.with_gains, excess)
    if best is None:
        speeds = ", ".join(f"{feed:g}" for feed in goal.feeds)
        raise InvalidInputError(f"control law {law}: no gains make the loop stable at {speeds} m/s")
    judged = rule.judged(best, rule.plants)
    missed = rule.excess(judged)
    remark = f"no gains were found within the limits of {' and '.join(missed)}"
    return replace(judged, remark=remark if missed else None)


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
