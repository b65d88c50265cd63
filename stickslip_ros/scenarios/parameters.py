"""The parameters of each node: name, unit, bounds, default and meaning stand here once.

ROS declarations, scenario files, overrides, messages and the documentation derive from these
models. A nested field `friction.static` is the ROS parameter of that name.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from enum import StrEnum
from functools import cache
from math import inf, isinf, pi, sqrt
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.loop.washout import WashoutParameters
from stickslip_ros.physics.model.disturbance import Disturbance, DisturbanceKind
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import LAWS, FrictionLaw
from stickslip_ros.text import did_you_mean, shown


class Pace(StrEnum):
    """What the plant waits for between samples: the clock, or the answer to the last one."""

    REALTIME = "realtime"
    LOCKSTEP = "lockstep"


class Fixed(StrEnum):
    """From which state of the node on a parameter cannot be changed."""

    NEVER = ""
    ACTIVE = "active"
    CONFIGURED = "configured"

    @property
    def changes(self) -> str:
        """When it can be changed, in words."""
        return {"": "at any time", "active": "while inactive", "configured": "before configured"}[
            self
        ]


_SMALLEST, _LARGEST = 1e-30, 1e30
"""Magnitudes, in SI units, between which no product or power in the physics overflows."""
_SHORTEST = 1e-3
"""Shortest time, s, that a node looks at the clock for."""


def _field(
    default: Any,
    meaning: str,
    unit: str | None = None,
    *,
    fixed: Fixed = Fixed.NEVER,
    choices: Iterable[str] = (),
    **bounds: Any,
) -> Any:
    """Describe a parameter."""
    extra: Any = {"unit": unit, "fixed": fixed, "choices": tuple(choices)}
    if isinstance(default, float) and "allow_inf_nan" not in bounds:
        bounds = {"ge": -_LARGEST, "le": _LARGEST} | bounds
    return Field(default, description=meaning, json_schema_extra=extra, **bounds)


_NAME = "[A-Za-z_][A-Za-z0-9_]*"
_NODE_NAME = re.compile(f"/?({_NAME}/)*{_NAME}")


def _known_law(name: str) -> str:
    if name not in LAWS:
        raise ValueError(f"no law {name}")
    return name


class _Model(BaseModel):
    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_default=True
    )


class Friction(_Model):
    """Friction law and its coefficients; a law uses those that its formula names."""

    law: Annotated[str, AfterValidator(_known_law)] = _field(
        "stribeck", "Friction law.", choices=LAWS
    )
    static: float = _field(0.4, "Static (break-away) coefficient mu_s.", ge=0.0)
    minimum: float = _field(0.25, "Smallest kinetic coefficient mu_m (stribeck).", ge=0.0)
    minimum_speed: float = _field(
        0.5, "Relative speed v_m of the smallest coefficient (stribeck).", "m/s", ge=_SMALLEST
    )
    slope: float = _field(0.45, "Fall of the coefficient with relative speed (linear).", "s/m")
    kinetic: float = _field(0.25, "Kinetic coefficient mu_k (exponential).", ge=0.0)
    decay_speed: float = _field(
        0.5,
        "Speed v_s over which the static coefficient decays (exponential).",
        "m/s",
        ge=_SMALLEST,
    )
    viscous: float = _field(0.0, "Rise of the coefficient with speed (exponential).", "s/m")

    @model_validator(mode="after")
    def _static_is_largest(self) -> Self:
        """Refuse a kinetic coefficient of the law in use that is above the static one."""
        for lower in ("minimum", "kinetic"):
            if lower in LAWS[self.law].constants() and getattr(self, lower) > self.static:
                raise ValueError(
                    f"friction.{lower} = {getattr(self, lower)} must not exceed "
                    f"friction.static = {self.static}"
                )
        return self

    def as_law(self) -> FrictionLaw:
        """Return the friction law in SI units."""
        law = LAWS[self.law]
        return law(*[getattr(self, name) for name in law.constants()])


class Initial(_Model):
    """State of the slide at the first sample."""

    position: float = _field(0.0, "Displacement of the slide at the start.", "m")
    velocity: float = _field(0.0, "Velocity of the slide at the start.", "m/s")


class DisturbanceParameters(_Model):
    """A disturbance force on the slide that is part of the scenario."""

    kind: DisturbanceKind = _field(
        DisturbanceKind.NONE,
        "Time course: none, step, impulse (one sample long) or sine.",
        choices=DisturbanceKind,
        strict=False,
    )
    amplitude: float = _field(0.0, "Amplitude of the disturbance.", "N")
    start: float = _field(0.0, "Simulated time at which it starts.", "s", ge=0.0, le=1e9)
    duration: float = _field(float("inf"), "How long it lasts.", "s", ge=0.0, allow_inf_nan=True)
    frequency: float = _field(1.0, "Frequency of the sine.", "Hz", ge=_SMALLEST, le=1e9)


class NodeParameters(_Model):
    """Parameters that every node has."""

    autostart: bool = _field(True, "Configure and activate at start.", fixed=Fixed.ACTIVE)
    wait_for: list[str] = _field(
        [],
        "Nodes that must be there to read what this one writes before it is activated.",
        fixed=Fixed.ACTIVE,
    )
    use_sim_time: bool = _field(False, "Let ROS time follow /clock.")

    @model_validator(mode="after")
    def _names_are_possible(self) -> Self:
        """Refuse to wait for a node of a name that none can have."""
        if not all(_NODE_NAME.fullmatch(name) for name in self.wait_for):
            message = (
                f"wait_for = {shown(self.wait_for)} is refused: must be names of nodes, "
                "of letters, digits and _, not beginning with a digit"
            )
            raise ValueError(message)
        return self

    @classmethod
    def validated(cls, values: Mapping[str, Any], source: str) -> Self:
        """Return the parameters given by their flat names, the rest at their defaults.

        Raises InvalidInputError naming `source`, parameter, value and what is allowed.
        """
        known = known_parameters(cls)
        for name, value in values.items():
            if name not in known:
                raise InvalidInputError(
                    f"{source}: unknown parameter {name:.80} = {shown(value)}; "
                    f"{did_you_mean(name, known)}"
                )
        try:
            return cls.model_validate(_nested(values))
        except ValidationError as error:
            raise InvalidInputError(f"{source}: {_explain(cls, error, values)}") from None

    @classmethod
    def check_bounds(cls, name: str, value: Any) -> None:
        """Refuse a value that is out of its bounds whatever the other parameters are.

        Raises InvalidInputError naming parameter, value and what is allowed.
        """
        try:
            cls.model_validate(_nested({name: value}))
        except ValidationError as error:
            if any(".".join(map(str, detail["loc"])) == name for detail in error.errors()):
                raise InvalidInputError(_explain(cls, error, {name: value})) from None

    def flat(self) -> dict[str, Any]:
        """Return the values by their flat names, as plain Python types."""
        return dict(_flat(self.model_dump(mode="python")))


class PlantParameters(NodeParameters):
    """Parameters of the plant node."""

    mass: float = _field(1.0, "Mass of the slide.", "kg", ge=_SMALLEST)
    damping: float = _field(0.02, "Viscous damping of the transmission.", "N s/m", ge=0.0)
    stiffness: float = _field(1.0, "Stiffness of the transmission.", "N/m", ge=_SMALLEST)
    normal_force: float = _field(1.0, "Force pressing slide and belt together.", "N", ge=_SMALLEST)
    belt_speed: float = _field(0.4, "Speed of the belt (feed speed), of either sign.", "m/s")
    friction: Friction = Friction()
    initial: Initial = Initial()
    rate: float = _field(100.0, "Samples per second.", "Hz", fixed=Fixed.ACTIVE, ge=1e-6, le=1e9)
    pace: Pace = _field(
        Pace.LOCKSTEP,
        "Whether the plant keeps to the clock or waits for the answer to each sample.",
        choices=Pace,
        strict=False,
        fixed=Fixed.ACTIVE,
    )
    real_time_factor: float = _field(
        1.0, "Simulated over wall time in pace realtime.", fixed=Fixed.ACTIVE, ge=_SMALLEST
    )
    force_delay: float = _field(
        0.0, "Delay from a sample to the start of its force.", "s", fixed=Fixed.ACTIVE, ge=0.0
    )
    force_jitter: float = _field(
        0.0, "Largest random addition to the delay of each force.", "s", fixed=Fixed.ACTIVE, ge=0.0
    )
    force_jitter_seed: int = _field(
        0, "What the random additions follow from.", fixed=Fixed.ACTIVE, ge=0, le=1_000_000_000
    )
    force_timeout: float = _field(
        0.1, "Age up to which a force is held on in pace realtime.", "s", fixed=Fixed.ACTIVE, ge=0.0
    )
    reply_timeout: float = _field(
        10.0,
        "Wall time that lockstep waits for a force or a reader.",
        "s",
        fixed=Fixed.ACTIVE,
        ge=_SHORTEST,
    )
    expects_control: bool = _field(True, "Whether a controller is to answer.", fixed=Fixed.ACTIVE)
    flow_window: int = _field(
        1000,
        "Samples by which lockstep may run ahead of the recorder.",
        "samples",
        fixed=Fixed.ACTIVE,
        ge=200,
        le=4_000,
    )
    duration: float = _field(
        float("inf"),
        "Simulated time after which the plant pauses by itself.",
        "s",
        fixed=Fixed.ACTIVE,
        ge=0.0,
        allow_inf_nan=True,
    )
    publish_clock: bool = _field(False, "Publish simulated time on /clock.", fixed=Fixed.CONFIGURED)
    disturbance: DisturbanceParameters = DisturbanceParameters()

    @model_validator(mode="after")
    def _delay_is_bounded(self) -> Self:
        """Refuse a delay that would keep more than a million forces waiting."""
        if (self.force_delay + self.force_jitter) * self.rate > 1e6:
            message = (
                f"force_delay = {self.force_delay} s and force_jitter = {self.force_jitter} s "
                "must not exceed 1e6 periods of rate together"
            )
            raise ValueError(message)
        return self

    @model_validator(mode="after")
    def _samples_are_short(self) -> Self:
        """Refuse a period of samples that holds more than a thousand natural ones."""
        natural = sqrt(self.stiffness / self.mass) / (2.0 * pi)
        if self.rate < natural / 1000.0:
            raise ValueError(
                f"rate = {self.rate} Hz must be at least a thousandth of the natural frequency, "
                f"{natural:g} Hz with mass = {self.mass} kg and stiffness = {self.stiffness} N/m"
            )
        return self

    @property
    def last_sample(self) -> int | None:
        """Number of the sample with which the plant pauses by itself, if it does."""
        samples = self.duration * self.rate
        return None if isinf(samples) else round(samples)

    def as_drive(self) -> Drive:
        """Return the drive."""
        return Drive(
            mass=self.mass,
            damping=self.damping,
            stiffness=self.stiffness,
            normal_force=self.normal_force,
            belt_speed=self.belt_speed,
            friction=self.friction.as_law(),
        )

    def drive_names(self) -> list[str]:
        """Return the flat names of what makes the drive: those that its friction law uses, too."""
        constants = LAWS[self.friction.law].constants()
        return [
            *(each.name for each in fields(Drive) if each.name != "friction"),
            "friction.law",
            *(f"friction.{name}" for name in constants),
        ]

    def as_disturbance(self) -> Disturbance:
        """Return the disturbance of the scenario."""
        return Disturbance(**dict(self.disturbance))


class WashoutControllerParameters(NodeParameters):
    """Parameters of the washout controller node."""

    corner_frequency: float = _field(
        2.0, "Corner frequency d of the filter.", "rad/s", ge=_SMALLEST
    )
    linear_gain: float = _field(-1.0, "Linear gain k1; negative takes energy out.", "N s/m")
    cubic_gain: float = _field(-1.0, "Cubic gain k2.", "N s^3/m^3")
    force_limit: float = _field(
        float("inf"), "Largest magnitude of the force.", "N", ge=0.0, allow_inf_nan=True
    )
    start_after: float = _field(
        0.0, "Time from the first sample during which the force is zero.", "s", ge=0.0
    )

    def as_washout(self) -> WashoutParameters:
        """Return the constants of the control law."""
        return WashoutParameters(**{name: getattr(self, name) for name in self.law_names()})

    @classmethod
    def law_names(cls) -> list[str]:
        """Return the names of the constants of the control law."""
        return [name for name in cls.model_fields if name not in NodeParameters.model_fields]


class AnalyzerParameters(NodeParameters):
    """Parameters of the analyzer node."""

    bag: str = _field("", "Directory to record to; empty: none.", fixed=Fixed.ACTIVE)
    window: int = _field(
        20, "Cycles to average over.", "cycles", fixed=Fixed.ACTIVE, ge=1, le=100_000
    )
    flush_period: float = _field(
        1.0,
        "Wall time after which what was recorded is on disk.",
        "s",
        fixed=Fixed.CONFIGURED,
        ge=_SHORTEST,
    )
    max_bag_size: int = _field(
        0,
        "Size from which on a bag goes on in a further file; 0: any.",
        "bytes",
        fixed=Fixed.ACTIVE,
        ge=0,
        le=2**62,
    )
    max_bag_duration: float = _field(
        0.0,
        "Time between stamps beyond which a bag goes on in a further file; 0: any.",
        "s",
        fixed=Fixed.ACTIVE,
        ge=0.0,
        le=1e9,
    )
    compression: Literal["lz4", "zstd", "none"] = _field(
        "lz4", "Compression of the bag.", fixed=Fixed.ACTIVE, choices=("lz4", "zstd", "none")
    )


class ReplayParameters(NodeParameters):
    """Parameters of the replay node, which is part of no scenario."""

    bag: str = _field(
        "", "Bag to replay: its directory, or one of its files.", fixed=Fixed.CONFIGURED
    )
    rate: float = _field(1.0, "Recorded time over wall time.", fixed=Fixed.ACTIVE, ge=_SMALLEST)
    loop: bool = _field(False, "Begin anew at the end of the bag.", fixed=Fixed.ACTIVE)
    start: float = _field(
        0.0,
        "Recorded time, from the bag's first message on, to begin at.",
        "s",
        fixed=Fixed.CONFIGURED,
        ge=0.0,
        le=1e10,
    )
    duration: float = _field(
        float("inf"),
        "Recorded time to replay.",
        "s",
        fixed=Fixed.CONFIGURED,
        ge=_SMALLEST,
        allow_inf_nan=True,
    )
    topics: list[str] = _field(
        [], "Topics to replay; none: all of the bag.", fixed=Fixed.CONFIGURED
    )
    clock: bool = _field(False, "Publish recorded time on /clock.", fixed=Fixed.CONFIGURED)


NODE_PARAMETERS: dict[str, type[NodeParameters]] = {
    "plant": PlantParameters,
    "washout_controller": WashoutControllerParameters,
    "analyzer": AnalyzerParameters,
}
"""The parameter model of every node by the node's name."""


