"""`stickslip replay`: a recorded run, published again."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from stickslip_ros.app import INTERRUPTED
from stickslip_ros.app.arguments import add_network, seconds
from stickslip_ros.app.optional_dependencies import loading_ros
from stickslip_ros.app.output import progress_bar, tell
from stickslip_ros.app.recordings import add_bag_layout

DESCRIPTION = (
    "Publish the messages of a bag again, unchanged, under their recorded names and with their "
    "recorded spacing. The replay starts when one of the topics has a reader and no other reader "
    "has appeared for half a second. It ends with the bag, or at Ctrl-C. The stamps in the "
    "messages are not changed. With options that say where a bag of another machine has motion and "
    "force, these are published as joint_states and control_force of our plant."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = DESCRIPTION
    parser.usage = "%(prog)s BAG [OPTION ...]"  # argparse shows BAG last, where --topics takes it
    parser.add_argument(
        "bag", metavar="BAG", type=Path, help="bag directory, or one .mcap file; the first argument"
    )
    parser.add_argument(
        "--rate",
        type=float,
        default=1.0,
        metavar="R",
        help="ratio of recorded time to wall time (default: 1)",
    )
    parser.add_argument(
        "--loop",
        action="store_true",
        help="start again at the end, until Ctrl-C; readers see the stamps go back",
    )
    parser.add_argument(
        "--start",
        type=seconds,
        default=0.0,
        metavar="S",
        help="start at S s from the first message of the bag (default: 0)",
    )
    parser.add_argument(
        "--duration",
        type=seconds,
        default=float("inf"),
        metavar="S",
        help="replay S s of recorded time (default: until the end)",
    )
    parser.add_argument(
        "--topics",
        nargs="+",
        action="extend",
        default=[],
        metavar="T",
        help="topics to replay (default: all)",
    )
    parser.add_argument("--clock", action="store_true", help="publish recorded time on /clock")
    parser.add_argument(
        "--wait-for",
        nargs="+",
        action="extend",
        default=[],
        metavar="NODE",
        help="start when these nodes read the topics (default: when any node does)",
    )
    add_bag_layout(parser)
    add_network(parser, "let other machines see the topics (default: loopback only)")


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    with loading_ros():
        from stickslip_ros.nodes.base.network import keep_on_this_machine
        from stickslip_ros.nodes.replay import replay_bag

        reach = keep_on_this_machine(arguments.network)

    def offering(topics: Sequence[str]) -> None:
        wait = f"until {', '.join(arguments.wait_for) or 'a node'} reads them"
        tell(f"{arguments.bag}: {', '.join(topics)}, {reach}, waiting {wait}")

    names = ("rate", "loop", "start", "duration", "topics", "clock", "wait_for")
    machine = ("joint", "belt_joint", "belt_speed", "states_topic", "force_topic", "time", "force")
    given = {name: getattr(arguments, name) for name in (*names, *machine)} | {
        "bag": str(arguments.bag)
    }
    parameters = {name: value for name, value in given.items() if value is not None}
    with progress_bar(f"replaying {arguments.bag}", None if arguments.loop else 1.0) as progress:
        interrupted = replay_bag(parameters, offering, progress)
    return INTERRUPTED if interrupted else 0
