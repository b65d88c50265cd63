"""Reading a scenario file: sections of node name patterns, each with parameters."""

import re
from collections.abc import Mapping
from io import TextIOWrapper
from itertools import chain, takewhile
from pathlib import Path
from typing import Any, NamedTuple

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.files import open_regular
from stickslip_ros.scenarios import full_name, ros_yaml
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.scenarios.ros_yaml import PARAMETERS_KEY, LineError
from stickslip_ros.text import did_you_mean, shown

_PATTERN = re.compile(r"(/(\*\*?|[A-Za-z_]\w*))+", re.ASCII)
_LARGEST_FILE = 1_000_000
"""Largest number of characters in a scenario file."""
FIT_COLUMNS = "names", "standard_errors", "correlations"
"""Lists of a fit: those of correlations row by row."""
BASE_SECTION = "scenario"
"""Last part of the name of the section that names the base and belongs to no node."""


class ScenarioFile(NamedTuple):
    """The contents of a scenario file, without those of its base."""

    path: Path
    sections: list[tuple[str, Mapping[str, Any]]]
    """Node name patterns, each with its parameters by flat name."""
    base: str | None
    """Name or path of the scenario that supplies the omitted parameters."""
    fit: Mapping[str, Any]
    """Names, standard errors and correlations of constants that were fitted; see `Scenario`."""

    def named_nodes(self, namespace: str) -> set[str]:
        """Return the names of the nodes that have a section of their own in `namespace`."""
        return {
            name
            for pattern, _ in self.sections
            for _, _, name in [pattern.rpartition("/")]
            if "*" not in name and section_matches(pattern, full_name(namespace, name))
        }

    def values(
        self, namespace: str, *, other_nodes: bool
    ) -> tuple[list[tuple[str, str, Any]], list[str]]:
        """Return node, flat name and value of each parameter of the nodes in `namespace`.

        Also return the sections of unknown nodes. Raises InvalidInputError for an unknown parameter
        and, unless `other_nodes` is set, for an unknown node.
        """
        values: list[tuple[str, str, Any]] = []
        other_sections: list[str] = []
        for pattern, parameters in self.sections:
            known = {
                node: model.known
                for node, model in NODE_PARAMETERS.items()
                if section_matches(pattern, full_name(namespace, node))
            }
            if not known and not other_nodes:
                node = pattern.rpartition("/")[2]
                every = f"the nodes in namespace {namespace} are {', '.join(NODE_PARAMETERS)}"
                raise InvalidInputError(
                    f"{self.path}: section {pattern} matches no node; "
                    + did_you_mean(node, NODE_PARAMETERS.keys() - {node}, every)
                )
            if not known:
                other_sections.append(pattern)
                continue
            for name, value in parameters.items():
                takers = [node for node in known if len(known) == 1 or name in known[node]]
                if not takers:
                    raise InvalidInputError(
                        f"{self.path}: section {pattern}: no node has a parameter {name:.80}; "
                        + did_you_mean(
                            name, {*chain(*known.values())}, "docs/parameters.md lists all"
                        )
                    )
                values += [(node, name, value) for node in takers]
        return values, other_sections


def read_file(path: Path, namespace: str) -> ScenarioFile:
    """Read the sections of a scenario file, and the base that it names for `namespace`.

    Raises InvalidInputError if the file is not a scenario file.
    """
    sections: list[tuple[str, Mapping[str, Any]]] = []
    base: str | None = None
    fit: Mapping[str, Any] = {}
    for name, parameters in _sections(path).items():
        pattern = f"/{name.removeprefix('/')}"
        is_base = section_matches(pattern, full_name(namespace, BASE_SECTION))
        if is_base and pattern.endswith(f"/{BASE_SECTION}"):
            given = {name.removeprefix("fit."): value for name, value in parameters.items()}
            base = given.pop("base", None)
            fit = given
            named = base is None if fit else isinstance(base, str) and base
            if not named or (fit and not _is_fit(fit)):
                raise InvalidInputError(
                    f"{path}: section {pattern}: {shown(parameters)} is invalid: must be base, the "
                    "name or the path of a scenario, or the fit that `stickslip identify` writes"
                )
        else:
            sections.append((pattern, parameters))
    return ScenarioFile(path, sections, base, fit)


