"""`stickslip run`: the closed loop as ROS 2 nodes, recorded and reported."""

import argparse
import shlex
import sys
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from datetime import UTC, datetime
from itertools import count, pairwise
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip_ros.app import INTERRUPTED
from stickslip_ros.app.arguments import (
    DEFAULT_CONTROLLER,
    add_control,
    add_json,
    add_namespace,
    add_network,
    add_scenario_file,
    is_program,
    law_constants,
    namespace_of,
    naming,
    scenario_of,
    seconds,
)
from stickslip_ros.app.optional_dependencies import check_dashboard, loading_ros
from stickslip_ros.app.output import print_json, print_parts, progress_bar, tell
from stickslip_ros.errors import BagError, InvalidInputError, RunError
from stickslip_ros.installed_packages import find_executable
from stickslip_ros.nodes.base.network import NamespaceInUseError
from stickslip_ros.scenarios import DEFAULT_NAMESPACE, Pace
from stickslip_ros.text import number_in

if TYPE_CHECKING:
    from stickslip_ros.nodes.running.bringup import RunOutcome
    from stickslip_ros.scenarios.files import Scenario


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_scenario_file(parser)
    control = add_control(parser)
    control.add_argument(
        "--controller",
        metavar="CONTROLLER",
        help="controller: a control law by its name (`stickslip list` prints them), a Python "
        f"script, or PACKAGE/EXECUTABLE as for `ros2 run` {DEFAULT_CONTROLLER}; arguments after "
        "-- are passed to a script or executable, as in -- --ros-args -p gain:=3.0",
    )
    control.add_argument(
        "--external-controller",
        action="store_true",
        help="start no controller, and wait for one that you start yourself",
    )
    parser.add_argument(
        "--duration", type=seconds, metavar="S", help="simulated time, s (default: until Ctrl-C)"
    )
    parser.add_argument(
        "--pace",
        choices=[str(pace) for pace in Pace],
        help="follow the clock, or continue as soon as each force has arrived (default: the "
        "scenario's)",
    )
    parser.add_argument(
        "--composed",
        action="store_true",
        help="run the nodes in this process (default: each in its own)",
    )
    parser.add_argument(
        "--bag",
        type=Path,
        metavar="DIR",
        help="directory to record to; must not exist (default: a new one in bags/)",
    )
    add_namespace(parser)
    parser.add_argument(
        "--dashboard",
        action="store_true",
        help="show the run on a web page, as `stickslip dashboard` does, until the run ends",
    )
    add_network(parser, "let other machines see the nodes (default: loopback only)")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    from stickslip_ros.record.recorder import check_new_bag
    from stickslip_ros.show.measure_table import measure_table, report_sentences
    from stickslip_ros.show.quantities import Units

    given = {"pace": arguments.pace, "duration": arguments.duration}
    overrides = [f"plant.{name}={value}" for name, value in given.items() if value is not None]
    namespace = namespace_of(arguments.namespace)
    controller = _other_controller(arguments)
    scenario = scenario_of(
        arguments,
        *overrides,
        namespace=namespace,
        unused=[] if controller is None else law_constants(),
        replaced=controller is not None,
    )
    if controller is not None and not scenario.plant.expects_control:
        raise InvalidInputError(
            "plant.expects_control = False is refused with --controller and --external-controller"
        )
    bag = arguments.bag or _bag_of(scenario) or default_bag(scenario.name)
    check_new_bag(bag)
    if arguments.dashboard:
        check_dashboard()
    # Before ROS is loaded, which takes a while.
    tell(_announcement(scenario, bag, composed=arguments.composed))
    with loading_ros():
        from stickslip_ros.nodes.base.network import keep_on_this_machine

        reach = keep_on_this_machine(arguments.network)
    tell(f"nodes in {namespace}, {reach}")
    again = _again(arguments.words)
    with _dashboard(namespace, bag, scenario, again) if arguments.dashboard else nullcontext():
        results, interrupted = record(
            scenario, bag, namespace=namespace, composed=arguments.composed, controller=controller
        )
    if arguments.json:
        command = shlex.join([arguments.controller, *arguments.further]) if controller else None
        print_json({**results, "controller_command": command, **scenario.provenance()})
    else:
        report, drive = results["report"], scenario.plant.as_drive()
        values, units = {"": {**report, **results}}, {"": Units.for_drive(drive)}
        print_parts(
            measure_table(scenario.name, values, units),
            *report_sentences(report, drive),
            *_limit_of_machine(scenario, results),
        )
    if not results["report"]["complete"]:
        why = results["report"]["missing"][0]
        raise RunError(f"the bag {bag} could not be written to its end: {why}")
    if interrupted:
        tell(f"stickslip run: interrupted: the bag {bag} is closed; the nodes have ended")
        return INTERRUPTED
    return 0


