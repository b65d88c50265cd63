"""`stickslip design`: gains for a drive, tried out by simulation."""

import argparse
import shlex
import sys
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from stickslip_ros.app.arguments import (
    add_json,
    add_plot,
    add_scenario,
    check_new,
    check_picture,
    made_of,
    scenario_of,
    write_picture,
    writing,
)
from stickslip_ros.app.output import print_json, print_table, progress_bar
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.plots.design_table import CONTROLLER, MARGINS, WORST, design_tables
from stickslip_ros.studies.design import Design, Task, design
from stickslip_ros.studies.design_task import OWN_SPEED_RANGE
from stickslip_ros.text import printable

HELP = "propose corner frequency and gains that damp the vibration within a force limit"

_DESCRIPTION = f"""{HELP}. The drive, rate and force_delay are the scenario's, the force limit is
washout_controller.force_limit (-p washout_controller.force_limit=200). Its gains do not matter.
What is proposed was simulated: the vibration is caught at several belt speeds and phases."""

_PROPOSED = [f"washout_controller.{name}" for name in CONTROLLER if name != "force_limit"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = _DESCRIPTION
    add_scenario(parser)
    parser.add_argument(
        "--belt-speed",
        metavar="LOW:HIGH",
        help="range of belt speeds to design for, m/s, both above zero; one number for a single "
        f"speed (default: the scenario's belt speed, give or take {OWN_SPEED_RANGE:.0%})".replace(
            "%", "%%"
        ),
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="write the scenario there, complete, with what is proposed; an existing file is left "
        "alone",
    )
    add_plot(parser, "the decay rate over corner frequency and linear gain")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    scenario = scenario_of(arguments, unused=_PROPOSED)
    task = Task.from_scenario(scenario, _belt_speeds(arguments.belt_speed))
    if arguments.out is not None:
        check_new("--out", arguments.out)
    check_picture(arguments.plot)
    with progress_bar(f"designing for {scenario.name}", 1.0) as progress:
        found = design(task, progress)
    if arguments.json:
        print_json({**_as_dict(found), **made_of(scenario)})
    else:
        for part in design_tables(scenario.name, found):
            if isinstance(part, str):
                print(part)
            else:
                print_table(*part)
        if found.parameter_file is not None and arguments.out is None:
            print(
                "--out FILE writes the scenario with these gains, --json has it as parameter_file"
            )
    if arguments.out is not None:
        _write(arguments.out, found)
    if arguments.plot is not None:
        _draw(arguments.plot, found)
    return 0


def _belt_speeds(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        speeds = [float(part) for part in text.split(":")]
    except ValueError:
        speeds = []
    if len(speeds) not in (1, 2):
        raise InvalidInputError(f"--belt-speed {text!r}: must be LOW:HIGH, or one speed, in m/s")
    return speeds[0], speeds[-1]


def _write(path: Path, found: Design) -> None:
    if found.parameter_file is None:
        _leave_out(f"--out {path}: not written")
        return
    with writing("--out", path), path.open("x", encoding="utf-8") as file:
        file.write(found.parameter_file)
    command = shlex.join(["stickslip", "run", str(path)])
    print(f"{printable(str(path))} is written: `{printable(command)}` runs it", file=sys.stderr)


def _draw(path: Path, found: Design) -> None:
    # Half as long again to import as everything else.
    from stickslip_ros.plots.stability_map import stability_figure

    around = found.map_around()
    if around is None:
        _leave_out(f"--plot {path}: not drawn")
    else:
        write_picture(path, stability_figure(around, None))


def _leave_out(what: str) -> None:
    print(f"stickslip design: {what}, for there is nothing to propose", file=sys.stderr)


def _as_dict(found: Design) -> dict[str, Any]:
    controller, slowest, task = found.controller, found.slowest, found.task
    values = asdict(controller) if controller else dict.fromkeys(CONTROLLER)
    checks = [asdict(check) for check in found.checks]
    return {
        "belt_speeds": list(task.belt_speeds),
        **values,
        "force_limit": task.force_limit,
        "worst_belt_speed": slowest.drive.belt_speed if slowest else None,
        "decay_rate": min((check.decay_rate for check in found.checks), default=None),
        **{name: _largest(check[name] for check in checks) for name in WORST},
        "margins": asdict(found.margins) if found.margins else dict.fromkeys(MARGINS),
        "checks": checks,
        "parameter_file": found.parameter_file,
        "remark": found.remark,
    }


def _largest(values: Iterable[float | None]) -> float | None:
    return max((value for value in values if value is not None), default=None)
