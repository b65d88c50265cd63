"""Gains of a control law by one rule, from the sampled loops at all feeds.

The smallest decay rate at these feeds is made as large as it gets within the limits of a goal:
of force, noise, margins and decay. The washout law must also catch the vibration without control.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import product
from math import copysign, inf, log, log10, sqrt
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.constants import constants_of
from stickslip_ros.model.control import ControlLaw, Washout
from stickslip_ros.model.control.base import MOTOR, TABLE
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import POSITION
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.controller_trial import Bench, Vibration
from stickslip_ros.studies.gain_search import Loops, fastest, linear_part, rounded
from stickslip_ros.studies.stability import hopf_distance, hopf_ratio, number_text
from stickslip_ros.studies.tuned_gains import Goal, Limit, Tuned
from stickslip_ros.theory.linear import jacobians
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop, why_no_linear_loop
from stickslip_ros.theory.loop_response import LoopResponse, PlantResponse
from stickslip_ros.theory.requirements import AUTONOMOUS, STATIC, require

_DECADES = 2.5, 1.0
"""Gains are searched from so many decades below the softest scale to so many above the stiffest."""
_NOISE_SHARE = 0.05
"""Largest rms force by noise, as a share of the limit, or of the static friction if it is less."""
_GAIN_MARGIN = 10.0**0.1
"""Least factor, 2 dB, between the force of a law and an unstable one."""
_SLOWEST = 0.05
"""Least decay rate, per natural period or per `_WITHOUT_PERIOD`."""
_WITHOUT_PERIOD = 0.2
"""Period, s, of a drive without a spring."""
RESERVE = 0.97
"""Share of the limits that gains use at first."""
_FIRST = 10.0
"""Weight of margins and decay, next to force and noise."""
_NEAR = 0.9
"""Share of the largest force from which on it restricts the gains."""
_CUBIC_SHARES = 0.125, 0.25, 0.5
"""Cubic gains to try, as shares of the friction law's own cubic coefficient.

