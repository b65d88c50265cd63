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
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, contextmanager, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Generic, TypeVar

import rclpy
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.child_process import start_child
from stickslip_ros.nodes.base.machine import own_domain
from stickslip_ros.nodes.base.managed import ManagedNode
from stickslip_ros.nodes.base.network import domain_variables
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


@contextmanager
def party(
    make: Callable[..., AbstractContextManager[Slice[T]]], *arguments: Any
) -> Generator[Slice[T]]:
    """Yield a function that runs slices of `make(*arguments)` in a process with its own domain."""
    context = multiprocessing.get_context("spawn")
    with own_domain() as domain:
        connection, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs, domain, make, arguments))
        process.start()
        theirs.close()

        def receive() -> Any:
            try:
                return connection.recv()
            except EOFError:
                raise SystemExit("a party ended early, see above") from None

        def run(count: int) -> T:
            connection.send(count)
            return receive()

        try:
            receive()
            yield run
        finally:
            connection.close()
            process.join(EXIT_TIMEOUT)
            process.kill()
            process.join()
        if process.exitcode:
            raise SystemExit("a party failed, see above")


def _serve(
    connection: Connection,
    domain: int,
    make: Callable[..., AbstractContextManager[Slice[Any]]],
    arguments: tuple[Any, ...],
) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process ends it
    os.environ.update(domain_variables(domain))
    with make(*arguments) as run:
        connection.send(None)
        with suppress(EOFError, BrokenPipeError):  # the parent process has no more requests
            while True:
                connection.send(run(connection.recv()))


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
            raise SystemExit(f"the bag does not hold {self._samples} samples: {report}")


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
