"""Parties of a benchmark: separate processes that run a slice on request.

While one runs, the others wait. All of them use the transport of `stickslip run`. Our closed loop
is such a party. Messages that its analyzer has not written at the end of a slice, at most 20 ms,
are not counted.
"""

import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Generic, TypeVar

import rclpy
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from benchmarks.slices import Row, by_turns
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.child_process import start_child
from stickslip_ros.nodes.base.managed import ManagedNode
from stickslip_ros.nodes.base.network import domain_variables, own_domain
from stickslip_ros.nodes.base.spinner import spin
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.scenarios.files import DEFAULT_NAMESPACE, load_scenario, parameter_file

T = TypeVar("T")

ROS_ARGUMENTS = ["--ros-args", "--log-level", "error", "-r", f"__ns:={DEFAULT_NAMESPACE}"]
READY_TIMEOUT = 30.0
EXIT_TIMEOUT = 30.0

Slice = Callable[[int], T]
"""Runs a number of samples or round trips and returns the measurement."""


class PartyError(Exception):
    """A party failed; the text says why."""


def results_by_turns(
    rounds: int,
    parties: Mapping[str, AbstractContextManager[Slice[T]]],
    count: Callable[[Slice[T]], int],
) -> tuple[dict[str, list[T]], list[Row]]:
    """Run slices of all parties in turns; return their results, and a row for each that failed.

    `count` runs a first slice of a party and returns the length of the others. A party that fails
    ends, without a result unless it has run all of its slices; the others go on.
    """
    failures: dict[str, str] = {}
    results: dict[str, list[T]] = {}

    @contextmanager
    def noted(name: str) -> Generator[None]:
        try:
            yield
        except PartyError as error:
            failures.setdefault(name, str(error))

    def begin(name: str) -> Callable[[], None]:
        run = resources.enter_context(parties[name])
        length = count(run)
        results[name] = []

        def turn() -> None:
            if name not in failures:
                with noted(name):
                    results[name].append(run(length))

        return turn

    with ExitStack() as resources:
        turns: list[Callable[[], None]] = []
        for name in parties:
            resources.enter_context(noted(name))
            with noted(name):
                turns.append(begin(name))
        by_turns(rounds, *turns)
    whole = {name: values for name, values in results.items() if len(values) == rounds}
    return whole, [Row(name, failure=why) for name, why in failures.items()]


@contextmanager
def party(
    make: Callable[..., AbstractContextManager[Slice[T]]], *arguments: Any
) -> Generator[Slice[T]]:
    """Yield a function that runs slices of `make(*arguments)` in a process with its own domain.

    Raises PartyError if the process fails, also when it ends.
    """
    context = multiprocessing.get_context("spawn")
    with own_domain() as domain:
        connection, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs, domain, make, arguments))
        process.start()
        theirs.close()

        def receive() -> Any:
            try:
                why, result = connection.recv()
            except (EOFError, ConnectionResetError):
                process.join(EXIT_TIMEOUT)
                raise PartyError(f"it ended early, with status {process.exitcode}") from None
            if why:
                raise PartyError(why)
            return result

        def ask(count: int | None) -> None:
            with suppress(BrokenPipeError, ConnectionResetError):  # `receive` says that it ended
                connection.send(count)

        def run(count: int) -> T:
            ask(count)
            return receive()

        try:
            receive()
            yield run
            ask(None)
            if not connection.poll(EXIT_TIMEOUT):
                raise PartyError(f"it did not end within {EXIT_TIMEOUT:g} s")
            receive()
        finally:
            connection.close()
            process.join(EXIT_TIMEOUT)
            process.kill()
            process.join()
        if process.exitcode:
            raise PartyError(f"it ended with status {process.exitcode}")


def _serve(
    connection: Connection,
    domain: int,
    make: Callable[..., AbstractContextManager[Slice[Any]]],
    arguments: tuple[Any, ...],
) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process ends it
    os.environ.update(domain_variables(domain))
    try:
        with make(*arguments) as run:
            connection.send(("", None))
            while (count := connection.recv()) is not None:
                connection.send(("", run(count)))
        connection.send(("", None))
    except (EOFError, BrokenPipeError):  # the parent process has no more requests
        return
    except (Exception, SystemExit) as error:
        with suppress(BrokenPipeError):
            why = str(error).partition("\n")[0] or type(error).__name__
            connection.send((why, None))
        raise