def _is_fit(fit: Mapping[str, Any]) -> bool:
    """Return whether a fit has names, as many standard errors, and the correlations of all."""
    names, plant = fit.get("names"), NODE_PARAMETERS["plant"].known
    if {*fit} != {*FIT_COLUMNS} or not isinstance(names, list):
        return False
    counts = len(names), len(names) ** 2
    return all(str(name).removeprefix("plant.") in plant for name in names) and all(
        isinstance(fit[column], list)
        and len(fit[column]) == count
        and all(isinstance(value, float) for value in fit[column])
        for column, count in zip(FIT_COLUMNS[1:], counts, strict=True)
    )


def section_matches(pattern: str, node: str) -> bool:
    """Return whether a section applies to the node of that full name, by the rules of ROS."""
    tokens = {"**": r"(/\w+)*", "*": r"/\w+"}
    expression = "".join(tokens.get(t, "/" + re.escape(t)) for t in pattern.split("/")[1:])
    return re.fullmatch(expression, node) is not None


def _sections(path: Path) -> Mapping[str, Mapping[str, Any]]:
    """Return node name patterns, each with its parameters by flat name, combined as ROS does.

    A pattern that occurs again has the place of its first section; with or without / at its
    beginning, it is another one.
    """
    try:
        with TextIOWrapper(open_regular(path), encoding="utf-8", newline="") as file:
            text = file.read(_LARGEST_FILE + 1)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InvalidInputError(f"cannot read scenario {path}: {reason}") from None
    if len(text) > _LARGEST_FILE:
        raise InvalidInputError(f"scenario {path} is longer than {_LARGEST_FILE} characters")
    sections: dict[str, dict[str, Any]] = {}
    lines: dict[tuple[str, str], int] = {}
    for keys, line, value in ros_yaml.entries(text, str(path)):
        depth = keys.index(PARAMETERS_KEY) if PARAMETERS_KEY in keys else len(keys)
        nodes, names = keys[:depth], keys[depth + 1 :]
        pattern, name = "/".join(nodes), ".".join(names)
        reason = None
        if nodes == keys:
            place = f"found {value!r:.60} at {'/'.join(keys) or 'the top'}"
            reason = f"expected node names with {PARAMETERS_KEY} below, {place}"
        elif (value == {}) == bool(names) or value == [] or "" in keys:
            reason = f"{pattern}: {PARAMETERS_KEY} must be names and values"
        elif not _PATTERN.fullmatch(f"/{pattern.removeprefix('/')}") or "/" in "".join(nodes[1:]):
            reason = f"{pattern}: must be names of nodes as in /**/plant, with no / in an inner one"
        elif "." in "".join(names[1:-1]):
            reason = f"{pattern}: {name}: the name of an inner group must have no ."
        elif (pattern, name) in lines and name:
            reason = f"{pattern}: {name} is already on line {lines[pattern, name]}"
        if reason is not None:
            raise LineError(path, line, reason)
        lines[pattern, name] = line
        sections.setdefault(pattern, {}).update({name: value} if names else {})
    if not sections:
        raise InvalidInputError(f"{path}: expected node names with {PARAMETERS_KEY} below")
    return sections


def leading_comment(path: Path) -> str:
    """Return the first sentence of the comment at the top of a scenario file.

    Empty for a file without one.
    """
    with TextIOWrapper(open_regular(path), encoding="utf-8", errors="replace") as file:
        lines = takewhile(lambda line: line.startswith("#"), file)
        comment = " ".join(line.strip("# \n") for line in lines)
    return comment.partition(". ")[0].rstrip(".")
