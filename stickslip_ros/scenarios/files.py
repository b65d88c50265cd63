"""Scenarios: ROS parameter files, loaded by name or path, with overrides."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.installed_packages import prefixes
from stickslip_ros.physics.measures.cycle_measures import CycleMeter
from stickslip_ros.physics.measures.drift import resolved
from stickslip_ros.physics.measures.sample_meter import SampleAssumptions, varies
from stickslip_ros.physics.model.control import ControlLaw
from stickslip_ros.scenarios import DEFAULT_NAMESPACE, ros_yaml
from stickslip_ros.scenarios.foreign_laws import CONTROLLERS
from stickslip_ros.scenarios.keywords import described, in_own_unit, override, plain
from stickslip_ros.scenarios.parameters import (
    CONTROLLER_PARAMETERS,
    DEFAULT_LAW,
    NODE_PARAMETERS,
    AnalyzerParameters,
    ControllerParameters,
    PlantParameters,
    controller_node,
)
from stickslip_ros.scenarios.ros_yaml import PARAMETERS_KEY, LineError
from stickslip_ros.scenarios.sections import ScenarioFile, read_file
from stickslip_ros.tables import TextTable
from stickslip_ros.text import did_you_mean

FILE, BASE, OVERRIDE, DEFAULT = "file", "base", "override", "default"
"""Where the value of a parameter comes from."""

_NAMED_BY_PATH = "a file is given by its path ending in .yaml"


class SeveralControllersError(InvalidInputError):
    """A scenario file with sections for several controllers, loaded without the law to use."""

    def __init__(self, path: Path, laws: Sequence[str]) -> None:
        super().__init__(
            f"{path}: has sections for the controllers "
            f"{' and '.join(map(controller_node, laws))}: name the control law to use"
        )
        self.laws = laws
        """Names of the control laws."""


@dataclass(frozen=True, repr=False)
class Scenario:
    """The parameters of every node in one run, and their source.

    Create a scenario with `load_scenario`, and change it with `changed`.

    Examples
    --------
    >>> from stickslip_ros.scenarios.files import load_scenario
    >>> scenario = load_scenario("feed_drive", ["plant.belt_speed=0.03"])
    >>> scenario.plant.mass, scenario.plant.belt_speed
    (100.0, 0.03)
    >>> scenario.changed({"plant.damping": 200.0}).plant.damping
    200.0
    """

    name: str
    """Name of the scenario file without its ending."""
    overrides: tuple[str, ...]
    """Overrides, as NODE.PARAMETER=VALUE, that the values already contain."""
    plant: PlantParameters
    """Parameters of the plant node."""
    controller: ControllerParameters
    """Parameters of the controller node in use; also an attribute by the name of the node."""
    analyzer: AnalyzerParameters
    """Parameters of the analyzer node."""
    path: Path = field(compare=False)
    """The scenario file."""
    other_sections: tuple[str, ...] = ()
    """Sections of the file that match none of these nodes, such as that of a user's own node."""
    sources: Mapping[str, str] = field(default_factory=dict[str, str], compare=False, repr=False)
    """Source of each value, by NODE.PARAMETER: `FILE`, `BASE` or `OVERRIDE`; defaults are not
    listed."""
    other_controllers: Mapping[str, ControllerParameters] = field(
        default_factory=dict[str, ControllerParameters], compare=False, repr=False
    )
    """Parameters of other controllers that the file has sections for, by control law."""
    bases: tuple[Path, ...] = field(default=(), compare=False, repr=False)
    """The files that complete the scenario file, the nearest first."""

    def __getattr__(self, name: str) -> Any:
        controller = self.__dict__.get("controller")
        if controller is not None and name == controller.node:
            return controller
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    @property
    def control_law(self) -> ControlLaw | None:
        """Control law with its constants; None without control."""
        return self.controller.control_law if self.plant.expects_control else None

    @property
    def reading(self) -> SampleAssumptions:
        """How the samples of the plant are to be read."""
        plant = self.plant
        found = self.analyzer.reading_of(plant.flat(), plant.as_drive().fastest_belt)
        follows = plant.expects_control and varies(self.controller.flat())
        return found._replace(varies=found.varies or follows)

    def cycle_meter(self, cycles: int) -> CycleMeter:
        """Return what measures the motion itself.

        Parameters
        ----------
        cycles : int
            Number of the last cycles.
        """
        meter, reading = CycleMeter(cycles), self.reading
        meter.drift.resolution = step = self.plant.sensor.position_resolution
        meter.drift.judged = not reading.varies
        meter.within = max(resolved(step), reading.within)
        return meter

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes: plant, the controller in use, and analyzer."""
        return "plant", self.controller.node, "analyzer"

    @property
    def given(self) -> frozenset[str]:
        """NODE.PARAMETER of each parameter that the file, its base or an override sets."""
        return frozenset(name for name in self.sources if name.partition(".")[0] in self.nodes)

    @property
    def left_to_defaults(self) -> list[str]:
        """Parameters of drive, rate and controller left at their defaults, as NODE.PARAMETER."""
        names = [f"plant.{name}" for name in (*self.plant.drive_names(), "rate")]
        if self.plant.expects_control:
            names += self.controller_names
        return [name for name in names if name not in self.sources]

    @property
    def controller_names(self) -> list[str]:
        """Constants of the control law, as NODE.PARAMETER."""
        return [
            f"{self.controller.node}.{name}" for name in self.controller.control_law.constants()
        ]

    def as_dict(self) -> dict[str, dict[str, Any]]:
        """Return the parameters of every node.

        Returns
        -------
        dict[str, dict[str, Any]]
            Values by node and flat name, for example `["plant"]["friction.static"]`.
        """
        return {node: getattr(self, node).flat() for node in self.nodes}

    def provenance(self) -> dict[str, Any]:
        """Return what a result was made from, for its JSON: name, parameters and overrides."""
        return {
            "scenario": {"name": self.name, **self.as_dict()},
            "overrides": list(self.overrides),
        }

    def unused(self) -> dict[str, str]:
        """Return why parameters have no effect, by NODE.PARAMETER; defaults are not listed."""
        found = {
            f"{node}.{name}": f"{node}.{why}"
            for node in self.nodes
            for name, why in getattr(self, node).unused().items()
        }
        if not self.plant.expects_control:
            known = self.controller.known
            for name, value in self.controller.flat().items():
                if [value] != [known[name].default]:
                    name = f"{self.controller.node}.{name}"
                    found[name] = f"{name} is not used with plant.expects_control = False"
        return found

    def changed(self, values: Mapping[str, Any]) -> Self:
        """Return the scenario with other values of some parameters.

        Parameters
        ----------
        values : Mapping[str, Any]
            New values by NODE.PARAMETER, such as `{"plant.belt_speed": 0.03}`.

        Returns
        -------
        Scenario
            The changed copy.

        Raises
        ------
        InvalidInputError
            If a value is out of bounds or not compatible with the others.
        """
        return self._changed(values, {})

    def overridden(self, overrides: Sequence[str], values: Mapping[str, Any] | None = None) -> Self:
        """Return the scenario with further overrides.

        Parameters
        ----------
        overrides : Sequence[str]
            Texts NODE.PARAMETER=VALUE, the value written as in a scenario file.
        values : Mapping[str, Any], optional
            Further values by NODE.PARAMETER, which act after the texts.

        Returns
        -------
        Scenario
            The changed copy.

        Raises
        ------
        InvalidInputError
            If a name is unknown, a value is not allowed, or a parameter has no effect.
        """
        given: dict[str, Any] = {}
        for text in overrides:
            node, parameter, value = parse_override(text)
            given[f"{node}.{parameter}"] = value
        texts = [*overrides]
        for name, value in (values or {}).items():
            given[name] = in_own_unit(name, plain(value))
            texts.append(override(name, plain(value)))
        sources: dict[str, str] = {}
        for text in texts:
            node = text.partition(".")[0]
            sources[node] = f"{sources.get(node, f'{self.path} with')} {text:.80}"
        changed = self._changed(given, {node: f"{each}, {node}" for node, each in sources.items()})
        for reason in (why for name, why in changed.unused().items() if name in given):
            raise InvalidInputError(reason)
        last = {text.partition("=")[0]: text for text in (*self.overrides, *texts)}
        return replace(
            changed,
            overrides=tuple(last.values()),
            sources={**self.sources, **dict.fromkeys(given, OVERRIDE)},
        )

    def with_controller(self, law: str) -> Self:
        """Return the scenario with another controller.

        Parameters
        ----------
        law : str
            Name of the control law. Its parameters are those of the scenario file; the others have
            their defaults, except that a force limit follows.

        Returns
        -------
        Scenario
            The changed copy.

        Raises
        ------
        InvalidInputError
            If there is no control law of that name.
        """
        if known_law(law) == self.controller.law:
            return self
        others = {**self.other_controllers, self.controller.law: self.controller}
        controller = others.pop(law, None) or CONTROLLER_PARAMETERS[law]
        overrides = [
            each for each in self.overrides if not each.startswith(f"{self.controller.node}.")
        ]
        return replace(
            self,
            controller=controller,
            other_controllers=others,
            overrides=tuple(overrides),
        ).with_force_limit()

    def with_force_limit(self) -> Self:
        """Return the scenario with the force limit of another controller, unless it has its own."""
        own = f"{self.controller.node}.force_limit"
        for other in self.other_controllers.values():
            name = f"{other.node}.force_limit"
            if name in self.sources and own not in self.sources:
                sources = {**self.sources, own: self.sources[name]}
                return replace(self.changed({own: other.control_law.force_limit}), sources=sources)
        return self

    def _changed(self, values: Mapping[str, Any], sources: Mapping[str, str]) -> Self:
        """Return the scenario with other values; `sources` names their source by node."""
        by_node: dict[str, dict[str, Any]] = {}
        for target, value in values.items():
            node, _, parameter = target.partition(".")
            absolute = _absolute(node, parameter, value, Path())
            by_node.setdefault(node, {})[parameter] = absolute
        own = self.controller.node
        changes: dict[str, Any] = {}
        for node, new in by_node.items():
            if node not in self.nodes:
                raise InvalidInputError(
                    f"{node}: is not the controller in use, which is {self.controller.node}"
                )
            changed = getattr(self, node).changed(new, sources.get(node, node))
            changes["controller" if node == own else node] = changed
        return replace(self, **changes)

    def __repr__(self) -> str:
        return "\n".join(self._table().lines())

    def _repr_html_(self) -> str:
        return self._table().html()

    def _table(self) -> TextTable:
        """Return the parameters of the drive and its controller, and others that are given."""
        shown = [f"plant.{name}" for name in (*self.plant.drive_names(), "rate")]
        if self.plant.expects_control:
            shown += self.controller_names
        shown += sorted(self.given.difference(shown))
        dimensionless = self.plant.as_drive().is_dimensionless
        rows: list[list[str]] = []
        for full_name in shown:
            node, _, name = full_name.partition(".")
            value, known = self._flat[node][name], described(full_name)
            text = f"{value:.10g}" if isinstance(value, float) else str(value)
            text = known.unset if text == "nan" else text
            unit = "" if dimensionless else known.unit or ""
            note = "" if full_name in self.given else "default"
            rows.append([full_name, f"{text} {unit}".rstrip(), note])
        title = f"scenario {' '.join([self.name, *self.overrides])}"
        return TextTable(title, ["", "", ""], rows)

    @cached_property
    def _flat(self) -> dict[str, dict[str, Any]]:
        return self.as_dict()


def parameter_file(values: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the text of a ROS parameter file.

    Parameters
    ----------
    values : Mapping[str, Mapping[str, Any]]
        Values by node and flat name, as from `Scenario.as_dict`. Empty lists are omitted, because
        a parameter file cannot give their type.

    Returns
    -------
    str
        The text, in YAML.

    Examples
    --------
    >>> print(parameter_file({"plant": {"mass": 80.0, "pace": "realtime"}}))
    "/**/plant":
      "ros__parameters":
        "mass": 80.0
        "pace": "realtime"
    <BLANKLINE>
    """
    sections = {
        f"/**/{node}": {
            PARAMETERS_KEY: {name: value for name, value in parameters.items() if value != []}
        }
        for node, parameters in values.items()
    }
    return ros_yaml.dump(sections)


