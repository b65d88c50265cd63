"""`stickslip basin`: which motion a start leads to."""

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from stickslip_ros.app.arguments import (
    add_json,
    add_plot,
    add_scenario,
    check_figure,
    scenario_of,
    write_figure,
)
from stickslip_ros.app.optional_dependencies import interrupts_kept
from stickslip_ros.app.output import print_table
from stickslip_ros.app.study_command import add_running, computed, course_of, write_results
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.studies.options import BASIN_COURSE

if TYPE_CHECKING:
    from stickslip_ros.plots.units import Units
    from stickslip_ros.scenarios.files import Scenario
    from stickslip_ros.studies.basin import Attractor, Basins
    from stickslip_ros.studies.journal import Journal
    from stickslip_ros.studies.plan import Plan

_DESCRIPTION = f"""Find the motion that each initial state leads to, and the share of initial
states for each motion (basin stability), over a grid or a random sample. An initial state is a
displacement and a velocity of the slide; the washout filter is at rest. Each motion is followed
until it is steady, for at most {BASIN_COURSE.patience} transients."""

_COUNT = 40
"""Positions and velocities of the grid."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = _DESCRIPTION
    add_scenario(parser)
    for name, what, unit in (("position", "displacements", "m"), ("velocity", "velocities", "m/s")):
        parser.add_argument(
            f"--{name}",
            metavar="A:B:COUNT",
            help=f"{what} of the grid, {unit}, as in --{name} -2:2:{_COUNT}; A:B is enough for a "
            f"--sample (default: {_COUNT} values over about twice the range of a vibration)",
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
    add_running(parser, BASIN_COURSE)
    add_plot(parser, "the motion that each initial state leads to")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    with interrupts_kept():
        from stickslip_ros.plots.units import Units
        from stickslip_ros.studies.basin import Basins, basin_study
    scenario = scenario_of(arguments)
    study = basin_study(
        scenario,
        _plan(arguments, scenario),
        course=course_of(arguments, BASIN_COURSE),
        continuous=arguments.continuous_control,
    )
    check_figure(arguments)
    label = f"basins of {scenario.name}, {study.plan.size} starts"
    with computed(arguments, study, label) as journal:
        basins = Basins.from_points(journal.points())
        made = {"attractors": [asdict(attractor) for attractor in basins.attractors]}
        if arguments.plot is not None:
            _draw(arguments, journal, basins)
        write_results(arguments, journal, {"attractor": basins.place}, made)
        if not arguments.json:
            title = f"{scenario.name}, {study.plan.size} starts"
            _print(title, basins, Units.for_drive(scenario.plant.as_drive()))
    return 0


def _plan(arguments: argparse.Namespace, scenario: "Scenario") -> "Plan":
    from stickslip_ros.studies.basin import POSITION, VELOCITY, default_axes
    from stickslip_ros.studies.plan import Axis, Grid, RandomSample

    if arguments.seed is not None and arguments.sample is None:
        raise InvalidInputError(f"--seed {arguments.seed}: is for a random --sample")
    if arguments.seed is not None and arguments.seed < 0:
        raise InvalidInputError(f"--seed {arguments.seed}: must be 0 or more")
    axes = list(default_axes(scenario, _COUNT))
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


def _print(title: str, basins: "Basins", units: "Units") -> None:
    rows = [
        [
            _name(attractor),
            units.text(attractor.amplitude, "m"),
            units.text(attractor.midpoint, "m"),
            str(attractor.count),
            f"{attractor.share:.4f}",
            f"{attractor.standard_error:.4f}",
        ]
        for attractor in basins.attractors
    ]
    headings = ["motion", "amplitude", "midpoint", "starts", "share", "standard error"]
    print_table(title, headings, rows)


def _name(attractor: "Attractor") -> str:
    from stickslip_ros.physics.measures.cycle_measures import Regime

    name = Regime.label(attractor.regime)
    return name if attractor.steady or attractor.regime is None else f"{name}, not steady"


def _draw(arguments: argparse.Namespace, journal: "Journal", basins: "Basins") -> None:
    import numpy as np

    from stickslip_ros.plots.basin_picture import basin_figure
    from stickslip_ros.plots.units import Units
    from stickslip_ros.studies.basin import POSITION, VELOCITY
    from stickslip_ros.studies.columns import Columns
    from stickslip_ros.studies.plan import Grid

    plan, scenario = journal.study.plan, journal.study.scenario
    drive = scenario.plant.as_drive()
    units = Units.for_drive(drive)
    columns = Columns.from_journal(journal)
    figure = basin_figure(
        position=columns.values[POSITION],
        velocity=columns.values[VELOCITY],
        attractor=np.array([basins.place(point) for point in journal.points()]),
        regimes=[attractor.regime for attractor in basins.attractors],
        labels=[_label(attractor, units) for attractor in basins.attractors],
        grid_shape=plan.shape if isinstance(plan, Grid) else None,
        belt_speed=drive.belt_speed,
        equilibrium_position=drive.equilibrium_position,
        units=units,
        title=" ".join([scenario.name, *scenario.overrides]),
    )
    write_figure(arguments, figure)


def _label(attractor: "Attractor", units: "Units") -> str:
    amplitude = ""
    if attractor.amplitude is not None:
        amplitude = f", amplitude {units.text(attractor.amplitude, 'm')}"
    share, error = 100.0 * attractor.share, 100.0 * attractor.standard_error
    return f"{_name(attractor)}{amplitude}: {share:.1f} % \N{PLUS-MINUS SIGN} {error:.1f} %"