@contextmanager
def ros() -> Generator[None]:
    rclpy.init(args=ROS_ARGUMENTS, signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield
    finally:
        rclpy.try_shutdown()


class ObservedPlant(PlantNode):
    """Sets a future when it pauses."""

    def start(self) -> None:
        self.paused = Future()
        super().start()

    def stop(self) -> None:
        super().stop()
        self.paused.set_result(None)


PlantT = TypeVar("PlantT", bound=ObservedPlant)


class OurLoop(Generic[PlantT]):
    """Our plant; our controller and analyzer on the same executor or in two other processes."""

    def __init__(
        self, make_plant: Callable[..., PlantT], scenario: str, bag: Path, *, composed: bool
    ) -> None:
        loaded = load_scenario(scenario)
        values = loaded.as_dict()
        values["analyzer"]["bag"] = str(bag)
        values["washout_controller"]["wait_for"] = ["analyzer", "plant"]
        values["plant"] |= {"autostart": False, "wait_for": ["analyzer", "washout_controller"]}
        self.plant = make_plant(overrides=values.pop("plant"))
        self.processes: list[subprocess.Popen[bytes]] = []
        self._rate = loaded.plant.rate
        self._bag = bag
        self._samples = 0
        self._executor: Executor = EventsExecutor()
        self._composed: list[ManagedNode[Any]] = []
        if composed:
            self._composed = [
                AnalyzerNode(overrides=values["analyzer"]),
                WashoutControllerNode(overrides=values["washout_controller"]),
            ]
        else:
            file = bag.with_suffix(".yaml")
            file.write_text(parameter_file(values), encoding="utf-8")
            arguments = [*ROS_ARGUMENTS, "--params-file", str(file)]
            self.processes = [
                start_child([sys.executable, "-m", node.__module__, *arguments])
                for node in (AnalyzerNode, WashoutControllerNode)
            ]
        for node in [*self._composed, self.plant]:
            self._executor.add_node(node)
        self.plant.trigger_configure()
        self.run(0)

    def run(self, samples: int) -> None:
        """Let the plant take `samples` steps as soon as it is connected."""
        duration = Parameter("duration", Parameter.Type.DOUBLE, samples / self._rate)
        self.plant.set_parameters([duration])
        deadline = time.monotonic() + READY_TIMEOUT
        self.plant.trigger_activate()
        while not self.plant.active:
            if time.monotonic() > deadline:
                raise SystemExit(f"the plant was not connected in {READY_TIMEOUT} s")
            spin_for(self._executor, 0.05)
            self.plant.trigger_activate()
        spin(self._executor, self.plant.paused)
        figures = self.plant.diagnose()[2]
        if figures["samples"] != samples + 1:
            raise SystemExit(f"the plant did not take {samples} steps: {figures}")
        self._samples += samples + 1

    def close(self) -> None:
        """Close the bag; raise SystemExit if a sample is missing in it."""
        for node in self._composed:
            node.trigger_deactivate()
        for process in self.processes:
            process.terminate()
        for process in self.processes:
            process.wait()
        report = report_of_recording(self._bag)
        if report["samples"] != self._samples or not report["complete"]:
            whole = "whole" if report["complete"] else "cut off"
            raise SystemExit(
                f"its bag, {whole}, holds {report['samples']} of {self._samples} samples"
            )


@contextmanager
def closed_loop(
    make_plant: Callable[..., PlantT], scenario: str, *, composed: bool
) -> Generator[OurLoop[PlantT]]:
    """Run a scenario in this process, or all but the plant in two others; check its recording.

    A slice is one activation of the plant; the other nodes are active all the time.
    """
    with tempfile.TemporaryDirectory() as directory, ros():
        loop = OurLoop(make_plant, scenario, Path(directory) / "bag", composed=composed)
        yield loop
        loop.close()


def spin_for(executor: Executor, duration: float) -> None:
    executor.spin_until_future_complete(Future(), timeout_sec=duration)


def wait_until_connected(executor: Executor, *publishers: Any) -> None:
    deadline = time.monotonic() + READY_TIMEOUT
    while not all(publisher.get_subscription_count() for publisher in publishers):
        if time.monotonic() > deadline:
            topics = ", ".join(publisher.topic_name for publisher in publishers)
            raise SystemExit(f"no subscriber to {topics} within {READY_TIMEOUT} s")
        spin_for(executor, 0.05)