def load_scenario(
    name_or_path: str,
    overrides: Sequence[str] = (),
    namespace: str = DEFAULT_NAMESPACE,
    *,
    base: str | None = None,
    controller: str | None = None,
    other_nodes: bool = False,
) -> Scenario:
    """Load a scenario by its name in config/ or by its path.

    Parameters
    ----------
    name_or_path : str
        Name of a scenario that ships, or path of a ROS parameter file ending in `.yaml`.
    overrides : Sequence[str]
        Texts NODE.PARAMETER=VALUE that override the file; the value is written as in the file.
    namespace : str
        Namespace of the nodes. Sections of the file apply to it by the rules of ROS.
    base : str or None
        Name or path of the scenario that supplies the parameters that the file omits. By default
        it is the one that the file's own section `scenario` names; without a base these parameters
        have their defaults.
    controller : str or None
        Name of the control law in use. By default it is the one whose section the file has, or
        else its base, and the first of `CONTROL_LAWS` without such a section.
    other_nodes : bool
        Whether sections of unknown nodes are ignored instead of refused.

    Returns
    -------
    Scenario
        The validated parameters of every node.

    Raises
    ------
    InvalidInputError
        If the file cannot be read, or if a name is unknown or a value has the wrong type or is out
        of bounds.

    Examples
    --------
    >>> scenario = load_scenario("paper", ["plant.belt_speed=0.2"])
    >>> scenario.name, scenario.plant.belt_speed
    ('paper', 0.2)
    """
    path = _find(name_or_path)
    files = [read_file(path, namespace)]
    below = _path_of_base(files[0]) if base is None else _find(base)
    given = [path] if base is None else [path, below]
    while below is not None:
        if any(below.samefile(file.path) for file in files):
            raise InvalidInputError(f"{path}: base {below} leads back to itself")
        with _contents_kept(below, given):
            files.append(read_file(below, namespace))
            below = _path_of_base(files[-1])
    law = _law_in_use(files, namespace) if controller is None else known_law(controller)
    values: dict[str, dict[str, Any]] = {node: {} for node in NODE_PARAMETERS}
    sources: dict[str, str] = {}
    other_sections: list[str] = []
    for file in files[::-1]:
        with _contents_kept(file.path, given):
            found, other_sections = file.values(namespace, other_nodes=other_nodes)
            for node, name, value in found:
                values[node][name] = _absolute(node, name, value, file.path.parent)
                sources[f"{node}.{name}"] = FILE if file is files[0] else BASE
                if file.path not in given:
                    NODE_PARAMETERS[node].check_bounds(name, value)
    models: dict[str, Any] = {
        node: NODE_PARAMETERS[node].changed(parameters, f"{path}, {node}")
        for node, parameters in values.items()
        if parameters or node in ("plant", controller_node(law), "analyzer")
    }
    scenario = Scenario(
        name=path.stem,
        plant=models["plant"],
        controller=models[controller_node(law)],
        analyzer=models["analyzer"],
        overrides=(),
        path=path,
        other_sections=tuple(other_sections),
        sources=sources,
        other_controllers={
            other: models[controller_node(other)]
            for other in CONTROLLER_PARAMETERS
            if other != law and controller_node(other) in models
        },
        bases=tuple(file.path for file in files[1:]),
    )
    for name, why in scenario.unused().items():
        if name.startswith("plant.") and sources.get(name) == FILE:
            raise InvalidInputError(f"{path}: {why}")
    scenario = scenario if controller is None else scenario.with_force_limit()
    return scenario.overridden(overrides) if overrides else scenario


