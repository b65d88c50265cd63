"""`stickslip compare`: which control law holds a drive, how well, and with what force."""

import argparse
import shlex
from pathlib import Path

from stickslip_ros.app.arguments import (
    add_scenario,
    add_spread,
    check_new,
    law_constants,
    whole,
    write_new,
    writing,
)
from stickslip_ros.app.output import progress_bar, tell
from stickslip_ros.app.result import add_results, check_results
from stickslip_ros.app.study_command import add_workers, check_out, give_study, scenario_over
from stickslip_ros.text import printable

_DESCRIPTION = """Compare control laws on one drive. The gains of each law are tuned by one rule for
the sampled loop, or given by the scenario. With a moving belt the task is regulation: the slide is
held still against disturbances. With the belt at rest it is positioning at the reference of the
scenario's controller. All laws meet the same noise and the same drives."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = _DESCRIPTION
    add_scenario(parser)
    parser.add_argument(
        "--controllers",
        required=True,
        metavar="LAW,LAW,...",
        help="control laws to compare (`stickslip list` prints them)",
    )
    parser.add_argument(
        "--given",
        default="",
        metavar="LAW,...",
        help="laws among them whose gains are those of the scenario (default: all are tuned)",
    )
    parser.add_argument(
        "--over",
        action="append",
        default=[],
        metavar="NODE.PARAMETER=A:B:COUNT",
        help="COUNT values of a parameter, as in --over plant.belt_speed=0.002:0.03:4; the gains "
        "are for all belt speeds",
    )
    parser.add_argument(
        "--disturbances",
        default="step,impulse,sine",
        metavar="KIND,...",
        help="none, step, impulse, sine, also with an amplitude as in sine=300N@8Hz (default: "
        "%(default)s, of a tenth of the static friction)",
    )
    _add_cases(parser)
    add_workers(
        parser,
        "; FILE.yaml is a scenario with the best law and its gains, a FOLDER has one for each law",
    )
    parser.add_argument(
        "--rank-by",
        metavar="COLUMN",
        help="rank the laws by a mean, the smallest first, as reversal_height of a reference that "
        "turns back (default: by the cases held, then the error, then the force beyond the mean)",
    )
    add_results(parser, "error and peak force of each law over the parameters")


def _add_cases(parser: argparse.ArgumentParser) -> None:
    """Add what the cases of a comparison are."""
    parser.add_argument(
        "--seeds",
        type=whole("a number of seeds, from {} to {}", 1, 100_000),
        default=1,
        metavar="N",
        help="seeds of noise and of the constants of the drive (default: %(default)d)",
    )
    add_spread(
        parser,
        "largest deviation of the constants of the drive, as in 0.2, or fit: as the fit of "
        "`stickslip identify --out` leaves them open (default: 0)",
    )
    parser.add_argument(
        "--duration", type=float, default=6.0, metavar="S", help="of a case (default: %(default)g)"
    )
    parser.add_argument(
        "--tolerance",
        type=float,
        metavar="SHARE",
        help="what a law that holds may leave: share of the belt speed (default: 0.05), or of the "
        "motion of the reference (default: 0.001)",
    )


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.api.comparison import ComparedLaws
    from stickslip_ros.studies.comparison import Outcomes, check_rank, compared
    from stickslip_ros.studies.design import gains_file

    proposed = law_constants("force_limit", "start_after")
    scenario, axes = scenario_over(arguments, *([] if arguments.given else proposed))
    check_results(arguments)
    check_rank(arguments.rank_by, scenario)
    chosen: Path | None = arguments.out
    if chosen is not None and chosen.suffix.lower() in ("", ".yaml", ".yml"):
        check_new("--out", chosen)
        arguments.out = None
    check_out(arguments.out)
    gains = f"gains for {scenario.name}"
    with progress_bar(gains, 1.0, lines=True, even=False) as progress:  # laws differ by far
        study, tuned = compared(
            scenario,
            arguments.controllers,
            axes,
            disturbances=arguments.disturbances,
            given=arguments.given.split(",") if arguments.given else (),
            seeds=arguments.seeds,
            spread=arguments.spread,
            duration=arguments.duration,
            tolerance=arguments.tolerance,
            progress=progress,
        )
    label = f"comparison on {scenario.name}, {study.plan.size} cases"
    outcomes = Outcomes(study.plan.size)
    result = ComparedLaws(study, outcomes, tuned, arguments.rank_by)
    give_study(arguments, study, label, lambda _: result, outcomes)
    if chosen is not None and arguments.out is None:
        files = {rank.law: gains_file(result.scenarios[rank.law]) for rank in result.ranks}
        paths = {law: chosen / f"{law}.yaml" for law in files}
        if chosen.suffix:
            paths = {result.ranks[0].law: chosen}
        for law, path in paths.items():
            with writing("--out", path):
                path.parent.mkdir(parents=True, exist_ok=True)
            write_new("--out", path, files[law])
            run_it = printable(shlex.join(["stickslip", "run", str(path)]))
            tell(f"{law} is written to {printable(str(path))}: `{run_it}` runs it")