@dataclass(frozen=True)
class Parameter:
    """What is known of one parameter."""

    name: str
    """Flat name, such as friction.static."""
    kind: type
    """bool, int, float, str or list (of str)."""
    default: Any
    unit: str | None
    meaning: str
    fixed: Fixed
    choices: tuple[str, ...]
    """What a parameter of kind str may be; empty: anything."""
    bounds: str
    """What is allowed, in words, but for limits that only a mistake meets; empty: anything."""
    limits: str
    """What is allowed, with those."""
    finite: bool
    """Whether a number must be finite."""
    range: tuple[float, float] | None
    """Least and largest value of a number, if it has both and they are not those of any."""


def parameters_of(model: type[BaseModel], prefix: str = "") -> Iterator[Parameter]:
    """Yield the parameters of a node's model in the order of their definition."""
    for name, field in model.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from parameters_of(kind, f"{prefix}{name}.")
        else:
            yield _parameter(prefix + name, field)


def _parameter(name: str, field: FieldInfo) -> Parameter:
    extra: Any = field.json_schema_extra
    choices = tuple(str(choice) for choice in extra["choices"])
    kind: Any = str if choices else field.annotation
    if kind == list[str]:
        kind = list
    return Parameter(
        name=name,
        kind=kind,
        default=str(field.default) if kind is str else field.default,
        unit=extra["unit"],
        meaning=field.description or "",
        fixed=extra["fixed"],
        choices=choices,
        bounds=_bounds(field, choices, told=True),
        limits=_bounds(field, choices, told=False),
        finite=not any(
            getattr(constraint, "allow_inf_nan", False) for constraint in field.metadata
        ),
        range=_range(field),
    )


