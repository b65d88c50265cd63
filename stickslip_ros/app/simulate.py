"""`stickslip simulate`: the closed loop without ROS, measured on the motion itself."""

import argparse
from pathlib import Path

from stickslip_ros.app.arguments import (
    add_json,
    add_plot,
    add_scenario,
    check_figure,
    made_of,
    naming,
    scenario_of,
    seconds,
    write_figure,
)
from stickslip_ros.app.optional_dependencies import interrupts_kept
from stickslip_ros.app.output import print_figures, print_json, progress_bar
from stickslip_ros.plots.why_no_cycle import why_no_cycle
from stickslip_ros.studies.options import DEFAULT_PERIODS


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_scenario(parser)
    parser.add_argument(
        "--duration",
        type=seconds,
        metavar="S",
        help=f"simulated time, s (default: the scenario's, else {DEFAULT_PERIODS:g} periods; "
        "needed if it has neither a duration nor a spring)",
    )
    parser.add_argument(
        "--continuous-control",
        action="store_true",
        help="let the controller act continuously, as in the paper's eq. 19 "
        "(default: the force is held from sample to sample, as between the nodes)",
    )
    add_plot(parser, "motion, force, cycles and friction law")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    with interrupts_kept():
        from stickslip_ros.plots.run_history import RunHistory
        from stickslip_ros.plots.units import Units
        from stickslip_ros.studies.settling import check_continuous
        from stickslip_ros.studies.simulate import default_duration, simulate
    scenario = scenario_of(arguments)
    duration = arguments.duration
    if duration is None:
        duration = default_duration(scenario)
    plot: Path | None = arguments.plot
    check_figure(arguments)
    if arguments.continuous_control:
        with naming("--continuous-control:"):
            check_continuous(scenario)
    history = None if plot is None else RunHistory()
    units = Units.for_drive(scenario.plant.as_drive())
    shown = f"{duration:g} {units.of_unit('s')}".rstrip()
    with progress_bar(f"simulating {shown}", 1.0) as progress:
        measures = simulate(
            scenario,
            duration,
            continuous=arguments.continuous_control,
            progress=progress,
            observer=history,
        )
    if plot is not None and history is not None:
        from stickslip_ros.plots.simulated_run import simulated_run_figure

        write_figure(arguments, simulated_run_figure(scenario, history, measures))
    if arguments.json:
        print_json({**measures.as_dict(), "duration": duration, **made_of(scenario)})
    else:
        print_figures(f"{scenario.name}, {shown}", {"": measures.as_dict()}, {"": units})
        reason = why_no_cycle(measures.regime, duration, scenario.plant.as_drive())
        if reason is not None:
            print(reason)
    return 0
