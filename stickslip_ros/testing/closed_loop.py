"""The closed loop as a context manager: run a scenario and a controller for a simulated time."""

import os
import shlex
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from inspect import Parameter, signature
from os import PathLike, fspath
from pathlib import Path
from shutil import which
from typing import Any, Self

import rclpy
from rclpy.exceptions import InvalidNamespaceException
from rclpy.node import Node
from rclpy.validate_namespace import validate_namespace

from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.nodes.analyzer import VERDICT_TIME
from stickslip_ros.nodes.base.child_process import ChildProcesses, how_it_ended
from stickslip_ros.nodes.base.clients import LifecycleClient, parameters_call
from stickslip_ros.nodes.base.managed import ERROR
from stickslip_ros.nodes.base.network import domain_variables, own_domain
from stickslip_ros.nodes.base.process import loopback_session
from stickslip_ros.nodes.running.bringup import node_parameters
from stickslip_ros.nodes.running.composition import Composition, ControllerThread
from stickslip_ros.nodes.running.controller_search import ControllerSearch
from stickslip_ros.record.recorder import check_new_bag
from stickslip_ros.record.topics import force_topics
from stickslip_ros.scenarios import DEFAULT_NAMESPACE, LONGEST_NAMESPACE, full_name
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS
from stickslip_ros.testing.result import Diagnostics, RunResult, result_of
from stickslip_ros.text import shown

Controller = Callable[..., Node] | Sequence[str] | str | None
"""The controller of a loop: a class or function that makes an rclpy node, a command that starts
one, the controller of the scenario ("scenario"), the name of a control law such as
"velocity_feedback", a node that the test starts itself ("external"), or none (None)."""

_OF_SCENARIO, _EXTERNAL = "scenario", "external"

_OF_A_TEST = ("plant.pace=lockstep", "plant.reply_timeout=5.0")
"""Defaults that the caller may override; a busy machine is never delayed for this timeout."""

_EXPECTS_CONTROL, _BAG = "plant.expects_control", "analyzer.bag"

_NODE_TIMEOUT, _PROCESS_TIMEOUT = 5.0, 30.0
"""Wall time, s, in which a controller must be found: in this process, in another process."""
_ANSWER_TIMEOUT = 2.0


