"""Arguments of the commands that read recordings."""

import argparse
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

from stickslip_ros.app.arguments import length, seconds, shift, velocity, whole
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.record import ForceSource, TimeSource


def add_recordings(parser: argparse.ArgumentParser, what: str) -> None:
    """Add RECORDING, and `what` it is."""
    parser.add_argument("recordings", metavar="RECORDING", nargs="+", type=Path, help=what)


def _add_table_form(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--columns",
        metavar="QUANTITY=COLUMN,...",
        help="where a table has time, position, velocity, force, belt_velocity, friction_force, "
        "disturbance and reference: columns and numbers with + - * /, brackets, unwrap(column, "
        "turn) and cumsum(column), in SI units, as in time=t,position=(cmd-x)*1e-3,"
        "belt_velocity=0.04; 'a name' in quotes, #2 for the second column; what has no number in "
        "it is converted, if the table has its unit",
    )
    parser.add_argument(
        "--decimal", metavar="MARK", help="decimal mark of a table, . or , (default: found)"
    )
    parser.add_argument(
        "--skip",
        type=int,
        metavar="LINES",
        help="lines of a table before its names or, without names, its rows (default: found)",
    )
    parser.add_argument(
        "--encoding", metavar="NAME", help="encoding of a table, as utf-16 (default: found)"
    )
    parser.add_argument(
        "--period",
        type=seconds,
        metavar="S",
        help="time from row to row of a table without times, as 2ms (default: found above them)",
    )
    parser.add_argument(
        "--where",
        metavar="COLUMN=VALUE",
        help="rows of a table that are read, as joint_name=elbow (default: all)",
    )
    parser.add_argument(
        "--session",
        type=whole("a whole number from {} to {}", 1, 1_000_000),
        metavar="N",
        help="which session of a table is read, where the time starts again",
    )
    parser.add_argument(
        "--second",
        type=Path,
        metavar="FILE",
        help="another table of the same run: its columns are 2:NAME, at its own times",
    )
    parser.add_argument(
        "--shift",
        type=shift,
        default=0.0,
        metavar="S",
        help="what is added to times of their own that columns of a table have, as -20ms "
        "(default: 0)",
    )


def _add_units(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--force-constant",
        metavar="K",
        help="the force of a table is a current: 50N/A of a linear motor, 0.35Nm/A of a motor with "
        "--pitch or --rotary",
    )
    parser.add_argument(
        "--pitch", type=length, metavar="M", help="way of the slide in a turn of the motor, as 10mm"
    )
    parser.add_argument(
        "--rotary",
        action="store_true",
        help="show displacements as angles, rad, and forces as torques, N m",
    )


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how recordings are read: see `reading_of`."""
    _add_table_form(parser)
    _add_units(parser)
    parser.add_argument(
        "--from",
        dest="start",
        type=seconds,
        default=0.0,
        metavar="S",
        help="start of the part that is used, s from the first sample of each recording "
        "(default: 0)",
    )
    parser.add_argument(
        "--to",
        dest="end",
        type=seconds,
        default=float("inf"),
        metavar="S",
        help="end of the part that is used, s from the first sample of each recording "
        "(default: the end)",
    )
    parser.add_argument(
        "--namespace", metavar="NS", help="ROS namespace of the drive, if a bag holds several"
    )
    add_bag_layout(parser)


def reading_of(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return how recordings are read, by the names that the functions of the API have for it."""
    from stickslip_ros.record.bag_layout import BagLayout
    from stickslip_ros.record.table_columns import TableFormat

    names = [option.name for kind in (TableFormat, BagLayout) for option in fields(kind)]
    names += ["start", "end", "namespace", "belt_speed"]
    columns = _columns_of(arguments.columns)
    if arguments.force_constant is not None and columns is None:
        raise InvalidInputError(
            f"--force-constant {arguments.force_constant}: is for the current in a table that "
            "--columns names as its force"
        )
    return {"columns": columns} | {name: getattr(arguments, name) for name in names}


def add_bag_layout(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where recordings of other machines have motion and force."""
    parser.add_argument(
        "--joint",
        metavar="NAME",
        help="joint that is the slide (default: slide of slide and belt, or the only one)",
    )
    parser.add_argument("--belt-joint", metavar="NAME", help="joint that is the belt")
    parser.add_argument(
        "--belt-speed",
        type=velocity,
        metavar="V",
        help="belt speed, m/s, for a table, in place of its belt velocity, and for a bag whose "
        "joint states have no belt (default: a belt that is not recorded is at rest)",
    )
    parser.add_argument(
        "--states-topic",
        metavar="TOPIC",
        help="full name of the topic of joint states (default: joint_states of the namespace); "
        "with [2] behind it, of two sources that take turns the second",
    )
    parser.add_argument(
        "--force-topic",
        metavar="TOPIC",
        help="full name of the topic of forces: wrenches, numbers, arrays, or joint commands with "
        "efforts (default: control_force of the namespace); with [2] behind it, the second number "
        "of an array",
    )
    parser.add_argument(
        "--time",
        choices=get_args(TimeSource),
        default="header",
        help="time by the stamps in the messages, or by the log of the recorder (default: header)",
    )
    parser.add_argument(
        "--force",
        choices=get_args(ForceSource),
        default="topic",
        help="force from a topic, or the effort of the joint, which in our bags is friction "
        "(default: topic)",
    )


def _columns_of(text: str | None) -> dict[str, str] | None:
    """Return the columns that --columns names, by quantity."""
    from stickslip_ros.record.expressions import parts_of

    if text is None:
        return None
    columns: dict[str, str] = {}
    for part in parts_of(text):
        quantity, equals, column = (side.strip() for side in part.partition("="))
        if not (quantity and equals and column) or quantity in columns:
            raise InvalidInputError(
                f"--columns {text}: must be QUANTITY=COLUMN,..., each quantity once, as in "
                "time=t,position=x"
            )
        columns[quantity] = column
    return columns
