"""`stickslip basin`: which motion a start leads to."""

import argparse
from functools import partial
from typing import TYPE_CHECKING

from stickslip_ros.app.arguments import add_json, add_scenario, scenario_of
from stickslip_ros.app.result import add_plot, check_results
from stickslip_ros.app.study_command import add_running, give_study, settling_of
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.studies.options import BASIN_COUNT, BASIN_OPTIONS

if TYPE_CHECKING:
    from stickslip_ros.scenarios.files import Scenario
    from stickslip_ros.studies.plan import Plan

_DESCRIPTION = f"""Find the motion that each initial state leads to, and the share of initial
states for each motion (basin stability), over a grid or a random sample. An initial state is a
displacement and a velocity of the slide; the controller is at rest. Each motion is followed
until it is steady, for at most {BASIN_OPTIONS.patience} transients."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = _DESCRIPTION
    add_scenario(parser)
    for name, what, unit in (("position", "displacements", "m"), ("velocity", "velocities", "m/s")):
        parser.add_argument(
            f"--{name}",
            metavar="A:B:COUNT",
            help=f"{what} of the grid, {unit}, as in --{name} -2:2:{BASIN_COUNT}; A:B is enough "
            f"for a --sample (default: {BASIN_COUNT} values over about twice the range of a "
            "vibration)",
        )
    parser.add_argument(
        "--sample",
        type=int,
        metavar="COUNT",
        help="use COUNT random initial states instead of the grid, uniformly distributed between "
        "the ends of --position and --velocity",
    )
    parser.add_argument(
        "--seed", type=int, metavar="SEED", help="seed of the random sample, 0 or more (default: 0)"
    )
    add_running(parser, BASIN_OPTIONS)
    add_plot(parser, "the motion that each initial state leads to")
    add_json(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.api.studies import Basin
    from stickslip_ros.studies.basin import basin_study

    scenario = scenario_of(arguments)
    study = basin_study(
        scenario,
        _plan(arguments, scenario),
        settling=settling_of(arguments, BASIN_OPTIONS),
        continuous=arguments.continuous_control,
    )
    check_results(arguments)
    label = f"basins of {scenario.name}, {study.plan.size} starts"
    give_study(arguments, study, label, partial(Basin, study))


def _plan(arguments: argparse.Namespace, scenario: "Scenario") -> "Plan":
    from stickslip_ros.studies.basin import POSITION, VELOCITY, default_axes
    from stickslip_ros.studies.plan import Axis, Grid, RandomSample

    if arguments.seed is not None and arguments.sample is None:
        raise InvalidInputError(f"--seed {arguments.seed}: is for a random --sample")
    if arguments.seed is not None and arguments.seed < 0:
        raise InvalidInputError(f"--seed {arguments.seed}: must be 0 or more")
    axes: list[Axis] = []
    for place, (option, parameter) in enumerate((("position", POSITION), ("velocity", VELOCITY))):
        text: str | None = getattr(arguments, option)
        if text is None:
            axes.append(default_axes(scenario, BASIN_COUNT)[place])
            continue
        # Of a sample only the ends matter.
        number = f"{text}:2" if arguments.sample is not None and text.count(":") == 1 else text
        try:
            axes.append(Axis.parse(f"{parameter}={number}"))
        except InvalidInputError as error:
            reason = str(error).partition(": ")[2].replace("NODE.PARAMETER=", "")
            raise InvalidInputError(f"--{option}={text}: {reason}") from None
    if arguments.sample is None:
        return Grid(tuple(axes))
    return RandomSample(tuple(axes), arguments.sample, arguments.seed or 0)
