"""Scenarios: ROS parameter files, found by name or path, with overrides."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from pathlib import Path
from sys import float_info
from typing import Any, ClassVar, NamedTuple, Self, cast

import yaml

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.installed import prefixes
from stickslip_ros.scenarios.parameters import (
    NODE_PARAMETERS,
    AnalyzerParameters,
    NodeParameters,
    PlantParameters,
    WashoutControllerParameters,
    parameters_of,
)
from stickslip_ros.text import did_you_mean, shown

DEFAULT_NAMESPACE = "/feed_drive"
LONGEST_NAMESPACE = 200
"""Characters with which the names of all topics and services are short enough for ROS."""

_PARAMETERS_KEY = "ros__parameters"
_LARGEST = 1_000_000
"""Characters of a scenario file."""
_SCENARIO = "scenario"
"""Last part of the name of the section that is for no node, but says what completes the file."""
_NAMED_BY_PATH = "a file is given by its path ending in .yaml"


@dataclass(frozen=True)
class Scenario:
    """What one run is made of: the parameters of every node, and where they come from."""

    name: str
    overrides: tuple[str, ...]
    plant: PlantParameters
    washout_controller: WashoutControllerParameters
    analyzer: AnalyzerParameters
    path: Path = field(compare=False)
    """The scenario file."""
    other_sections: tuple[str, ...] = ()
    """Sections of the file that match none of these nodes: parameters of a user's own node."""
    given: frozenset[str] = field(default=frozenset(), compare=False, repr=False)
    """NODE.PARAMETER of what the file, its base or an override gives."""

    @property
    def left_to_defaults(self) -> list[str]:
        """NODE.PARAMETER of the drive, its rate and its washout controller that nothing gives."""
        names = [f"plant.{name}" for name in (*self.plant.drive_names(), "rate")]
        if self.plant.expects_control:
            names += [f"washout_controller.{name}" for name in self.washout_controller.law_names()]
        return [name for name in names if name not in self.given]

    def as_dict(self) -> dict[str, dict[str, Any]]:
        """Return every node's parameters by node and flat name."""
        return {node: parameters.flat() for node, parameters in self._nodes()}

    def changed(self, values: Mapping[str, Any]) -> Self:
        """Return the scenario with other values of parameters, by NODE.PARAMETER.

        Raises InvalidInputError for what is out of bounds, or does not go with the rest.
        """
        by_node: dict[str, dict[str, Any]] = {}
        for target, value in values.items():
            node, _, parameter = target.partition(".")
            by_node.setdefault(node, {})[parameter] = value
        changes: dict[str, Any] = {
            node: NODE_PARAMETERS[node].validated({**self._flat[node], **new}, node)
            for node, new in by_node.items()
        }
        return replace(self, **changes)

    @cached_property
    def _flat(self) -> dict[str, dict[str, Any]]:
        return self.as_dict()

    def _nodes(self) -> Iterator[tuple[str, NodeParameters]]:
        for node in NODE_PARAMETERS:
            yield node, getattr(self, node)


