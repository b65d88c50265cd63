"""`stickslip stability`: the theory of a scenario, without a simulation."""

import argparse

from stickslip_ros.app.arguments import (
    add_json,
    add_plot,
    add_scenario,
    check_figure,
    provenance,
    scenario_of,
    write_figure,
)
from stickslip_ros.app.output import print_json, print_parts, progress_bar
from stickslip_ros.errors import InvalidInputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_scenario(parser)
    add_plot(
        parser,
        "where the sampled loop is stable and how fast it settles, over cutoff frequency and "
        "linear gain, and the critical gain over the delay of the force; with --no-control the "
        "bifurcation diagram over the belt speed, with stable and unstable limit cycles",
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.plots.study_tables import stability_tables
    from stickslip_ros.studies.stability import stability, why_no_figure

    scenario = scenario_of(arguments)
    check_figure(arguments)
    if arguments.plot is not None:
        reason = why_no_figure(scenario)
        if reason is not None:
            raise InvalidInputError(f"--plot {arguments.plot}: there is nothing to draw: {reason}")
    with progress_bar(f"theory of {scenario.name}", None):
        found, notes = stability(scenario)
    if arguments.plot is not None:
        with progress_bar("drawing", None):
            from stickslip_ros.plots.stability_figure import scenario_stability_figure

            write_figure(arguments, lambda style: scenario_stability_figure(scenario, style=style))
    if arguments.json:
        print_json({**found, "notes": notes, **provenance(scenario)})
    else:
        print_parts(stability_tables(scenario, found, notes))
