"""`stickslip basin`: which motion a start leads to."""

import argparse
from dataclasses import asdict

from stickslip_ros.app.arguments import (
    add_json,
    add_plot,
    add_scenario,
    check_picture,
    scenario_of,
    write_picture,
)
from stickslip_ros.app.output import print_table
from stickslip_ros.app.study_command import add_running, computed, course_of, write_results
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.plots.basin_table import basin_table
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.basin import (
    COUNT,
    COURSE,
    POSITION,
    VELOCITY,
    Basins,
    basin_study,
    default_axes,
)
from stickslip_ros.studies.columns import Columns
from stickslip_ros.studies.plan import Axis, Grid, Plan, RandomSample

HELP = "find which motion each start leads to, and the share of starts that each motion gets"

_DESCRIPTION = f"""{HELP} (basin stability), over a grid of starts or a random sample. A start is a
displacement and a velocity of the slide; the washout filter is at rest. Each motion is followed
until it is steady, for {COURSE.patience} transients at most."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = _DESCRIPTION
    add_scenario(parser)
    for name, what, unit in (("position", "displacements", "m"), ("velocity", "velocities", "m/s")):
        parser.add_argument(
            f"--{name}",
            metavar="A:B:COUNT",
            help=f"{what} of the grid, {unit}, as in --{name} -2:2:{COUNT} (of a --sample A:B "
            f"will do; default: {COUNT}, twice as far to either side as a vibration goes, about)",
        )
    parser.add_argument(
        "--sample",
        type=int,
        metavar="COUNT",
        help="so many random starts, uniformly distributed between the ends of --position and "
        "--velocity, instead of the grid",
    )
    parser.add_argument(
        "--seed", type=int, metavar="SEED", help="which sample it is, 0 or more (default: 0)"
    )
    add_running(parser, COURSE)
    add_plot(parser, "which motion each start leads to")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    scenario = scenario_of(arguments)
    study = basin_study(
        scenario,
        _plan(arguments, scenario),
        course=course_of(arguments, COURSE),
        continuous=arguments.continuous_control,
    )
    check_picture(arguments.plot)
    label = f"basins of {scenario.name}, {study.plan.size} starts"
    with computed(arguments, study, label) as journal:
        basins = Basins.from_points(journal.points())
        made = {"attractors": [asdict(attractor) for attractor in basins.attractors]}
        if arguments.plot is not None:
            # Half as long again to import as everything else.
            from stickslip_ros.plots.basin_picture import study_figure

            columns = Columns.from_journal(journal)
            write_picture(arguments.plot, study_figure(columns, basins, study))
        write_results(arguments, journal, {"attractor": basins.place}, made)
        if not arguments.json:
            print_table(*basin_table(study, basins))
    return 0


def _plan(arguments: argparse.Namespace, scenario: Scenario) -> Plan:
    if arguments.seed is not None and arguments.sample is None:
        raise InvalidInputError(f"--seed {arguments.seed}: is for a random --sample")
    if arguments.seed is not None and arguments.seed < 0:
        raise InvalidInputError(f"--seed {arguments.seed}: must be 0 or more")
    axes = list(default_axes(scenario, COUNT))
    for place, (option, parameter) in enumerate((("position", POSITION), ("velocity", VELOCITY))):
        text: str | None = getattr(arguments, option)
        if text is None:
            continue
        # Of a sample only the ends matter.
        number = f"{text}:2" if arguments.sample is not None and text.count(":") == 1 else text
        try:
            axes[place] = Axis.parse(f"{parameter}={number}")
        except InvalidInputError as error:
            reason = str(error).partition(": ")[2].replace("NODE.PARAMETER=", "")
            raise InvalidInputError(f"--{option}={text}: {reason}") from None
    if arguments.sample is None:
        return Grid(tuple(axes))
    return RandomSample(tuple(axes), arguments.sample, arguments.seed or 0)