def _limit_of_machine(scenario: "Scenario", results: Mapping[str, Any]) -> list[str]:
    """Return, after a run that was not in time, what a loop that only sleeps misses here."""
    from stickslip_ros.measures.timing import Timing
    from stickslip_ros.nodes.base.scheduling import share_missed

    plant = scenario.plant
    timing = Timing(*(results[name] for name in Timing._fields))
    if plant.pace is Pace.LOCKSTEP or not timing.warning():
        return []
    share = share_missed(plant.period / plant.real_time_factor)
    return [
        f"a loop that only sleeps until each sample missed {100.0 * share:.2g} % of its deadlines "
        "on this machine just now"
    ]


def _announcement(scenario: "Scenario", bag: Path, *, composed: bool) -> str:
    """Return in one line what is started."""
    from stickslip_ros.show.quantities import Units

    plant = scenario.plant
    pace = "lockstep" if plant.pace is Pace.LOCKSTEP else "real time"
    if plant.pace is Pace.REALTIME and plant.real_time_factor != 1.0:
        pace += f" x {plant.real_time_factor:g}"
    duration = "until Ctrl-C"
    if isfinite(plant.duration):
        unit = Units.for_drive(plant.as_drive()).of_unit("s")
        duration = f"duration {plant.duration:g} {unit}".rstrip()
    where = "in this process" if composed else "in processes of their own"
    return f"{scenario.name}: {pace}, {duration}; starting the nodes {where}; recording to {bag}"


def record(
    scenario: "Scenario",
    bag: Path,
    *,
    namespace: str = DEFAULT_NAMESPACE,
    composed: bool,
    controller: Sequence[str] | None = None,
) -> tuple[dict[str, Any], bool]:
    """Run the nodes into `bag`; return its results, and whether it was interrupted.

    `controller` is the command of one in place of ours, empty for one that is started elsewhere.
    Raises KeyboardInterrupt where nothing was recorded before that, and RunError, with what is
    left, where the run failed.
    """
    duration = scenario.plant.duration
    total = duration if duration < float("inf") else None
    with loading_ros():
        from stickslip_ros.nodes.running.bringup import NothingRecordedError, run_nodes
    with progress_bar(f"running {scenario.name}", total) as progress:
        try:
            outcome = run_nodes(
                scenario,
                namespace=namespace,
                bag=bag,
                composed=composed,
                controller=controller,
                on_simulated_time=progress,
                notify=tell,
            )
        except NamespaceInUseError as error:
            raise InvalidInputError(f"{error}: give this one another, by --namespace") from None
        except NothingRecordedError as error:
            raise RunError(f"{error}; nothing was recorded") from None
        except RunError as error:
            raise RunError(f"{error}; {_state_of(bag)}") from None
    try:
        return _values(bag, outcome), outcome.interrupted
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{_state_of(bag)}; the nodes have ended") from None
    except BagError as error:
        if outcome.interrupted:  # before the first sample
            left = f"; {bag} holds nothing" if bag.exists() else ""
            raise KeyboardInterrupt(f"nothing was recorded{left}; the nodes have ended") from None
        raise RunError(outcome.recording_failure or str(error)) from None


