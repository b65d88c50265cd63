"""The parameters of each node, with unit, bounds, default and meaning.

ROS declarations, scenario files, overrides, messages and the documentation derive from these
models. The nested field `friction.static` is the ROS parameter of that name.
"""

import re
from collections.abc import Callable
from dataclasses import fields, replace
from math import ceil, inf, isinf, isnan, nan, pi, sqrt
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    AfterValidator,
    PrivateAttr,
    ValidatorFunctionWrapHandler,
    create_model,
    field_validator,
    model_validator,
)

from stickslip_ros.deprecated_names import Renamed
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.loop.controller import Controller
from stickslip_ros.physics.loop.reference import ReferenceCourse, ReferenceKind
from stickslip_ros.physics.loop.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.physics.model.actuator import Actuator
from stickslip_ros.physics.model.constants import Constant, constants_of
from stickslip_ros.physics.model.control import CONTROL_LAWS, ControlLaw
from stickslip_ros.physics.model.disturbance import Disturbance, DisturbanceKind
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import LAWS, Directional, FrictionLaw, Table
from stickslip_ros.physics.model.sensor import Sensor
from stickslip_ros.scenarios.curve_file import Pairs, read_pairs
from stickslip_ros.scenarios.foreign_laws import FRICTION_LAWS, add_laws_of_other_packages
from stickslip_ros.scenarios.pace import Pace
from stickslip_ros.scenarios.parameter_field import LARGEST, SMALLEST, Fixed, field
from stickslip_ros.scenarios.validation import ParameterGroup, refused
from stickslip_ros.text import shown

if TYPE_CHECKING:
    from stickslip_ros.physics.motion.motion import Motion

_SHORTEST = 1e-3
"""Shortest time-out or period of a node, s."""
_OF_DRIVE = [each.name for each in fields(Drive) if each.type is float]
"""Parameters of the plant that the drive takes unchanged."""
_AS_FORWARD = nan
"""Value of a constant of backward slip that is the one of forward slip."""
_NAME = "[A-Za-z_][A-Za-z0-9_]*"
_NODE_NAME = re.compile(f"/?({_NAME}/)*{_NAME}")


def _known_law(name: str) -> str:
    if name in LAWS:
        return name
    if name in FRICTION_LAWS.refused:
        raise refused(FRICTION_LAWS.refused[name])
    raise ValueError(f"no law {name}")


def _constants_of_laws(*, reverse: bool = False) -> dict[str, Any]:
    """Return a field for each constant of the laws that is one number, by name."""
    field_of = _reverse_field_of if reverse else _field_of
    laws: dict[str, list[str]] = {}
    constants: dict[str, Constant] = {}
    for law in LAWS.values():
        for name, constant in constants_of(law).items():
            if isinstance(constant.default, tuple) or (constant.whole and reverse):
                continue
            constants.setdefault(name, constant)
            laws.setdefault(name, []).append(law.name)
    return {
        name: field_of(constant, laws[name] if len(laws[name]) < _LAWS_WITH_CONSTANTS else [])
        for name, constant in constants.items()
    }


def _reverse_field_of(constant: Constant, laws: list[str]) -> Any:
    """Return type and description of the parameter for a constant of backward slip."""
    meaning = f"{constant.meaning.removesuffix('.')}, for v_r < 0."
    return _field_of(replace(constant, default=_AS_FORWARD, meaning=meaning), laws)


def _curve(direction: str = "") -> Any:
    return field(
        "",
        f"CSV file of relative speeds (m/s, from 0 on) and coefficients{direction} (table).",
        fixed=Fixed.CONFIGURED,
        file=True,
    )


def _group_of(part: type, fixed: Fixed) -> type[ParameterGroup]:
    """Return the parameters for the constants of a part of the plant."""
    constants = constants_of(part).items()
    described: dict[str, Any] = {name: _field_of(each, fixed=fixed) for name, each in constants}
    return create_model(part.__name__, __base__=ParameterGroup, **described)


def _field_of(constant: Constant, laws: list[str] | None = None, fixed: Fixed = Fixed.NEVER) -> Any:
    """Return type and description of a parameter for a constant, for some `laws` only."""
    meaning = constant.meaning
    if laws:
        meaning = f"{meaning.removesuffix('.')} ({', '.join(laws)})."
    least = max(constant.at_least, SMALLEST if constant.positive else -inf)
    bounds: dict[str, Any] = {} if least == -inf else {"ge": least}
    default: Any = constant.default
    if constant.whole:
        bounds = {bound: ceil(value) for bound, value in bounds.items()}
        return int, field(int(default), meaning, constant.unit, fixed=fixed, **bounds)
    if isnan(default):
        limits: dict[str, Any] = {"ge": -LARGEST, "le": LARGEST} | bounds
        return float, field(
            default, meaning, constant.unit, unset="as forward", allow_inf_nan=True, **limits
        )
    if isinf(default):
        bounds["allow_inf_nan"] = True
    return float, field(float(default), meaning, constant.unit, fixed=fixed, **bounds)


