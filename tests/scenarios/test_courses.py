"""The courses of belt, load and disturbance in scenarios."""

import os
import pickle
from pathlib import Path

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.course import NO_COURSE
from stickslip_ros.physics.model.courses import Impulse, Ramp, Sine, Step, Table, Trapezoid
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.parameter_field import Fixed, known_parameters
from stickslip_ros.scenarios.parameters import PlantParameters
from tests.scenarios.files import refusal, scenario_file, section

TABLE = "time,value\n0,0\n1,0.5\n3,-0.25\n"


def plant(**values: object) -> PlantParameters:
    return PlantParameters.validated(
        {name.replace("__", "."): value for name, value in values.items()}, "test"
    )


@pytest.mark.parametrize("part", ["belt", "load"])
def test_each_kind_gives_its_course(part: str) -> None:
    constants = {"amplitude": 0.5, "start": 1.0, "duration": 4.0, "frequency": 2.0}
    given = {f"{part}.{name}": value for name, value in constants.items()}
    expected = {
        "none": NO_COURSE,
        "step": Step(0.5, 1.0, 4.0),
        "impulse": Impulse(0.5, 1.0, 0.02),
        "ramp": Ramp(0.5, 1.0, 4.0),
        "sine": Sine(0.5, 1.0, 4.0, 2.0),
        "trapezoid": Trapezoid(0.5, 1.0, 4.0, 2.0),
    }
    for kind, course in expected.items():
        parameters = PlantParameters.validated(
            {**given, f"{part}.kind": kind, "rate": 50.0}, "test"
        )
        assert getattr(parameters.as_drive(), part) == course


def test_by_default_belt_and_load_are_constant() -> None:
    drive = plant().as_drive()
    assert drive.belt is drive.load is NO_COURSE


@pytest.mark.parametrize("part", ["belt", "load", "disturbance"])
def test_a_table_from_a_file_beside_the_scenario(tmp_path: Path, part: str) -> None:
    (tmp_path / "course.csv").write_text(TABLE)
    text = section("/**/plant", f"{{{part}.kind: table, {part}.file: course.csv}}")
    scenario = load_scenario(scenario_file(tmp_path, text))
    assert getattr(scenario.plant, part).file == str(tmp_path / "course.csv")
    course = getattr(scenario.plant, part).as_course(1.0)
    assert course == Table((0.0, 1.0, 3.0), (0.0, 0.5, -0.25))
    assert pickle.loads(pickle.dumps(scenario)) == scenario


def test_a_file_of_an_override_is_relative_to_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "course.csv").write_text(TABLE)
    monkeypatch.chdir(tmp_path)
    overrides = ["plant.belt.file=course.csv", "plant.belt.kind=table"]
    scenario = load_scenario("paper", overrides)
    assert scenario.plant.belt.file == str(tmp_path / "course.csv")
    changed = load_scenario("paper").changed(
        {"plant.belt.file": "course.csv", "plant.belt.kind": "table"}
    )
    assert changed.plant.belt == scenario.plant.belt


def test_the_content_is_that_at_loading(tmp_path: Path) -> None:
    path = tmp_path / "course.csv"
    path.write_text(TABLE)
    parameters = plant(load__kind="table", load__file=str(path))
    path.unlink()
    assert parameters.as_drive().load == Table((0.0, 1.0, 3.0), (0.0, 0.5, -0.25))


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("", "the file has no numbers"),
        ("0,1\n0,2\n", "time = 0.0 s after 0.0 s: the times must increase"),
        ("1,1\n0,2\n", "time = 0.0 s after 1.0 s: the times must increase"),
        ("0,1\n1\n", "must be two numbers"),
        ("0,1\n1,nan\n", "must be two numbers"),
        ("0,1\n1,1e31\n", "must be two numbers"),
        ("0,1\n" * 300_000, "must have at most"),
        ("\xff", "the file has no numbers"),
    ],
)
def test_bad_files_are_refused(tmp_path: Path, content: str, reason: str) -> None:
    path = tmp_path / "course.csv"
    path.write_text(content)
    message = refusal("paper", "plant.belt.kind=table", f"plant.belt.file={path}")
    assert "belt.file = '" in message
    assert reason in message


@pytest.mark.parametrize("name", ["missing.csv", "", "/dev/zero", "\0"])
def test_what_is_no_file_is_refused(tmp_path: Path, name: str) -> None:
    file = str(tmp_path / name) if name.endswith("csv") else name
    with pytest.raises(InvalidInputError, match=r"belt\.file = .* is refused") as caught:
        plant(belt__kind="table", belt__file=file)
    assert len(str(caught.value).splitlines()) == 1


def test_a_pipe_without_a_writer_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    assert "must be a regular file" in refusal(
        "paper", "plant.load.kind=table", f"plant.load.file={tmp_path / 'pipe.csv'}"
    )


@pytest.mark.parametrize("part", ["belt", "load", "disturbance"])
def test_constants_that_make_no_course_are_refused(part: str) -> None:
    assert f"{part}.duration = inf s: must be above 0 and finite for a ramp" in refusal(
        "paper", f"plant.{part}.kind=ramp"
    )
    assert f"{part}.duration = 1.0 s: must be at least 2/frequency = 2 s" in refusal(
        "paper", f"plant.{part}.kind=trapezoid", f"plant.{part}.duration=1"
    )


@pytest.mark.parametrize(
    "values",
    [
        ["kind=step", "amplitude=-1.5"],
        ["kind=ramp", "amplitude=-1.5", "duration=2"],
        ["kind=sine", "amplitude=1.01"],
        ["kind=sine", "amplitude=-1.01", "frequency=0.1"],
        ["kind=trapezoid", "amplitude=-1.5", "duration=9"],
    ],
)
def test_a_load_that_lifts_the_slide_is_refused(values: list[str]) -> None:
    message = refusal("paper", *(f"plant.load.{value}" for value in values))
    assert "load.amplitude = " in message
    assert "must leave a normal force of at least 0 N, with normal_force = 1.0 N" in message


@pytest.mark.parametrize(
    "values",
    [
        ["kind=none", "amplitude=-9"],
        ["kind=step", "amplitude=-1"],
        ["kind=sine", "amplitude=1"],
        ["kind=sine", "amplitude=9", "duration=0.4"],
    ],
)
def test_a_load_that_does_not_is_taken(values: list[str]) -> None:
    load_scenario("paper", [f"plant.load.{value}" for value in values])


def test_a_table_that_lifts_the_slide_is_refused(tmp_path: Path) -> None:
    (tmp_path / "course.csv").write_text("0,0\n1,-1.25\n")
    file = tmp_path / "course.csv"
    message = refusal("paper", "plant.load.kind=table", f"plant.load.file={file}")
    assert "load.file = '" in message
    assert " is refused: must leave a normal force" in message


def test_when_they_can_be_changed() -> None:
    known = known_parameters(PlantParameters)
    for part in ("belt", "load", "disturbance"):
        assert known[f"{part}.file"].fixed is Fixed.RUNNING
        assert known[f"{part}.amplitude"].fixed is Fixed.NEVER
    assert known["belt.kind"].fixed is known["load.kind"].fixed is Fixed.ACTIVE
    assert known["disturbance.kind"].fixed is Fixed.NEVER