@contextmanager
def _contents_kept(path: Path, given: Sequence[Path | None]) -> Generator[None]:
    """Keep what is in a file out of messages unless it is `given`: another one may name any."""
    try:
        yield
    except InvalidInputError as error:
        if path in given:
            raise
        place = f" at line {error.line}" if isinstance(error, LineError) else ""
        raise InvalidInputError(
            f"base {path} of {given[0]} is refused{place}: must be a scenario file; "
            f"`stickslip simulate {path}` says why"
        ) from None


def _absolute(node: str, name: str, value: Any, folder: Path) -> Any:
    """Return a value; a path that is relative to a folder as an absolute one."""
    known = NODE_PARAMETERS[node].known
    is_path = name in known and known[name].file and value and isinstance(value, str)
    return str((folder / value).absolute()) if is_path else value


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


def _law_in_use(files: Sequence[ScenarioFile], namespace: str) -> str:
    """Return the control law that the nearest file with a section of a controller names."""
    for file in files:
        named = file.named_nodes(namespace)
        laws = [law for law in CONTROLLER_PARAMETERS if controller_node(law) in named]
        if len(laws) > 1:
            raise SeveralControllersError(file.path, laws)
        if laws:
            return laws[0]
    return DEFAULT_LAW


def config_directories() -> list[Path]:
    """Return the existing directories that contain the scenarios known by name."""
    installed = [prefix / "share/stickslip_ros/config" for prefix in prefixes()]
    source_tree = Path(__file__).parents[2] / "config"
    return [directory for directory in [source_tree, *installed] if directory.is_dir()]