@cache
def known_parameters(model: type[BaseModel]) -> Mapping[str, Parameter]:
    """Return the parameters of a node's model by their flat names."""
    return {parameter.name: parameter for parameter in parameters_of(model)}


_COMPARISONS = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}


_NOT_TOLD = {("at least", -_LARGEST), ("at most", _LARGEST), ("at most", 2**62)}


def _limits(field: FieldInfo) -> Iterator[tuple[str, Any]]:
    """Yield the comparisons with what bounds a number, and that."""
    for constraint in field.metadata:
        for name in _COMPARISONS:
            if hasattr(constraint, name):
                yield name, getattr(constraint, name)


def _range(field: FieldInfo) -> tuple[float, float] | None:
    limits = {name[0]: limit for name, limit in _limits(field)}
    if len(limits) < 2 or limits == {"g": -_LARGEST, "l": _LARGEST}:
        return None
    return limits["g"], limits["l"]


def _bounds(field: FieldInfo, choices: tuple[str, ...], *, told: bool) -> str:
    if choices:
        return "one of " + ", ".join(choices)
    limits = [(_COMPARISONS[name], limit) for name, limit in _limits(field)]
    if told:
        limits = [
            ("above", 0) if limit == ("at least", _SMALLEST) else limit
            for limit in limits
            if limit not in _NOT_TOLD
        ]
    return " and ".join(
        f"{words} {limit:g}" if isinstance(limit, float) else f"{words} {limit}"
        for words, limit in limits
    )


