"""The signals of belt, load and disturbance in scenarios."""

import pickle
from pathlib import Path

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.signals import NO_SIGNAL, impulse, ramp, sine, step, table, trapezoid
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from tests.scenarios.files import plant, refusal, scenario_file, section

POINTS = table([(0.0, 0.0), (1.0, 0.5), (3.0, -0.25)])
TABLE = "time,value\n0,0\n1,0.5\n3,-0.25\n"


def test_each_kind_gives_its_signal() -> None:
    constants = {"amplitude": 0.5, "start": 1.0, "duration": 4.0, "frequency": 2.0}
    for part in ("belt", "load", "disturbance"):
        given = {f"{part}.{name}": value for name, value in constants.items()}
        for kind, signal in {
            "none": NO_SIGNAL,
            "step": step(0.5, 1.0, 4.0),
            "impulse": impulse(0.5, 0.02, 1.0),
            "ramp": ramp(0.5, 1.0, 4.0),
            "sine": sine(0.5, 1.0, 4.0, 2.0),
            "trapezoid": trapezoid(0.5, 1.0, 4.0, 2.0),
        }.items():
            values = {**given, f"{part}.kind": kind, "rate": 50.0}
            parameters = PlantParameters().changed(values, "test")
            assert getattr(parameters, part).signal(parameters.period) == signal
            if part != "disturbance":
                assert getattr(parameters.as_drive(), part) == signal


@pytest.mark.parametrize("part", ["belt", "load", "disturbance"])
def test_a_table_from_a_file_beside_the_scenario(tmp_path: Path, part: str) -> None:
    (tmp_path / "course.csv").write_text(TABLE)
    text = section("/**/plant", f"{{{part}.kind: table, {part}.file: course.csv}}")
    scenario = load_scenario(scenario_file(tmp_path, text))
    assert getattr(scenario.plant, part).file == str(tmp_path / "course.csv")
    assert getattr(scenario.plant, part).signal(1.0) == POINTS
    assert pickle.loads(pickle.dumps(scenario)) == scenario


def test_a_file_of_an_override_is_relative_to_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "course.csv").write_text(TABLE)
    monkeypatch.chdir(tmp_path)
    scenario = load_scenario("paper", ["plant.belt.file=course.csv", "plant.belt.kind=table"])
    assert scenario.plant.belt.file == str(tmp_path / "course.csv")
    given = {"plant.belt.file": "course.csv", "plant.belt.kind": "table"}
    assert load_scenario("paper").changed(given).plant.belt == scenario.plant.belt


def test_the_content_is_that_at_loading_unless_the_file_is_given_again(tmp_path: Path) -> None:
    path = tmp_path / "course.csv"
    path.write_text(TABLE)
    scenario = load_scenario("paper", ["plant.belt.kind=table", f"plant.belt.file={path}"])
    path.write_text("0,1\n")
    for name in ("plant.mass", "plant.belt.start"):
        assert scenario.changed({name: 2.0}).plant.belt.signal(1.0) == POINTS
    given = {"plant.belt.file": str(path)}
    assert scenario.changed(given).plant.belt.signal(1.0) == table([(0.0, 1.0)])
    path.unlink()
    assert scenario.plant.as_drive().belt == POINTS
    with pytest.raises(InvalidInputError, match="the file cannot be read: No such file"):
        scenario.changed(given)


def test_bad_files_are_refused(tmp_path: Path) -> None:
    """What is no table for friction either is in test_friction_parameters.py."""
    path = tmp_path / "course.csv"
    for content, reason in (
        ("", "the file has no numbers"),
        ("1,1\n0,2\n", "point 2 of the table: the time must be above the one before"),
        ("0,0\n1,-1.25\n", "must leave a normal force of at least 0 N"),
    ):
        path.write_text(content)
        message = refusal("paper", "plant.load.kind=table", f"plant.load.file={path}")
        assert "load.file = '" in message
        assert reason in message
    for name in (str(tmp_path / "missing.csv"), "", "\0"):
        with pytest.raises(InvalidInputError, match=r"belt\.file = .* is (invalid|refused)"):
            plant(belt__kind="table", belt__file=name)


def test_a_load_may_take_all_of_the_normal_force() -> None:
    for values in (
        ("kind=step", "amplitude=-1"),
        ("kind=sine", "amplitude=1"),
        ("kind=sine", "amplitude=9", "duration=0.4"),
    ):
        load_scenario("paper", [f"plant.load.{value}" for value in values])
