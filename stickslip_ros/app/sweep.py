"""`stickslip sweep`: the settled motion of a scenario over one parameter or two."""

import argparse
from typing import TYPE_CHECKING

from stickslip_ros.app.arguments import (
    add_json,
    add_plot,
    add_scenario,
    check_figure,
    check_speeds,
    naming,
    scenario_of,
    write_figure,
)
from stickslip_ros.app.output import print_table
from stickslip_ros.app.study_command import add_running, computed, course_of, write_results
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.studies.options import Continuation, SettlingOptions

if TYPE_CHECKING:
    from stickslip_ros.studies.columns import Further

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
    add_plot(parser, "the bifurcation diagram, or the map")
    parser.add_argument(
        "--colour",
        choices=("regime", "amplitude", "stick_fraction"),
        default="regime",
        help="quantity that the map shows (default: %(default)s)",
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.plots.study_tables import sweep_table, units_of
    from stickslip_ros.studies.plan import Axis, Grid
    from stickslip_ros.studies.study import sweep_study
    from stickslip_ros.studies.transitions import transitions

    with naming("--over"):
        axes = [Axis.parse(text) for text in arguments.over]
    if len(axes) == 1 and arguments.colour != "regime":
        raise InvalidInputError(f"--colour {arguments.colour}: is for maps, of two parameters")
    scenario = scenario_of(arguments, unused=[axis.parameter for axis in axes])
    belts = [axis for axis in axes if axis.parameter == "plant.belt_speed"]
    check_speeds(arguments, scenario, *(end for axis in belts for end in (axis.first, axis.last)))
    study = sweep_study(
        scenario,
        axes,
        continuation=None if arguments.carry is None else Continuation(arguments.carry),
        course=course_of(arguments, SettlingOptions()),
        continuous=arguments.continuous_control,
    )
    check_figure(arguments)
    plan = study.plan
    assert isinstance(plan, Grid)
    label = f"sweep of {study.scenario.name}, {plan.size} points"
    further: Further = {}
    if plan.continuation:
        further = {"direction": [plan.direction(number) for number in range(plan.size)]}
    with computed(arguments, study, label) as journal:
        columns, colour = journal.columns, arguments.colour
        if arguments.plot is not None:
            from stickslip_ros.plots.study_figure import sweep_figure

            write_figure(arguments, lambda style: sweep_figure(columns, study, colour, style=style))
        theory = transitions(study, plan.axes[0]) if len(plan.axes) == 1 else {}
        made = {"transitions": {name.lower().replace(" ", "_"): theory[name] for name in theory}}
        write_results(arguments, journal, further, made)
        if not arguments.json:
            print_table(*sweep_table(study, columns))
            units = units_of(study)
            for name, values in theory.items():
                print(f"{name}: {', '.join(units.texts(values, plan.axes[0].unit))}")
