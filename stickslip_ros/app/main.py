"""`stickslip`: the entry script; every command has its own file."""

import argparse
import io
import os
import re
import sys
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stderr

from stickslip_ros.app import INTERRUPTED
from stickslip_ros.app.commands import COMMANDS, command_parser, overview
from stickslip_ros.errors import InvalidInputError, StickslipError
from stickslip_ros.installed_packages import versions
from stickslip_ros.interrupts import raise_interrupts
from stickslip_ros.standard_streams import nowhere, open_closed_streams
from stickslip_ros.text import did_you_mean


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its status.

    0 done; 1 the run failed; 2 the input is refused; 130 interrupted.
    """
    given = words = sys.argv[1:] if arguments is None else list(arguments)
    command = " ".join(given[:1])
    further: list[str] = []
    chosen: argparse.Namespace | None = None
    if command == "run" and "--" in given:  # what follows is for the controller
        end = given.index("--")
        given, further = given[:end], given[end + 1 :]
    open_closed_streams()
    if isinstance(sys.stdout, io.TextIOWrapper):  # µ is not in every encoding
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        raise_interrupts()
        if not given or given[0] in ("-h", "--help"):
            print(overview(), flush=True)
            sys.exit(0)
        parser = command_parser(_command_of(given[0]))
        known = argparse.Namespace(words=words, further=further)
        chosen, unknown = parser.parse_known_args(_with_negative_values(given[1:]), known)
        if unknown:
            parser.error(_unrecognized(unknown, parser.format_usage()))
        with redirect_stderr(nowhere()) if chosen.quiet else nullcontext():
            status: int = chosen.run(chosen) or 0
        sys.stdout.flush()
    except StickslipError as error:
        print(f"stickslip {command}: {error}", file=sys.stderr)
        status = 2 if isinstance(error, InvalidInputError) else 1
    except KeyboardInterrupt as error:
        out = getattr(chosen, "out", None)
        said = error.args or ([f"{out} is there"] if out is not None and out.exists() else [])
        print(": ".join([f"stickslip {command}: interrupted", *said]), file=sys.stderr)
        status = INTERRUPTED
    except BrokenPipeError:  # the reader of our output has closed it
        sys.stdout = nowhere()
        status = 0
    except OSError as error:  # such as a full disk below standard output
        sys.stdout = nowhere()
        print(f"stickslip {command}: {_reason(error)}", file=sys.stderr)
        status = 1
    except Exception as error:
        from stickslip_ros.scenarios.foreign_laws import failure_in_words  # --help needs none

        failure = failure_in_words(error)
        if failure is None:
            raise
        print(f"stickslip {command}: {failure}", file=sys.stderr)
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


def _command_of(name: str) -> str:
    """Return the name of a command, or show the versions."""
    parser = argparse.ArgumentParser(
        prog="stickslip", usage="%(prog)s [-h] [--version] COMMAND ...", add_help=False
    )
    parser.add_argument("--version", action="store_true")
    if parser.parse_known_args([name])[0].version:
        print(", ".join(f"{part} {version}" for part, version in versions().items()))
        parser.exit()
    if name not in COMMANDS:
        known = f"known are {', '.join(sorted(COMMANDS))}"
        meant = did_you_mean(name, [*COMMANDS, "--version", "--help"], known)
        parser.error(f"unknown command {name!r:.80}; {meant}")
    return name


if __name__ == "__main__":
    main()