def shipped_scenarios() -> dict[str, Path]:
    """Return the files of the scenarios that are found by name, by that name."""
    found = {path.stem: path for d in config_directories()[::-1] for path in d.glob("*.yaml")}
    return dict(sorted(found.items()))


def _find(name_or_path: str) -> Path:
    """Return the file of that path, or otherwise of that name, with or without .yaml."""
    path = Path(name_or_path)
    name = name_or_path.removesuffix(".yaml")
    given_as_file = "/" in name_or_path or name_or_path.endswith((".yaml", ".yml"))
    if given_as_file and path.exists():
        return path
    if "/" in name_or_path:
        raise InvalidInputError(f"no scenario file {name_or_path}")
    shipped = shipped_scenarios()
    if name in shipped:
        return shipped[name]
    missing, otherwise = f"no scenario file {name_or_path}", _NAMED_BY_PATH
    if not given_as_file:
        missing = f"unknown scenario {name_or_path!r}"
        otherwise = f"the known names are {', '.join(sorted(shipped))}; {_NAMED_BY_PATH}"
    raise InvalidInputError(f"{missing}; {did_you_mean(name, shipped, otherwise)}")


def _path_of_base(file: ScenarioFile) -> Path | None:
    """Return the path of the base that a file names; a path is relative to that file."""
    if file.base is None:
        return None
    beside = file.path.parent / file.base
    if beside.suffix in (".yaml", ".yml") and beside.exists():
        return beside
    try:
        return _find(file.base)
    except InvalidInputError as error:
        raise InvalidInputError(f"{file.path}: base: {error}") from None


def parse_override(text: str) -> tuple[str, str, Any]:
    """Return node, parameter and value of a text NODE.PARAMETER=VALUE.

    The value is not checked. Raises InvalidInputError for an unknown node or parameter.
    """
    target, equals, written = text.partition("=")
    node, _, parameter = target.partition(".")
    known = [f"{node}.{name}" for node, model in NODE_PARAMETERS.items() for name in model.known]
    given = f"{text:.80}"
    if equals and target in known:
        value = ros_yaml.parse(written, f"{given}: the value")
        return node, parameter, in_own_unit(target, value)
    if not equals or not parameter:
        meant = did_you_mean(target, known, "as in plant.belt_speed=0.2")
        raise InvalidInputError(f"{given}: must be NODE.PARAMETER=VALUE; {meant}")
    if node not in NODE_PARAMETERS:
        meant = did_you_mean(node, NODE_PARAMETERS)
        raise InvalidInputError(f"{given}: unknown node {node:.80}; {meant}")
    every = f"{node} has {', '.join(sorted(NODE_PARAMETERS[node].known))}"
    meant = did_you_mean(target, known, every)
    raise InvalidInputError(f"{given}: unknown parameter {parameter:.80}; {meant}")
