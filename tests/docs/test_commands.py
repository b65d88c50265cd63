"""Commands that the text of a page only names: they exist, with the options that are named."""

import re

import pytest

from stickslip_ros.app.commands import COMMANDS
from stickslip_ros.app.main import _parser
from tests.docs.page import CHECKOUT, pages, spans

TARGETS = set(
    re.findall(r"^(\w[\w-]*):", (CHECKOUT / "Makefile").read_text(encoding="utf-8"), re.M)
)


def named(program: str) -> list[str]:
    return sorted({s for page in pages() for s in spans(page) if re.match(rf"{program} \w", s)})


@pytest.mark.parametrize("command", named("stickslip"))
def test_stickslip_has_the_commands_and_options_that_are_named(command: str) -> None:
    names, *arguments = command.split()[1:]
    name, *others = names.split("|")
    assert {name, *others} <= set(COMMANDS)
    (subparsers,) = _parser([name])._subparsers._group_actions
    known = subparsers.choices[name]._option_string_actions
    options = {a.split("=")[0] for a in arguments if re.match("--?[a-z]", a)}
    assert options <= set(known)


@pytest.mark.parametrize("command", named("make"))
def test_make_has_the_targets_that_are_named(command: str) -> None:
    assert {word for word in command.split()[1:] if "=" not in word} <= TARGETS
