"""The parameters of each node, with unit, bounds, default and meaning.

ROS declarations, scenario files, overrides, messages and the documentation derive from these
models. The nested field `friction.static` is the ROS parameter of that name.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from math import inf, isinf, pi, sqrt
from typing import TYPE_CHECKING, Any, Literal, Self, get_args

from typing_extensions import override

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.sample_assumptions import SampleAssumptions, reading_of
from stickslip_ros.model.actuator import IDEAL_ACTUATOR, Actuator
from stickslip_ros.model.constants import (
    SMALLEST,
    Parameter,
    at_build,
    at_rest,
    constant,
    constants_of,
    parameters_of,
)
from stickslip_ros.model.control import CONTROL_LAWS, ControlLaw
from stickslip_ros.model.drive import Drive, DriveConstants
from stickslip_ros.model.motor import Motor
from stickslip_ros.model.sensor import EXACT_SENSOR, Sensor
from stickslip_ros.motion.controller import Controller
from stickslip_ros.motion.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.record import ForceSource, TimeSource
from stickslip_ros.record.codec import FORCE_TYPES, UNSTAMPED
from stickslip_ros.scenarios import Pace
from stickslip_ros.scenarios.curve_file import Pairs
from stickslip_ros.scenarios.foreign_laws import CONTROLLERS
from stickslip_ros.scenarios.friction_parameters import Friction
from stickslip_ros.scenarios.signal_parameters import (
    BeltParameters,
    DisturbanceParameters,
    LoadParameters,
    ReferenceParameters,
)
from stickslip_ros.scenarios.validation import ParameterGroup
from stickslip_ros.text import did_you_mean, shown

if TYPE_CHECKING:
    from stickslip_ros.motion.motion import Motion

_SHORTEST_TIME = 1e-3
"""Shortest time-out or period of a node, s."""
_NAME = "[A-Za-z_][A-Za-z0-9_]*"
_NODE_NAME = re.compile(f"/?({_NAME}/)*{_NAME}")


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
            yield "sensor.difference_samples", "by the velocity exact; difference uses it"

    @property
    def selected(self) -> Motor | None:
        """The motor; None if it is ideal."""
        if self.kind == "ideal":
            return None
        return Motor(**{name: getattr(self, name) for name in constants_of(Motor)})


@dataclass(frozen=True)
class NodeParameters(ParameterGroup):
    """Parameters that every node has."""

    autostart: bool = at_rest(True, "Configure and activate the node at start.")
    wait_for: list[str] = at_rest(
        [], "Nodes that must subscribe to this node's topics before it activates."
    )
    use_sim_time: bool = constant(False, "Take ROS time from /clock.")
    thread_priority: int = at_rest(
        0,
        "Priority (SCHED_FIFO) of the threads of the node's process; 0: ordinary scheduling.",
        whole=True,
        at_least=0,
        at_most=99,
    )
    cpu_affinity: int = at_rest(
        -1,
        "Processor on which the node's process runs; -1: any.",
        whole=True,
        at_least=-1,
        at_most=4095,
    )
    lock_memory: bool = at_rest(
        False,
        "Keep the memory of the node's process from being paged out.",
    )

    @override
    def completed(self, prefix: str, curves: dict[str, Pairs]) -> Self:
        if not all(_NODE_NAME.fullmatch(name) for name in self.wait_for):
            raise ValueError(
                f"wait_for = {shown(self.wait_for)} is invalid: must be names of nodes, "
                "of letters, digits and _, not starting with a digit"
            )
        return self


@dataclass(frozen=True)
class PlantParameters(DriveConstants, NodeParameters):
    """Parameters of the plant node, the constants of the drive among them."""

    friction: Friction = field(default_factory=Friction)
    initial: Initial = field(default_factory=Initial)
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
        at_least=_SHORTEST_TIME,
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
    force_number: int = at_build(
        0,
        "Number of the force in the arrays on `control_force`, from 1; 0: they have only one.",
        whole=True,
        at_least=0,
        at_most=1000,
    )
    command_timeout: float = at_rest(
        0.02,
        "Wall time after which a sample without a command holds the last one (newest, lockstep).",
        "s",
        at_least=_SHORTEST_TIME,
    )
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
            yield "sensor.difference_samples", "by the velocity exact; difference uses it"

    @property
    def period(self) -> float:
        """Sample period, s."""
        return 1.0 / self.rate

    @property
    def control_rate(self) -> float:
        """Samples per second that ask the controller for a force, Hz."""
        return self.rate / self.answer_every

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


DEFAULT_LAW = next(iter(CONTROL_LAWS))
"""Control law of a scenario that names none."""


@dataclass(frozen=True)
class ControllerChoice(NodeParameters):
    """Parameters of a controller node before its law is known."""

    law: str = at_build(DEFAULT_LAW, "Control law.", choices=CONTROL_LAWS)


@dataclass(frozen=True)
class ControllerParameters(NodeParameters):
    """Parameters of a controller node: those of every node, and the constants of its control law.

    A constant is also an attribute, such as `linear_gain`.
    """

    control_law: ControlLaw = field(default_factory=CONTROL_LAWS[DEFAULT_LAW])
    """The control law with its constants."""
    reference: ReferenceParameters = field(default_factory=ReferenceParameters)
    """The reference; of kind none for a law that follows none."""

    def __getattr__(self, name: str) -> Any:
        law = self.__dict__.get("control_law")
        if law is not None and name in constants_of(type(law)):
            return getattr(law, name)
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    @property
    @override
    def known(self) -> Mapping[str, Parameter]:
        return _parameters_of_law(type(self.control_law))

    @override
    def replaced(self, values: Mapping[str, Any]) -> Self:
        parts = {name: value for name, value in values.items() if name in self.__dataclass_fields__}
        constants = {name: value for name, value in values.items() if name not in parts}
        constants.pop("law", None)
        law = self.control_law
        made = CONTROLLERS.made(lambda: replace(law, **constants), type(law))
        return replace(self, **parts, control_law=made)

    @override
    def not_used(self) -> Iterator[tuple[str, str]]:
        return super().not_used() if self.control_law.follows_reference else iter(())

    @property
    def law(self) -> str:
        """Name of the control law."""
        return self.control_law.name

    @property
    def node(self) -> str:
        """Name of the node and of its section."""
        return controller_node(self.law)

    def as_controller(self) -> Controller:
        """Return the controller."""
        return Controller(self.control_law, self.reference.signal(period=0.0).reference)


def controller_node(law: str) -> str:
    """Return the name of the node, and of the section, of a control law."""
    return f"{law}_controller"


@cache
def _parameters_of_law(law: type[ControlLaw]) -> Mapping[str, Parameter]:
    """Return the parameters of the controller node of a law by flat name."""
    described = constants_of(law)
    own_law = replace(
        ControllerChoice().known["law"],
        default=law.name,
        meaning="Control law of the node.",
        choices=(law.name,),
    )
    reference = parameters_of(ReferenceParameters(), "reference.")
    parameters = (
        *parameters_of(NodeParameters()),
        own_law,
        *(described[n] for n in law.constants() if not isinstance(described[n].default, tuple)),
        *(reference if law.follows_reference else ()),
    )
    return {parameter.name: parameter for parameter in parameters}


@dataclass(frozen=True)
class MachineParameters(NodeParameters):
    """Parameters that say where joint states of other machines have the motion."""

    joint: str = at_build(
        "", "Joint that is the slide; empty: `slide` beside `belt`, or the only joint."
    )
    belt_joint: str = at_build("", "Joint that is the belt; empty: `belt`, if there is one.")
    belt_speed: float = at_build(0.0, "Belt speed, where the joint states have no belt.", "m/s")


@dataclass(frozen=True)
class AnalyzerParameters(MachineParameters):
    """Parameters of the analyzer node."""

    bag: str = at_rest("", "Directory to record to; empty: no recording.")
    bag_exists: Literal["refuse", "next"] = at_rest(
        "refuse",
        "If the directory exists: refuse it, or record to the next one that does not, with _2, _3, "
        "... behind its name.",
        choices=("refuse", "next"),
    )
    window: int = at_rest(
        20, "Number of cycles to average.", "cycles", whole=True, at_least=1, at_most=100_000
    )
    stick_speed: float = at_rest(
        -1.0,
        "Largest relative speed of a slide that sticks; below 0: automatic, that is 0, with "
        "friction with a memory a hundredth of the belt speed, and found by fits under noise.",
        "m/s",
        at_least=-1.0,
    )
    onset_margin: float = constant(
        0.1,
        "Share of the belt speed by which it must exceed the onset of vibration; else a warning.",
        at_least=0.0,
        at_most=1.0,
    )
    flush_period: float = at_build(
        1.0, "Longest wall time until a recorded message is on disk.", "s", at_least=_SHORTEST_TIME
    )
    max_bag_size: int = at_rest(
        0,
        "Size at which the bag continues in a new file; 0: no limit.",
        "bytes",
        whole=True,
        at_least=0,
        at_most=2**62,
    )
    max_bag_duration: float = at_rest(
        0.0,
        "Recorded time at which the bag continues in a new file; 0: no limit.",
        "s",
        at_least=0.0,
        at_most=1e9,
    )
    compression: Literal["lz4", "zstd", "none"] = at_rest(
        "lz4", "Compression of the bag.", choices=("lz4", "zstd", "none")
    )
    force_type: str = at_build(
        FORCE_TYPES[0],
        "Type of the messages on `control_force`; `effort`: the force is the effort of the joint.",
        choices=(*FORCE_TYPES, "effort"),
    )
    force_number: int = at_build(
        0,
        "Number of the force in the arrays on `control_force`, from 1; 0: they have only one.",
        whole=True,
        at_least=0,
        at_most=1000,
    )

    @property
    def given_stick_speed(self) -> float | None:
        """The stick speed, m/s; None if it is automatic."""
        return None if self.stick_speed < 0.0 else self.stick_speed

    def reading_of(self, plant: Mapping[str, Any], fastest_belt: float = 0.0) -> SampleAssumptions:
        """Return how samples of a plant are to be read."""
        return reading_of(plant, fastest_belt, given=self.given_stick_speed)


@dataclass(frozen=True)
class ReplayParameters(MachineParameters):
    """Parameters of the replay node, which scenarios do not contain."""

    bag: str = at_build("", "Bag to replay: its directory or one of its files.")
    rate: float = at_rest(1.0, "Recorded time divided by wall time.", positive=True)
    loop: bool = at_rest(False, "Start again at the end of the bag.")
    on_end: Literal["pause", "exit"] = at_rest(
        "pause",
        "At the end of the bag the node becomes inactive, and with exit its process ends.",
        choices=("pause", "exit"),
    )
    start: float = at_build(
        0.0,
        "Recorded time to start at, from the bag's first message.",
        "s",
        at_least=0.0,
        at_most=1e10,
    )
    duration: float = at_build(inf, "Recorded time to replay.", "s", positive=True)
    topics: list[str] = at_build([], "Topics to replay; empty: all topics of the bag.")
    clock: bool = at_build(False, "Publish recorded time on /clock.")
    states_topic: str = at_build("", "Topic of joint states of another machine; empty: found.")
    force_topic: str = at_build("", "Topic of forces of another machine; empty: found.")
    time: TimeSource = at_build(
        "header",
        "Time of a bag of another machine: the stamps, or the log of the recorder.",
        choices=get_args(TimeSource),
    )
    force: ForceSource = at_build(
        "topic",
        "Force of another machine: of a topic, or the effort of the joint.",
        choices=get_args(ForceSource),
    )


CONTROLLER_PARAMETERS: dict[str, ControllerParameters] = {
    name: ControllerParameters(control_law=law()) for name, law in CONTROL_LAWS.items()
}
"""The parameters of the controller node of each control law at their defaults, by law."""

NODE_PARAMETERS: dict[str, NodeParameters] = {
    "plant": PlantParameters(),
    **{controller_node(name): parameters for name, parameters in CONTROLLER_PARAMETERS.items()},
    "analyzer": AnalyzerParameters(),
}
"""The parameters of each node at their defaults, by node name; a run has one of the controllers."""


def known_law(name: str) -> str:
    """Return the name of a control law; raises InvalidInputError if there is none of that name."""
    if name in CONTROLLER_PARAMETERS:
        return name
    if name in CONTROLLERS.refused:
        raise InvalidInputError(f"control law {name} is refused: {CONTROLLERS.refused[name]}")
    every = f"the known names are {', '.join(CONTROLLER_PARAMETERS)}"
    raise InvalidInputError(
        f"unknown control law {name:.80}; {did_you_mean(name, CONTROLLER_PARAMETERS, every)}"
    )