def parameter_file(values: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the text of a ROS parameter file with those values by node and flat name.

    Empty lists are left out: a parameter file cannot say of what type they are.
    """
    sections = {
        f"/**/{node}": {
            _PARAMETERS_KEY: {name: value for name, value in parameters.items() if value != []}
        }
        for node, parameters in values.items()
    }
    return yaml.dump(sections, Dumper=_QuotingDumper, sort_keys=False)


def load_scenario(
    name_or_path: str,
    overrides: Sequence[str] = (),
    namespace: str = DEFAULT_NAMESPACE,
    *,
    base: str | None = None,
    other_nodes: bool = False,
) -> Scenario:
    """Load the scenario of that name in config/, or of that path.

    What it leaves out is that of the scenario `base`, by default the one that its own section
    `scenario` names; without one the parameters' defaults act. `overrides` are texts
    NODE.PARAMETER=VALUE, the value written as in the file. Sections apply to the nodes in
    `namespace` as ROS applies them. Raises InvalidInputError for anything unknown, ill-typed or out
    of bounds; with `other_nodes`, sections of unknown nodes are left alone.
    """
    path = _find(name_or_path)
    files = [_read(path, namespace, other_nodes=other_nodes)]
    below = _path_of_base(files[0]) if base is None else _find(base)
    while below is not None:
        if any(below.samefile(file.path) for file in files):
            raise InvalidInputError(f"{path}: base {below} is a file that it completes")
        files.append(_read(below, namespace, other_nodes=other_nodes))
        below = _path_of_base(files[-1])
    values: dict[str, dict[str, Any]] = {
        node: {name: value for file in files[::-1] for name, value in file.values[node].items()}
        for node in NODE_PARAMETERS
    }
    for node, parameters in values.items():
        NODE_PARAMETERS[node].validated(parameters, f"{path}, {node}")
    given = dict.fromkeys(NODE_PARAMETERS, "")
    for override in overrides:
        node, parameter, value = _parse_override(override)
        values[node][parameter] = value
        given[node] += f" -p {override:.80}"
    models: dict[str, Any] = {
        node: NODE_PARAMETERS[node].validated(
            parameters, f"{path} with{given[node]}, {node}" if given[node] else f"{path}, {node}"
        )
        for node, parameters in values.items()
    }
    return Scenario(
        name=path.stem,
        overrides=tuple(overrides),
        path=path,
        other_sections=tuple(files[0].other_sections),
        given=frozenset(f"{node}.{name}" for node in values for name in values[node]),
        **models,
    )


def number_in(text: str) -> float | None:
    """Return the number that a text is to ROS, None if it is none."""
    value = yaml.load(text, Loader=_RosLoader) if _NUMBER.fullmatch(text) else None
    return value if isinstance(value, int | float) else None


def section_matches(pattern: str, node: str) -> bool:
    """Return whether a section applies to the node of that full name, as ROS has it."""
    tokens = {"**": r"(/\w+)*", "*": r"/\w+"}
    expression = "".join(tokens.get(t, "/" + re.escape(t)) for t in pattern.split("/")[1:])
    return re.fullmatch(expression, node) is not None


def config_directories() -> list[Path]:
    """Return the existing directories in which scenarios are found by name."""
    installed = [prefix / "share/stickslip_ros/config" for prefix in prefixes()]
    source_tree = Path(__file__).parents[2] / "config"
    return [directory for directory in [source_tree, *installed] if directory.is_dir()]


def _find(name_or_path: str) -> Path:
    """Return the file of that path, or else of that name, with or without .yaml."""
    path = Path(name_or_path)
    name = name_or_path.removesuffix(".yaml")
    given_as_file = "/" in name_or_path or name_or_path.endswith((".yaml", ".yml"))
    if given_as_file and path.is_file():
        return path
    if "/" in name_or_path:
        raise InvalidInputError(f"no scenario file {name_or_path}")
    shipped = {path.stem: path for d in config_directories()[::-1] for path in d.glob("*.yaml")}
    if name in shipped:
        return shipped[name]
    if given_as_file:
        raise InvalidInputError(
            f"no scenario file {name_or_path}; {did_you_mean(name, shipped, _NAMED_BY_PATH)}"
        )
    every = f"known by name are {', '.join(sorted(shipped))}; {_NAMED_BY_PATH}"
    raise InvalidInputError(
        f"unknown scenario {name_or_path!r}; {did_you_mean(name, shipped, every)}"
    )


class _File(NamedTuple):
    """What a scenario file says."""

    path: Path
    values: dict[str, dict[str, Any]]
    """By node and flat name."""
    other_sections: list[str]
    base: str | None


def _path_of_base(file: _File) -> Path | None:
    """Return the path of the base that a file names; a path is relative to that file."""
    if file.base is None:
        return None
    beside = file.path.parent / file.base
    if beside.suffix in (".yaml", ".yml") and beside.is_file():
        return beside
    try:
        return _find(file.base)
    except InvalidInputError as error:
        raise InvalidInputError(f"{file.path}: base: {error}") from None


def _read(path: Path, namespace: str, *, other_nodes: bool) -> _File:
    values: dict[str, dict[str, Any]] = {node: {} for node in NODE_PARAMETERS}
    other_sections: list[str] = []
    base: str | None = None
    for pattern, parameters in _sections(path):
        own = section_matches(pattern, f"{namespace.rstrip('/')}/{_SCENARIO}")
        if own and pattern.endswith(f"/{_SCENARIO}"):
            base = _base_of(path, pattern, parameters)
        elif other_nodes and not _matching(pattern, namespace):
            other_sections.append(pattern)
        else:
            _apply(values, path, pattern, parameters, namespace)
    return _File(path, values, other_sections, base)


def _base_of(path: Path, pattern: str, parameters: Mapping[str, Any]) -> str:
    for name in parameters:
        if name != "base":
            raise InvalidInputError(
                f"{path}: section {pattern}: unknown parameter {name:.80}; known is base"
            )
    base = parameters.get("base")
    if not isinstance(base, str) or not base:
        raise InvalidInputError(
            f"{path}: section {pattern}: base = {shown(base)} is refused: must be the name or the "
            "path of a scenario"
        )
    return base


class _RosLoader(yaml.SafeLoader):
    """Reads scalars as rcl does, which takes 1e3 for a number and knows no dates.

    Like rcl it refuses aliases, with which a small file could unfold into a boundless one.
    """

    bool_values: ClassVar[dict[str, bool]] = {**yaml.SafeLoader.bool_values, "y": True, "n": False}

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            raise yaml.YAMLError(f"aliases are not taken, line {event.start_mark.line + 1}")
        return super().compose_node(parent, index)


def _whole_number(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int | float | str:
    """Return a number for a whole one beyond 64 bits, and its text for one beyond any number."""
    try:
        value = loader.construct_yaml_int(node)
        return value if -(2**63) <= value < 2**63 else float(value)
    except (ValueError, OverflowError):
        return str(node.value)


def _number(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> float | str:
    """Return the text of a number that overflows or underflows."""
    text: str = node.value.lower()
    value = float(loader.construct_yaml_float(node))
    zero = not text.partition("e")[0].strip("+-.0")
    if zero or text.endswith(("inf", "nan")) or float_info.min <= abs(value) < inf:
        return value
    return str(node.value)


_RosLoader.add_constructor("tag:yaml.org,2002:int", _whole_number)
_RosLoader.add_constructor("tag:yaml.org,2002:float", _number)
_RosLoader.yaml_implicit_resolvers = {}
_BOOLEANS = [
    spelling
    for word in ("true", "false", "yes", "no", "on", "off", "y", "n")
    for spelling in (word, word.capitalize(), word.upper())
]
_SCALARS = {
    "bool": "|".join(_BOOLEANS),
    "int": r"[-+]?(0|[1-9][0-9]*|0[0-7]+|0x[0-9a-fA-F]+)",
    "float": r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?"
    r"|[-+]?\.?(inf|Inf|INF)|[-+]?\.?(nan|NaN|NAN)",
    "null": "~|null|Null|NULL|",
}
_NUMBER = re.compile(f"(?:{_SCALARS['int']}|{_SCALARS['float']})")
for _tag, _pattern in _SCALARS.items():
    _RosLoader.add_implicit_resolver(
        f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_pattern})$"), None
    )


class _QuotingDumper(yaml.SafeDumper):
    """Quotes every string, so that no reader takes it for anything else."""


_QuotingDumper.add_representer(
    str,
    lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"'),
)


def _parse_yaml(text: str, source: str) -> Any:
    try:
        return yaml.load(text, Loader=_RosLoader)
    except yaml.YAMLError as error:
        reason = " ".join(str(error).split())
        raise InvalidInputError(f"{source} is not YAML: {reason}") from None
    except RecursionError:
        raise InvalidInputError(f"{source} is not taken: it is nested too deep") from None
    except (ArithmeticError, AttributeError, LookupError, ValueError):
        raise InvalidInputError(
            f"{source} is not YAML: a tag (!!) does not suit its value"
        ) from None


def _sections(path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the node name pattern and the parameters, flat, of each section of the file."""
    try:
        with path.open(encoding="utf-8") as file:
            text = file.read(_LARGEST + 1)
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"cannot read scenario {path}: {error}") from None
    if len(text) > _LARGEST:
        raise InvalidInputError(
            f"cannot read scenario {path}: it is longer than {_LARGEST} characters"
        )
    yield from _walk(_parse_yaml(text, str(path)), "", path)


