"""The closed loop as a context manager: a scenario, a controller, and so much simulated time."""

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from inspect import Parameter, signature
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Literal, Self

import rclpy
from rclpy.exceptions import InvalidNamespaceException
from rclpy.node import Node
from rclpy.validate_namespace import validate_namespace

from stickslip_ros.bags.recorder import check_new_bag
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.nodes.analyzer import VERDICT_TIME
from stickslip_ros.nodes.base.managed import ERROR
from stickslip_ros.nodes.base.service_call import parameters_call
from stickslip_ros.running.composition import Composition, node_parameters
from stickslip_ros.running.controller_search import ControllerSearch
from stickslip_ros.running.domain import domain_variables, own_domain, ros_context
from stickslip_ros.running.lifecycle_client import LifecycleClient
from stickslip_ros.running.user_controller import ControllerProcess, ControllerThread
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.scenarios.namespace import DEFAULT_NAMESPACE, LONGEST_NAMESPACE
from stickslip_ros.testing.result import Diagnostics, RunResult, result_of
from stickslip_ros.text import shown

Controller = Callable[..., Node] | Sequence[str] | Literal["washout", "external"] | None
"""What is to control: a class or function that makes an rclpy node, a command that starts one,
ours (washout), whatever the test starts by itself (external), or nothing."""

_OF_A_TEST = ("plant.pace=lockstep", "plant.reply_timeout=5.0")
"""Where the caller asks for nothing else. A busy machine does not stand still for so long."""

_EXPECTS_CONTROL, _BAG = "plant.expects_control", "analyzer.bag"

_NODE_TIMEOUT, _PROCESS_TIMEOUT = 5.0, 30.0
"""Wall time, s, in which a controller has to be found, in this process or in one of its own."""
_ANSWER_TIMEOUT = 2.0


