"""`stickslip stability`: what theory says of a scenario, without running it."""

import argparse

from stickslip_ros.app.arguments import (
    add_json,
    add_plot,
    add_scenario,
    check_picture,
    made_of,
    scenario_of,
    write_picture,
)
from stickslip_ros.app.output import print_json, print_table, progress_bar
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.plots.stability_table import stability_tables
from stickslip_ros.studies.stability import (
    stability,
    stability_map,
    why_no_stability_map,
)

HELP = "equilibrium, Hopf speeds, limit cycles and critical gains of a scenario, by theory"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_scenario(parser)
    add_plot(
        parser,
        "where the sampled loop is stable and how fast it comes to rest, over corner frequency and "
        "linear gain, and the critical gain over the delay of the force",
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    scenario = scenario_of(arguments)
    if arguments.plot is not None:
        check_picture(arguments.plot)
        reason = why_no_stability_map(scenario)
        if reason is not None:
            raise InvalidInputError(f"--plot {arguments.plot}: there is nothing to draw: {reason}")
    with progress_bar(f"theory of {scenario.name}", None):
        found, notes = stability(scenario)
    if arguments.plot is not None:
        with progress_bar("drawing", None):
            # Half as long again to import as everything else.
            from stickslip_ros.plots.stability_map import stability_figure

            write_picture(arguments.plot, stability_figure(*stability_map(scenario)))
    if arguments.json:
        print_json({**found, "notes": notes, **made_of(scenario)})
    else:
        for part in stability_tables(scenario, found, notes):
            if isinstance(part, str):
                print(part)
            else:
                print_table(*part)
    return 0