add_laws_of_other_packages()
_LAWS_WITH_CONSTANTS = sum(bool(constants_of(law)) for law in LAWS.values())


class ReverseFriction(
    create_model("_Reverse", __base__=ParameterGroup, **_constants_of_laws(reverse=True))
):
    """Coefficients of backward slip, v_r < 0, where they differ from those of forward slip."""

    file: str = _curve(" for v_r < 0; empty: as forward")

    @field_validator("*", mode="wrap")
    @classmethod
    def _as_forward(cls, value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        """Take nan, which no bounds allow, as one object: groups of parameters then compare."""
        return _AS_FORWARD if isinstance(value, float) and isnan(value) else handler(value)

    def __setstate__(self, state: dict[Any, Any]) -> None:
        super().__setstate__(state)
        values = self.__dict__
        values |= {name: _AS_FORWARD for name, value in values.items() if value != value}


class _ChosenLaw(ParameterGroup):
    law: Annotated[str, AfterValidator(_known_law)] = field(
        "stribeck", "Friction law.", choices=LAWS
    )


class Friction(create_model("_Constants", __base__=_ChosenLaw, **_constants_of_laws())):
    """Friction law and its coefficients; each law uses those of its formula."""

    file: str = _curve()
    reverse: ReverseFriction = ReverseFriction()

    _law: FrictionLaw = PrivateAttr()

    @model_validator(mode="after")
    def _constants_fit_together(self) -> Self:
        """Refuse constants that the law refuses, under their names as parameters."""
        kind = LAWS[self.law]
        if issubclass(kind, Table) and not self.file:
            raise ValueError(
                f"friction.file = {self.file!r} is refused: must be a CSV file of speeds and "
                f"coefficients for law {self.law}"
            )
        law = kind(**self._constants(self, "friction"))
        reverse = self._constants(self.reverse, "friction.reverse")
        if reverse:
            law = Directional(law, replace(law, **reverse))
        refusal = law.refusal()
        if refusal is not None:

            def parameter(match: re.Match[str]) -> str:
                own = "reverse." if match[1] and match[2] in reverse else ""
                return f"friction.{own}{match[2]} = "

            names = "|".join(kind.constants())
            raise ValueError(re.sub(rf"\b(reverse\.)?({names}) = ", parameter, refusal))
        self._law = law
        return self

    def as_law(self) -> FrictionLaw:
        """Return the friction law in SI units."""
        return self._law

    def names(self) -> list[str]:
        """Return the names of the parameters that make the law.

        Constants of backward slip that are not given are none of them, and no constant at a default
        that simplifies the equations.
        """
        law = LAWS[self.law]
        described = constants_of(law)
        own = [
            name
            for name in law_parameters(law)
            if not (
                name in described
                and described[name].simplifies
                and getattr(self, name) == described[name].default
            )
        ]
        return [*own, *(f"reverse.{name}" for name in self._given(self.reverse))]

    def _given(self, group: "Friction | ReverseFriction") -> dict[str, Any]:
        """Return the values of a group for the parameters of the law, by name."""
        known = type(group).model_fields
        values = {
            name: getattr(group, name) for name in law_parameters(LAWS[self.law]) if name in known
        }
        return {name: value for name, value in values.items() if value not in ("", _AS_FORWARD)}

    def _constants(self, group: "Friction | ReverseFriction", prefix: str) -> dict[str, Any]:
        """Return the constants of the law that a group gives, those of a table from its file."""
        values = self._given(group)
        if "file" in values:
            path = values.pop("file")
            values["points"] = _points(path, f"{prefix}.file = {shown(path)} is refused")
        return values


def law_parameters(law: type[FrictionLaw]) -> list[str]:
    """Return the names of the parameters of a friction law, in the group `friction`."""
    if issubclass(law, Table):
        return ["file"]
    return [name for name in law.constants() if name in Friction.model_fields]


def _points(path: str, lead: str) -> Pairs:
    """Return the points of a table from its file; a refusal begins with `lead`."""
    try:
        points = read_pairs(path)
    except InvalidInputError as error:
        raise ValueError(f"{lead}: {error}") from None
    refusal = Table(points).refusal()
    if refusal is not None:
        raise ValueError(f"{lead}: {refusal}")
    return points


class Initial(ParameterGroup):
    """State of the slide at the first sample."""

    position: float = field(0.0, "Initial displacement of the slide.", "m")
    velocity: float = field(0.0, "Initial velocity of the slide.", "m/s")


class DisturbanceParameters(ParameterGroup):
    """Disturbance force on the slide that is part of the scenario."""

    kind: DisturbanceKind = field(
        DisturbanceKind.NONE,
        "Time course: none, step, impulse (one sample long) or sine.",
        choices=DisturbanceKind,
        strict=False,
    )
    amplitude: float = field(0.0, "Amplitude of the disturbance.", "N")
    start: float = field(
        0.0, "Simulated time at which the disturbance starts.", "s", ge=0.0, le=1e9
    )
    duration: float = field(
        float("inf"), "Duration of the disturbance.", "s", ge=0.0, allow_inf_nan=True
    )
    frequency: float = field(1.0, "Frequency of the sine.", "Hz", ge=SMALLEST, le=1e9)


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


class SensorParameters(_group_of(Sensor, Fixed.ACTIVE)):
    """Constants of the sensor."""


class ActuatorParameters(_group_of(Actuator, Fixed.NEVER)):
    """Constants of the actuator."""


class PlantParameters(NodeParameters):
    """Parameters of the plant node."""

    mass: float = field(1.0, "Mass of the slide.", "kg", ge=SMALLEST)
    damping: float = field(0.02, "Viscous damping of the transmission.", "N s/m", ge=0.0)
    stiffness: float = field(1.0, "Stiffness of the transmission.", "N/m", ge=SMALLEST)
    normal_force: float = field(
        1.0, "Force that presses the slide onto the belt.", "N", ge=SMALLEST
    )
    belt_speed: float = field(0.4, "Speed of the belt (feed speed), positive or negative.", "m/s")
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
    disturbance: DisturbanceParameters = DisturbanceParameters()
    if constants_of(Sensor):
        sensor: SensorParameters = SensorParameters()
    if constants_of(Actuator):
        actuator: ActuatorParameters = ActuatorParameters()

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

    @property
    def last_sample(self) -> int | None:
        """Number of the sample at which the plant pauses; None without `duration`."""
        samples = self.duration * self.rate
        return None if isinf(samples) else round(samples)

    def as_drive(self) -> Drive:
        """Return the drive."""
        values = {name: getattr(self, name) for name in _OF_DRIVE}
        return Drive(**values, friction=self.friction.as_law(), actuator=self.as_actuator())

    def as_actuator(self) -> Actuator:
        """Return the actuator."""
        return Actuator(**dict(getattr(self, "actuator", ())))

    def as_sensor(self) -> Sensor:
        """Return the sensor."""
        return Sensor(**dict(getattr(self, "sensor", ())))

    def drive_names(self) -> list[str]:
        """Return the flat names of the drive's parameters, with those of its friction law."""
        return [*_OF_DRIVE, "friction.law", *(f"friction.{name}" for name in self.friction.names())]

    def as_disturbance(self) -> Disturbance:
        """Return the disturbance of the scenario."""
        return Disturbance(**dict(self.disturbance))

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
            disturbance=self.as_disturbance(),
            sensor=self.as_sensor(),
            overtaken=overtaken,
            advance=advance,
        )


