"""Malicious scenarios: refused in one line; nothing is executed or written."""

import os
from pathlib import Path

import pytest

from stickslip_ros.app.main import main
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.files import load_scenario
from tests.scenarios.files import scenario_file

PLANT = "/**/plant:\n  ros__parameters:\n    "
BAG = '/**/analyzer:\n  ros__parameters:\n    bag: "{}"\n'


HOSTILE = {
    "a: &a {x: 1}\n? *a\n: *a\n": "expected node names",
    f"{PLANT}a: &a [x, x]\n    b: [*a, *a]\n": "line 4: is not YAML for ROS: must be a scalar, and",
    "[" * 1_000: "must be a scalar",
    "{a: " * 100_000: "nested too deeply",
    "x" * 1_000_001: "longer than 1000000 characters",
    f"{PLANT}mass: !!python/object/apply:os.system [touch executed]\n": "mass = ['touch executed']",
    f"{PLANT}mass: !!python/name:os.system\n": "a value is missing",
    f"{PLANT}mass: !!timestamp soon\n": "mass = 'soon' is invalid",
    f"{PLANT}mass: !!bool perhaps\n": "mass = 'perhaps' is invalid",
    f'{PLANT}"\\e]0;owned\\a": 1.0\n': r"unknown parameter \x1b]0;owned\x07",
    '"/\\e[2J": {ros__parameters: {mass: 1.0}}\n': r"/\x1b[2J",
    '"plant\\nstickslip: all is well": {ros__parameters: 1}\n': r"plant\nstickslip: all",
}


def test_it_is_refused_in_one_line_that_steers_no_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for text, reason in HOSTILE.items():
        with pytest.raises(InvalidInputError) as raised:
            load_scenario(scenario_file(tmp_path, text))
        assert reason in str(raised.value)
        assert str(raised.value).isprintable()
        assert [file.name for file in tmp_path.iterdir()] == ["scenario.yaml"]


def test_it_names_no_bag_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    here = tmp_path / "here"
    here.mkdir()
    (here / "link").symlink_to(tmp_path)
    monkeypatch.chdir(here)
    for bag in ("/etc/owned", "../owned", "link/owned"):
        with pytest.raises(SystemExit) as ended:
            main(["run", scenario_file(here, BAG.format(bag)), "--duration", "1"])
        assert ended.value.code == 2
        assert "must be below the current directory" in capsys.readouterr().err
        assert [file.name for file in tmp_path.iterdir()] == ["here"]


def test_its_file_name_cannot_steer_a_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "[red]{task.fields}\x1b[2J.yaml"
    path.write_text(f"{PLANT}mass: 1.0\n", encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        main(["simulate", str(path), "--duration", "1"])
    assert ended.value.code == 0
    output = capsys.readouterr().out
    assert r"[red]{task.fields}\x1b[2J" in output
    assert "\x1b" not in output


SECRET = "hunter2"
BASE = "/**/scenario:\n  ros__parameters: {base: secret.yaml}\n"


def test_what_is_in_a_file_that_it_names_is_not_shown(tmp_path: Path) -> None:
    for text in (
        f"root:{SECRET}:0:0\n",
        f"{SECRET}: @\n",
        f"- {SECRET}\n",
        f"{SECRET}: {{ros__parameters: {{a: 1}}}}\n",
        f"/**/plant: {{ros__parameters: {{{SECRET}: 1}}}}\n",
        f"/**/plant: {{ros__parameters: {{mass: {SECRET}}}}}\n",
        f"/**/plant: {{ros__parameters: {{mass: {{{SECRET}: 1}}}}}}\n",
        f"/**/plant: {{ros__parameters: {{wait_for: [], wait_for: {SECRET}}}}}\n",
        f"/**/plant: {{ros__parameters: {{friction: {{law: {SECRET}}}}}}}\n",
        f"/**/scenario: {{ros__parameters: {{base: {SECRET}}}}}\n",
        f"/**/scenario: {{ros__parameters: {{{SECRET}: 1}}}}\n",
    ):
        (tmp_path / "secret.yaml").write_text(text, encoding="utf-8")
        with pytest.raises(InvalidInputError) as raised:
            load_scenario(scenario_file(tmp_path, BASE))
        assert SECRET not in str(raised.value)
        assert f"base {tmp_path / 'secret.yaml'} of " in str(raised.value)
        assert "at line 1: must be a scenario file" in str(raised.value) or text[5:12] != SECRET
        with pytest.raises(InvalidInputError, match=rf"secret\.yaml.*({SECRET}|line 1: )"):
            load_scenario(str(tmp_path / "secret.yaml"))


def test_nor_is_what_is_in_a_curve(tmp_path: Path) -> None:
    for text in (SECRET, "0,0.4\n0.7,0.3\n0.7,0.2", "1,1\n1,1", "0,-0.7\n0,0.7"):
        (tmp_path / "c.csv").write_text(f"0,0\n{text}\n", encoding="utf-8")
        for group in ("friction: {law", "disturbance: {kind"):
            with pytest.raises(InvalidInputError, match=r"file = '.* is refused: ") as raised:
                load_scenario(scenario_file(tmp_path, f"{PLANT}{group}: table, file: c.csv}}\n"))
            words = {*str(raised.value).rpartition(" is refused: ")[2].replace(",", " ").split()}
            assert words.isdisjoint({SECRET, "0.7", "-0.7", "0.0", "1.0"})


def test_what_may_never_end_is_not_read(tmp_path: Path) -> None:
    endless = tmp_path / "secret.yaml"
    for make in (os.mkfifo, lambda path: path.symlink_to("/dev/zero")):
        make(endless)
        with pytest.raises(InvalidInputError, match="it is not a regular file"):
            load_scenario(str(endless))
        with pytest.raises(InvalidInputError, match="must be a scenario file"):
            load_scenario(scenario_file(tmp_path, BASE))
        endless.unlink()
