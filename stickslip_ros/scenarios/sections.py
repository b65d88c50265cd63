"""Reading a scenario file: sections of node name patterns, each with parameters."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple, cast

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios import ros_yaml
from stickslip_ros.scenarios.parameter_field import known_parameters
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.scenarios.validation import flattened
from stickslip_ros.text import did_you_mean, shown

PARAMETERS_KEY = "ros__parameters"
_LARGEST = 1_000_000
"""Largest number of characters in a scenario file."""
BASE_SECTION = "scenario"
"""Last part of the name of the section that names the base and belongs to no node."""

SetValue = Callable[[str, str, Any], None]
"""Takes node, flat name and value of a parameter."""


class ScenarioFile(NamedTuple):
    """The contents of a scenario file, without those of its base."""

    path: Path
    sections: list[tuple[str, Mapping[str, Any]]]
    """Node name patterns, each with its parameters by flat name."""
    base: str | None
    """Name or path of the scenario that supplies the omitted parameters."""

    def named_nodes(self, namespace: str) -> set[str]:
        """Return the names of the nodes that have a section of their own in `namespace`."""
        return {
            name
            for pattern, _ in self.sections
            for _, _, name in [pattern.rpartition("/")]
            if "*" not in name and section_matches(pattern, f"{namespace.rstrip('/')}/{name}")
        }

    def apply(self, set_value: SetValue, namespace: str, *, other_nodes: bool) -> list[str]:
        """Pass each parameter of the nodes in `namespace` to `set_value`.

        Return the sections of unknown nodes. Raises InvalidInputError for an unknown parameter
        and, unless `other_nodes` is set, for an unknown node.
        """
        other_sections: list[str] = []
        prefix = namespace.rstrip("/")
        for pattern, parameters in self.sections:
            nodes = [
                node for node in NODE_PARAMETERS if section_matches(pattern, f"{prefix}/{node}")
            ]
            if nodes:
                _apply(set_value, self.path, pattern, parameters, nodes)
            elif other_nodes:
                other_sections.append(pattern)
            else:
                node = pattern.rpartition("/")[2]
                every = f"the nodes in namespace {namespace} are {', '.join(NODE_PARAMETERS)}"
                raise InvalidInputError(
                    f"{self.path}: section {pattern} matches no node; "
                    + did_you_mean(node, NODE_PARAMETERS.keys() - {node}, every)
                )
        return other_sections


def read_file(path: Path, namespace: str) -> ScenarioFile:
    """Read the sections of a scenario file, and the base that it names for `namespace`.

    Raises InvalidInputError if the file is not a scenario file.
    """
    sections: list[tuple[str, Mapping[str, Any]]] = []
    base: str | None = None
    for pattern, parameters in _sections(path):
        own = section_matches(pattern, f"{namespace.rstrip('/')}/{BASE_SECTION}")
        if own and pattern.endswith(f"/{BASE_SECTION}"):
            base = _base_of(path, pattern, parameters)
        else:
            sections.append((pattern, parameters))
    return ScenarioFile(path, sections, base)


def section_matches(pattern: str, node: str) -> bool:
    """Return whether a section applies to the node of that full name, by the rules of ROS."""
    tokens = {"**": r"(/\w+)*", "*": r"/\w+"}
    expression = "".join(tokens.get(t, "/" + re.escape(t)) for t in pattern.split("/")[1:])
    return re.fullmatch(expression, node) is not None


def _base_of(path: Path, pattern: str, parameters: Mapping[str, Any]) -> str:
    for name in parameters:
        if name != "base":
            raise InvalidInputError(
                f"{path}: section {pattern}: unknown parameter {name:.80}; the only one is base"
            )
    base = parameters.get("base")
    if not isinstance(base, str) or not base:
        raise InvalidInputError(
            f"{path}: section {pattern}: base = {shown(base)} is refused: must be the name or the "
            "path of a scenario"
        )
    return base


def _apply(
    set_value: SetValue,
    path: Path,
    pattern: str,
    parameters: Mapping[str, Any],
    nodes: Sequence[str],
) -> None:
    """Pass the parameters of a section to `set_value` for the nodes that it matches."""
    known = {node: known_parameters(NODE_PARAMETERS[node]) for node in nodes}
    for name, value in parameters.items():
        takers = [node for node in nodes if len(nodes) == 1 or name in known[node]]
        if not takers:
            raise InvalidInputError(
                f"{path}: section {pattern}: no node has a parameter {name:.80}; "
                + did_you_mean(name, {*chain(*known.values())}, "docs/parameters.md lists all")
            )
        for node in takers:
            set_value(node, name, value)


def _sections(path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the node name pattern and the parameters by flat name of each section."""
    try:
        with path.open(encoding="utf-8") as file:
            text = file.read(_LARGEST + 1)
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"cannot read scenario {path}: {error}") from None
    if len(text) > _LARGEST:
        raise InvalidInputError(
            f"cannot read scenario {path}: it is longer than {_LARGEST} characters"
        )
    yield from _walk(ros_yaml.parse(text, str(path)), "", path)


def _walk(tree: Any, name: str, path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    if not isinstance(tree, dict) or not tree:
        raise InvalidInputError(
            f"{path}: expected node names with {PARAMETERS_KEY} below, found {tree!r:.60} "
            f"at {name or 'the top'}"
        )
    for key, below in cast(dict[Any, Any], tree).items():
        if key != PARAMETERS_KEY:
            yield from _walk(below, f"{name}/{str(key).strip('/')}", path)
        elif isinstance(below, dict):
            yield name, dict(flattened(cast(dict[Any, Any], below)))
        else:
            raise InvalidInputError(f"{path}: {name}: {PARAMETERS_KEY} must be names and values")


def leading_comment(path: Path) -> str:
    """Return the first sentence of the comment at the top of a scenario file.

    Empty for a file without one.
    """
    comment: list[str] = []
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            if not line.startswith("#"):
                break
            comment.append(line.strip("# \n"))
    sentence, _, _ = " ".join(comment).partition(". ")
    return sentence.rstrip(".")