class ClosedLoop:
    """A plant and a controller in a ROS domain of their own; a context manager.

    The loop is loopback only and leaves nothing behind. The plant runs in lockstep: it waits for
    the answer to each sample, up to `plant.reply_timeout` (5 s unless overridden), and continues
    without a force if none arrives. The plant runs only during `run`, the controller as long as the
    loop is open.

    A class or function is called without arguments and makes an rclpy node, which runs in its own
    thread. A managed (lifecycle) node is configured and activated. Relative topic names resolve in
    `namespace`. A node without an explicit context uses that of the loop, unless rclpy's default
    context is already in use (the test has called rclpy.init, or another loop is open): then the
    class or function must take the argument `context`.

    A command is started with `environment` and `ros_arguments`, and is ended with all processes
    that it has started. Parameters in its own --ros-args take precedence. With "external", start
    the controller yourself with the same environment and arguments.

    Parameters
    ----------
    scenario : str or os.PathLike
        Name of a shipped scenario, or path of a scenario file.
    *overrides : str
        Parameters as NODE.PARAMETER=VALUE.
    controller : Controller
        A class or function that makes an rclpy node, a command as a list of strings, the name of a
        control law, "scenario", "external", or None. A law starts no controller if the scenario
        sets `plant.expects_control` to false.
    namespace : str
        ROS namespace of the drive.
    bag : str or os.PathLike or None
        Directory to which the first run is recorded; `_2`, `_3`, ... are appended for further
        runs. None: recordings are not kept.

    Raises
    ------
    InvalidInputError
        If the scenario, an override, the controller or the namespace is invalid.
    BagError
        If no bag can be created at `bag`.

    Examples
    --------
    >>> from stickslip_ros.testing import ClosedLoop
    >>> with ClosedLoop("feed_drive", "washout_controller.start_after=0.0") as loop:
    ...     result = loop.run(5.0)
    >>> str(result.measures.regime), result.late_forces
    ('equilibrium', 0)
    """

    def __init__(
        self,
        scenario: str | PathLike[str],
        *overrides: str,
        controller: Controller = _OF_SCENARIO,
        namespace: str = DEFAULT_NAMESPACE,
        bag: str | PathLike[str] | None = None,
    ) -> None:
        self.namespace = _checked_namespace(namespace)
        self.controller: Node | None = None
        """The controller's node while the loop is open, if it runs in this process."""
        _check_controller(controller)
        self._to_control = controller
        self._is_law = isinstance(controller, str) and controller != _EXTERNAL
        law = str(controller) if self._is_law and controller != _OF_SCENARIO else None
        scenario_of_test = load_scenario(
            fspath(scenario),
            [*_OF_A_TEST, *([f"{_EXPECTS_CONTROL}=false"] if controller is None else [])],
            self.namespace,
            controller=law,
            other_nodes=not self._is_law and controller is not None,
        )
        self.scenario = self._changed(scenario_of_test, overrides)
        """The current scenario, including changes by `set` and `disturb`."""
        if self._is_law and not self.scenario.plant.expects_control:
            self._to_control, self._is_law = None, False
        self._bag = None if bag is None else Path(bag)
        if self._bag is not None:
            check_new_bag(self._bag)
        self._opened = ExitStack()
        self._thread: ControllerThread | None = None
        self._processes = ChildProcesses()
        self._nodes: Composition | None = None

    @property
    def environment(self) -> dict[str, str]:
        """Environment of a process that joins this loop; raises RunError if it is not open."""
        self._open_nodes()
        return {**os.environ, **domain_variables(self._domain)}

    @property
    def ros_arguments(self) -> list[str]:
        """ROS arguments of a process whose relative names are in this loop's namespace.

        They name the scenario file as parameter file if it has sections for nodes of other
        packages.
        """
        files = ["--params-file", str(self.scenario.path)] if self.scenario.other_sections else []
        return ["--ros-args", "-r", f"__ns:={self.namespace}", *files]

    def __enter__(self) -> Self:
        self._runs = 0
        self._brought_up: set[str] = set()
        with ExitStack() as opened:
            self._domain = opened.enter_context(own_domain())
            self._directory = opened.enter_context(
                tempfile.TemporaryDirectory(prefix="stickslip_ros_")
            )
            session = loopback_session(self._domain, self.ros_arguments)
            spinner = opened.enter_context(session)
            self.context = spinner.executor.context
            opened.callback(self._forget)  # while ROS still runs
            parameters = node_parameters(self.scenario, self._bag_of_run)
            if not self._is_law:
                parameters.pop(self.scenario.controller.node, None)
            self._nodes = Composition(spinner, parameters)
            opened.callback(self._nodes.close)
            self._start_controller(opened)
            self._opened = opened.pop_all()
        return self

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        thread = self._thread
        with self._opened:
            if thread is not None and error is None:
                thread.settle()  # it may be about to raise
                if thread.unreported:
                    thread.check()

    def run(self, duration: float, *, timeout: float = 300.0) -> RunResult:
        """Run the loop for some simulated time and return the result.

        A further call continues the motion in a new segment of samples; the first of them is one
        sampling period after the last sample before.

        Parameters
        ----------
        duration : float
            Simulated time, s.
        timeout : float
            Largest wall time of the run, s.

        Returns
        -------
        RunResult
            Recorded columns, measures and diagnostics of this run.

        Raises
        ------
        InvalidInputError
            If the duration is not positive and finite.
        RunError
            If the loop is not open, the controller raises or ends, or is not found on the topics,
            the run takes longer than `timeout`, or its recording is incomplete.
        """
        nodes = self._open_nodes()
        if not 0.0 < duration < float("inf"):
            raise InvalidInputError(f"duration = {duration} s is invalid: must be above 0, finite")
        nodes.set_parameters(nodes.plant, {"duration": float(duration)})
        nodes.plant.elapsed = 0.0
        try:
            nodes.activate(nodes.analyzer)
            self._runs += 1
            self._close_the_loop(nodes)
            if not self._wait(nodes, lambda: not nodes.plant.active, timeout):
                values = nodes.plant.diagnose()[2]
                raise RunError(
                    f"the run of {duration} s took more than {timeout} s: {values['samples']} "
                    f"samples so far, {values['late_forces']} without a force"
                )
            diagnostics = self._end_run(nodes)
        finally:
            for node in (nodes.plant, nodes.analyzer):
                if node.active:
                    node.trigger_deactivate()
        window, reading = self.scenario.analyzer.window, self.scenario.reading
        result = result_of(self._bag_of_run, window, reading, diagnostics)
        taken = diagnostics["plant"].figures["samples"]
        if self.scenario.plant.pace == "lockstep" and len(result.states) < taken:
            raise RunError(
                f"the recording of the run failed: it has {len(result.states)} of {taken} samples"
            )
        return result

    def set(self, *overrides: str) -> None:
        """Change parameters from the next sample or run on.

        Parameters
        ----------
        *overrides : str
            Parameters as NODE.PARAMETER=VALUE.

        Raises
        ------
        InvalidInputError
            If a parameter is refused; then nothing is changed.
        RunError
            If the loop is not open.
        """
        nodes = self._open_nodes()
        scenario = self._changed(self.scenario, overrides)
        values: dict[str, dict[str, Any]] = {}
        for node, parameter in (_target(text).split(".", 1) for text in overrides):
            if node not in nodes.nodes:
                raise InvalidInputError(
                    f"{node} is not part of this loop, whose nodes are {', '.join(nodes.nodes)}"
                )
            values.setdefault(node, {})[parameter] = scenario.as_dict()[node][parameter]
        # Only an active node may still refuse, and at most one is active between runs.
        for node in sorted(values, key=lambda name: not nodes.nodes[name].active):
            nodes.set_parameters(nodes.nodes[node], values[node])
        self.scenario = scenario

    def disturb(self, force: float) -> None:
        """Apply a constant force to the slide from the next sample or run on.

        It replaces the disturbance of the scenario. A force on the topic disturbance_force is added
        to it.

        Parameters
        ----------
        force : float
            N.

        Raises
        ------
        InvalidInputError
            If the force is not finite.
        RunError
            If the loop is not open.
        """
        self.set(
            "plant.disturbance.kind=step",
            f"plant.disturbance.amplitude={float(force)!r}",
            "plant.disturbance.start=0.0",
            "plant.disturbance.duration=inf",
        )

    @property
    def _bag_of_run(self) -> Path:
        bag = self._bag or Path(self._directory, "bag")
        return bag if self._runs <= 1 else bag.with_name(f"{bag.name}_{self._runs}")

    def _changed(self, scenario: Scenario, overrides: Sequence[str]) -> Scenario:
        given = {_target(text): text for text in overrides}
        if _BAG in given:
            raise InvalidInputError(
                f"{given[_BAG]} is refused: use the argument `bag` of ClosedLoop"
            )
        changed = scenario.overridden(overrides)
        if self._to_control is None and changed.plant.expects_control:
            raise InvalidInputError(
                f"{given[_EXPECTS_CONTROL]} is refused: this loop has no controller"
            )
        return changed

    def _forget(self) -> None:
        self._nodes = self._thread = self.controller = None
        self._processes = ChildProcesses()

    def _open_nodes(self) -> Composition:
        if self._nodes is None:
            raise RunError("the loop is not open: use it within `with ClosedLoop(...) as loop:`")
        return self._nodes

    def _start_controller(self, opened: ExitStack) -> None:
        if callable(self._to_control):
            self.controller = self._made_node(self._to_control)
            self._thread = ControllerThread(self.controller)
            opened.callback(self._thread.close)
            self._thread.start()
        elif self._to_control is not None and not isinstance(self._to_control, str):
            command = list(self._to_control)
            # In rcl, later parameters take precedence: those of the command must.
            at = command.index("--ros-args") if "--ros-args" in command else len(command)
            command[at : at + 1] = self.ros_arguments
            name, variables = shlex.join(command), domain_variables(self._domain)
            if which(command[0]) is None:
                raise InvalidInputError(f"the controller {name}: no command {command[0]!r}")
            setting = (f"{variable}={value}" for variable, value in variables.items())
            self._processes.start(name, ["env", *setting, *command], guarded=True)
            opened.callback(self._processes.end)

    def _made_node(self, make: Callable[..., Node]) -> Node:
        if self.context is rclpy.get_default_context():
            node: Any = make()
        elif any(
            argument.kind is Parameter.VAR_KEYWORD or argument.name == "context"
            for argument in signature(make).parameters.values()
        ):
            node = make(context=self.context)
        else:
            raise InvalidInputError(
                f"the controller {make!r} does not take `context`, which it must while rclpy's "
                "default context is in use: rclpy.init was called, or another loop is open"
            )
        if not isinstance(node, Node):
            raise InvalidInputError(f"the controller {make!r} made {node!r}, not an rclpy node")
        if node.context is not self.context:
            node.destroy_node()
            raise InvalidInputError(f"the controller {make!r} made a node in another context")
        return node

    def _close_the_loop(self, nodes: Composition) -> None:
        """Activate the plant as soon as plant and controller have discovered each other."""
        listeners = ["analyzer"]
        if self._is_law:
            listeners.append(self.scenario.controller.node)
            controller = nodes.nodes[self.scenario.controller.node]
            if not controller.active:
                nodes.activate(controller)
        elif self._to_control is not None:
            listeners += self._find_controller(nodes)
        nodes.set_parameters(nodes.plant, {"wait_for": listeners})
        nodes.activate(nodes.plant, _NODE_TIMEOUT)

    def _find_controller(self, nodes: Composition) -> list[str]:
        """Wait for a controller, bring it up and return its full name; RunError if none appears."""
        search = ControllerSearch(
            nodes.plant, self.namespace, nodes.nodes, force_topics(self.scenario.plant.force_type)
        )
        elsewhere = self.controller is None
        timeout = _PROCESS_TIMEOUT if elsewhere else _NODE_TIMEOUT

        def managed() -> set[str]:
            here = full_name(self.namespace, "")
            names = {name for name in search.managed() if name.startswith(here)}
            return names - self._brought_up if elsewhere else set()

        self._wait(nodes, lambda: bool(search.controllers() or managed()), timeout)
        for name in managed():
            client = LifecycleClient(nodes.spinner, nodes.plant, name, _ANSWER_TIMEOUT)
            client.bring_up(timeout, self._check_running)
            self._brought_up.add(name)
            self._wait(nodes, lambda: bool(search.controllers()), timeout)
        controllers = search.controllers()
        if not controllers:
            reasons = "; ".join([f"no node {search.task}", *search.near_misses()])
            raise RunError(f"no controller was found within {timeout:g} s: {reasons}")
        # The middleware announces our topics to a process in the order of their creation: once the
        # process has discovered where its answer goes, it has also discovered plant and analyzer.
        for name in controllers if elsewhere else []:
            call = parameters_call(nodes.plant, name, [], lambda _: None)
            nodes.spinner.spin_until(call.pursue, 2.0 * _ANSWER_TIMEOUT)
            call.close()
        return controllers

    def _wait(self, nodes: Composition, condition: Callable[[], bool], timeout: float) -> bool:
        """Run our nodes until the condition holds; RunError as soon as the controller ends."""

        def is_met() -> bool:
            self._check_running()
            return condition()

        return nodes.spinner.spin_until(is_met, timeout)

    def _check_running(self) -> None:
        if self._thread is not None:
            self._thread.check()
        for name, status in self._processes.ended().items():
            raise RunError(f"the controller {name} has ended ({how_it_ended(status)})")

    def _end_run(self, nodes: Composition) -> dict[str, Diagnostics]:
        """Let the analyzer process pending messages and close its bag; return all diagnostics."""
        if self._thread is not None:
            self._thread.settle()
            self._thread.check()
        level, complaint, _ = nodes.analyzer.diagnose()
        if level == ERROR:
            raise RunError(f"the recording of the run failed: {complaint}")
        diagnostics = {
            name: Diagnostics(*node.diagnose())
            for name, node in nodes.nodes.items()
            if node is not nodes.analyzer
        }
        if diagnostics["plant"].figures["dropped_messages"]:
            nodes.spinner.spin_for(VERDICT_TIME)
        nodes.analyzer.call_soon(nodes.analyzer.trigger_deactivate)
        nodes.spinner.spin_until(lambda: not nodes.analyzer.active, timeout=30.0)
        return diagnostics


def _target(override: str) -> str:
    return override.partition("=")[0]


def _check_controller(controller: object) -> None:
    known = _OF_SCENARIO, _EXTERNAL, None, *CONTROLLER_PARAMETERS
    if callable(controller) or controller in known:
        return
    if isinstance(controller, Sequence) and not isinstance(controller, str | bytes):
        command = list[Any](controller)
        if command and all(isinstance(argument, str) for argument in command):
            return
    raise InvalidInputError(
        f"controller = {controller!r} is invalid: must be a class or function that makes an rclpy "
        "node, a command as a list of strings, the name of a control law "
        f"({', '.join(CONTROLLER_PARAMETERS)}), 'scenario', 'external' or None"
    )


def _checked_namespace(namespace: str) -> str:
    try:
        validate_namespace(namespace)
    except InvalidNamespaceException as error:
        reason = str(error).splitlines()[0]
        raise InvalidInputError(f"namespace = {namespace!r} is refused: {reason}") from None
    if len(namespace) > LONGEST_NAMESPACE:
        raise InvalidInputError(
            f"namespace = {shown(namespace)} is invalid: must have at most {LONGEST_NAMESPACE} "
            "characters"
        )
    return namespace
