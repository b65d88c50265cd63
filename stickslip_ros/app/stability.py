"""`stickslip stability`: the theory of a scenario, without a simulation."""

import argparse

from stickslip_ros.app.arguments import add_json, add_scenario, add_spread, scenario_of
from stickslip_ros.app.output import progress_bar
from stickslip_ros.app.result import add_plot, check_results, print_result, write_results
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
    add_spread(
        parser,
        "deviation of the constants, as in 0.2, or fit: as for `stickslip compare`; gives the "
        "critical feed speed an interval",
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.api.theory import stability

    scenario = scenario_of(arguments)
    check_results(arguments)
    if arguments.plot is not None:
        from stickslip_ros.show.stability_figure import why_no_figure

        reason = why_no_figure(scenario)
        if reason is not None:
            raise InvalidInputError(f"--plot {arguments.plot}: there is nothing to draw: {reason}")
    with progress_bar(f"theory of {scenario.name}", None):
        result = stability(scenario, arguments.spread)
    with progress_bar("drawing", None):
        write_results(arguments, result)
    print_result(arguments, result)