def _walk(tree: Any, name: str, path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    if not isinstance(tree, dict) or not tree:
        raise InvalidInputError(
            f"{path}: expected node names with {_PARAMETERS_KEY} below, found {tree!r:.60} "
            f"at {name or 'the top'}"
        )
    for key, below in cast(dict[Any, Any], tree).items():
        if key != _PARAMETERS_KEY:
            yield from _walk(below, f"{name}/{str(key).strip('/')}", path)
        elif isinstance(below, dict):
            yield name, dict(_flatten(cast(dict[Any, Any], below)))
        else:
            raise InvalidInputError(f"{path}: {name}: {_PARAMETERS_KEY} must be names and values")


def _flatten(values: Mapping[Any, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flatten(cast(dict[Any, Any], value), f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _apply(
    values: dict[str, dict[str, Any]],
    path: Path,
    pattern: str,
    parameters: Mapping[str, Any],
    namespace: str,
) -> None:
    """Give the parameters of a section to every node that it matches."""
    nodes = _matching(pattern, namespace)
    if not nodes:
        node = pattern.rpartition("/")[2]
        raise InvalidInputError(
            f"{path}: section {pattern} matches no node; "
            + did_you_mean(
                node,
                NODE_PARAMETERS.keys() - {node},
                f"in namespace {namespace} there are {', '.join(NODE_PARAMETERS)}",
            )
        )
    for_all = len(nodes) > 1
    for name, value in parameters.items():
        takers = [n for n in nodes if not for_all or name in _names(n)]
        if not takers:
            known = {known for node in nodes for known in _names(node)}
            raise InvalidInputError(
                f"{path}: section {pattern}: no node has a parameter {name:.80}; "
                + did_you_mean(name, known, "docs/parameters.md has them all")
            )
        for node in takers:
            values[node][name] = value


def _matching(pattern: str, namespace: str) -> list[str]:
    """Return the nodes in `namespace` to which a section applies."""
    return [n for n in NODE_PARAMETERS if section_matches(pattern, f"{namespace.rstrip('/')}/{n}")]


def _names(node: str) -> set[str]:
    return {parameter.name for parameter in parameters_of(NODE_PARAMETERS[node])}


def _parse_override(override: str) -> tuple[str, str, Any]:
    target, equals, text = override.partition("=")
    node, _, parameter = target.partition(".")
    known = [f"{node}.{name}" for node in NODE_PARAMETERS for name in sorted(_names(node))]
    if not equals or not parameter:
        raise InvalidInputError(
            f"-p {override:.80}: must be NODE.PARAMETER=VALUE; "
            + did_you_mean(target, known, "as in -p plant.belt_speed=0.2")
        )
    if node not in NODE_PARAMETERS:
        raise InvalidInputError(
            f"-p {override:.80}: unknown node {node:.80}; {did_you_mean(node, NODE_PARAMETERS)}"
        )
    if target not in known:
        every = f"{node} has {', '.join(sorted(_names(node)))}"
        raise InvalidInputError(
            f"-p {override:.80}: unknown parameter {parameter:.80}; "
            + did_you_mean(target, known, every)
        )
    return node, parameter, _parse_yaml(text, f"-p {override:.80}: the value")
