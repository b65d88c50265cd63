"""`stickslip sweep`: the settled motion of a scenario over one parameter or two."""

import argparse
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import groupby, islice
from typing import TYPE_CHECKING

from stickslip_ros.app.arguments import (
    add_json,
    add_plot,
    add_scenario,
    check_figure,
    naming,
    scenario_of,
    write_figure,
)
from stickslip_ros.app.optional_dependencies import interrupts_kept
from stickslip_ros.app.output import print_table
from stickslip_ros.app.study_command import add_running, computed, course_of, write_results
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.studies.options import Carry, SettlingCourse

if TYPE_CHECKING:
    from stickslip_ros.plots.units import Units
    from stickslip_ros.studies.columns import ExtraColumns
    from stickslip_ros.studies.journal import Journal
    from stickslip_ros.studies.plan import Grid
    from stickslip_ros.studies.study import Point

_DESCRIPTION = """Measure the settled motion of a scenario over the values of one parameter or two:
amplitude, regime, stick fraction and turning points, for a bifurcation diagram (one parameter) or a
map (two). A point that fails or diverges is a row of the table, with the reason."""

_MOST_RANGES = 60
"""Most rows of the printed table; beyond that only the points of each regime are counted."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = _DESCRIPTION
    add_scenario(parser)
    parser.add_argument(
        "--over",
        action="append",
        required=True,
        metavar="NODE.PARAMETER=A:B:COUNT",
        help="COUNT values from A to B of a parameter of plant or washout_controller, SI units, as "
        "in --over plant.belt_speed=0.02:0.6:1000; A:B:COUNT:log for a geometric sequence. A "
        "second --over gives a map",
    )
    parser.add_argument(
        "--carry",
        choices=[str(carry) for carry in Carry],
        help="start each point in the final state of its neighbour, filter included, with the "
        "(last) parameter going up, down or both, which shows hysteresis (default: start every "
        "point in the scenario's initial state)",
    )
    add_running(parser, SettlingCourse())
    add_plot(parser, "the bifurcation diagram, or the map")
    parser.add_argument(
        "--colour",
        choices=("regime", "amplitude", "stick_fraction"),
        default="regime",
        help="quantity that the map shows (default: %(default)s)",
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    with interrupts_kept():
        from stickslip_ros.plots.units import Units
        from stickslip_ros.studies.plan import Axis, Grid
        from stickslip_ros.studies.sweep import sweep_study
        from stickslip_ros.studies.transitions import transitions
    with naming("--over"):
        axes = [Axis.parse(text) for text in arguments.over]
    if len(axes) == 1 and arguments.colour != "regime":
        raise InvalidInputError(f"--colour {arguments.colour}: is for maps, of two parameters")
    study = sweep_study(
        scenario_of(arguments, unused=[axis.parameter for axis in axes]),
        axes,
        carry=None if arguments.carry is None else Carry(arguments.carry),
        course=course_of(arguments, SettlingCourse()),
        continuous=arguments.continuous_control,
    )
    check_figure(arguments)
    plan = study.plan
    assert isinstance(plan, Grid)
    label = f"sweep of {study.scenario.name}, {plan.size} points"
    further: ExtraColumns = {}
    if plan.carried:
        further = {"direction": lambda point: plan.direction(point.number)}
    with computed(arguments, study, label) as journal:
        if arguments.plot is not None:
            _draw(arguments, journal)
        theory = transitions(study, plan.axes[0]) if len(plan.axes) == 1 else {}
        made = {"transitions": {name.lower().replace(" ", "_"): theory[name] for name in theory}}
        write_results(arguments, journal, further, made)
        if not arguments.json:
            units = Units.for_drive(study.scenario.plant.as_drive(), plan.parameters)
            _print(journal, plan, units)
            for name, values in theory.items():
                print(f"{name}: {', '.join(units.texts(values, plan.axes[0].unit))}")
    return 0


def _draw(arguments: argparse.Namespace, journal: "Journal") -> None:
    from stickslip_ros.plots.sweep_picture import diagram_figure, map_figure
    from stickslip_ros.studies.columns import Columns

    columns, study = Columns.from_journal(journal), journal.study
    if len(arguments.over) == 1:
        write_figure(arguments, diagram_figure(columns, study))
    else:
        write_figure(arguments, map_figure(columns, study, arguments.colour))


def _direction_and_regime(point: "Point", plan: "Grid") -> str:
    """Return what the points in a row of the printed table have in common."""
    from stickslip_ros.physics.measures.cycle_measures import Regime

    regime = point.reason or Regime.label(point.measures.regime)
    if point.reason is None and not point.steady:
        regime += ", not steady"
    return f"{plan.direction(point.number) or ''} {regime}".lstrip()


def _print(journal: "Journal", plan: "Grid", units: "Units") -> None:
    """Print in which ranges of the parameter there is which regime; of a map, how often."""
    title = f"{journal.study.scenario.name}, {journal.count} points"
    if len(plan.axes) == 1:
        rows = list(islice(_ranges(journal, plan, units), _MOST_RANGES + 1))
        if len(rows) <= _MOST_RANGES:
            headings = ["regime", plan.parameters[0], "points", "amplitude", "stick fraction"]
            print_table(title, headings, rows)
            return
    counts = Counter(_direction_and_regime(point, plan) for point in journal.points())
    rows = [[kind, str(count)] for kind, count in counts.items()]
    print_table(title, ["regime", "points"], rows)


def _ranges(journal: "Journal", plan: "Grid", units: "Units") -> Iterator[list[str]]:
    largest = max((point.measures.amplitude or 0.0 for point in journal.points()), default=0.0)
    for kind, points in groupby(journal.points(), lambda point: _direction_and_regime(point, plan)):
        measured = [
            (point.measures.amplitude, point.measures.stick_fraction, point.number)
            for point in points
        ]
        amplitudes, stick_fractions, numbers = zip(*measured, strict=True)
        yield [
            kind,
            _range([plan.values(number)[0] for number in numbers], plan.axes[0].unit, units),
            str(len(numbers)),
            _range(amplitudes, "m", units, largest),
            _range(stick_fractions, "", units),
        ]


def _range(values: Iterable[float | None], unit: str, units: "Units", largest: float = 0.0) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return "-"
    low, high = units.texts([min(known), max(known)], unit, largest=largest)
    return low if low == high else f"{low.split()[0]} to {high}"
