"""The parameters of each node, with unit, bounds, default and meaning.

ROS declarations, scenario files, overrides, messages and the documentation derive from these
models. The nested field `friction.static` is the ROS parameter of that name.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from math import inf
from typing import Any, Literal, Self, get_args

from typing_extensions import override

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.sample_assumptions import SampleAssumptions, reading_of
from stickslip_ros.model.constants import (
    Parameter,
    at_build,
    at_rest,
    constant,
    constants_of,
    parameters_of,
)
from stickslip_ros.model.control import CONTROL_LAWS, ControlLaw
from stickslip_ros.motion.controller import Controller
from stickslip_ros.record import ForceSource, TimeSource
from stickslip_ros.record.codec import FORCE_TYPES
from stickslip_ros.scenarios.foreign_laws import CONTROLLERS
from stickslip_ros.scenarios.parameter_group import SHORTEST_TIME, NodeParameters, numbered_force
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.scenarios.signal_parameters import ReferenceParameters
from stickslip_ros.text import did_you_mean

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
        1.0, "Longest wall time until a recorded message is on disk.", "s", at_least=SHORTEST_TIME
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
    force_number: int = numbered_force()

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
