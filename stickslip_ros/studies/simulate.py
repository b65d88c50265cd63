"""Simulation of a scenario's closed loop without ROS, measured on the motion itself."""

from stickslip_ros.physics.loop.motion_tracer import MotionTracer
from stickslip_ros.physics.loop.simulation import simulate_continuous, simulate_sampled
from stickslip_ros.physics.loop.washout import Washout
from stickslip_ros.physics.measures.cycle_measures import CycleMeter, Measures
from stickslip_ros.physics.measures.observer import RunObserver
from stickslip_ros.physics.motion.motion import Motion
from stickslip_ros.progress import Progress
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.settling import check_continuous


def simulate(
    scenario: Scenario,
    duration: float,
    *,
    continuous: bool = False,
    progress: Progress = lambda _: None,
    observer: RunObserver | None = None,
) -> Measures:
    """Return the measures of the scenario's motion over `duration` (s).

    An `observer` receives the motion. Raises InvalidInputError if `continuous` control does not
    support the scenario.
    """
    if continuous:
        check_continuous(scenario)
    plant = scenario.plant
    washout = scenario.washout_controller.as_washout() if plant.expects_control else None
    motion = Motion(
        plant.as_drive(),
        plant.initial.position,
        plant.initial.velocity,
        continuous_control=continuous,
        record=True,
    )
    meter = CycleMeter(scenario.analyzer.window)
    if continuous:
        return simulate_continuous(motion, washout, duration, meter, progress, observer)
    tracer = None if observer is None else MotionTracer(motion, observer)
    loop = plant.as_loop(motion, advance=None if tracer is None else tracer.advance)
    law = None if washout is None else Washout(washout)
    return simulate_sampled(loop, motion, law, duration, meter, progress, tracer)