class ReferenceParameters(ParameterGroup):
    """Reference that the controller follows."""

    kind: ReferenceKind = field(
        ReferenceKind.NONE,
        "Source: none, the topic `reference`, or a time course (step, ramp, sine, trapezoid).",
        choices=ReferenceKind,
        strict=False,
        fixed=Fixed.CONFIGURED,
    )
    amplitude: float = field(0.0, "Largest displacement of the course.", "m")
    start: float = field(0.0, "Simulated time at which the course starts.", "s", ge=0.0, le=1e9)
    duration: float = field(
        float("inf"),
        "Duration of the course; of a ramp, the time of its rise.",
        "s",
        ge=0.0,
        allow_inf_nan=True,
    )
    frequency: float = field(
        1.0,
        "Frequency of the sine; one over the time of each rise and fall of the trapezoid.",
        "Hz",
        ge=SMALLEST,
        le=1e9,
    )

    @model_validator(mode="after")
    def _course_is_possible(self) -> Self:
        """Refuse constants that do not make a course, under their names as parameters."""
        refusal = ReferenceCourse(**dict(self)).refusal()
        if refusal is not None:
            raise ValueError(f"reference.{refusal}")
        return self


class ControllerParameters(NodeParameters):
    """Parameters of a controller node: those of its control law; see `controller_model`."""

    law: str = field(
        next(iter(CONTROL_LAWS)), "Control law.", fixed=Fixed.CONFIGURED, choices=CONTROL_LAWS
    )

    @model_validator(mode="after")
    def _constants_fit_together(self) -> Self:
        """Refuse constants that the law refuses."""
        refusal = self.as_law().refusal()
        if refusal is not None:
            raise ValueError(refusal)
        return self

    as_washout: ClassVar[Renamed] = Renamed("as_law")

    @property
    def node(self) -> str:
        """Name of the node and of its section."""
        return controller_node(self.law)

    def as_law(self) -> ControlLaw:
        """Return the control law with its constants."""
        known = type(self).model_fields
        law = CONTROL_LAWS[self.law]
        return law(**{name: getattr(self, name) for name in law.constants() if name in known})

    def as_reference(self) -> ReferenceCourse:
        """Return the reference; of kind NONE for a law that follows none."""
        given: ReferenceParameters | None = getattr(self, "reference", None)
        return ReferenceCourse() if given is None else ReferenceCourse(**dict(given))

    def as_controller(self, state: tuple[float, ...] | None = None) -> Controller:
        """Return the controller, with the state of its law at the first sample."""
        return Controller(self.as_law(), self.as_reference(), state)

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
            fields[name] = _field_of(described[name])
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
