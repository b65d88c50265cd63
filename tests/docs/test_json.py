"""docs/json.schema.json is the schema of what the commands print with --json."""

import json
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from jsonschema.validators import extend

from stickslip_ros.app.commands import COMMANDS, command_parser
from stickslip_ros.measures.cycle_measures import CycleMeasures
from stickslip_ros.quantities import quantities_of
from tests.app.conftest import Run, stickslip  # noqa: F401 - a fixture used here
from tests.nodes.conftest import domain, process_environment  # noqa: F401 - fixtures used here

ROOT = Path(__file__).parents[2]
SCHEMA = json.loads((ROOT / "docs" / "json.schema.json").read_text(encoding="utf-8"))
PARTS = SCHEMA["$defs"]
REFERENCE = str(ROOT / "bags" / "reference")

# 1.0 is an integer of JSON, but not what a count prints.
_INTEGERS = Draft202012Validator.TYPE_CHECKER.redefine(
    "integer", lambda _, value: type(value) is int
)
Validator = extend(Draft202012Validator, type_checker=_INTEGERS)


def closed(schema: Any, *, part: bool = False) -> Any:
    """The schema with no other keys in any object; `part`: of an object that has others, too."""
    if isinstance(schema, list):
        return [closed(each, part=part) for each in schema]
    if not isinstance(schema, dict):
        return schema
    of_objects = ("properties", "$defs")
    found = {
        key: {name: closed(each, part=key == "$defs") for name, each in value.items()}
        if key in of_objects
        else closed(value, part=key == "allOf")
        for key, value in schema.items()
    }
    if not part and ({"properties", "allOf", "$ref"} & found.keys()):
        found["unevaluatedProperties"] = False
    return found


def differences(name: str, printed: Any) -> list[str]:
    """Say where the schema and what was printed are not the same."""
    validator = Validator(closed({"$defs": PARTS, "$ref": f"#/$defs/{name}"}))
    return [f"{error.json_path}: {error.message}" for error in validator.iter_errors(printed)]


SHORT = ("--transient", "20", "--cycles", "3")
BELT = ("--over", "plant.belt_speed=0.3:0.6:3")
GRID = ("--position=-1:1:2", "--velocity=-1:1:2")
RIG = ("feed_drive", "--belt-speed")
ENCODER = ("-p", "plant.sensor.position_resolution=1e-6")
CALLS = [  # tests/app/test_results.py has others
    ("simulate", ("simulate", "paper", "--duration", "30")),
    ("simulate", ("simulate", "paper", "--duration", "0.1", "--no-control")),
    ("simulate", ("simulate", "feed_drive", "--duration", "1", *ENCODER)),
    ("sweep", ("sweep", "paper", "--no-control", *BELT, *SHORT)),
    ("sweep", ("sweep", "paper", "--no-control", *BELT, "--over", "plant.mass=1:2:2", *SHORT)),
    ("basin", ("basin", "paper", "--no-control", *GRID, *SHORT)),
    ("stability", ("stability", "feed_drive", "-p", "plant.friction.law=coulomb")),
    ("stability", ("stability", "paper", "-p", "plant.belt_speed=0")),
    ("design", ("design", *RIG, "0.02:0.04", "-p", "plant.force_delay=0.02")),
    pytest.param("design", ("design", *RIG, "0.03", *ENCODER), marks=pytest.mark.long),
    ("design", ("design", *RIG, "0.04", "--controller", "velocity_feedback", "--spread", "0.1")),
    ("repair", ("repair", REFERENCE, "sound")),
    ("list", ("list",)),
    ("show", ("show", "feed_drive", "-p", "plant.mass=2")),
]  # fmt: skip


@pytest.mark.parametrize(("name", "arguments"), CALLS)
def test_the_schema_has_what_is_printed(
    stickslip: Run,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    arguments: tuple[str, ...],
) -> None:
    for drawn in ("_SEARCHED", "_TRIED"):
        monkeypatch.setattr(f"stickslip_ros.studies.design.{drawn}", 2)
    done = stickslip(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    assert differences(name, json.loads(done.stdout)) == []


@pytest.mark.process
@pytest.mark.parametrize("control", [(), pytest.param(("--no-control",), marks=pytest.mark.long)])
def test_the_schema_has_what_a_run_prints(
    stickslip: Run,  # noqa: F811
    control: tuple[str, ...],
) -> None:
    done = stickslip("run", "paper", "--composed", "--duration", "20", *control, "--json")
    assert done.returncode == 0, done.stderr
    assert differences("run", json.loads(done.stdout)) == []


def test_every_command_with_json_is_in_the_schema() -> None:
    Validator.check_schema(SCHEMA)
    options = {name: command_parser(name)._option_string_actions for name in COMMANDS}
    assert {name for name in COMMANDS if "--json" in options[name]} <= PARTS.keys()


def test_every_key_is_described() -> None:
    def undescribed(schema: Any, path: str = "") -> list[str]:
        own = schema.get("properties", {}).items()
        found = [f"{path}.{n}" for n, s in own if not {"description", "$ref", "items"} & s.keys()]
        return [*found, *(each for n, s in own for each in undescribed(s, f"{path}.{n}"))]

    assert [each for name, part in PARTS.items() for each in undescribed(part, name)] == []


def test_the_measures_of_a_cycle_are_those_of_the_class() -> None:
    described = PARTS["cycle"]["properties"]
    assert described.keys() == PARTS["columns"]["properties"].keys()
    assert described.keys() == quantities_of(CycleMeasures).keys()
    for name, (_, unit, missing) in quantities_of(CycleMeasures).items():
        assert described[name]["description"].endswith(f"{unit}; null {missing}")
