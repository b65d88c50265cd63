"""`stickslip`: the entry script; every command has its own file."""

import argparse
import io
import os
import re
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import NoReturn

from stickslip_ros.app import INTERRUPTED
from stickslip_ros.app.commands import COMMANDS, EXAMPLES, overview
from stickslip_ros.app.optional_dependencies import interrupts_kept
from stickslip_ros.errors import InvalidInputError, StickslipError
from stickslip_ros.interrupts import raise_interrupts
from stickslip_ros.standard_streams import nowhere, open_closed_streams
from stickslip_ros.text import did_you_mean
from stickslip_ros.versions import versions


def _load(name: str) -> ModuleType:
    """Import the module of a command: its arguments, and a `run` that imports what it needs."""
    match name:
        case "run":
            from stickslip_ros.app import run as command
        case "dashboard":
            from stickslip_ros.app import dashboard as command
        case "simulate":
            from stickslip_ros.app import simulate as command
        case "stability":
            from stickslip_ros.app import stability as command
        case "design":
            from stickslip_ros.app import design as command
        case "sweep":
            from stickslip_ros.app import sweep as command
        case "basin":
            from stickslip_ros.app import basin as command
        case "identify":
            from stickslip_ros.app import identify as command
        case "report":
            from stickslip_ros.app import report as command
        case "repair":
            from stickslip_ros.app import repair as command
        case "replay":
            from stickslip_ros.app import replay as command
        case "paper":
            from stickslip_ros.app import paper as command
        case "set":
            from stickslip_ros.app import set as command
        case "list":
            from stickslip_ros.app import list as command
        case "show":
            from stickslip_ros.app import show as command
        case "new":
            from stickslip_ros.app import new as command
        case "schema":
            from stickslip_ros.app import schema as command
        case "completion":
            from stickslip_ros.app import completion as command
        case _:
            raise AssertionError(name)
    return command


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its status.

    0 done; 1 the run failed; 2 the input is refused; 130 interrupted.
    """
    given = sys.argv[1:] if arguments is None else list(arguments)
    command = " ".join(given[:1])
    further: list[str] = []
    if command == "run" and "--" in given:  # what follows is for the controller
        end = given.index("--")
        given, further = given[:end], given[end + 1 :]
    given = _with_negative_values(given)
    open_closed_streams()
    if isinstance(sys.stdout, io.TextIOWrapper):  # µ is not in every encoding
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        raise_interrupts()
        if not given or given[0] in ("-h", "--help"):
            print(overview(), flush=True)
            sys.exit(0)
        parser = _parser(given)
        if command and not command.startswith("-") and command not in COMMANDS:
            parser.error(f"unknown command {command!r:.80}; {did_you_mean(command, COMMANDS)}")
        known = argparse.Namespace(further=further, parser_of=command_parser)
        chosen, unknown = parser.parse_known_args(given, known)
        if unknown:
            chosen.parser.error(_unrecognized(unknown, chosen.parser.format_usage()))
        status: int = chosen.run(chosen)
        sys.stdout.flush()
    except StickslipError as error:
        print(f"stickslip {command}: {error}", file=sys.stderr)
        status = 2 if isinstance(error, InvalidInputError) else 1
    except KeyboardInterrupt as error:
        print(": ".join([f"stickslip {command}: interrupted", *error.args]), file=sys.stderr)
        status = INTERRUPTED
    except BrokenPipeError:  # the reader of our output has closed it
        sys.stdout = nowhere()
        status = 0
    except OSError as error:  # such as a full disk below standard output
        sys.stdout = nowhere()
        print(f"stickslip {command}: {_reason(error)}", file=sys.stderr)
        status = 1
    sys.exit(status)


def _unrecognized(arguments: Sequence[str], usage: str) -> str:
    """Return the message about unknown arguments, with the options that may be meant."""
    option = next((text for text in arguments if text.startswith("--")), "").partition("=")[0]
    meant = did_you_mean(option, set(re.findall(r"--[a-z][\w-]*", usage)), "")
    return "; ".join(filter(None, [f"unrecognized arguments: {' '.join(arguments)}", meant]))


def _with_negative_values(given: Sequence[str]) -> list[str]:
    """Join a value that begins with a negative number to its option: argparse reads an option."""
    joined: list[str] = []
    for word in given:
        negative = re.match(r"-(\.?\d|inf)", word)
        if negative and joined and re.fullmatch(r"--[\w-]+", joined[-1]):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def _reason(error: OSError) -> str:
    try:
        os.getcwd()
    except FileNotFoundError:
        return "the current directory has been deleted: change to one that exists"
    return str(error)


def _parser(given: Sequence[str]) -> argparse.ArgumentParser:
    """Return the parser of all commands; only the given one gets its arguments, and is imported."""
    parser = argparse.ArgumentParser(
        prog="stickslip",
        description="Stick-slip vibration of a feed drive: run, simulate and measure it.",
    )
    parser.add_argument(
        "--version", action=_ShowVersions, nargs=0, help="show the version numbers and exit"
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    chosen = next((word for word in given if not word.startswith("-")), "")
    for name, (_, line) in COMMANDS.items():
        example = f"example: {EXAMPLES[name]}" if name in EXAMPLES else None
        subparser = commands.add_parser(name, help=line, description=line, epilog=example)
        if name == chosen:
            with interrupts_kept():
                command = _load(name)
            command.add_arguments(subparser)
            subparser.set_defaults(run=command.run, parser=subparser)
    return parser


def command_parser(name: str) -> argparse.ArgumentParser:
    """Return the parser of a command alone."""
    parser = argparse.ArgumentParser(prog=f"stickslip {name}", description=COMMANDS[name][1])
    _load(name).add_arguments(parser)
    return parser


class _ShowVersions(argparse.Action):
    """Look the version numbers up when they are asked for: that takes longer than all else."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        print(", ".join(f"{name} {version}" for name, version in versions().items()))
        parser.exit()


if __name__ == "__main__":
    main()
