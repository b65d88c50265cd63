"""Scenario files: ROS parameter files, found by name or path and loaded with their bases."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.installed_packages import prefixes
from stickslip_ros.scenarios import DEFAULT_NAMESPACE, ros_yaml
from stickslip_ros.scenarios.parameters import (
    CONTROLLER_PARAMETERS,
    DEFAULT_LAW,
    NODE_PARAMETERS,
    controller_node,
    known_law,
)
from stickslip_ros.scenarios.ros_yaml import PARAMETERS_KEY, LineError
from stickslip_ros.scenarios.scenario import BASE, FILE, Scenario
from stickslip_ros.scenarios.sections import ScenarioFile, read_file
from stickslip_ros.text import did_you_mean

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
    given = [path] if base is None else [path, _find(base)]
    files = _with_bases(read_file(path, namespace), given, namespace)
    law = _law_in_use(files, namespace) if controller is None else known_law(controller)
    scenario = _completed(files, given, law, namespace, other_nodes=other_nodes)
    scenario = scenario if controller is None else scenario.with_force_limit()
    return scenario.overridden(overrides) if overrides else scenario


def _completed(
    files: Sequence[ScenarioFile],
    given: Sequence[Path],
    law: str,
    namespace: str,
    *,
    other_nodes: bool,
) -> Scenario:
    """Return what a file and its bases say together, with the controller of a law."""
    path = files[0].path
    values: dict[str, dict[str, Any]] = {node: {} for node in NODE_PARAMETERS}
    sources: dict[str, str] = {}
    paths: dict[str, Path] = {}
    other_sections: list[str] = []
    for file in reversed(files):
        with _contents_kept(file.path, given):
            entries, other_sections = file.values(namespace, other_nodes=other_nodes)
            for node, name, value in entries:
                values[node][name] = NODE_PARAMETERS[node].absolute(name, value, file.path.parent)
                sources[f"{node}.{name}"] = FILE if file is files[0] else BASE
                paths[f"{node}.{name}"] = file.path
                if file.path not in given:
                    NODE_PARAMETERS[node].check_bounds(name, value)
    models: dict[str, Any] = {
        node: NODE_PARAMETERS[node].changed(parameters, f"{path}, {node}")
        for node, parameters in values.items()
        if parameters or node in ("plant", controller_node(law), "analyzer")
    }
    controllers = {
        other: models[controller_node(other)]
        for other in CONTROLLER_PARAMETERS
        if controller_node(other) in models
    }
    scenario = Scenario(
        name=path.stem,
        plant=models["plant"],
        controller=controllers.pop(law),
        analyzer=models["analyzer"],
        overrides=(),
        path=path,
        other_sections=tuple(other_sections),
        sources=sources,
        files=paths,
        other_controllers=controllers,
        fit=next((file.fit for file in files if file.fit), {}),
        bases=tuple(file.path for file in files[1:]),
    )
    for name, why in scenario.unused().items():
        if name.startswith("plant.") and sources.get(name) == FILE:
            raise InvalidInputError(f"{path}: {why}")
    return scenario


def _with_bases(
    file: ScenarioFile, given: Sequence[Path], namespace: str
) -> Sequence[ScenarioFile]:
    """Return a file and its bases; `given` has its path, and that of a base given beside it."""
    files = [file]
    below = given[1] if len(given) > 1 else _path_of_base(file)
    while below is not None:
        if any(below.samefile(other.path) for other in files):
            raise InvalidInputError(f"{file.path}: base {below} leads back to itself")
        with _contents_kept(below, given):
            files.append(read_file(below, namespace))
            below = _path_of_base(files[-1])
    return files


@contextmanager
def _contents_kept(path: Path, given: Sequence[Path]) -> Generator[None]:
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


def shipped_scenarios() -> dict[str, Path]:
    """Return the files of the scenarios that are found by name, by that name."""
    installed = [prefix / "share/stickslip_ros/config" for prefix in prefixes()]
    folders = [Path(__file__).parents[2] / "config", *installed]
    shipped = {path.stem: path for folder in folders[::-1] for path in folder.glob("*.yaml")}
    return dict(sorted(shipped.items()))


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


def parameter_file(values: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the text of a ROS parameter file.

    Parameters
    ----------
    values : Mapping[str, Mapping[str, Any]]
        Values by node and flat name, as from `Scenario.as_dict`. Empty lists are omitted, because
        a parameter file cannot give their type.
    """
    sections = {
        f"/**/{node}": {
            PARAMETERS_KEY: {name: value for name, value in parameters.items() if value != []}
        }
        for node, parameters in values.items()
    }
    return ros_yaml.dump(sections)