def _again(words: Sequence[str]) -> str:
    """Return these words as a command, without --bag: that directory exists now."""
    kept = [w for before, w in pairwise(["", *words]) if "--bag" not in (before, w.split("=")[0])]
    return shlex.join(["stickslip", *kept])


@contextmanager
def _dashboard(namespace: str, bag: Path, scenario: "Scenario", again: str) -> Generator[None]:
    """Serve the page in a process of its own, which has no part in whether the run succeeds."""
    from stickslip_ros.nodes.base.child_process import ChildProcesses

    command = "-m", "stickslip_ros.app.main", "dashboard", "--namespace", namespace
    command += (f"--command={again}",)
    plant = scenario.plant.flat()
    named = filter(None, (plant[p.name] for p in scenario.plant.known.values() if p.file))
    page = ChildProcesses()
    page.start("dashboard", [sys.executable, *command, *(f"--read={p}" for p in (bag, *named))])
    try:
        yield
    finally:
        page.end()


def default_bag(scenario: str) -> Path:
    """Return a directory for a new bag that does not exist yet."""
    name = f"{scenario}-{datetime.now(UTC):%Y%m%dT%H%M%SZ}"
    candidates = (Path("bags") / (name + (f"_{n}" if n > 1 else "")) for n in count(1))
    return next(path for path in candidates if not path.exists())


def _bag_of(scenario: "Scenario") -> Path | None:
    """Return the bag that the scenario names; in a file it must be below this directory."""
    name = scenario.analyzer.bag
    if not name or any(given.startswith("analyzer.bag=") for given in scenario.overrides):
        return Path(name) if name else None
    try:
        inside = Path(name).resolve().is_relative_to(Path.cwd())
    except (OSError, RuntimeError, ValueError):  # a loop of links, or no name of a file
        inside = False
    if not inside:
        raise InvalidInputError(
            f"{scenario.path}, analyzer: bag = {name!r} is refused: what a scenario names must be "
            "below the current directory; --bag takes any"
        )
    return Path(name)


def _other_controller(arguments: argparse.Namespace) -> list[str] | None:
    """Return the command of the controller in place of ours, empty if it is started elsewhere."""
    asked: str | None = arguments.controller
    if asked is not None and is_program(asked):
        with naming("--controller"):
            return [str(find_executable(asked)), *arguments.further]
    if arguments.further:
        given = "which is not given" if asked is None else f"and {asked} is a control law"
        raise InvalidInputError(
            f"-- {shlex.join(arguments.further)}: arguments after -- are for a script or "
            f"executable of --controller, {given}"
        )
    return [] if arguments.external_controller else None


def _values(bag: Path, outcome: "RunOutcome") -> dict[str, Any]:
    from stickslip_ros.record.report import report_of_recording

    report, plant = report_of_recording(bag), outcome.plant
    if outcome.recording_failure:
        missing = [outcome.recording_failure, *report["missing"]]
        report = {**report, "complete": False, "missing": missing}
    return {
        "bag": str(bag),
        "controller": outcome.controller,
        "report": report,
        "samples": report["samples"],
        "lost_samples": report["lost_samples"],
        "late_forces": int(number_in(plant.get("late_forces", ""))),
        "missed_deadlines": int(number_in(plant.get("missed_deadlines", ""))),
        "steps_per_second": float(number_in(plant.get("steps_per_second", ""))),
    }


def _state_of(bag: Path) -> str:
    """Return what a failed run has left."""
    from stickslip_ros.record.reader import Recording

    try:
        with Recording(bag) as recording:
            if recording.complete:
                return f"the bag {bag} is closed"
    except BagError:
        return "nothing was recorded"
    return (
        f"the bag {bag} was not closed: `stickslip report` reads what it holds, "
        "`stickslip repair` writes a sound bag from it"
    )
