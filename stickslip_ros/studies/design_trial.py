"""Trials of a design: what its controller comes to in theory and in simulation, check by check."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import copysign, inf
from typing import Annotated, Any, Self

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import LARGEST, SMALLEST
from stickslip_ros.model.control import ControlLaw, Washout
from stickslip_ros.model.drive import Drive, number_text
from stickslip_ros.quantities import Quantity
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.case_outcome import Disturbance, simulate_case
from stickslip_ros.studies.controller_trial import FILTER_SETTLED, Rest, Vibration
from stickslip_ros.studies.drive_loops import DriveLoops, linear_part
from stickslip_ros.studies.goal import Goal
from stickslip_ros.studies.options import FEED_TOLERANCE, OWN_SPEED_RANGE
from stickslip_ros.studies.spread import Spread, check_spread
from stickslip_ros.theory.linear_sampled_loop import settling_time
from stickslip_ros.theory.requirements import SPRING, require

_PERIODS, _SHORTEST, _WITHOUT_SPRING, _DECAYS = 100.0, 2.0, 6.0, 18.0
"""Duration of a check: natural periods, at least so many seconds, without a period so many, and
times in which a small deviation decays by a factor e."""
_THROWN_SPEEDS = 3.0, 30.0, 300.0
"""Speeds with which the slide must return to equilibrium, in the speed scale of the drive."""


@dataclass(frozen=True)
class Task:
    """The task of a design; SI units. Create it with `Task.from_scenario`."""

    scenario: Scenario
    """Drive, loop and control law; the gains of the law are not used."""
    belt_speeds: tuple[float, float]
    """Lowest and highest belt speed, m/s, above zero."""
    force_limit: float
    """Largest allowed force, N: that of the controller, or the limit of a weaker actuator."""
    spread: Spread = 0.0
    """Largest deviation of a constant of the drive, as a share, or `FIT`."""

    @classmethod
    def from_scenario(
        cls,
        scenario: Scenario,
        belt_speeds: tuple[float, float] | None = None,
        spread: Spread = 0.0,
    ) -> Self:
        """Return the task of a scenario.

        Parameters
        ----------
        scenario : Scenario
            Source of drive, loop, control law and force limit.
        belt_speeds : tuple[float, float], optional
            Lowest and highest belt speed, m/s; by default 10 % below and above the scenario's.
        spread : float or str, optional
            Spread of the drive's constants: the gains are to hold all drives that it draws.

        Raises
        ------
        InvalidInputError
            If the speeds are not a range above zero, if they are omitted and the scenario's belt
            is at rest, if the scenario has no controller, or if the spread is not allowed.
        """
        check_spread(spread)
        plant, law = scenario.plant, scenario.control_law
        if law is None:
            raise InvalidInputError(
                "plant.expects_control = False: without control there are no gains"
            )
        if isinstance(law, Washout):
            require(f"a design of the {law.name} law", plant.as_drive(), SPRING)
        if isinstance(law, Washout) and plant.motor.kind == "mass":
            raise InvalidInputError(
                f"plant.motor.kind = mass is refused: a design of the {law.name} law needs an "
                "ideal motor"
            )
        if belt_speeds is None:
            speed = abs(plant.belt_speed)
            if speed == 0.0:
                raise InvalidInputError(
                    "plant.belt_speed = 0: gains are for a moving belt, so speeds must be given"
                )
            belt_speeds = (speed * (1.0 - OWN_SPEED_RANGE), speed * (1.0 + OWN_SPEED_RANGE))
        low, high = belt_speeds
        if not SMALLEST <= low <= high <= LARGEST:
            ordered = SMALLEST <= high < low <= LARGEST
            must = "the lower must be first" if ordered else f"must be above 0, at most {LARGEST:g}"
            raise InvalidInputError(f"belt speeds {low:g} m/s to {high:g} m/s: {must}")
        return cls(scenario, (low, high), min(law.force_limit, plant.actuator.limit), spread)

    @cached_property
    def drive(self) -> Drive:
        """The drive at the scenario's belt speed."""
        return self.scenario.plant.as_drive()

    def with_law(self, law: ControlLaw) -> Scenario:
        """Return the scenario with other constants of its law.

        Parameters
        ----------
        law : ControlLaw
            The law with the constants.

        Returns
        -------
        Scenario
            The changed copy. Its belt speed is that of the scenario, or the nearest one within the
            range.
        """
        (low, high), belt_speed = self.belt_speeds, self.scenario.plant.belt_speed
        values = {name: getattr(law, name) for name in law.constants()}
        proposed: dict[str, Any] = {
            f"{self.scenario.controller.node}.{name}": value
            for name, value in values.items()
            if isinstance(value, float) or value != getattr(self.scenario.control_law, name)
        }
        proposed["plant.belt_speed"] = copysign(min(max(abs(belt_speed), low), high), belt_speed)
        return self.scenario.overridden([], proposed)


