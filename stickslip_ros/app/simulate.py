"""`stickslip simulate`: the closed loop without ROS, measured on the motion itself."""

import argparse
from math import isfinite

from stickslip_ros.app.arguments import add_json, add_scenario, made_of, scenario_of, seconds
from stickslip_ros.app.output import print_figures, print_json, progress_bar
from stickslip_ros.physics.measures import CycleMeter, Measures
from stickslip_ros.physics.motion import Motion
from stickslip_ros.physics.simulation import Progress, simulate_continuous, simulate_sampled
from stickslip_ros.physics.washout import Washout
from stickslip_ros.scenario.files import Scenario
from stickslip_ros.studies.settled import check_continuous, sampled_loop

HELP = "run a scenario without ROS and measure its motion"

_DEFAULT_PERIODS = 200.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_scenario(parser)
    parser.add_argument(
        "--duration",
        type=seconds,
        metavar="S",
        help=f"simulated time, s (default: the scenario's, else {_DEFAULT_PERIODS:g} periods)",
    )
    parser.add_argument(
        "--continuous-control",
        action="store_true",
        help="let the controller act without sampling, as in the paper's eq. 19 "
        "(default: the force is held from sample to sample, as between the nodes)",
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    scenario = scenario_of(arguments)
    duration = arguments.duration
    if duration is None and isfinite(scenario.plant.duration):
        duration = scenario.plant.duration
    elif duration is None:
        duration = _DEFAULT_PERIODS * scenario.plant.as_drive().natural_period
    with progress_bar(f"simulating {duration:g} s", 1.0) as progress:
        measures = simulate(
            scenario, duration, continuous=arguments.continuous_control, progress=progress
        )
    if arguments.json:
        print_json({**measures.as_dict(), "duration": duration, **made_of(scenario)})
    else:
        print_figures(f"{scenario.name}, {duration:g} s", {"": measures.as_dict()})
    return 0


def simulate(
    scenario: Scenario, duration: float, *, continuous: bool = False, progress: Progress
) -> Measures:
    """Return the measures of the scenario's motion over `duration` (s).

    Raises InvalidInputError for what continuous control does not have.
    """
    if continuous:
        check_continuous(scenario)
    plant, washout = scenario.plant, scenario.washout_controller.as_washout()
    controlled = washout if plant.expects_control else None
    initial = plant.initial
    motion = Motion(
        plant.as_drive(),
        initial.position,
        initial.velocity,
        continuous_control=continuous,
        record=True,
    )
    meter = CycleMeter(scenario.analyzer.window)
    if not continuous:
        law = Washout(controlled) if controlled else None
        return simulate_sampled(sampled_loop(plant, motion), motion, law, duration, meter, progress)
    return simulate_continuous(motion, controlled, duration, meter, progress)
