"""`stickslip simulate`: the closed loop without ROS, measured on the motion itself."""

import argparse
from math import isfinite

from stickslip_ros.app.arguments import add_json, add_scenario, made_of, scenario_of, seconds
from stickslip_ros.app.output import print_figures, print_json, progress_bar
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.measures import CycleMeter, Measures
from stickslip_ros.physics.motion import Motion
from stickslip_ros.physics.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.physics.simulation import Progress, simulate_continuous, simulate_sampled
from stickslip_ros.physics.washout import Washout
from stickslip_ros.scenario.files import Scenario

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
        loop = SampledLoop(
            motion,
            plant.rate,
            LOCKSTEP_START,
            force_delay=plant.force_delay,
            force_jitter=plant.force_jitter,
            force_jitter_seed=plant.force_jitter_seed,
            expects_control=plant.expects_control,
            disturbance=plant.as_disturbance(),
        )
        law = Washout(controlled) if controlled else None
        return simulate_sampled(loop, motion, law, duration, meter, progress)
    for name, value, needed in (
        ("washout_controller.force_limit", washout.force_limit, float("inf")),
        ("plant.force_delay", plant.force_delay, 0.0),
        ("plant.force_jitter", plant.force_jitter, 0.0),
        ("plant.disturbance.kind", str(plant.disturbance.kind), "none"),
    ):
        if value != needed:
            raise InvalidInputError(
                f"--continuous-control knows no {name}: it is {value}, and must be {needed}"
            )
    return simulate_continuous(motion, controlled, duration, meter, progress)
