"""`stickslip simulate`: the closed loop without ROS, measured on the motion itself."""

import argparse
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from stickslip_ros.app.arguments import (
    add_out,
    add_scenario,
    check_new,
    naming,
    scenario_of,
    seconds,
    writing,
)
from stickslip_ros.app.output import progress_bar
from stickslip_ros.app.result import (
    add_results,
    check_results,
    is_drawn,
    print_result,
    write_results,
)
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.files import written
from stickslip_ros.studies.options import DEFAULT_PERIODS

if TYPE_CHECKING:
    from stickslip_ros.motion.trajectory import SampleRecorder
    from stickslip_ros.scenarios.files import Scenario

_ROUNDING = 1e-9
"""Share of an interval by which it may differ from a whole number of sample periods."""


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
    add_out(
        parser,
        "time, position, velocity, friction force, control force, position and velocity of the "
        "belt at the samples, what a sensor tells, and the reference (CSV, SI units)",
        metavar="FILE.csv",
    )
    parser.add_argument(
        "--every",
        type=seconds,
        metavar="S",
        help="time from row to row of --out, s: a multiple of the sample period (default: one)",
    )
    add_results(parser, "motion, force, cycles and friction law")


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.api.runs import measured_run
    from stickslip_ros.show.quantities import Units
    from stickslip_ros.studies.settling import check_continuous
    from stickslip_ros.studies.simulate import default_duration

    scenario = scenario_of(arguments)
    duration = arguments.duration
    if duration is None:
        duration = default_duration(scenario)
    check_results(arguments)
    if arguments.continuous_control:
        with naming("--continuous-control:"):
            check_continuous(scenario)
    units = Units.for_drive(scenario.plant.as_drive())
    shown = f"{duration:g} {units.of_unit('s')}".rstrip()
    with (
        _recorder(arguments, scenario) as recorder,
        progress_bar(f"simulating {shown}", 1.0) as progress,
    ):
        simulated = measured_run(
            scenario,
            duration,
            continuous=arguments.continuous_control,
            recorder=recorder,
            drawn=is_drawn(arguments),
            progress=progress,
        )
        write_results(arguments, simulated)
    print_result(arguments, simulated)


@contextmanager
def _recorder(
    arguments: argparse.Namespace, scenario: "Scenario"
) -> "Generator[SampleRecorder | None]":
    """Provide what writes the file of --out, if it is given."""
    out: Path | None = arguments.out
    if out is None:
        if arguments.every is not None:
            raise InvalidInputError(
                f"--every {arguments.every:g}: needs --out FILE.csv, which is not given"
            )
        yield None
        return
    rate = scenario.plant.rate
    every = _samples(arguments.every, rate)
    if out.suffix.lower() != ".csv":
        raise InvalidInputError(f"--out {out}: must end in .csv")
    check_new("--out", out)
    from stickslip_ros.studies.simulate import TrajectoryFile, recorded_columns

    with writing("--out", out), written(out) as stream:
        yield TrajectoryFile(stream, rate, every, **recorded_columns(scenario))


def _samples(interval: float | None, rate: float) -> int:
    """Return the number of sample periods in an interval, s."""
    if interval is None:
        return 1
    samples = round(interval * rate)
    if samples < 1 or abs(interval * rate - samples) > _ROUNDING * samples:
        raise InvalidInputError(
            f"--every {interval:g}: must be a multiple of the sample period, {1.0 / rate:g} s"
        )
    return samples
