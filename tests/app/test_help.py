"""The help of the program and of each command."""

import re
import shlex

import pytest

from stickslip_ros.app.commands import COMMANDS, EXAMPLES
from stickslip_ros.app.main import command_parser
from tests.app.conftest import Run


@pytest.mark.parametrize("arguments", [(), ("--help",), ("-h",)])
def test_the_help_has_every_command_below_its_task(
    stickslip: Run, arguments: tuple[str, ...]
) -> None:
    done = stickslip(*arguments)
    assert (done.returncode, done.stderr) == (0, "")
    group, shown = "", {}
    for line in done.stdout.splitlines():
        group = line.rstrip(":") if re.fullmatch(r"[A-Z][\w ]*:", line) else group
        if line.startswith("  "):
            name, meaning = line.split(maxsplit=1)
            shown[name] = group, meaning
    assert shown.items() >= COMMANDS.items()
    assert max(map(len, done.stdout.splitlines())) <= 80


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_a_command_ends_with_an_example_that_it_takes(
    stickslip: Run, name: str
) -> None:
    done = stickslip(name, "--help")
    assert done.returncode == 0
    assert " ".join(done.stdout.split()).endswith(f"example: {EXAMPLES[name]}")
    words = shlex.split(EXAMPLES[name].split(" > ")[0].removeprefix('eval "$(').removesuffix(')"'))
    assert words[:2] == ["stickslip", name]
    command_parser(name).parse_args(words[2:])


@pytest.mark.parametrize("name", COMMANDS)
def test_every_argument_has_a_help_text(name: str) -> None:
    for action in command_parser(name)._actions:
        assert action.help, action
