"""`stickslip completion`: the completion script of a shell."""

import argparse
from collections.abc import Iterable
from pathlib import Path

from stickslip_ros.app.commands import COMMANDS, command_parser

_FILES = ("BAG", "DIR", "FILE", "OUT", "RECORDING")
"""Metavars of files and directories."""

_PARAMETERS = ("NODE.PARAMETER=VALUE", "NODE.PARAMETER=A:B:COUNT")

_SPACE_OF_ZSH = """\
    # zsh has no compopt: the space after a word is part of it.
    [[ -z $kind || $kind == options ]] && COMPREPLY=("${COMPREPLY[@]/%/ }")
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "Print a script that completes commands, options, scenarios, parameters and files in a "
        "shell. Evaluate it in the start-up file of the shell, or store it where the shell looks "
        "for completions, such as ~/.local/share/bash-completion/completions/stickslip."
    )
    parser.add_argument("shell", choices=("bash", "zsh"), help="the shell")


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    if arguments.shell == "zsh":
        print("autoload -U +X compinit && compinit\nautoload -U +X bashcompinit && bashcompinit")
    print(_script(arguments.shell), end="")


def _script(shell: str) -> str:
    from stickslip_ros.scenarios.files import shipped_scenarios
    from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS, NODE_PARAMETERS
    from stickslip_ros.scenarios.template import own_first

    parameters = {
        f"{node}.{parameter.name}": parameter
        for node, model in NODE_PARAMETERS.items()
        for parameter in own_first(model)
    }
    values = {
        name: ("true", "false") if parameter.kind is bool else parameter.choices
        for name, parameter in parameters.items()
    }
    of_commands, of_options = _cases()
    parts = {
        "@SHELL@": shell,
        "@SPACE@": _SPACE_OF_ZSH if shell == "zsh" else "",
        "@NOSPACE@": " -o nospace" if shell == "zsh" else "",
        "@COMMANDS@": _words(COMMANDS),
        "@COMMAND_CASES@": "\n".join(of_commands),
        "@OPTION_CASES@": "\n".join(of_options),
        "@VALUE_CASES@": "\n".join(
            f"            {name}) words={_words(choices)} ;;"
            for name, choices in values.items()
            if choices
        ),
        "@LAWS@": _words(CONTROLLER_PARAMETERS),
        "@SCENARIOS@": _words(shipped_scenarios()),
        "@PARAMETERS@": _words(f"{name}=" for name in parameters),
    }
    script = Path(__file__).with_suffix(".sh").read_text(encoding="utf-8")
    for place, text in parts.items():
        script = script.replace(place, text)
    return script


def _cases() -> tuple[list[str], list[str]]:
    """Return the branches of the script for the commands, and for their options with a value."""
    of_commands: list[str] = []
    of_options: list[str] = []
    for name in COMMANDS:
        options: list[str] = []
        positional = ""
        for action in command_parser(name)._actions:  # pyright: ignore[reportPrivateUsage]
            completed = _completed(action)
            options += action.option_strings
            if action.option_strings and action.nargs != 0:
                pattern = " | ".join(f'"{name} {option}"' for option in action.option_strings)
                of_options.append(f"            {pattern}) {completed} ;;")
            elif not action.option_strings and not positional:
                positional = completed.replace("kind=", "positional=")
        of_commands.append(f"        {name}) options={_words(options)} {positional} ;;")
    return of_commands, of_options


def _completed(action: argparse.Action) -> str:
    """Return how the script completes the value of an option or an argument."""
    if action.choices is not None:
        return f"words={_words(action.choices)}"
    if action.metavar in _PARAMETERS:
        return "kind=parameters"
    if action.metavar in ("CONTROLLER", "NAME"):
        return "words=@LAWS@" + (" kind=files" if action.metavar == "CONTROLLER" else "")
    if action.metavar == "MEASURE":
        from stickslip_ros.show.quantities import COLOURS

        return f"words={_words(COLOURS)}"
    if action.metavar == "SCENARIO":
        return "kind=scenarios"
    return "kind=files" if action.metavar in _FILES else "kind="


def _words(words: Iterable[str]) -> str:
    return f"'{' '.join(words)}'"
