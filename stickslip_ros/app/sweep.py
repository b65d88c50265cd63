"""`stickslip sweep`: the settled motion of a scenario over one parameter or two."""

import argparse
from functools import partial

from stickslip_ros.app.arguments import add_scenario, naming
from stickslip_ros.app.result import add_results, check_results
from stickslip_ros.app.study_command import add_running, give_study, scenario_over, settling_of
from stickslip_ros.studies.options import Continuation, SettlingOptions

_DESCRIPTION = """Measure the settled motion of a scenario over the values of one parameter or two:
amplitude, regime, stick fraction and turning points, for a bifurcation diagram (one parameter) or a
map (two). A point that fails or diverges is a row of the table, with the reason."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = _DESCRIPTION
    add_scenario(parser)
    parser.add_argument(
        "--over",
        action="append",
        required=True,
        metavar="NODE.PARAMETER=A:B:COUNT",
        help="COUNT values from A to B of a parameter of the plant or the controller, SI units, as "
        "in --over plant.belt_speed=0.02:0.6:1000; A:B:COUNT:log for a geometric sequence. A "
        "second --over gives a map",
    )
    parser.add_argument(
        "--carry",
        choices=[str(carry) for carry in Continuation],
        help="start each point in the final state of its neighbour, controller included, with the "
        "(last) parameter going up, down or both, which shows hysteresis (default: start every "
        "point in the scenario's initial state)",
    )
    add_running(parser, SettlingOptions())
    parser.add_argument(
        "--colour",
        default="regime",
        metavar="MEASURE",
        help="quantity that the map shows: the regime, or a measure of the table of --out, as in "
        "--colour amplitude (default: %(default)s)",
    )
    add_results(parser, "the bifurcation diagram, or the map")


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.api.studies import Sweep
    from stickslip_ros.show.quantities import check_colour
    from stickslip_ros.studies.study import sweep_study

    with naming("--colour:"):
        check_colour(arguments.colour, len(arguments.over))
    scenario, axes = scenario_over(arguments)
    study = sweep_study(
        scenario,
        axes,
        continuation=None if arguments.carry is None else Continuation(arguments.carry),
        settling=settling_of(arguments, SettlingOptions()),
        continuous=arguments.continuous_control,
    )
    check_results(arguments)
    label = f"sweep of {study.scenario.name}, {study.plan.size} points"
    give_study(arguments, study, label, partial(Sweep, study), colour=arguments.colour)