@dataclass(frozen=True, kw_only=True)
class Check:
    """Predicted and simulated behaviour at one belt speed under one disturbance; SI units."""

    belt_speed: Annotated[float, Quantity("belt speed", "m/s")]
    """Belt speed, m/s."""
    disturbance: Annotated[str, Quantity("disturbance")]
    """A disturbance, or `vibration`: that without control, when the control is switched on."""
    vibrates: bool | None = None
    """Whether the drive vibrates without control; None where that is not asked."""
    decay_rate: float
    """Decay rate of a small deviation, 1/s."""
    predicted_settling_time: Annotated[float, Quantity("1 % settling time, predicted", "s")]
    """Predicted 1 % settling time of a small deviation, s."""
    predicted_peak_force: Annotated[float, Quantity("peak force, predicted", "N")]
    """Predicted peak force, N: from the disturbance on, or switched on at the worst phase."""
    held: Annotated[bool | None, Quantity("held")] = None
    """Whether the simulated drive is held; None where nothing was simulated."""
    settling_time: Annotated[float | None, Quantity("simulated: settling time", "s")] = None
    """Simulated settling time, s: of the vibration at the worst phase, or after a disturbance."""
    disturbed_force: Annotated[float | None, Quantity("peak force", "N")] = None
    """Simulated peak force from the disturbance on, N; the vibration is all of it."""
    peak_force: Annotated[float | None, Quantity("with the start", "N")] = None
    """Simulated peak force from the first sample on, N."""
    rms_velocity: Annotated[float | None, Quantity("rms velocity", "m/s")] = None
    """Simulated rms velocity after the disturbance, m/s."""
    mean_force: Annotated[float | None, Quantity("mean force", "N")] = None
    """Simulated mean force there, N."""
    rms_force: Annotated[float | None, Quantity("rms force beyond the mean", "N")] = None
    """Simulated rms force beyond it, N."""
    reason: str | None = None
    """How the simulated control fails; None if it does not."""
    rest: Rest | None = None
    """Motion and force that noise and rounding leave at rest, simulated; of a vibration only."""


