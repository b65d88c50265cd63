"""`stickslip`: the entry script; every command has its own file."""

import argparse
import os
import sys
from collections.abc import Sequence

from stickslip_ros.app import design, paper, repair, replay, report, run, simulate, stability
from stickslip_ros.errors import InvalidInputError, StickslipError

_COMMANDS = (run, simulate, stability, design, report, repair, replay, paper)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its status.

    0 done; 1 the run failed; 2 what came in is refused; 130 interrupted.
    """
    parser = argparse.ArgumentParser(
        prog="stickslip",
        description="Stick-slip vibration of a feed drive: run, simulate and measure it.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in _COMMANDS:
        subparser = commands.add_parser(command.NAME, help=command.HELP, description=command.HELP)
        command.add_arguments(subparser)
        subparser.set_defaults(run=command.run)
    chosen = parser.parse_args(arguments)
    try:
        status: int = chosen.run(chosen)
        sys.stdout.flush()
    except InvalidInputError as error:
        print(f"stickslip {chosen.command}: {error}", file=sys.stderr)
        status = 2
    except StickslipError as error:
        print(f"stickslip {chosen.command}: {error}", file=sys.stderr)
        status = 1
    except KeyboardInterrupt:
        print(f"stickslip {chosen.command}: interrupted", file=sys.stderr)
        status = run.INTERRUPTED
    except BrokenPipeError:  # whoever read our output has seen enough
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - the interpreter flushes it at exit
        status = 0
    sys.exit(status)


if __name__ == "__main__":
    main()
