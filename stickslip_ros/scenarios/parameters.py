"""The parameters of each node, with unit, bounds, default and meaning.

ROS declarations, scenario files, overrides, messages and the documentation derive from these
models. The nested field `friction.static` is the ROS parameter of that name.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from math import isinf, pi, sqrt
from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import create_model, model_validator
from typing_extensions import override

from stickslip_ros.physics.loop.controller import Controller
from stickslip_ros.physics.loop.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.physics.measures.sample_meter import SampleAssumptions, reading_of
from stickslip_ros.physics.model.actuator import Actuator
from stickslip_ros.physics.model.constants import constants_of
from stickslip_ros.physics.model.control import CONTROL_LAWS, ControlLaw
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.sensor import Sensor
from stickslip_ros.physics.model.signals import SignalKind
from stickslip_ros.scenarios import Pace
from stickslip_ros.scenarios.foreign_laws import CONTROLLERS
from stickslip_ros.scenarios.friction_parameters import Friction
from stickslip_ros.scenarios.parameter_field import SMALLEST, Fixed, field, field_of
from stickslip_ros.scenarios.signal_parameters import (
    BeltParameters,
    DisturbanceParameters,
    LoadParameters,
    ReferenceParameters,
)
from stickslip_ros.scenarios.validation import ParameterGroup
from stickslip_ros.text import shown

if TYPE_CHECKING:
    from stickslip_ros.physics.motion.motion import Motion

_SHORTEST = 1e-3
"""Shortest time-out or period of a node, s."""
_OF_DRIVE = [each.name for each in fields(Drive) if each.type is float]
"""Parameters of the plant that the drive takes unchanged."""
_DEFAULTS = {each.name: each.default for each in fields(Drive)}
"""Defaults of the drive; only constants that may be absent have one."""
_NAME = "[A-Za-z_][A-Za-z0-9_]*"
_NODE_NAME = re.compile(f"/?({_NAME}/)*{_NAME}")


class Initial(ParameterGroup):
    """State of the slide at the first sample."""

    position: float = field(0.0, "Initial displacement of the slide.", "m")
    velocity: float = field(0.0, "Initial velocity of the slide.", "m/s")


class NodeParameters(ParameterGroup):
    """Parameters that every node has."""

    autostart: bool = field(True, "Configure and activate the node at start.", fixed=Fixed.ACTIVE)
    wait_for: list[str] = field(
        [],
        "Nodes that must subscribe to this node's topics before it activates.",
        fixed=Fixed.ACTIVE,
    )
    use_sim_time: bool = field(False, "Take ROS time from /clock.")

    @model_validator(mode="after")
    def _names_are_possible(self) -> Self:
        """Refuse to wait for an invalid node name."""
        if not all(_NODE_NAME.fullmatch(name) for name in self.wait_for):
            raise ValueError(
                f"wait_for = {shown(self.wait_for)} is refused: must be names of nodes, "
                "of letters, digits and _, not starting with a digit"
            )
        return self


def _group_of(part: type, fixed: Fixed) -> type[ParameterGroup]:
    """Return the parameters for the constants of a part of the plant."""
    constants = constants_of(part).items()
    described: dict[str, Any] = {name: field_of(each, fixed=fixed) for name, each in constants}
    return create_model(part.__name__, __base__=ParameterGroup, **described)


class SensorParameters(_group_of(Sensor, Fixed.ACTIVE)):
    """Constants of the sensor."""

    @model_validator(mode="after")
    def _constants_fit_together(self) -> Self:
        """Refuse constants that the sensor refuses."""
        refusal = Sensor(**dict(self)).refusal()
        if refusal is not None:
            raise ValueError(f"sensor.{refusal}")
        return self

    @override
    def not_used(self) -> Iterator[tuple[str, str]]:
        if not Sensor(**dict(self)).spans:
            yield "difference_samples", "by the velocity exact; difference uses it"


class ActuatorParameters(_group_of(Actuator, Fixed.NEVER)):
    """Constants of the actuator."""


class PlantParameters(NodeParameters):
    """Parameters of the plant node."""

    mass: float = field(1.0, "Mass of the slide.", "kg", ge=SMALLEST)
    damping: float = field(0.02, "Viscous damping of the transmission.", "N s/m", ge=0.0)
    stiffness: float = field(
        1.0, "Stiffness of the transmission; 0 for an axis that no spring holds.", "N/m", ge=0.0
    )
    normal_force: float = field(
        1.0, "Force that presses the slide onto the belt.", "N", ge=SMALLEST
    )
    belt_speed: float = field(0.4, "Speed of the belt (feed speed), positive or negative.", "m/s")
    bias_force: float = field(0.0, "Constant force on the slide, such as an offset.", "N")
    friction: Friction = Friction()
    initial: Initial = Initial()
    rate: float = field(100.0, "Samples per second.", "Hz", fixed=Fixed.ACTIVE, ge=1e-6, le=1e9)
    pace: Pace = field(
        Pace.LOCKSTEP,
        "Pace of the samples: by the clock (realtime), or after each answer (lockstep).",
        choices=Pace,
        strict=False,
        fixed=Fixed.ACTIVE,
    )
    real_time_factor: float = field(
        1.0, "Simulated time divided by wall time (realtime).", fixed=Fixed.ACTIVE, ge=SMALLEST
    )
    force_delay: float = field(
        0.0, "Delay from a sample to the start of its force.", "s", fixed=Fixed.ACTIVE, ge=0.0
    )
    force_jitter: float = field(
        0.0, "Largest random addition to the delay of a force.", "s", fixed=Fixed.ACTIVE, ge=0.0
    )
    force_jitter_seed: int = field(
        0, "Seed of the random delays.", fixed=Fixed.ACTIVE, ge=0, le=1_000_000_000
    )
    force_timeout: float = field(
        0.1, "Age up to which the last force is held (realtime).", "s", fixed=Fixed.ACTIVE, ge=0.0
    )
    reply_timeout: float = field(
        10.0,
        "Longest wall time to wait for a force or the recorder (lockstep).",
        "s",
        fixed=Fixed.ACTIVE,
        ge=_SHORTEST,
    )
    expects_control: bool = field(
        True, "Whether the plant expects forces from a controller.", fixed=Fixed.ACTIVE
    )
    flow_window: int = field(
        1000,
        "Largest lead of the plant over the recorder (lockstep).",
        "samples",
        fixed=Fixed.ACTIVE,
        ge=200,
        le=4_000,
    )
    duration: float = field(
        float("inf"),
        "Simulated time after which the plant pauses.",
        "s",
        fixed=Fixed.ACTIVE,
        ge=0.0,
        allow_inf_nan=True,
    )
    publish_clock: bool = field(False, "Publish simulated time on /clock.", fixed=Fixed.CONFIGURED)
    load: LoadParameters = LoadParameters()
    belt: BeltParameters = BeltParameters()
    disturbance: DisturbanceParameters = DisturbanceParameters()
    sensor: SensorParameters = SensorParameters()
    actuator: ActuatorParameters = ActuatorParameters()
    publish_truth: bool = field(
        False,
        "Publish the true state and the force of the actuator, too.",
        fixed=Fixed.CONFIGURED,
    )

    @model_validator(mode="after")
    def _spring_is_none_or_some(self) -> Self:
        """Refuse a stiffness so small that the scales of the drive overflow."""
        if 0.0 < self.stiffness < SMALLEST:
            raise ValueError(
                f"stiffness = {self.stiffness} N/m is refused: must be 0 or at least {SMALLEST:g}"
            )
        return self

    @model_validator(mode="after")
    def _delay_is_bounded(self) -> Self:
        """Refuse a delay of more than a million samples."""
        if (self.force_delay + self.force_jitter) * self.rate > 1e6:
            raise ValueError(
                f"force_delay = {self.force_delay} s and force_jitter = {self.force_jitter} s "
                "must not exceed 1e6 periods of rate together"
            )
        return self

    @model_validator(mode="after")
    def _samples_are_short(self) -> Self:
        """Refuse a sampling period of more than a thousand natural periods."""
        natural = sqrt(self.stiffness / self.mass) / (2.0 * pi)
        if self.rate < natural / 1000.0:
            raise ValueError(
                f"rate = {self.rate} Hz must be at least a thousandth of the natural frequency, "
                f"{natural:g} Hz with mass = {self.mass} kg and stiffness = {self.stiffness} N/m"
            )
        return self

    @model_validator(mode="after")
    def _slide_stays_on_the_belt(self) -> Self:
        """Refuse a load that would lift the slide off the belt."""
        lowest, _ = self.load.signal(self.period).bounds
        if self.normal_force + lowest < 0.0:
            load = "file" if self.load.kind is SignalKind.TABLE else "amplitude"
            raise ValueError(
                f"load.{load} = {shown(getattr(self.load, load))} is refused: must leave a normal "
                f"force of at least 0 N, with normal_force = {self.normal_force} N and a load down "
                f"to {lowest} N"
            )
        return self

    @override
    def not_used(self) -> Iterator[tuple[str, str]]:
        if self.pace is Pace.LOCKSTEP:
            yield "real_time_factor", "by the pace lockstep; realtime uses it"
        yield from super().not_used()

    @property
    def period(self) -> float:
        """Sample period, s."""
        return 1.0 / self.rate

    @property
    def last_sample(self) -> int | None:
        """Number of the sample at which the plant pauses; None without `duration`."""
        samples = self.duration * self.rate
        return None if isinf(samples) else round(samples)

    def as_drive(self) -> Drive:
        """Return the drive."""
        values = {name: getattr(self, name) for name in _OF_DRIVE}
        return Drive(
            **values,
            friction=self.friction.as_law(),
            belt=self.belt.signal(self.period),
            load=self.load.signal(self.period),
            actuator=self.as_actuator(),
        )

    def as_actuator(self) -> Actuator:
        """Return the actuator."""
        return Actuator(**dict(self.actuator))

    def as_sensor(self) -> Sensor:
        """Return the sensor."""
        return Sensor(**dict(self.sensor))

    def drive_names(self) -> list[str]:
        """Return the flat names of the drive's parameters, with those of its friction law.

        Those at a default of the drive are none of them.
        """
        own = [name for name in _OF_DRIVE if getattr(self, name) != _DEFAULTS.get(name)]
        return [*own, "friction.law", *(f"friction.{name}" for name in self.friction.names())]

    def as_loop(
        self,
        motion: "Motion",
        start: int = LOCKSTEP_START,
        *,
        hold_late: bool = False,
        overtaken: Callable[[int, float], None] = lambda stamp, force: None,
        advance: Callable[[float], None] | None = None,
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
            expects_control=self.expects_control,
            disturbance=self.disturbance.signal(self.period),
            sensor=self.as_sensor(),
            overtaken=overtaken,
            advance=advance,
        )


class ControllerParameters(NodeParameters):
    """Parameters of a controller node: those of its control law; see `controller_model`."""

    law: str = field(
        next(iter(CONTROL_LAWS)), "Control law.", fixed=Fixed.CONFIGURED, choices=CONTROL_LAWS
    )

    @model_validator(mode="after")
    def _constants_fit_together(self) -> Self:
        """Refuse constants that the law refuses."""
        CONTROLLERS.made(self.as_law, CONTROL_LAWS[self.law])
        return self

    @property
    def node(self) -> str:
        """Name of the node and of its section."""
        return controller_node(self.law)

    def as_law(self) -> ControlLaw:
        """Return the control law with its constants."""
        known = type(self).model_fields
        law = CONTROL_LAWS[self.law]
        return law(**{name: getattr(self, name) for name in law.constants() if name in known})

    @property
    def reference_group(self) -> ReferenceParameters:
        """The reference; of kind none for a law that follows none."""
        return getattr(self, "reference", ReferenceParameters())

    def as_controller(self, state: tuple[float, ...] | None = None) -> Controller:
        """Return the controller, with the state of its law at the first sample."""
        return Controller(self.as_law(), self.reference_group.signal(period=0.0).reference, state)

    def law_names(self) -> list[str]:
        """Return the names of the constants of the control law."""
        return CONTROL_LAWS[self.law].constants()


def controller_node(law: str) -> str:
    """Return the name of the node, and of the section, of a control law."""
    return f"{law}_controller"


def controller_model(law: type[ControlLaw]) -> type[ControllerParameters]:
    """Return the parameters of the controller node of a law."""
    described = constants_of(law)
    own_law = field(
        law.name, "Control law of the node.", fixed=Fixed.CONFIGURED, choices=[law.name]
    )
    fields: dict[str, Any] = {"law": (Literal[law.name], own_law)}
    for name in law.constants():
        if not isinstance(described[name].default, tuple):
            fields[name] = field_of(described[name])
    if law.follows_reference:
        fields["reference"] = ReferenceParameters, ReferenceParameters()
    title = "".join(word.capitalize() for word in law.name.split("_"))
    model = create_model(
        f"{title}ControllerParameters",
        __base__=ControllerParameters,
        __module__=__name__,
        **fields,
    )
    model.__doc__ = f"Parameters of the {controller_node(law.name)} node."
    return model


class AnalyzerParameters(NodeParameters):
    """Parameters of the analyzer node."""

    bag: str = field("", "Directory to record to; empty: no recording.", fixed=Fixed.ACTIVE)
    window: int = field(
        20, "Number of cycles to average.", "cycles", fixed=Fixed.ACTIVE, ge=1, le=100_000
    )
    stick_speed: float = field(
        -1.0,
        "Largest relative speed of a slide that sticks; below 0: automatic, that is 0, with "
        "friction with a memory a hundredth of the belt speed, and found by fits under noise.",
        "m/s",
        fixed=Fixed.ACTIVE,
        ge=-1.0,
    )
    flush_period: float = field(
        1.0,
        "Longest wall time until a recorded message is on disk.",
        "s",
        fixed=Fixed.CONFIGURED,
        ge=_SHORTEST,
    )
    max_bag_size: int = field(
        0,
        "Size at which the bag continues in a new file; 0: no limit.",
        "bytes",
        fixed=Fixed.ACTIVE,
        ge=0,
        le=2**62,
    )
    max_bag_duration: float = field(
        0.0,
        "Recorded time at which the bag continues in a new file; 0: no limit.",
        "s",
        fixed=Fixed.ACTIVE,
        ge=0.0,
        le=1e9,
    )
    compression: Literal["lz4", "zstd", "none"] = field(
        "lz4", "Compression of the bag.", fixed=Fixed.ACTIVE, choices=("lz4", "zstd", "none")
    )

    @property
    def given_stick_speed(self) -> float | None:
        """The stick speed, m/s; None if it is automatic."""
        return None if self.stick_speed < 0.0 else self.stick_speed

    def reading_of(self, plant: Mapping[str, Any], fastest_belt: float = 0.0) -> SampleAssumptions:
        """Return how samples of a plant are to be read."""
        return reading_of(plant, fastest_belt, given=self.given_stick_speed)


class ReplayParameters(NodeParameters):
    """Parameters of the replay node, which scenarios do not contain."""

    bag: str = field(
        "", "Bag to replay: its directory or one of its files.", fixed=Fixed.CONFIGURED
    )
    rate: float = field(1.0, "Recorded time divided by wall time.", fixed=Fixed.ACTIVE, ge=SMALLEST)
    loop: bool = field(False, "Start again at the end of the bag.", fixed=Fixed.ACTIVE)
    start: float = field(
        0.0,
        "Recorded time to start at, from the bag's first message.",
        "s",
        fixed=Fixed.CONFIGURED,
        ge=0.0,
        le=1e10,
    )
    duration: float = field(
        float("inf"),
        "Recorded time to replay.",
        "s",
        fixed=Fixed.CONFIGURED,
        ge=SMALLEST,
        allow_inf_nan=True,
    )
    topics: list[str] = field(
        [], "Topics to replay; empty: all topics of the bag.", fixed=Fixed.CONFIGURED
    )
    clock: bool = field(False, "Publish recorded time on /clock.", fixed=Fixed.CONFIGURED)


DEFAULT_LAW = next(iter(CONTROL_LAWS))
"""Control law of a scenario that names none."""

CONTROLLER_PARAMETERS: dict[str, type[ControllerParameters]] = {
    name: controller_model(law) for name, law in CONTROL_LAWS.items()
}
"""The parameter model of the controller node of each control law, by name of the law."""


def __getattr__(name: str) -> Any:
    """Return the model of a controller by the name of its class, as pickle looks for it."""
    for model in CONTROLLER_PARAMETERS.values():
        if model.__name__ == name:
            return model
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


NODE_PARAMETERS: dict[str, type[NodeParameters]] = {
    "plant": PlantParameters,
    **{controller_node(name): model for name, model in CONTROLLER_PARAMETERS.items()},
    "analyzer": AnalyzerParameters,
}
"""The parameter model of each node, by node name; a run has one of the controllers."""
