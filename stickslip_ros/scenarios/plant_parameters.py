"""The parameters of the plant, and the drive and the sampled loop that they make."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import inf, isinf, pi, sqrt
from typing import TYPE_CHECKING, Literal, Self

from typing_extensions import override

from stickslip_ros.model.actuator import IDEAL_ACTUATOR, Actuator
from stickslip_ros.model.constants import SMALLEST, at_build, at_rest, constant, constants_of
from stickslip_ros.model.drive import Drive, DriveConstants
from stickslip_ros.model.motor import Motor
from stickslip_ros.model.sensor import EXACT_SENSOR, Sensor
from stickslip_ros.motion.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.record.codec import FORCE_TYPES, UNSTAMPED
from stickslip_ros.scenarios import Pace
from stickslip_ros.scenarios.curve_file import Pairs
from stickslip_ros.scenarios.friction_parameters import Friction
from stickslip_ros.scenarios.parameter_group import (
    SHORTEST_TIME,
    NodeParameters,
    ParameterGroup,
    numbered_force,
)
from stickslip_ros.scenarios.signal_parameters import (
    BeltParameters,
    DisturbanceParameters,
    LoadParameters,
)
from stickslip_ros.text import shown

if TYPE_CHECKING:
    from stickslip_ros.motion.motion import Motion

_NO_DIFFERENCE = "sensor.difference_samples", "by the velocity exact; difference uses it"
"""What a sensor without a difference does not use, and why."""


@dataclass(frozen=True)
class Initial(ParameterGroup):
    """State of the slide at the first sample."""

    position: float = constant(0.0, "Initial displacement of the slide.", "m")
    velocity: float = constant(0.0, "Initial velocity of the slide.", "m/s")


@dataclass(frozen=True)
class _MotorKind(ParameterGroup):
    kind: Literal["ideal", "mass"] = at_build(
        "ideal",
        "Motor behind the screw: it moves exactly at the feed and its force acts on the slide "
        "(ideal), or it is a body of its own (mass).",
        choices=("ideal", "mass"),
    )


@dataclass(frozen=True)
class MotorParameters(Motor, _MotorKind):
    """The motor behind the screw, and its encoder."""

    sensor: Sensor = EXACT_SENSOR

    @override
    def not_used(self) -> Iterator[tuple[str, str]]:
        if self.kind == "ideal":
            yield from ((name, "by the kind ideal; mass uses it") for name in self.known)
        elif not self.sensor.spans:
            yield _NO_DIFFERENCE

    @property
    def selected(self) -> Motor | None:
        """The motor; None if it is ideal."""
        if self.kind == "ideal":
            return None
        return Motor(**{name: getattr(self, name) for name in constants_of(Motor)})


@dataclass(frozen=True)
class DriveParameters(DriveConstants, NodeParameters):
    """The drive of the plant: its constants, its friction and its initial state."""

    friction: Friction = field(default_factory=Friction)
    initial: Initial = field(default_factory=Initial)


@dataclass(frozen=True)
class SamplingParameters(ParameterGroup):
    """When the plant samples the motion, and when forces of the controller act."""

    rate: float = at_rest(100.0, "Samples per second.", "Hz", at_least=1e-6, at_most=1e9)
    pace: Pace = at_rest(
        Pace.LOCKSTEP,
        "Pace of the samples: by the clock (realtime), or after each answer (lockstep).",
    )
    real_time_factor: float = at_rest(
        1.0, "Simulated time divided by wall time (realtime).", positive=True
    )
    force_delay: float = at_rest(
        0.0, "Delay from a sample to the start of its force.", "s", at_least=0.0
    )
    force_jitter: float = at_rest(
        0.0, "Largest random addition to the delay of a force.", "s", at_least=0.0
    )
    force_jitter_seed: int = at_rest(
        0, "Seed of the random delays.", whole=True, at_least=0, at_most=1_000_000_000
    )
    force_timeout: float = at_rest(
        0.1, "Age up to which the last force is held (realtime).", "s", at_least=0.0
    )
    answer_every: int = at_rest(
        1,
        "Samples from one that asks the controller for a force to the next; between them the last "
        "force is held.",
        "samples",
        whole=True,
        at_least=1,
        at_most=1000,
    )
    reply_timeout: float = at_rest(
        10.0,
        "Longest wall time to wait for a force or the recorder (lockstep).",
        "s",
        at_least=SHORTEST_TIME,
    )
    command_rule: Literal["answer", "newest"] = at_rest(
        "answer",
        "Which force acts: that with the stamp of the sample (answer), or the newest, whatever its "
        "stamp; in lockstep the first one after each sample, in real time each from its arrival.",
        choices=("answer", "newest"),
    )
    force_type: str = at_build(
        FORCE_TYPES[0],
        "Type of the messages on `control_force`; those without a stamp need the rule newest.",
        choices=FORCE_TYPES,
    )
    force_number: int = numbered_force()
    command_timeout: float = at_rest(
        0.02,
        "Wall time after which a sample without a command holds the last one (newest, lockstep).",
        "s",
        at_least=SHORTEST_TIME,
    )

    @property
    def period(self) -> float:
        """Sample period, s."""
        return 1.0 / self.rate

    @property
    def control_rate(self) -> float:
        """Samples per second that ask the controller for a force, Hz."""
        return self.rate / self.answer_every


@dataclass(frozen=True)
class PlantParameters(SamplingParameters, DriveParameters):
    """Parameters of the plant node, the constants of the drive among them."""

    effort: Literal["friction", "actuator"] = at_rest(
        "friction",
        "What `effort` of the slide is in joint_states: friction, or the force of the actuator.",
        choices=("friction", "actuator"),
    )
    slide_name: str = at_build("slide", "Name of the slide in joint_states and joint_commands.")
    belt_name: str = at_build("belt", "Name of the belt in joint_states.")
    expects_control: bool = at_rest(True, "Whether the plant expects forces from a controller.")
    flow_window: int = at_rest(
        1000,
        "Largest lead of the plant over the recorder (lockstep).",
        "samples",
        whole=True,
        at_least=200,
        at_most=4_000,
    )
    duration: float = at_rest(
        inf, "Simulated time after which the plant pauses.", "s", at_least=0.0
    )
    publish_clock: bool = at_build(False, "Publish simulated time on /clock.")
    load: LoadParameters = field(default_factory=LoadParameters)
    belt: BeltParameters = field(default_factory=BeltParameters)
    disturbance: DisturbanceParameters = field(default_factory=DisturbanceParameters)
    sensor: Sensor = EXACT_SENSOR
    actuator: Actuator = IDEAL_ACTUATOR
    motor: MotorParameters = field(default_factory=MotorParameters)
    publish_truth: bool = at_build(
        False, "Publish the true state and the force of the actuator, too."
    )

    @override
    def completed(self, prefix: str, curves: dict[str, Pairs]) -> Self:
        natural = sqrt(self.stiffness / self.mass) / (2.0 * pi)
        lowest, _ = self.load.signal(self.period).bounds
        if 0.0 < self.stiffness < SMALLEST:  # the scales of the drive overflow
            raise ValueError(
                f"stiffness = {self.stiffness} N/m is invalid: must be 0 or at least {SMALLEST:g}"
            )
        if self.force_type in UNSTAMPED and self.command_rule != "newest":
            raise ValueError(
                f"force_type = {self.force_type} is refused with command_rule = "
                f"{self.command_rule}: its messages have no stamp; command_rule must be newest"
            )
        if (self.force_delay + self.force_jitter) * self.rate > 1e6:
            raise ValueError(
                f"force_delay = {self.force_delay} s and force_jitter = {self.force_jitter} s "
                "must not exceed 1e6 periods of rate together"
            )
        if self.control_rate < natural / 1000.0:
            name = "rate" if self.answer_every == 1 else "rate / answer_every"
            raise ValueError(
                f"{name} = {self.control_rate} Hz must be at least a thousandth of the natural "
                f"frequency, {natural:g} Hz with mass = {self.mass} kg and stiffness = "
                f"{self.stiffness} N/m"
            )
        if self.motor.kind == "mass" and self.stiffness == 0.0:
            raise ValueError(
                "stiffness = 0.0 N/m is invalid: must be above 0 N/m with motor.kind = mass"
            )
        if self.normal_force + lowest < 0.0:  # the slide is lifted off the belt
            load = "file" if self.load.kind == "table" else "amplitude"
            raise ValueError(
                f"load.{load} = {shown(getattr(self.load, load))} is invalid: must leave a normal "
                f"force of at least 0 N, with normal_force = {self.normal_force} N and a load down "
                f"to {lowest} N"
            )
        return super().completed(prefix, curves)

    @override
    def not_used(self) -> Iterator[tuple[str, str]]:
        if self.pace is Pace.LOCKSTEP:
            yield "real_time_factor", "by the pace lockstep; realtime uses it"
        elif self.command_rule == "newest":
            yield "answer_every", "by the rule newest in real time: each command acts when it comes"
        yield from super().not_used()
        if not self.sensor.spans:
            yield _NO_DIFFERENCE

    @property
    def last_sample(self) -> int | None:
        """Number of the sample at which the plant pauses; None without `duration`."""
        samples = self.duration * self.rate
        return None if isinf(samples) else round(samples)

    @property
    def exactly_measured(self) -> bool:
        """Whether the samples are the true motion, of the slide and of a motor."""
        return self.sensor.exact and (self.motor.kind == "ideal" or self.motor.sensor.exact)

    def as_drive(self) -> Drive:
        """Return the drive."""
        return Drive(
            **{name: getattr(self, name) for name in constants_of(DriveConstants)},
            friction=self.friction.selected,
            belt=self.belt.signal(self.period),
            load=self.load.signal(self.period),
            actuator=self.actuator,
            motor=self.motor.selected,
        )

    def drive_names(self) -> list[str]:
        """Return the flat names of the drive's parameters, with those of its friction law.

        Those at a default that simplifies the equations are none of them.
        """
        names = [
            name
            for name, described in constants_of(DriveConstants).items()
            if not (described.simplifies and getattr(self, name) == described.default)
        ]
        if self.motor.kind == "mass":
            names += ["motor.kind", "motor.mass", "motor.damping", "motor.friction"]
        return [*names, "friction.law", *(f"friction.{name}" for name in self.friction.names())]

    @property
    def linear_sampling(self) -> tuple[float, float, Sensor, Sensor, int]:
        """Rate, delay, sensors and `answer_every`, the sampling of a `LinearSampledLoop`."""
        return self.rate, self.force_delay, self.sensor, self.motor.sensor, self.answer_every

    @property
    def mean_sampling(self) -> tuple[float, float, Sensor, Sensor, int]:
        """The same with the mean delay of forces with jitter."""
        rate, delay, sensor, motor_sensor, every = self.linear_sampling
        return rate, delay + self.force_jitter / 2.0, sensor, motor_sensor, every

    def as_loop(
        self,
        motion: "Motion",
        start: int = LOCKSTEP_START,
        *,
        hold_late: bool = False,
        overtaken: Callable[[int, float], None] = lambda stamp, force: None,
        advance: Callable[[float, float, float], None] | None = None,
    ) -> SampledLoop:
        """Return the sampled loop over `motion`; see `SampledLoop` for the arguments."""
        return SampledLoop(
            motion,
            self.rate,
            start,
            force_delay=self.force_delay,
            force_jitter=self.force_jitter,
            force_jitter_seed=self.force_jitter_seed,
            force_timeout=self.force_timeout,
            hold_late=hold_late,
            answer_every=self.answer_every,
            expects_control=self.expects_control,
            disturbance=self.disturbance.signal(self.period),
            sensor=self.sensor,
            motor_sensor=self.motor.sensor,
            overtaken=overtaken,
            advance=advance,
        )