class Trial:
    """Checks of control laws under disturbances, and with the vibration to catch."""

    def __init__(self, task: Task, disturbances: Sequence[Disturbance]) -> None:
        self.task, self.disturbances, scenario = task, disturbances, task.scenario
        goal = Goal.from_scenario(scenario, task.belt_speeds, disturbances, task.force_limit)
        self.loops = DriveLoops(scenario, scenario.controller.law, goal)
        """The linear loops at the belt speeds that are checked."""
        sensor, actuator = scenario.plant.sensor, task.drive.actuator
        self.rough = bool(
            sensor.position_resolution
            or actuator.resolution
            or sensor.position_noise
            or sensor.velocity_noise
        )
        """Whether noise or rounding keep the loop from resting."""

    def checks(self, law: Any) -> Iterator[tuple[Check, float]]:
        """Yield the checks of a law, and the share of them that is done."""
        loops, scenario = self.loops, self.task.with_law(law)
        vibrations = loops.vibrations or [None] * len(loops.plants)
        for row, (plant, vibration) in enumerate(zip(loops.plants, vibrations, strict=True)):
            drive = plant.loop.drive
            linear = loops.judged(law, [plant], [])
            predicted = settling_time(linear.decay_rate) or inf
            basic = Check(
                belt_speed=drive.belt_speed,
                disturbance="vibration",
                decay_rate=linear.decay_rate,
                predicted_settling_time=predicted,
                predicted_peak_force=linear.peak_force or 0.0,
            )
            done = (row + 1) / len(loops.plants)
            if vibration is not None:
                yield self._caught(basic, vibration, law), done
            for disturbance in self.disturbances:
                yield self._disturbed(basic, disturbance, scenario), done

    def _caught(self, check: Check, vibration: Vibration, law: Any) -> Check:
        """Return the check with the vibration caught, and what is left at rest."""
        drive, predicted = vibration.drive, check.predicted_settling_time
        rest = None
        if self.rough:
            settled = max(predicted, FILTER_SETTLED / law.corner_frequency)
            rest = self.loops.bench.rest(drive, law, settled)
        force = vibration.peak_force(law)
        check = replace(check, vibrates=vibration.vibrates, predicted_peak_force=force, rest=rest)
        if not vibration.vibrates:
            return check
        patience = 5.0 * predicted + 20.0 * drive.natural_period
        caught = self.loops.bench.catch(vibration, law, patience)
        return replace(
            check,
            held=caught.settling_time is not None,
            settling_time=caught.settling_time,
            disturbed_force=caught.peak_force,
            peak_force=caught.peak_force,
            reason=self._failure(drive.belt_speed, caught.settling_time, caught.peak_force),
        )

    def _failure(self, belt_speed: float, settles: float | None, peak: float) -> str | None:
        """Return how a caught vibration fails; None if it does not."""
        speed = f"at a belt speed of {number_text(self.task.drive, belt_speed, 'm/s')}"
        if settles is None and self.rough:
            rough = "with the noise and rounding of sensor and actuator"
            return f"{speed} the vibration does not decay to 1 % {rough}"
        if settles is None:
            return f"{speed} the vibration does not decay, although a small one would"
        if peak > self.task.force_limit:
            both = (number_text(self.task.drive, n, "N") for n in (peak, self.task.force_limit))
            return "{} the force reaches {}, above the limit of {}".format(speed, *both)
        return None

    def _disturbed(self, check: Check, disturbance: Disturbance, scenario: Scenario) -> Check:
        """Return the check with a simulated disturbance."""
        drive, duration = self.task.drive, max(_WITHOUT_SPRING, _DECAYS / check.decay_rate)
        if drive.has_spring:
            shortest = max(_PERIODS * drive.natural_period, _SHORTEST)
            duration = max(shortest, _DECAYS / check.decay_rate)
        values = {"plant.belt_speed": check.belt_speed, **disturbance.parameters(duration)}
        outcome = simulate_case(scenario.changed(values), duration, disturbance, FEED_TOLERANCE)
        reason = None
        if not outcome.held:
            speed = number_text(drive, check.belt_speed, "m/s")
            reason = f"the simulated drive is not held at {speed}, {disturbance}"
            if outcome.reason or outcome.sticking:
                stuck = f"it sticks for {outcome.sticking or 0.0:.2%} of the time"
                reason = f"{reason}: {outcome.reason or stuck}"
            elif outcome.rms_velocity is not None:
                both = outcome.rms_velocity, FEED_TOLERANCE * abs(check.belt_speed)
                rms, allowed = (number_text(drive, value, "m/s") for value in both)
                reason = f"{reason}: its rms velocity is {rms}, and must be at most {allowed}"
        measures = ("held", "settling_time", "disturbed_force", "peak_force")
        names = (*measures, "rms_velocity", "mean_force", "rms_force")
        values = {name: getattr(outcome, name) for name in names}
        return replace(check, disturbance=str(disturbance), reason=reason, **values)

    def throw_from_high_speeds(self, law: Any) -> tuple[str | None, str | None]:
        """Return a remark on motions with a fast start, and how the law fails, if it does."""
        remark: str | None = None
        loops = [plant.loop for plant in self.loops.plants]
        unlimited, slowest = replace(law, force_limit=inf), self.loops.slowest(law)
        for loop in loops:
            drive = loop.drive
            for speed in (thrown * drive.speed_scale for thrown in _THROWN_SPEEDS):
                if loop not in (loops[0], loops[-1], slowest):
                    continue
                if self.loops.bench.returns(drive, law, speed):
                    continue
                slide = (
                    f"started at {number_text(drive, speed, 'm/s')} on a belt at "
                    f"{number_text(drive, drive.belt_speed, 'm/s')}, the slide"
                )
                if law.cubic_gain != 0.0 or not self.loops.bench.returns(drive, unlimited, speed):
                    return None, f"{slide} does not return to equilibrium"
                remark = remark or f"{slide} needs more force than the limit"
        return remark, None

    def worst(self, law: ControlLaw) -> Check:
        """Return the check of a law where a deviation decays most slowly: the first that fails."""
        slowest = self.loops.slowest(law)
        speed, rate = slowest.drive.belt_speed, slowest.decay_rate(linear_part(law, slowest))
        if rate <= 0.0:
            where = number_text(self.task.drive, speed, "m/s")
            grows = number_text(self.task.drive, -rate, "1/s")
            reason = f"at {where} a small deviation grows with {grows}"
            return Check(
                belt_speed=speed,
                disturbance="none",
                decay_rate=rate,
                predicted_settling_time=inf,
                predicted_peak_force=inf,
                held=False,
                reason=reason,
            )
        there = Trial(replace(self.task, belt_speeds=(abs(speed),) * 2), self.disturbances)
        checks = [check for check, _ in there.checks(law)]
        failing = [check for check in checks if check.reason is not None]
        return [*failing, max(checks, key=lambda check: check.disturbed_force or 0.0)][0]