With a share of 1 the loop would diverge from high speeds. A positive cubic gain reduces the force
where the vibration is large, so that the force limit allows more linear gain.
"""


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


class Tuning:
    """The search for the gains of a law: loops and vibrations at the feeds, and limits."""

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
        self.others: dict[str, Tuning] = {}
        """Other drives that the gains have to hold, too, by what they are called."""
        self.plants: list[PlantResponse] = []
        for feed in goal.feeds:
            at_feed = replace(drive, belt_speed=feed)
            reason = why_no_linear_loop(at_feed, *plant.mean_sampling)
            if reason is not None:
                raise InvalidInputError(f"gains of {law} by theory: {reason}")
            seen = sensors[: 1 if drive.motor is None else 2]
            spans = (sensor.spans // plant.answer_every for sensor in seen)
            loop = LinearSampledLoop(at_feed, rate, delay, _jacobian(at_feed), *spans)
            self.plants.append(PlantResponse.of_loop(loop))
        self.bench = Bench.of_plant(plant)
        self.loops = Loops([member.loop for member in self.plants])
        self.noises = [sqrt(s.position_resolution**2 / 12.0 + s.position_noise**2) for s in sensors]
        self.friction = max(drive.friction.limits) * drive.normal_force

    @cached_property
    def vibrations(self) -> list[Vibration]:
        """Vibrations without control, which the washout law has to catch; of others none."""
        drive = self.drive
        if not isinstance(self.law, Washout) or not drive.has_spring or drive.motor is not None:
            return []
        return [self.bench.vibration(replace(drive, belt_speed=feed)) for feed in self.goal.feeds]

    @property
    def drives(self) -> "dict[str, Tuning]":
        """Return this drive and the others that the gains have to hold."""
        return {"the drive of the scenario": self, **self.others}

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

    def best(self, share: float = RESERVE, *, cubic: bool = True) -> Tuned:
        """Return the best gains.

        `share` is the part of each limit that they may use; `cubic` allows a cubic gain. If no
        gains keep all limits, the result has the nearest ones, and `missed` the limits. If the body
        that the scenario feeds back has no gains, another one is fed back.
        """
        first, *others = self.bodies
        value, law = self._searched(first, share)
        for other in others if value[0] < 0.0 else ():
            value, law = max((value, law), self._searched(other, share), key=lambda trial: trial[0])
        coefficient = self._own_cubic_coefficient if cubic and self.vibrations else 0.0
        chosen: Any = law
        seen = [vibration for tuning in self.drives.values() for vibration in tuning.vibrations]
        forces = [vibration.peak_force(chosen) for vibration in seen if coefficient]
        if max(forces, default=0.0) > _NEAR * share * self.goal.force_limit:
            for part in _CUBIC_SHARES:
                softer = replace(first, cubic_gain=rounded(part * coefficient))
                other = self._searched(softer, share)
                # Less is not worth a larger cubic gain.
                if other[0] > (value[0], 1.05 * value[1]):
                    value, law = other
        if value[1] <= 0.0:
            rates = {n: tuning.loops.decay_rates([law])[0] for n, tuning in self.drives.items()}
            worst = min(rates, key=lambda name: rates[name])
            slow = self.drives[worst].loops.slowest(law)
            speed, rate = (
                number_text(self.drive, number, unit)
                for number, unit in ((slow.drive.belt_speed, "m/s"), (-value[1], "1/s"))
            )
            remark = (
                "no gains make the loop stable at all these belt speeds: with the nearest ones a "
                f"deviation grows at {speed}, with {rate}{self._named(worst)}"
            )
            return Tuned(law, self.goal, value[1], remark=remark)
        tuned = self.judged(law, self.plants, self.vibrations)
        beyond = {name: tuning.missed(law) for name, tuning in self.drives.items()}
        worst = max(beyond, key=lambda name: sum(limit.excess for limit in beyond[name]))
        missed = beyond[worst]
        remarks: list[str] = []
        if self.vibrations and not any(vibration.vibrates for vibration in self.vibrations):
            remarks.append(self._calm())
        if missed:
            reasons = " and ".join(limit.sentence(self.drive) for limit in missed)
            reasons += self._named(worst)
            remarks.append(f"no gains keep all limits: with the nearest ones {reasons}")
        else:
            for name in self._body_names:
                asked, used = getattr(first, name), getattr(law, name)
                if asked != used:
                    remarks.append(f"{name} is {used}: with {asked} there are no gains")
        return replace(tuned, missed=missed, remark="; ".join(remarks) or None)

    def _named(self, drive: str) -> str:
        """Return an end of a sentence that names a drive, if there are several."""
        return f", of {drive}" if self.others else ""

    @cached_property
    def _body_names(self) -> list[str]:
        """Names of the constants that choose a body."""
        described = constants_of(type(self.law))
        return [name for name in described if described[name].choices == (TABLE, MOTOR)]

    @cached_property
    def bodies(self) -> list[ControlLaw]:
        """The law, and where there is a motor those that feed back other bodies."""
        laws = [self.law]
        if self.drive.motor is not None:
            names = self._body_names
            variants = (
                replace(self.law, **dict(zip(names, chosen, strict=True)))
                for chosen in product((MOTOR, TABLE), repeat=len(names))
            )
            laws += sorted(
                variants,
                key=lambda law: sum(getattr(law, n) != getattr(self.law, n) for n in names),
            )
        forms: dict[bytes, ControlLaw] = {}
        for law in laws:
            form = linear_part(law, self.loops.all[0])
            padded = np.pad(form.direct, (0, 4 - len(form.direct)))
            forms.setdefault((np.append(form.input, padded) + 0.0).tobytes(), law)
        return [*forms.values()]

    def _searched(self, law: ControlLaw, share: float) -> tuple[tuple[float, float], ControlLaw]:
        """Return the best gains of a law, with a value that is larger for better ones."""
        described = [constants_of(type(law))[name] for name in law.tuned]
        mass = self.drive.mass + (self.drive.motor.mass if self.drive.motor else 0.0)
        loop = self.loops.all[0]
        latest = loop.force_delay + (0.5 + loop.difference_samples / 2.0) / loop.rate
        stiff = replace(self.drive, mass=mass, stiffness=mass / latest**2)
        scales = [
            np.log([1.0 / d.scales.factor(constant.unit) for constant in described])
            for d in (self.drive, stiff)
        ]
        below, above = (log(10.0) * decades for decades in _DECADES)
        ends = np.minimum(*scales) - below, np.maximum(*scales) + above
        # The sign of the default first: another one serves long delays only.
        usual = [-1.0 if constant.default < 0.0 else 1.0 for constant in described]
        allowed = [
            (sign, -sign) if constant.at_least < 0.0 and not constant.positive else (sign,)
            for sign, constant in zip(usual, described, strict=True)
        ]

        def best_with(signs: Sequence[float]) -> tuple[tuple[float, float], ControlLaw]:
            def with_gains(point: FloatArray) -> ControlLaw:
                values = map(rounded, (np.exp(point) * signs).tolist())
                return replace(law, **dict(zip(law.tuned, values, strict=True)))

            def excess(law: ControlLaw) -> Iterator[float]:
                for tuning in self.drives.values():
                    deciding = [tuning.plants[place] for place in tuning.loops.ends]
                    for limit in tuning.limits(tuning.judged(law, deciding, tuning.vibrations)):
                        # What is missing is best told as a force: the others come first.
                        weight = _FIRST if limit.least else 1.0
                        yield weight * max(limit.excess - log(share), 0.0)

            return fastest(self.decay_rates, ends, with_gains, excess)

        first, *others = product(*allowed)
        best = best_with(first)
        for signs in others if best[0][0] < 0.0 else ():
            best = max(best, best_with(signs), key=lambda pair: pair[0])
        return best

    def decay_rates(self, laws: Sequence[ControlLaw]) -> FloatArray:
        """Return the smallest decay rate of all drives with each law, 1/s."""
        return np.min([tuning.loops.decay_rates(laws) for tuning in self.drives.values()], axis=0)

    def missed(self, law: ControlLaw) -> tuple[Limit, ...]:
        """Return the limits that a law that makes the loops of this drive stable does not keep."""
        limits = self.limits(self.judged(law, self.plants, self.vibrations))
        return tuple(limit for limit in limits if limit.excess > 1e-9)

    def judged(
        self, law: Any, plants: Sequence[PlantResponse], vibrations: Sequence[Vibration]
    ) -> Tuned:
        """Return what the loops of these plants say of a stable law that catches vibrations."""
        feedback = linear_part(law, plants[0].loop)
        responses = tuple(LoopResponse(plant, feedback) for plant in plants)
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
            min(plant.loop.decay_rate(feedback) for plant in plants),
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
        loop = response.plant.loop
        matrix, pushed = loop.transition_matrix(response.feedback), loop.disturbed
        forced = np.pad(pushed, (0, len(matrix) - len(pushed)))
        rest = np.linalg.solve(np.eye(len(matrix)) - matrix, forced)
        share = abs(1.0 - float(rest[POSITION]))  # dimensionless: the force of the spring
        return abs(friction) * (share if share > 1e-9 else 0.0)

    def limits(self, tuned: Tuned) -> list[Limit]:
        """Return the limits of the goal with what gains have."""
        goal, drive = self.goal, self.drive
        assert tuned.peak_force is not None
        assert tuned.noise_force is not None
        margin = min(1.0 / (tuned.gain_down or 1e-9), tuned.gain_up or inf)
        period = drive.natural_period if drive.has_spring else _WITHOUT_PERIOD
        noise = _NOISE_SHARE * min(goal.force_limit, self.friction)
        return [
            Limit(
                "the delay margin", tuned.delay_margin or inf, goal.delay_margin, "s", least=True
            ),
            Limit("the gain margin", margin, _GAIN_MARGIN, "dB", least=True),
            Limit("the peak force", tuned.peak_force, goal.force_limit, "N"),
            Limit("the rms force by noise", tuned.noise_force, noise, "N"),
            Limit("the decay rate", tuned.decay_rate, _SLOWEST / period, "1/s", least=True),
        ]

    @property
    def _own_cubic_coefficient(self) -> float:
        """The coefficient of the falling cubic friction at high speed, N s^3/m^3, or zero."""
        drive, high = self.drive, 1e6
        coefficient = -float(drive.dimensionless.friction.coefficient(high, 1.0)) / high**3
        return coefficient * drive.force_scale / drive.speed_scale**3 if coefficient > 1e-6 else 0.0

    def _calm(self) -> str:
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
