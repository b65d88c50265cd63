"""Friction as parameters: constants by direction, and measured curves from files."""

import json
from math import inf, nan
from pathlib import Path

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.friction import Directional, Exponential, Stribeck, Table
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.scenarios.template import scenario_schema
from tests.scenarios.files import plant, refusal, scenario_file, section

CURVE = "0,0.4\n0.1,0.3\n0.5,0.25\n"
POINTS = ((0.0, 0.4), (0.1, 0.3), (0.5, 0.25))


@pytest.fixture
def curve(tmp_path: Path) -> Path:
    path = tmp_path / "curve.csv"
    path.write_text(CURVE)
    return path


def test_constants_for_backward_slip_make_a_law_of_two_directions() -> None:
    same = Stribeck(0.4, 0.25, 0.5)
    assert plant() == plant(friction__reverse__static=float("nan"))
    assert plant().as_drive().friction == same
    assert plant(friction__reverse__static=nan).as_drive().friction == same
    assert plant(friction__reverse__slope=0.3).as_drive().friction == same  # of another law
    law = plant(friction__reverse__static=0.3).as_drive().friction
    assert law == Directional(same, Stribeck(0.3, 0.25, 0.5))


def test_a_refusal_names_the_parameter() -> None:
    finite = "is invalid: must be a finite number at least"
    for name, value, message in (
        ("reverse.static", 0.2, "minimum = 0.25 must not exceed friction.reverse.static = 0.2"),
        ("reverse.minimum", 0.45, "reverse.minimum = 0.45 must not exceed friction.static = 0.4"),
        ("reverse.static", -0.2, f"reverse.static = -0.2 {finite} 0, or nan (as forward)"),
        ("reverse.static", inf, f"reverse.static = inf {finite} 0, or nan (as forward)"),
        ("exponent", 101, f"exponent = 101 {finite} 1 and at most 100"),
        ("break_away", 1.0, f"break_away = 1.0 {finite} 0 and below 1"),
        (
            "reverse.break_away",
            1.0,
            f"reverse.break_away = 1.0 {finite} 0 and below 1, or nan (as forward)",
        ),
    ):
        with pytest.raises(InvalidInputError) as caught:
            PlantParameters().changed({f"friction.{name}": value}, "test")
        assert str(caught.value) == f"test: friction.{message}"


def test_the_names_of_a_drive_are_those_that_make_its_law() -> None:
    assert "friction.reverse.static" not in plant().drive_names()
    assert "friction.reverse.static" in plant(friction__reverse__static=0.3).drive_names()
    exponential = plant(friction__law="exponential")
    assert "friction.exponent" not in exponential.drive_names()
    two = plant(friction__law="exponential", friction__exponent=2.0)
    assert "friction.exponent" in two.drive_names()
    assert two.as_drive().friction == Exponential(0.4, 0.25, 0.5, 0.0, 2.0)


def test_the_schema_has_nested_groups() -> None:
    known = scenario_schema()["definitions"]["plant"]["properties"]["ros__parameters"]["properties"]
    value = known["friction.reverse.static"]
    assert value["minimum"] == 0.0
    assert "default" not in value
    assert known["friction"]["properties"]["reverse"]["properties"]["static"] == value
    assert known["friction"]["properties"]["reverse.static"] == value
    json.dumps(known, allow_nan=False)


def test_a_file_for_each_direction(curve: Path, tmp_path: Path) -> None:
    values = {"friction__law": "table", "friction__file": str(curve)}
    assert plant(**values).as_drive().friction == Table(POINTS)
    other = tmp_path / "other.csv"
    other.write_text("0,0.2\n")
    made = plant(**values, friction__reverse__file=str(other))
    assert made.as_drive().friction == Directional(Table(POINTS), Table(((0.0, 0.2),)))
    assert {"friction.file", "friction.reverse.file"} <= set(made.drive_names())


def test_what_a_file_may_look_like(curve: Path) -> None:
    for text in (
        CURVE.replace("\n", "\r\n"),
        "\ufeff" + CURVE,
        "# measured\nspeed,coefficient\n" + CURVE,
        "\n" + CURVE.replace(",", " , ") + "\n\n",
    ):
        curve.write_bytes(text.encode())
        law = plant(friction__law="table", friction__file=str(curve)).as_drive().friction
        assert law == Table(POINTS)


def test_a_file_of_a_base_is_relative_to_the_base(curve: Path, tmp_path: Path) -> None:
    scenario_file(tmp_path, section("/**/plant", "{friction: {law: table, file: curve.csv}}"))
    own = tmp_path / "own"
    own.mkdir()
    path = scenario_file(
        own,
        section("/**/plant", "{mass: 2.0}") + section("/**/scenario", "{base: ../scenario.yaml}"),
    )
    for friction in (load_scenario(path, each).plant.friction for each in ([], ["plant.rate=9"])):
        assert Path(friction.file).samefile(curve)
        assert Path(friction.file).is_absolute()
        assert friction.selected == Table(POINTS)


def refused(path: Path) -> str:
    name = f"plant.friction.file={path}"
    return refusal("paper", "plant.friction.law=table", name)


def test_a_file_that_makes_no_table_is_refused(curve: Path) -> None:
    no_numbers = "the file has no numbers: must have two on each line"
    two = "line {} must be two numbers with a comma between"
    for text, reason in (
        ("", no_numbers),
        ("speed,coefficient\n", no_numbers),
        ("0,0.4\n0.1\n", two.format(2)),
        ("0,0.4\n0.1,x\n", two.format(2)),
        ("0,0.4,7\n", two.format(1)),
        ("0,0.4\n0.1,nan\n", two.format(2)),
        ("0,0.4\n0.1,1e31\n", two.format(2)),
        ("0.1,0.4\n", "point 1 of the table: the speed must be 0"),
    ):
        curve.write_text(text)
        assert refused(curve).endswith(f"is refused: {reason}")


def test_a_file_that_cannot_be_read_is_refused(curve: Path, tmp_path: Path) -> None:
    assert "friction.file = '' is invalid: must be the path of a CSV file for law table" in (
        refusal("paper", "plant.friction.law=table")
    )
    assert refused(tmp_path / "none.csv").endswith(
        "is refused: the file cannot be read: No such file or directory"
    )
    assert refused(tmp_path).endswith("it is not a regular file")
    assert refused(Path("/dev/zero")).endswith("it is not a regular file")
    curve.write_bytes(b"\xff\xfe\x00")
    assert refused(curve).endswith("is refused: the file cannot be read: it is not UTF-8 text")
    curve.write_text("0,0.4\n" * 200_000)
    assert refused(curve).endswith("must have at most 1000000 bytes")

    curve.write_text(CURVE)
    files = f"plant.friction.file={curve}", f"plant.friction.reverse.file={tmp_path / 'none.csv'}"
    assert "friction.reverse.file = " in refusal("paper", "plant.friction.law=table", *files)
