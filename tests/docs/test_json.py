"""docs/json.md lists what the commands print with --json: every key, its type, and where null."""

import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from stickslip_ros.app.commands import COMMANDS, command_parser
from tests.app.conftest import Run, stickslip  # noqa: F401 - a fixture used here
from tests.nodes.conftest import domain, process_environment  # noqa: F401 - fixtures used here

ROOT = Path(__file__).parents[2]
REFERENCE = str(ROOT / "bags" / "reference")
HEAD = "| key | type | unit | null | stable | meaning |"
TYPES: dict[str, tuple[type, ...]] = {
    "number": (float, int),
    "integer": (int,),
    "string": (str,),
    "boolean": (bool,),
    "list": (list,),
    "object": (dict,),
    "any": (object,),
}

Path_ = tuple[str, ...]


class Key(NamedTuple):
    path: Path_
    type: str
    null: bool
    optional: bool


@cache
def sections() -> dict[str, list[list[str]]]:
    """The rows of the tables of the page by heading."""
    page = (ROOT / "docs" / "json.md").read_text(encoding="utf-8")
    found: dict[str, list[list[str]]] = {}
    for part in page.split("\n## ")[1:]:
        heading, _, text = part.partition("\n")
        if HEAD in text:
            rows = re.findall(r"^\|.*", text.split(HEAD)[1], re.MULTILINE)[1:]
            found[heading] = [[cell.strip() for cell in row.split("|")[1:-1]] for row in rows]
    return found


def segments(text: str) -> Path_:
    return tuple(filter(None, text.replace("[]", ".[]").split(".")))


def keys(heading: str, prefix: Path_ = ()) -> Iterator[Key]:
    """Yield the keys of a section, those of the sections that it includes among them."""
    for name, kind, _, null, stable, meaning in sections()[heading]:
        included = re.fullmatch(r"(?:`(.*)\.` \+ )?\[(\w+)\]\(#\w+\)", name)
        if included:
            yield from keys(included[2], prefix + segments(included[1] or ""))
        else:
            assert kind in TYPES, name
            assert stable in ("yes", "no"), name
            optional = meaning.startswith("Only ")
            yield Key(prefix + segments(name.strip("`")), kind, null != "no", optional)


def matches(documented: Path_, path: Path_) -> bool:
    return len(documented) == len(path) and all(
        a == b or (a.isupper() and b != "[]") for a, b in zip(documented, path, strict=True)
    )


def walk(value: Any, path: Path_ = ()) -> Iterator[tuple[Path_, Any]]:
    if path:
        yield path, value
    if isinstance(value, dict):
        for name, item in value.items():
            yield from walk(item, (*path, name))
    elif isinstance(value, list):
        for item in value:
            yield from walk(item, (*path, "[]"))


def differences(heading: str, printed: Any) -> Iterator[str]:
    """Say where the page and what was printed are not the same."""
    documented = list(keys(heading))
    exact = {key.path: key for key in documented}
    for path, value in walk(printed):
        found = exact.get(path) or next((k for k in documented if matches(k.path, path)), None)
        if found is None:
            yield f"{path} is not on the page"
        elif value is None:
            if not found.null:
                yield f"{path} is null"
        elif found.type != "any" and (
            not isinstance(value, TYPES[found.type])
            or (isinstance(value, bool) and found.type != "boolean")
        ):
            yield f"{path} = {value!r} is no {found.type}"
        if isinstance(value, dict):
            yield from (f"{path} has no {name}" for name in _absent(path, value, documented))
    yield from (f"there is no {name}" for name in _absent((), printed, documented))


def _absent(path: Path_, value: dict[str, Any], documented: list[Key]) -> Iterator[str]:
    for key in documented:
        *parent, name = key.path
        wanted = name != "[]" and not name.isupper() and not key.optional
        if wanted and name not in value and matches(tuple(parent), path):
            yield name


