"""Common part of the commands that run studies: their arguments, and running them."""

import argparse
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip_ros.app.arguments import (
    add_out,
    check_new,
    check_speeds,
    naming,
    scenario_of,
    whole,
    writing,
)
from stickslip_ros.app.output import progress_bar, tell
from stickslip_ros.app.result import print_result, write_results
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.files import written
from stickslip_ros.studies.options import SettlingOptions

if TYPE_CHECKING:
    from stickslip_ros.api.comparison import ComparedLaws
    from stickslip_ros.api.studies import Points
    from stickslip_ros.scenarios.files import Scenario
    from stickslip_ros.studies.plan import Axis
    from stickslip_ros.studies.study import PointStudy

_TABLES = (".csv", ".json")


def add_running(parser: argparse.ArgumentParser, settling: SettlingOptions) -> None:
    """Add how each point is followed (default: `settling`), where it is computed, and --out."""
    parser.add_argument(
        "--continuous-control",
        action="store_true",
        help="let the controller act continuously, as in the paper's eq. 19, which is several "
        "times as fast (default: the force is held from sample to sample)",
    )
    parser.add_argument(
        "--transient",
        type=float,
        default=settling.transient,
        metavar="PERIODS",
        help="natural periods that are skipped at each point (default: %(default)g)",
    )
    parser.add_argument(
        "--cycles",
        type=int,
        default=settling.cycles,
        metavar="COUNT",
        help="whole cycles that are measured after them (default: %(default)d)",
    )
    add_workers(parser)


def add_workers(parser: argparse.ArgumentParser, others: str = "") -> None:
    """Add where the points are computed, and --out; `others` are files that it also writes."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--workers",
        type=whole("a number of processes, from {} to {}", 1, 4 * (os.cpu_count() or 1)),
        default=1,
        metavar="COUNT",
        help="processes on this machine that share the points (default: 1); the results are the "
        "same, bit for bit",
    )
    where.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="compute the points on the Dask cluster with this scheduler, as in "
        "--dask tcp://head:8786 (extra: stickslip_ros[dask])",
    )
    kept = (
        ". If interrupted, the finished points stay in FILE.part, without --out in ~/.cache, and "
        f"the same command continues{others}"
    )
    add_out(parser, f"a table of all points ({', '.join(_TABLES)})", more=kept)


def scenario_over(arguments: argparse.Namespace, *unused: str) -> "tuple[Scenario, list[Axis]]":
    """Return the scenario, for what is not `unused`, and the axes of --over, of likely speeds."""
    from stickslip_ros.studies.plan import Axis

    with naming("--over"):
        axes = [Axis.parse(text) for text in arguments.over]
    scenario = scenario_of(arguments, unused=[*unused, *(axis.parameter for axis in axes)])
    belts = [axis for axis in axes if axis.parameter == "plant.belt_speed"]
    check_speeds(arguments, scenario, *(end for axis in belts for end in (axis.first, axis.last)))
    return scenario, axes


def settling_of(arguments: argparse.Namespace, default: SettlingOptions) -> SettlingOptions:
    """Return how each point is followed: as asked for, and otherwise as in `default`."""
    return replace(default, transient=arguments.transient, cycles=arguments.cycles)


def check_out(out: Path | None) -> None:
    """Refuse a file of points that cannot be written."""
    if out is not None:
        if out.suffix.lower() not in _TABLES:
            raise InvalidInputError(f"--out {out}: must end in one of {', '.join(_TABLES)}")
        check_new("--out", out)


def give_study(
    arguments: argparse.Namespace,
    study: "PointStudy[Any]",
    label: str,
    result_of: "Callable[[Any], Points | ComparedLaws]",
    columns: Any = None,
    **options: Any,
) -> None:
    """Compute the missing points of the study; write and print the result of its columns.

    `columns` take the points; by default those of a sweep. The `options` are those of the result's
    `plot`. Then the journal need not be kept any more.
    """
    from stickslip_ros.studies.journal import Journal, kept_journal
    from stickslip_ros.studies.runner import DaskError, dask_executor, run, run_here

    out: Path | None = arguments.out
    check_out(out)
    if out is not None:
        journal = Journal(study, out.with_name(f"{out.name}.part"), columns)
    else:
        journal = kept_journal(study, columns)
    with journal:
        kept, part = "; without --out no point is kept", journal.path
        if part is not None:
            kept = f"; they stay in {part}, and the same command continues from there"
        if journal.count and out is None:
            tell(f"{journal.count} points are taken from {part}")
        try:
            size, even = study.plan.size, study.plan.continuation is None  # else in their order
            with progress_bar(label, size, _advice(study), even=even) as progress:
                if arguments.dask is None:
                    run_here(journal, arguments.workers, progress)
                else:
                    with naming("--dask"), dask_executor(arguments.dask) as (executor, in_flight):
                        run(journal, executor, in_flight=in_flight, progress=progress)
        except KeyboardInterrupt:
            done = f"{journal.count} of {study.plan.size} points are done{kept}"
            tell(f"stickslip {arguments.command}: {done}")
            raise
        except OSError as error:
            raise RunError(f"{part or study.scenario.name}: {error.strerror}{kept}") from None
        except DaskError as error:
            raise RunError(f"--dask {error}{kept}") from None
        except RunError as error:
            raise RunError(f"{error}{kept}") from None
        result = result_of(journal.columns)
        write_results(arguments, result, **options)
        if out is not None:
            with writing("--out", out), written(out, then=journal.discard) as stream:
                if out.suffix.lower() == ".csv":
                    result.write_csv(stream)
                else:
                    result.write_json(stream)
        print_result(arguments, result)
        journal.discard()


def _advice(study: "PointStudy[Any]") -> str:
    """Return what would make a study quicker that simulates every sample of its loop."""
    from stickslip_ros.studies.settling import check_continuous
    from stickslip_ros.studies.study import Study

    plant = study.scenario.plant
    if not isinstance(study, Study) or study.continuous or not plant.expects_control:
        return ""
    with suppress(InvalidInputError):
        check_continuous(study.scenario)
        return "; every sample is simulated: --continuous-control is several times as fast"
    return ""
