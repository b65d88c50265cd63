"""Simulation of a scenario's closed loop without ROS, measured on the motion itself."""

import csv
from math import isfinite
from typing import Any, TextIO

from typing_extensions import override

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Measures
from stickslip_ros.measures.run_meter import RunObserver
from stickslip_ros.measures.sample_meter import SampleMeter
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.motion.simulation import MotionTracer, simulate_continuous, simulate_sampled
from stickslip_ros.motion.trajectory import SampleRecorder
from stickslip_ros.progress import Progress
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.stamps import END_OF_TIME, NANOSECONDS
from stickslip_ros.studies.options import DEFAULT_PERIODS
from stickslip_ros.studies.settling import (
    check_continuous,
    check_motor,
    check_reference,
    unit_period,
)


def default_duration(scenario: Scenario) -> float:
    """Return the scenario's own duration, s, or without one `DEFAULT_PERIODS`.

    Raises InvalidInputError if the scenario has neither a duration nor a spring.
    """
    if isfinite(scenario.plant.duration):
        return scenario.plant.duration
    return DEFAULT_PERIODS * unit_period(scenario.plant.as_drive(), scenario.plant.duration)


def sensor_meter(scenario: Scenario) -> SampleMeter | None:
    """Return what measures the samples that a sensor tells; None with an exact sensor."""
    if scenario.plant.sensor.exact:
        return None
    return SampleMeter(scenario.analyzer.window, reading=scenario.reading)


def recorded_columns(scenario: Scenario) -> dict[str, Any]:
    """Return the options of a `SampleRecorder` for what samples of a scenario have."""
    plant, law, followed = scenario.plant, scenario.control_law, scenario.controller.reference
    follows = law is not None and law.follows_reference and followed.kind not in ("none", "topic")
    return {
        "measured": not plant.exactly_measured,
        "motor": plant.motor.kind == "mass",
        "reference": followed.signal(period=0.0).reference if follows else None,
    }


def simulate(
    scenario: Scenario,
    duration: float,
    *,
    continuous: bool = False,
    progress: Progress = lambda _: None,
    observer: RunObserver | None = None,
    recorder: SampleRecorder | None = None,
    measured: SampleMeter | None = None,
) -> Measures:
    """Return the measures of the scenario's motion over `duration` (s).

    An `observer` receives the motion, a `recorder` takes its samples, and `measured` those that the
    sensor tells. Raises InvalidInputError for
    a duration that is not allowed, or if `continuous` control does not support the scenario.
    """
    longest = END_OF_TIME / NANOSECONDS
    if not 0.0 <= duration <= longest:
        raise InvalidInputError(f"a duration of {duration:g} s: must be from 0 to {longest:g} s")
    check_reference(scenario)
    check_motor(scenario)
    if continuous:
        check_continuous(scenario)
    plant = scenario.plant
    law = scenario.control_law
    control = law.continuous if continuous and law is not None else None
    motion = RecordedMotion(
        plant.as_drive(),
        plant.initial.position,
        plant.initial.velocity,
        control,
        scenario.analyzer.given_stick_speed,
    )
    meter = scenario.cycle_meter(scenario.analyzer.window)
    if continuous:
        return simulate_continuous(motion, law, duration, meter, progress, observer, recorder)
    tracer = None if observer is None else MotionTracer(motion, observer)
    loop = plant.as_loop(motion, advance=None if tracer is None else tracer.advance_under)
    controller = None if law is None else scenario.controller.as_controller()
    return simulate_sampled(
        loop, motion, controller, duration, meter, progress, tracer, recorder, measured
    )


class TrajectoryFile(SampleRecorder):
    """Writes the samples of a run to a CSV file as they come.

    The first line has the names of its `quantities`. The numbers are in SI units, with all digits.
    """

    def __init__(self, stream: TextIO, rate: float, every: int = 1, **options: Any) -> None:
        """Write samples as `SampleRecorder` keeps them."""
        super().__init__(rate, every, **options)
        self._write = csv.writer(stream, lineterminator="\n").writerow
        self._write(self.quantities)

    @override
    def keep(self, row: tuple[float, ...]) -> None:
        self._write(map(float, row))
