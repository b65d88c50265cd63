"""The help of the program and of each command."""

import re
import shlex
import sys

import pytest

from stickslip_ros.app.commands import COMMANDS, EXAMPLES, command_parser, overview
from tests.app.conftest import Run


def test_the_help_has_every_command_below_its_task(stickslip: Run) -> None:
    done = stickslip()
    assert (done.returncode, done.stderr) == (0, "")
    assert stickslip("--help").stdout == stickslip("-h").stdout == done.stdout
    group, shown = "", {}
    for line in done.stdout.splitlines():
        group = line.rstrip(":") if re.fullmatch(r"[A-Z][\w ]*:", line) else group
        if line.startswith("  "):
            name, meaning = line.split(maxsplit=1)
            shown[name] = group, meaning
    assert shown.items() >= COMMANDS.items()
    assert max(map(len, done.stdout.splitlines())) <= 80


def test_help_is_coloured_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    def helps() -> list[str]:
        return [overview(), command_parser("design").format_help()]

    plain = helps()
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    coloured = helps()
    assert [re.sub(r"\033\[[\d;]*m", "", text) for text in coloured] == plain
    for marked in ("\033[32mdesign\033[0m", "\033[1;34mDesign:\033[0m", "\033[36m--version"):
        assert marked in coloured[0]
    assert "\033[36m--belt-speed\033[0m LOW:HIGH" in coloured[1]
    monkeypatch.setenv("NO_COLOR", "1")
    assert helps() == plain


def test_the_help_of_a_command_ends_with_an_example_that_it_takes(stickslip: Run) -> None:
    for name in COMMANDS:
        done = stickslip(name, "--help")
        assert done.returncode == 0
        example = EXAMPLES[name]
        assert " ".join(done.stdout.split()).endswith(f"example: {example}")
        words = shlex.split(example.split(" > ")[0].removeprefix('eval "$(').removesuffix(')"'))
        assert words[:2] == ["stickslip", name]
        parser = command_parser(name)
        parser.parse_args(words[2:])
        for action in parser._actions:
            assert action.help, (name, action)
