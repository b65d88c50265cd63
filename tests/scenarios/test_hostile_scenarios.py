"""Malicious scenarios: refused in one line; nothing is executed or written."""

from pathlib import Path

import pytest

from stickslip_ros.app.main import main
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.files import load_scenario

PLANT = "/**/plant:\n  ros__parameters:\n    "
BAG = '/**/analyzer:\n  ros__parameters:\n    bag: "{}"\n'


def scenario(directory: Path, text: str) -> str:
    path = directory / "hostile.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n", "aliases are not supported"),
        ("[" * 1_000, "nested too deeply"),
        ("{a: " * 1_000, "nested too deeply"),
        ("x" * 1_000_001, "longer than 1000000 characters"),
        (f"{PLANT}mass: !!python/object/apply:os.system [touch executed]\n", "not YAML"),
        (f"{PLANT}mass: !!python/name:os.system\n", "not YAML"),
        (f"{PLANT}mass: !!timestamp soon\n", "does not match its value"),
        (f"{PLANT}mass: !!int ''\n", "does not match its value"),
        (f"{PLANT}mass: !!bool perhaps\n", "does not match its value"),
        (f"{PLANT}mass: !!float heavy\n", ""),
        (f'{PLANT}"\\e]0;owned\\a": 1.0\n', r"unknown parameter \x1b]0;owned\x07"),
        ('"/\\e[2J": {ros__parameters: {mass: 1.0}}\n', r"section /\x1b[2J"),
        ('"plant\\nstickslip: all is well": {ros__parameters: 1}\n', r"plant\nstickslip: all"),
    ],
)
def test_it_is_refused_in_one_line_that_steers_no_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, reason: str
) -> None:
    monkeypatch.chdir(tmp_path)
    path = scenario(tmp_path, text)
    with pytest.raises(InvalidInputError) as raised:
        load_scenario(path)
    assert reason in str(raised.value)
    assert str(raised.value).isprintable()
    assert [file.name for file in tmp_path.iterdir()] == ["hostile.yaml"]


@pytest.mark.parametrize("bag", ["/etc/owned", "../owned", "link/owned", "\\0"])
def test_it_names_no_bag_elsewhere(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    bag: str,
) -> None:
    here = tmp_path / "here"
    here.mkdir()
    (here / "link").symlink_to(tmp_path)
    monkeypatch.chdir(here)
    with pytest.raises(SystemExit) as ended:
        main(["run", scenario(here, BAG.format(bag)), "--duration", "1"])
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