SHORT = ("--transient", "20", "--cycles", "3")
BELT = ("--over", "plant.belt_speed=0.3:0.6:3")
GRID = ("--position=-1:1:2", "--velocity=-1:1:2")
RIG = ("feed_drive", "--belt-speed")
KNOWN = ("--fix", "plant.mass=100", "--fix", "plant.damping=200")
ENCODER = ("-p", "plant.sensor.position_resolution=1e-6")
CALLS = [
    ("simulate", ("simulate", "paper", "--duration", "30")),
    ("simulate", ("simulate", "paper", "--duration", "0.1", "--no-control")),
    ("simulate", ("simulate", "feed_drive", "--duration", "1", *ENCODER)),
    ("report", ("report", REFERENCE)),
    ("report of several bags", ("report", REFERENCE, f"{REFERENCE}/reference_0.mcap")),
    ("sweep", ("sweep", "paper", "--no-control", *BELT, *SHORT)),
    ("sweep", ("sweep", "paper", "--no-control", *BELT, *SHORT, "--carry", "both")),
    ("sweep", ("sweep", "paper", "--no-control", *BELT, "--over", "plant.mass=1:2:2", *SHORT)),
    ("basin", ("basin", "paper", "--no-control", *GRID, *SHORT)),
    ("basin", ("basin", "paper", "--no-control", "--sample", "3", *SHORT)),
    ("stability", ("stability", "paper")),
    ("stability", ("stability", "feed_drive", "-p", "plant.friction.law=coulomb")),
    ("stability", ("stability", "paper", "-p", "plant.belt_speed=0")),
    ("design", ("design", *RIG, "0.06")),
    ("design", ("design", *RIG, "0.02:0.04", "-p", "plant.force_delay=0.02")),
    pytest.param("design", ("design", *RIG, "0.03", *ENCODER), marks=pytest.mark.long),
    (
        "design of another law",
        ("design", *RIG, "0.04", "--controller", "velocity_feedback"),
    ),
    ("compare", ("compare", "feed_drive", "--controllers", "washout", "--duration", "0.3")),
    ("identify", ("identify", REFERENCE, "--to", "0.6", "--law", "stribeck", *KNOWN)),
    ("margin", ("margin", REFERENCE)),
    ("repair", ("repair", REFERENCE, "sound")),
    ("list", ("list",)),
    ("show", ("show", "feed_drive", "-p", "plant.mass=2")),
]  # fmt: skip


@pytest.mark.parametrize(("heading", "arguments"), CALLS)
def test_the_page_has_what_is_printed(
    stickslip: Run,  # noqa: F811
    heading: str,
    arguments: tuple[str, ...],
) -> None:
    done = stickslip(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    assert list(differences(heading, json.loads(done.stdout))) == []


@pytest.mark.process
@pytest.mark.parametrize("control", [(), pytest.param(("--no-control",), marks=pytest.mark.long)])
def test_the_page_has_what_a_run_prints(
    stickslip: Run,  # noqa: F811
    control: tuple[str, ...],
) -> None:
    done = stickslip("run", "paper", "--composed", "--duration", "20", *control, "--json")
    assert done.returncode == 0, done.stderr
    assert list(differences("run", json.loads(done.stdout))) == []


def test_every_command_with_json_is_on_the_page() -> None:
    options = {name: command_parser(name)._option_string_actions for name in COMMANDS}
    assert {name for name in COMMANDS if "--json" in options[name]} <= sections().keys()


def test_what_differs_is_found(stickslip: Run) -> None:  # noqa: F811
    printed = json.loads(stickslip("simulate", "paper", "--duration", "1", "--json").stdout)
    for change, said in (
        ({"amplitude": "wide"}, "('amplitude',) = 'wide' is no number"),
        ({"cycles": 1.5}, "('cycles',) = 1.5 is no integer"),
        ({"cycles": None}, "('cycles',) is null"),
        ({"new": 1}, "('new',) is not on the page"),
    ):
        assert list(differences("simulate", {**printed, **change})) == [said]
    del printed["regime"]
    assert list(differences("simulate", printed)) == ["there is no regime"]