class ClosedLoop:
    """A plant and a controller in a ROS domain of their own, run for so much simulated time.

        with ClosedLoop("feed_drive", "plant.belt_speed=0.03", controller=MyController) as loop:
            result = loop.run(5.0)
        assert result.measures.regime == "equilibrium"

    All is kept on this machine, and nothing is left behind. The plant runs in lockstep: it waits
    for the answer to each sample, up to `plant.reply_timeout` (5 s unless overridden), and goes on
    without if none comes. The plant only runs within `run`; the controller while the loop is open.

    A controller that is a class or a function is called without arguments and makes an rclpy
    node, which runs in a thread of its own; if it is a managed (lifecycle) node, it is configured
    and activated. Relative topic names are taken in `namespace`. Nodes that name no context are in
    that of the loop, unless rclpy's default context is in use already (the test has called
    rclpy.init, or another loop is open): then the controller must take `context`.

    A controller that is a command is started with `environment` and `ros_arguments`, and ended
    with all that it has started; of its own --ros-args the parameters go first. With "external"
    the test starts one, with the same. A scenario that expects no control has none of ours.
    """

    def __init__(
        self,
        scenario: str | PathLike[str],
        *overrides: str,
        controller: Controller = "washout",
        namespace: str = DEFAULT_NAMESPACE,
        bag: str | PathLike[str] | None = None,
    ) -> None:
        """Prepare a scenario, by name or path, with overrides NODE.PARAMETER=VALUE.

        The first run is recorded to the directory `bag`, further ones to `bag` with _2, _3 …
        appended; None: nothing is kept. Raises InvalidInputError for what cannot be.
        """
        self.namespace = _checked_namespace(namespace)
        self.controller: Node | None = None
        """The controller's node, if it runs in this process, while the loop is open."""
        _check_controller(controller)
        self._to_control = controller
        self._name_or_path = fspath(scenario)
        self._overrides = {_target(text): text for text in (*_OF_A_TEST, *overrides)}
        if controller is None:
            self._overrides.setdefault(_EXPECTS_CONTROL, f"{_EXPECTS_CONTROL}=false")
        self.scenario = self._load(self._overrides)
        """The scenario as it is at present."""
        if controller == "washout" and not self.scenario.plant.expects_control:
            self._to_control = None
        self._bag = None if bag is None else Path(bag)
        if self._bag is not None:
            check_new_bag(self._bag)
        self._opened = ExitStack()
        self._running: ControllerThread | ControllerProcess | None = None
        self._nodes: Composition | None = None

    @property
    def environment(self) -> dict[str, str]:
        """Environment of a process that is to meet this loop; RunError unless that is open."""
        self._open_nodes()
        return {**os.environ, **domain_variables(self._domain)}

    @property
    def ros_arguments(self) -> list[str]:
        """Arguments of a process that is to have its relative names in this loop's namespace.

        Parameters of its nodes are in the scenario file, if that has sections for others than ours.
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
            self.context = opened.enter_context(ros_context(self._domain, self.ros_arguments))
            opened.callback(self._forget)  # before ROS ends: then nothing of it is left
            parameters = node_parameters(self.scenario, self._bag_of_run)
            if self._to_control != "washout":
                parameters.pop("washout_controller", None)
            self._nodes = Composition(self.context, parameters)
            opened.callback(self._nodes.close)
            self._start_controller(opened)
            self._opened = opened.pop_all()
        return self

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        running = self._running
        with self._opened:
            if isinstance(running, ControllerThread) and running.unreported and error is None:
                running.check()

    def run(self, duration: float, *, timeout: float = 300.0) -> RunResult:
        """Run the loop for `duration` (s) of simulated time and return what it gave.

        Run again, the motion goes on from where it was, in a new segment of samples, the first of
        which stands a period after the last one. Raises RunError if the controller raises or ends,
        if it is not found on the topics, if the run takes more than `timeout` of wall time (s), or
        if it could not be recorded in whole.
        """
        nodes = self._open_nodes()
        if not 0.0 < duration < float("inf"):
            raise InvalidInputError(f"duration = {duration} s is refused: must be above 0, finite")
        nodes.set_parameters(nodes.plant, {"duration": float(duration)})
        nodes.plant.elapsed = 0.0
        try:
            nodes.activate(nodes.analyzer)
            self._runs += 1
            self._close_the_loop(nodes)
            if not self._wait(nodes, lambda: not nodes.plant.active, timeout):
                figures = nodes.plant.diagnose()[2]
                raise RunError(
                    f"the run of {duration} s took more than {timeout} s: {figures['samples']} "
                    f"samples so far, {figures['late_forces']} without a force"
                )
            diagnostics = self._end_run(nodes)
        finally:
            for node in (nodes.plant, nodes.analyzer):
                if node.active:
                    node.trigger_deactivate()
        result = result_of(self._bag_of_run, self.scenario.analyzer.window, diagnostics)
        if result.lost_samples and self.scenario.plant.pace == "lockstep":
            raise RunError(f"the recording of the run failed: {result.lost_samples} samples lost")
        return result

    def set(self, *overrides: str) -> None:
        """Change parameters, NODE.PARAMETER=VALUE each, from the next sample or run on.

        Raises InvalidInputError for what is refused; then nothing is changed.
        """
        nodes = self._open_nodes()
        changed = self._overrides | {_target(text): text for text in overrides}
        scenario = self._load(changed)
        values: dict[str, dict[str, Any]] = {}
        for node, parameter in (_target(text).split(".", 1) for text in overrides):
            if node not in nodes.nodes:
                raise InvalidInputError(
                    f"{node} is not part of this loop, whose nodes are {', '.join(nodes.nodes)}"
                )
            values.setdefault(node, {})[parameter] = scenario.as_dict()[node][parameter]
        # Only an active node may still refuse, and no more than one is active between runs.
        for node in sorted(values, key=lambda name: not nodes.nodes[name].active):
            nodes.set_parameters(nodes.nodes[node], values[node])
        self.scenario, self._overrides = scenario, changed

    def disturb(self, force: float) -> None:
        """Let a constant `force` (N) act on the slide from the next sample or run on.

        It takes the place of the disturbance of the scenario; that of the topic disturbance_force
        is added to it. Raises InvalidInputError unless it is finite.
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

    def _load(self, overrides: Mapping[str, str]) -> Scenario:
        if _BAG in overrides:
            raise InvalidInputError(
                f"{overrides[_BAG]} is refused: where to is said by `bag` of ClosedLoop"
            )
        scenario = load_scenario(
            self._name_or_path,
            list(overrides.values()),
            self.namespace,
            other_nodes=self._to_control not in ("washout", None),
        )
        if self._to_control is None and scenario.plant.expects_control:
            raise InvalidInputError(
                f"{overrides[_EXPECTS_CONTROL]} is refused: this loop has no controller"
            )
        return scenario

    def _forget(self) -> None:
        self._nodes = self._running = self.controller = None

    def _open_nodes(self) -> Composition:
        if self._nodes is None:
            raise RunError("the loop is not open: use it within `with ClosedLoop(...) as loop:`")
        return self._nodes

    def _start_controller(self, opened: ExitStack) -> None:
        if callable(self._to_control):
            self.controller = self._made_node(self._to_control)
            self._running = ControllerThread(self.controller)
            opened.callback(self._running.close)
            self._running.start()
        elif self._to_control not in ("washout", "external", None):
            command = list(self._to_control)
            # rcl lets later parameters win: those of the command are to.
            at = command.index("--ros-args") if "--ros-args" in command else len(command)
            command[at : at + 1] = self.ros_arguments
            self._running = ControllerProcess(command, domain_variables(self._domain))
            opened.callback(self._running.close)

    def _made_node(self, make: Callable[..., Node]) -> Node:
        if self.context is rclpy.get_default_context():
            node: Any = make()
        elif _takes_context(make):
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
        """Activate the plant as soon as plant and controller have found each other."""
        listeners = ["analyzer"]
        if self._to_control == "washout":
            listeners.append("washout_controller")
            controller = nodes.nodes["washout_controller"]
            if not controller.active:
                nodes.activate(controller)
        elif self._to_control is not None:
            listeners += self._find_controller(nodes)
        nodes.set_parameters(nodes.plant, {"wait_for": listeners})
        nodes.activate(nodes.plant, _NODE_TIMEOUT)

    def _find_controller(self, nodes: Composition) -> list[str]:
        """Wait for a controller, get it ready, and return its full name; RunError if none comes."""
        search = ControllerSearch(nodes.plant, self.namespace, nodes.nodes)
        elsewhere = self.controller is None
        timeout = _PROCESS_TIMEOUT if elsewhere else _NODE_TIMEOUT

        def managed() -> set[str]:
            here = f"{self.namespace.rstrip('/')}/"
            found = {name for name in search.managed() if name.startswith(here)}
            return found - self._brought_up if elsewhere else set()

        self._wait(nodes, lambda: bool(search.controllers() or managed()), timeout)
        for name in managed():
            client = LifecycleClient(nodes.spinner, nodes.plant, name, _ANSWER_TIMEOUT)
            client.bring_up(timeout, self._check_running)
            self._brought_up.add(name)
            self._wait(nodes, lambda: bool(search.controllers()), timeout)
        found = search.controllers()
        if not found:
            reasons = "; ".join([f"nobody {search.task}", *search.near_misses()])
            raise RunError(f"no controller was found within {timeout:g} s: {reasons}")
        # The middleware tells a process of our topics in the order in which we have made them: once
        # it has found what its answer is to go to, it has found plant and analyzer, too.
        for name in found if elsewhere else []:
            call = parameters_call(nodes.plant, name, [], lambda _: None)
            nodes.spinner.spin_until(call.pursue, 2.0 * _ANSWER_TIMEOUT)
            call.close()
        return found

    def _wait(self, nodes: Composition, condition: Callable[[], bool], timeout: float) -> bool:
        """Run our nodes until the condition holds; RunError as soon as the controller ends."""

        def is_met() -> bool:
            self._check_running()
            return condition()

        return nodes.spinner.spin_until(is_met, timeout)

    def _check_running(self) -> None:
        if self._running is not None:
            self._running.check()

    def _end_run(self, nodes: Composition) -> dict[str, Diagnostics]:
        """Let the analyzer take in what is under way and close its bag; return all diagnostics."""
        if isinstance(self._running, ControllerThread):
            self._running.settle()
            self._running.check()
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


def _takes_context(make: Callable[..., Node]) -> bool:
    return any(
        argument.kind is Parameter.VAR_KEYWORD or argument.name == "context"
        for argument in signature(make).parameters.values()
    )


def _check_controller(controller: object) -> None:
    if callable(controller) or controller in ("washout", "external", None):
        return
    if isinstance(controller, Sequence) and not isinstance(controller, str | bytes):
        command = list[Any](controller)
        if command and all(isinstance(argument, str) for argument in command):
            return
    raise InvalidInputError(
        f"controller = {controller!r} is refused: must be a class or function that makes an rclpy "
        "node, a command as a list of strings, 'washout', 'external' or None"
    )


def _checked_namespace(namespace: str) -> str:
    try:
        validate_namespace(namespace)
    except InvalidNamespaceException as error:
        reason = str(error).splitlines()[0]
        raise InvalidInputError(f"namespace = {namespace!r} is refused: {reason}") from None
    if len(namespace) > LONGEST_NAMESPACE:
        raise InvalidInputError(
            f"namespace = {shown(namespace)} is refused: must have at most {LONGEST_NAMESPACE} "
            "characters"
        )
    return namespace
