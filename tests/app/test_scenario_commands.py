"""list, show, new and schema: what a user learns of scenarios, and the file to edit."""

import json
import re
from contextlib import chdir
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from stickslip_ros.scenarios.files import load_scenario, shipped_scenarios
from tests.app.conftest import Run
from tests.scenarios.conftest import read_by_ros  # noqa: F401 - a fixture used here


def test_list_names_what_can_be_given_by_name(stickslip: Run) -> None:
    done = stickslip("list")
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    named = [line.split(maxsplit=1) for line in lines if re.match(r"  \w", line)]
    shown = dict(named)
    assert shown["feed_drive"].startswith("The slide of a machine tool: 100 kg, 16 Hz")
    assert shown["stribeck"].startswith("Cubic Stribeck law")
    assert "parameters: static, minimum, minimum_speed" in [line.strip() for line in lines]
    assert any("linear_gain" in line for line in lines)
    found = stickslip.json("list")
    assert [scenario["name"] for scenario in found["scenarios"]] == list(shipped_scenarios())
    assert "plant.friction.slope" in found["friction_laws"][2]["parameters"]


def test_show_tells_where_each_value_comes_from(stickslip: Run, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(
        "/**/scenario: {ros__parameters: {base: feed_drive}}\n"
        "/**/plant: {ros__parameters: {mass: 80.0}}\n"
        "/**/damper: {ros__parameters: {gain: 3.0}}\n"
    )
    arguments = ("show", "mine.yaml", "-p", "plant.belt_speed=0.02")
    shown = stickslip.json(*arguments)
    found = shown["parameters"]
    assert shown["bases"][0].endswith("config/feed_drive.yaml")
    assert {
        name: (row["value"], row["source"]) for name, row in found["plant"].items()
    }.items() >= {
        "mass": (80.0, "file"),
        "stiffness": (1e6, "base"),
        "belt_speed": (0.02, "override"),
        "friction.slope": (0.45, "default"),
    }.items()
    assert {node: set(rows) for node, rows in found.items()} == {
        node: set(values) for node, values in load_scenario("paper").as_dict().items()
    }
    text = stickslip(*arguments).stdout
    assert "section /**/damper is for another node" in text
    lines = [line.split() for line in text.splitlines()]
    assert ["mass", "80.0", "kg", "file"] in lines
    assert ["belt_speed", "0.02", "m/s", "override"] in lines
    dimensionless = [line.split() for line in stickslip("show", "paper").stdout.splitlines()]
    assert ["mass", "1.0", "file"] in dimensionless
    assert ["max_bag_size", "0", "bytes", "default"] in dimensionless


@pytest.mark.parametrize("source", ["feed_drive", "paper"])
def test_new_writes_a_file_that_is_the_scenario(
    stickslip: Run, tmp_path: Path, source: str
) -> None:
    done = stickslip("new", "mine.yaml", "--from", source, "--complete")
    assert (done.returncode, done.stderr) == (0, "")
    assert "`stickslip simulate mine.yaml`" in done.stdout
    title, command, empty, *_ = (tmp_path / "mine.yaml").read_text().splitlines()
    assert title == f"# mine: a drive with the values of {source}, to be edited."
    assert (command, empty) == ("# stickslip simulate mine.yaml", "")
    mine = load_scenario(str(tmp_path / "mine.yaml"))
    assert mine.as_dict() == load_scenario(source).as_dict()
    assert mine.left_to_defaults == []
    text = (tmp_path / "mine.yaml").read_text()
    assert max(map(len, text.splitlines())) <= 100
    for node, values in load_scenario(source).as_dict().items():
        for parameter in values:
            assert f"{parameter.rpartition('.')[2]}:" in text, (node, parameter)
    assert "    # Mass of the slide. [kg, above 0]\n    mass: " in text
    assert stickslip("simulate", "mine.yaml", "--duration", "1", "--json").returncode == 0


@pytest.mark.parametrize("source", ["feed_drive", "axis", "elsewhere/other.yaml"])
def test_new_writes_the_drive_and_its_controller(
    stickslip: Run, tmp_path: Path, source: str
) -> None:
    (tmp_path / "elsewhere").mkdir()
    stickslip("new", "elsewhere/other.yaml", "--from", "vibrating_load", "--complete")
    done = stickslip("new", "mine.yaml", "--from", source)
    assert (done.returncode, done.stderr) == (0, "")
    text = (tmp_path / "mine.yaml").read_text()
    assert len(text.splitlines()) < 30
    assert "    mass: 95.154  # Mass of the slide. [kg, above 0]\n" in text or source != "axis"
    with chdir(tmp_path):
        mine, whole = load_scenario("mine.yaml"), load_scenario(source)
    assert mine.as_dict() == whole.as_dict()
    assert {"plant.mass", "plant.rate"} <= mine.sources.keys()
    assert mine.sources["plant.mass"] == "file"
    assert mine.sources["plant.pace"] == "base"


def test_gains_are_told_to_be_of_another_drive(stickslip: Run, tmp_path: Path) -> None:
    """`new` leaves them out, and a command says where they are from, unless it needs none."""
    done = stickslip("new", "mine.yaml")
    assert "`stickslip design mine.yaml` finds gains for it" in done.stdout
    path = tmp_path / "mine.yaml"
    text = path.read_text().replace("mass: 100.0", "mass: 45.0")
    assert "gain: " not in text.replace("cubic_gain: ", "")
    assert "start_after" not in text
    path.write_text(text)
    for name, base in (("slower", "mine.yaml"), ("same", "feed_drive")):
        (tmp_path / f"{name}.yaml").write_text(
            f"/**/scenario: {{ros__parameters: {{base: {base}}}}}\n"
            "/**/plant: {ros__parameters: {belt_speed: 0.03}}\n"
        )
    names = ("corner_frequency", "linear_gain", "start_after")
    listed = ", ".join(f"washout_controller.{name}" for name in names)
    gain = "washout_controller.linear_gain=-1000"
    for arguments, told in (
        (("mine.yaml",), f"mine.yaml: {listed} are of "),
        (("slower.yaml",), f"slower.yaml: {listed} are of "),
        (("mine.yaml", "-p", gain), "corner_frequency, washout_controller.start_after are of "),
        (("mine.yaml", "-p", gain, "-p", "washout_controller.corner_frequency=9"), ""),
        (("mine.yaml", "--no-control"), ""),
        (("same.yaml",), ""),
        (("feed_drive", "-p", "plant.mass=45"), ""),
    ):
        said = stickslip("simulate", *arguments, "--duration", "0.1").stderr
        assert told in said
        assert ("feed_drive.yaml, for the drive there; `stickslip design`" in said) is bool(told)
    assert "are of" not in stickslip("design", "mine.yaml").stderr


def test_new_keeps_lists_and_texts(stickslip: Run, tmp_path: Path) -> None:
    (tmp_path / "other.yaml").write_text(
        '/**/plant: {ros__parameters: {wait_for: [analyzer, "b"]}}\n'
        '/**/analyzer: {ros__parameters: {bag: "a: \\"b\\" #"}}\n'
    )
    stickslip("new", "mine.yml", "--from", "./other.yaml", "--complete")
    mine = load_scenario(str(tmp_path / "mine.yml"))
    assert mine.plant.wait_for == ["analyzer", "b"]
    assert mine.analyzer.bag == 'a: "b" #'


@pytest.fixture
def schema(stickslip: Run) -> Any:
    found = json.loads(stickslip("schema").stdout)
    jsonschema.Draft7Validator.check_schema(found)
    return jsonschema.Draft7Validator(found)


def test_the_schema_accepts_what_ships_what_new_writes_and_other_ways_to_write_it(
    schema: Any, stickslip: Run, tmp_path: Path
) -> None:
    for name, shipped in shipped_scenarios().items():
        stickslip("new", f"{name}.yaml", "--from", name)
        stickslip("new", f"all_{name}.yaml", "--from", name, "--complete")
        for path in (shipped, tmp_path / f"{name}.yaml", tmp_path / f"all_{name}.yaml"):
            assert list(schema.iter_errors(yaml.safe_load(path.read_text()))) == [], path
    for text in (
        "/**/plant: {ros__parameters: {friction.law: coulomb, friction: {static: 0.3}}}",
        "/feed_drive/plant: {ros__parameters: {mass: 2}}",
        "/**/scenario: {ros__parameters: {base: feed_drive}}",
        "/**/damper: {ros__parameters: {gain: 3.0}}",
        "/**/washout_controller: {ros__parameters: {force_limit: .inf}}",
    ):
        assert list(schema.iter_errors(yaml.safe_load(text))) == [], text


def test_the_schema_refuses_what_is_wrong(schema: Any) -> None:
    for text, named in (
        ("/**/plant: {ros__parameters: {mas: 1.0}}", "mas"),
        ("/**/plant: {ros__parameters: {mass: -1.0}}", "-1.0"),
        ("/**/plant: {ros__parameters: {mass: heavy}}", "heavy"),
        ("/**/plant: {ros__parameters: {friction: {law: sticky}}}", "sticky"),
        ("/**/plant: {mass: 1.0}", "ros__parameters"),
        ("/**/scenario: {ros__parameters: {bas: paper}}", "'bas'"),
        ("/**/analyzer: {ros__parameters: {window: 0}}", "0"),
    ):
        errors = list(schema.iter_errors(yaml.safe_load(text)))
        assert any(named in error.message for error in errors), text


def test_the_schema_tells_unit_meaning_default_and_choices(stickslip: Run) -> None:
    sections = json.loads(stickslip("schema").stdout)["definitions"]
    plant = sections["plant"]["properties"]["ros__parameters"]["properties"]
    assert plant["mass"] == {
        "description": "Mass of the slide. [kg]",
        "type": "number",
        "minimum": 1e-30,
        "maximum": 1e30,
        "default": 1.0,
    }
    assert "coulomb" in plant["friction"]["properties"]["law"]["enum"]
    assert plant["wait_for"]["items"] == {"type": "string"}


def test_export_writes_the_law_in_the_language_of_the_file(stickslip: Run, tmp_path: Path) -> None:
    for ending, first in ((".c", "/*"), (".st", "(*")):
        path = tmp_path / f"law{ending}"
        done = stickslip("export", "feed_drive", "--out", str(path))
        assert (done.returncode, done.stderr) == (0, "")
        assert "washout at 1000 Hz" in done.stdout
        assert path.read_text().startswith(first)
    for arguments, why in (
        (("feed_drive", "--out", "law.py"), "must end in .c or .st"),
        (("feed_drive", "--no-control", "--out", "law.c"), "no law to export"),
    ):
        refused = stickslip("export", *arguments)
        assert refused.returncode == 2
        assert why in refused.stderr
