"""`stickslip design`: controller gains for a drive, verified by simulation."""

import argparse
import shlex
from pathlib import Path

from stickslip_ros.app.arguments import (
    add_out,
    add_scenario,
    add_spread,
    check_new,
    check_speeds,
    law_constants,
    scenario_of,
    write_new,
)
from stickslip_ros.app.output import progress_bar, tell
from stickslip_ros.app.result import add_results, check_results, give_result
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.quantities import number_of
from stickslip_ros.studies.options import OWN_SPEED_RANGE

_DESCRIPTION = """Propose gains of the controller that suppress the vibration within a force limit.
The scenario gives the drive, rate, force_delay and the force_limit of the controller. The gains of
the scenario are not used. The proposal is verified by simulation under disturbances at several belt
speeds; the washout law also catches the vibration without control, at several of its phases."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = _DESCRIPTION
    add_scenario(parser)
    parser.add_argument(
        "--belt-speed",
        metavar="LOW:HIGH",
        help="range of belt speeds to design for, m/s, both above zero; one number for a single "
        f"speed (default: the scenario's belt speed, plus or minus {OWN_SPEED_RANGE:.0%})".replace(
            "%", "%%"
        ),
    )
    add_spread(
        parser,
        "deviation of the constants, as in 0.2, or fit: as for `stickslip compare`; gains "
        "hold drives that it draws, and others judge them (default: 0)",
    )
    add_out(parser, "a complete scenario with the proposed gains")
    add_results(parser, "the Bode diagram, or of a washout the decay rate over its gains")


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.api.design import Proposal
    from stickslip_ros.studies.design import Task, design

    bodies = ("feedback", "velocity_feedback", "washout_feedback")
    proposed = law_constants("force_limit", "start_after", *bodies)
    for text in arguments.overrides:
        if text.partition("=")[0] in proposed:
            raise InvalidInputError(f"-p {text:.80}: is not used, because a design proposes it")
    scenario = scenario_of(arguments, unused=proposed)
    task = Task.from_scenario(scenario, _belt_speeds(arguments.belt_speed), arguments.spread)
    check_speeds(arguments, scenario, *task.belt_speeds)
    if arguments.out is not None:
        check_new("--out", arguments.out)
    check_results(arguments)
    label = f"designing for {scenario.name}"
    with progress_bar(label, 1.0, lines=True, even=False) as progress:  # of unknown attempts
        proposal = Proposal(design(task, progress))
    text = proposal.design.parameter_file
    if arguments.plot is not None and text is None:
        _report_omitted(f"--plot {arguments.plot}: not drawn")
        arguments.plot = None
    give_result(arguments, proposal)
    if not arguments.json and text is not None and arguments.out is None:
        print("--out FILE writes the scenario with these gains, --json prints it: parameter_file")
    out: Path | None = arguments.out
    if out is not None and text is None:
        _report_omitted(f"--out {out}: not written")
    elif out is not None and text is not None:
        write_new("--out", out, text)
        tell(f"{out} is written: `{shlex.join(['stickslip', 'run', str(out)])}` runs it")


def _belt_speeds(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    speeds = [number_of("--belt-speed", part, "m/s") for part in text.split(":")]
    if len(speeds) > 2:
        raise InvalidInputError(f"--belt-speed {text!r}: must be LOW:HIGH, or one speed, in m/s")
    return speeds[0], speeds[-1]


def _report_omitted(what: str) -> None:
    tell(f"stickslip design: {what}, because there is nothing to propose")
