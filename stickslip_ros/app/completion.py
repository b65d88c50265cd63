"""`stickslip completion`: the completion script of a shell."""

import argparse
import re
from pathlib import Path

from stickslip_ros.app.commands import COMMANDS, command_parser

_FILES = ("BAG", "DIR", "FILE", "FILE.csv", "OUT", "PATH", "RECORDING")
"""Metavars of files and directories."""

_FUNCTIONS = {
    "NODE.PARAMETER=VALUE": "_stickslip_parameters",
    "NODE.PARAMETER=A:B:COUNT": "_stickslip_parameters",
    "SCENARIO": "_stickslip_scenario_files",  # from "_file" shtab knows that these can be files
    "CONTROLLER": "_stickslip_controller_files",
}
"""What completes an argument in the shell, by its metavar."""


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
    import shtab

    from stickslip_ros.scenarios.files import shipped_scenarios
    from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS, NODE_PARAMETERS
    from stickslip_ros.show.quantities import COLOURS

    parser = argparse.ArgumentParser("stickslip")
    commands = parser.add_subparsers()
    for name, (_, meaning) in COMMANDS.items():
        command = command_parser(name)
        for action in command._actions:  # pyright: ignore[reportPrivateUsage]
            metavar = str(action.metavar)
            if metavar in _FILES:
                vars(action)["complete"] = shtab.FILE
            elif metavar in _FUNCTIONS:
                vars(action)["complete"] = dict.fromkeys(("bash", "zsh"), _FUNCTIONS[metavar])
            elif action.dest == "controller":
                action.choices = list(CONTROLLER_PARAMETERS)
            elif metavar == "MEASURE":
                action.choices = list(COLOURS)
            action.metavar = None  # which zsh would parse
        commands.add_parser(name, help=meaning, add_help=False, parents=[command])
    parameters = [
        f"{node}.{parameter.name}={value}"
        for node, model in NODE_PARAMETERS.items()
        for parameter in model.known.values()
        for value in (("true", "false") if parameter.kind is bool else parameter.choices or ("",))
    ]
    text = Path(__file__).with_suffix(f".{arguments.shell}").read_text(encoding="utf-8")
    for place, words in (
        ("@PARAMETERS@", parameters),
        ("@SCENARIOS@", shipped_scenarios()),
        ("@LAWS@", CONTROLLER_PARAMETERS),
    ):
        text = text.replace(place, " ".join(words))
    script = shtab.complete(parser, arguments.shell, preamble=text)
    if arguments.shell == "bash":
        script += "\ncomplete -F _stickslip stickslip"
    else:  # an argument that can be repeated, and --OPTION=VALUE
        script = script.replace('"(*):', '"*:')
        script = re.sub(r"(--[\w-]+)(?=\[.*[^\\]\]:)", r"\1=", script)
    print(script)