def _is_extreme(value: Any) -> bool:
    """Return whether a number is beyond limits that are not told otherwise."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and (_LARGEST < abs(value) < inf or 0 < value < _SMALLEST)


def _nested(values: Mapping[str, Any]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for name, value in values.items():
        group, _, rest = name.rpartition(".")
        (nested.setdefault(group, {}) if group else nested)[rest] = value
    return nested


def _flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield prefix + name, str(value) if isinstance(value, StrEnum) else value


_KIND_NAMES = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a string",
    list: "a list of strings",
}


def _explain(model: type[BaseModel], error: ValidationError, values: Mapping[str, Any]) -> str:
    """Return in one line which values are refused, and what is allowed."""
    known = known_parameters(model)
    complaints: list[str] = []
    for detail in error.errors():
        place = [part for part in detail["loc"] if isinstance(part, str)]
        name = ".".join(place)
        if name not in known:
            complaints.append(detail["msg"].removeprefix("Value error, "))
            continue
        parameter = known[name]
        allowed = _KIND_NAMES[parameter.kind]
        if parameter.kind is float and parameter.finite:
            allowed = "a finite number"
        value = values.get(name, detail["input"])
        bounds = parameter.limits if _is_extreme(value) else parameter.bounds
        if bounds:
            allowed = bounds if parameter.choices else f"{allowed} {bounds}"
        unit = f"{'' if bounds else ' in'} {parameter.unit}" if parameter.unit else ""
        text = ", not text" if isinstance(value, str) and parameter.kind is not str else ""
        complaints.append(f"{name} = {shown(value)} is refused: must be {allowed}{unit}{text}")
    return "; ".join(complaints)
