"""Bringing the nodes up and down: as processes or composed in one, activated in order."""

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParameters
from rclpy.client import Client
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_msgs.msg import Header

from stickslip_ros.errors import RunError
from stickslip_ros.messages.topics import CONTROL_FORCE, DIAGNOSTICS, JOINT_STATES, RECORDED
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.child_process import GUARD_PATIENCE, start
from stickslip_ros.nodes.base.managed import STATE, ManagedNode
from stickslip_ros.nodes.base.process import ROS_ARGUMENTS, initialise, spin, stop_on_signals
from stickslip_ros.nodes.plant import FAILURE, FINISHED, NEWEST_STAMP, PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.running.controller_search import find_controllers, find_managed, near_misses
from stickslip_ros.running.namespace_lock import claim
from stickslip_ros.scenarios.files import Scenario, parameter_file
from stickslip_ros.scenarios.sections import section_matches
from stickslip_ros.stamps import NANOSECONDS

_READY_TIMEOUT = 30.0
_ANSWER_TIMEOUT = 15.0
_MATCH_TIMEOUT = 5.0
"""Time, s, after which a client that finds no service is replaced: some never do."""
_RETRY_PERIOD = 0.02
_WATCH_PERIOD = 0.1
_LOOK_PERIOD = 0.1
_DISCOVERY_TIME = 3.0
"""Time, s, for which something must stand before it is no longer a matter of discovery."""
_SETTLING_TIME = 0.3
"""Time, s, given to a controller to match our readers: on our side nothing tells that it has."""
_EXIT_TIMEOUT = 2.0 * GUARD_PATIENCE + 2.0
_LAST_WORDS_TIMEOUT = 2.0
_CATCH_UP_TIMEOUT = 10.0

_ACTIVE = "active"
_NEXT_TRANSITION = {
    "unconfigured": Transition.TRANSITION_CONFIGURE,
    "inactive": Transition.TRANSITION_ACTIVATE,
}
"""The way from a state of a managed node's life cycle to the active one."""

_NODES: dict[str, Callable[..., ManagedNode[Any]]] = {
    "analyzer": AnalyzerNode,
    "washout_controller": WashoutControllerNode,
    "plant": PlantNode,
}
"""Every node by its name, in the order of activation."""

Progress = Callable[[float], None]
"""Told now and then how much time has been simulated, s."""

Tell = Callable[[str], None]
"""Told what a person should know meanwhile, in a sentence."""


@dataclass
class RunOutcome:
    """What a run came to."""

    interrupted: bool = False
    """Whether SIGINT, SIGTERM or SIGHUP ended it."""
    plant: dict[str, str] = field(default_factory=dict)
    """The plant's last figures, as in its diagnostics."""
    controller: str | None = None
    """Full name of the node that was the controller."""


def run_nodes(
    scenario: Scenario,
    *,
    namespace: str,
    bag: Path,
    composed: bool = False,
    controller: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
    tell: Tell = lambda _: None,
) -> RunOutcome:
    """Run the scenario's nodes until the plant has finished or a signal comes.

    A plant that somebody deactivates is waited for until it is activated again.

    `controller` is the command, executable and arguments, of one in place of ours, which is
    configured and activated if it is a managed (lifecycle) node. If the command is empty, somebody
    else starts one, and the plant waits for it.
    Every node is deactivated, and the bag closed, before this returns or raises RunError (a node
    died, or did not become ready). Raises InvalidInputError if another run is in the namespace, or
    ROS does not take what the environment says.
    """
    initialise()
    try:
        with claim(namespace, rclpy.get_default_context().get_domain_id()):
            bringup = _Bringup(scenario, namespace, controller, progress, tell)
            try:
                return bringup.run(_parameters(scenario, bag), composed)
            finally:
                bringup.close()
    finally:
        rclpy.try_shutdown()


def _parameters(scenario: Scenario, bag: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters by node, those of bringup included; the nodes to start are its keys."""
    values = scenario.as_dict()
    nodes = [n for n in _NODES if n != "washout_controller" or scenario.plant.expects_control]
    for node in nodes:
        values[node] |= {"autostart": False}
    values["analyzer"]["bag"] = str(bag)
    # The analyzer only listens until it is active; it is matched by those that write to it.
    for node in nodes[1:]:
        values[node]["wait_for"] = [other for other in nodes if other != node]
    return {node: values[node] for node in nodes}


class _Bringup:
    """A node that manages the others, and the executor that runs it."""

    def __init__(
        self,
        scenario: Scenario,
        namespace: str,
        other: Sequence[str] | None,
        progress: Progress,
        tell: Tell,
    ) -> None:
        self._scenario = scenario
        self._namespace = namespace
        self._other = other
        self._progress = progress
        self._tell = tell
        self._told: set[str] = set()
        self._ours = {f"{namespace.rstrip('/')}/{node}" for node in ("analyzer", "plant")}
        self._node = Node("bringup", namespace=namespace)
        self._executor: Executor = EventsExecutor()
        self._executor.add_node(self._node)
        self._stop = Future()
        self._hurry = Future()
        self._signal_handlers = stop_on_signals(self._executor, self._stop, self._hurry)
        self._composed: list[ManagedNode[Any]] = []
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._clients: dict[str, tuple[Client, float]] = {}
        self._active: list[str] = []
        self._failed = Future()
        self._plant_finished = Future()
        self._last_words = Future()
        self._paused = False
        self._outcome = RunOutcome()
        self._first_recorded: int | None = None
        self._recorded = 0
        self._node.create_subscription(
            DIAGNOSTICS.type, DIAGNOSTICS.name, self._on_diagnostics, DIAGNOSTICS.qos()
        )
        self._node.create_subscription(
            RECORDED.type, RECORDED.name, self._on_recorded, RECORDED.qos()
        )
        self._node.create_timer(_WATCH_PERIOD, self._watch_processes)

    def run(self, parameters: Mapping[str, Mapping[str, Any]], composed: bool) -> RunOutcome:
        nodes = list(parameters)
        if "washout_controller" in nodes:
            self._outcome.controller = f"{self._namespace.rstrip('/')}/washout_controller"
        if self._other is not None:
            nodes.remove("washout_controller")
        try:
            # It is gone once the nodes have read it: a run that is killed cannot remove it.
            with tempfile.TemporaryDirectory(prefix="stickslip_ros_") as directory:
                file = Path(directory, "parameters.yaml")
                file.write_text(parameter_file(parameters), encoding="utf-8")
                if composed:
                    self._compose({node: parameters[node] for node in nodes})
                else:
                    self._signal_handlers[signal.SIGTSTP] = signal.signal(
                        signal.SIGTSTP, self._stop_alone
                    )
                    self._spawn(nodes, file)
                self._start_other(file)
                self._bring_up(nodes)
            self._spin_until(self._plant_finished, None)
        finally:
            self._bring_down()
        if self._failed.done():
            raise RunError(self._failed.result())
        self._outcome.interrupted = self._stop.done()
        return self._outcome

    def close(self) -> None:
        for node in [*self._composed, self._node]:
            self._executor.remove_node(node)
            node.destroy_node()
        self._executor.shutdown()
        for number, handler in self._signal_handlers.items():
            signal.signal(number, handler)

    @property
    def _ended(self) -> bool:
        return self._stop.done() or self._failed.done()

    def _is_over(self, always: bool) -> bool:
        """Return whether nothing more is waited for, or only what is waited for `always`."""
        return self._hurry.done() if always else self._ended

    def _compose(self, parameters: Mapping[str, Mapping[str, Any]]) -> None:
        for name, values in parameters.items():
            node = _NODES[name](namespace=self._namespace, overrides=values)
            self._composed.append(node)
            self._executor.add_node(node)

    def _spawn(self, nodes: Iterable[str], file: Path) -> None:
        arguments = [*ROS_ARGUMENTS, "--params-file", str(file), "-r", f"__ns:={self._namespace}"]
        for name in nodes:
            module = _NODES[name].__module__
            self._processes[name] = start([sys.executable, "-m", module, *arguments])

    def _stop_alone(self, *_: object) -> None:
        """Be stopped, as by Ctrl-Z, which does not reach the nodes."""
        self._tell("stopped, and the nodes go on without being watched: fg takes the run up again")
        signal.raise_signal(signal.SIGSTOP)

    def _start_other(self, file: Path) -> None:
        """Start the other controller, if that is for us to do, with the scenario's parameters."""
        if self._other:
            executable, *further = self._other
            in_namespace = ["--ros-args", "-r", f"__ns:={self._namespace}"]
            # Its own parameters may stand in the scenario; overrides are in the other file. What
            # was given with the command comes last, and so has the last word.
            files = ["--params-file", str(self._scenario.path), "--params-file", str(file)]
            command = [executable, *in_namespace, *files, "--", *further]
            self._processes[self._other[0]] = start(command, guarded=True)

    def _bring_up(self, nodes: Iterable[str]) -> None:
        for node in nodes:
            self._change_state(node, Transition.TRANSITION_CONFIGURE)
        if self._other is not None:
            self._meet_the_other()
        for node in nodes:
            if node == "plant" and self._other is not None:
                self._await_controller(active=True)
                self._spin_for(_SETTLING_TIME)
            self._change_state(node, Transition.TRANSITION_ACTIVATE)

    def _meet_the_other(self) -> None:
        """Wait for the other controller, and have ours activated only when connected with it.

        Nothing is recorded yet: it may take long, and end with Ctrl-C.
        """
        if not self._other:
            self._tell(f"waiting for a controller: a node that {self._part}")
        controller = self._await_controller(active=False)
        if controller is None:
            return
        if self._other:
            self._processes[controller] = self._processes.pop(self._other[0])
        name = controller.rpartition("/")[2]
        self._set_wait_for("analyzer", [name])
        self._set_wait_for("plant", ["analyzer", name])
        nodes = self._node.get_node_names_and_namespaces()
        for section in self._scenario.other_sections:
            if not any(section_matches(section, f"{ns.rstrip('/')}/{name}") for name, ns in nodes):
                self._tell(f"{self._scenario.path}: section {section} matches no node")

    @property
    def _part(self) -> str:
        """What the controller does, in words."""
        topics = (JOINT_STATES.name, CONTROL_FORCE.name)
        return "reads {} and publishes {}".format(*map(self._node.resolve_topic_name, topics))

    def _await_controller(self, *, active: bool) -> str | None:
        """Return the controller when it is there, or at work; None if the run ends before.

        What is amiss for long is told. One that was started here must not take for ever.
        """
        started = time.monotonic()
        amiss_since: dict[str, float] = {}
        while not self._ended:
            self._outcome.controller, amiss = self._look_for_controller(active)
            if self._outcome.controller is not None:
                return self._outcome.controller
            now = time.monotonic()
            amiss_since = {what: amiss_since.get(what, now) for what in amiss}
            for what, since in amiss_since.items():
                if now - since > _DISCOVERY_TIME and what not in self._told:
                    self._told.add(what)
                    self._tell(what)
            if self._other and now - started > _READY_TIMEOUT:
                why = "; ".join([f"there is no active node that {self._part}", *amiss])
                self._fail(f"{self._other[0]} was not ready within {_READY_TIMEOUT:g} s: {why}")
            self._spin_for(_LOOK_PERIOD)
        return None

    def _look_for_controller(self, active: bool) -> tuple[str | None, list[str]]:
        """Return the controller, and in a sentence each what is amiss.

        A managed one that was started here is taken a step on towards its being active.
        """
        found, managed = find_controllers(self._node), find_managed(self._node)
        here = self._namespace.rstrip("/")
        # Before it is configured, it may have nothing to be found by but its namespace.
        perhaps = [node for node in managed if node.rpartition("/")[0] == here]
        amiss = near_misses(self._node, self._ours)
        for node in dict.fromkeys([*found, *perhaps]):
            if node in found and not (active and node in managed):
                return node, []
            if node in self._ours:
                continue
            state = self._state_of(node)
            if state == _ACTIVE:
                if node in found:
                    return node, []
                continue
            amiss.append(f"the managed node {node} is {state or 'silent'}")
            if self._other and state in _NEXT_TRANSITION:
                self._ask_for_transition(node, _NEXT_TRANSITION[state])
        return None, amiss

    def _set_wait_for(self, node: str, others: list[str]) -> None:
        parameter = Parameter("wait_for", value=others).to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        while not self._ended:
            if self._ask(SetParameters, f"{node}/set_parameters", request) is not None:
                break

    def _change_state(self, node: str, transition: int) -> None:
        """Take a node through a transition, again and again while it is not ready for it."""
        deadline = time.monotonic() + _READY_TIMEOUT
        while not self._ended and not self._ask_for_transition(node, transition):
            if time.monotonic() > deadline:
                self._fail(f"{node} did not become ready within {_READY_TIMEOUT:g} s")
            self._spin_for(_RETRY_PERIOD)

    def _bring_down(self) -> None:
        """Deactivate what is active, the analyzer last, and end the processes.

        Who is in a hurry, and says so by a second signal, does not wait for any answer.
        """
        for node in reversed(self._active):
            if node == "analyzer":
                self._let_the_analyzer_catch_up()
            finished = node == "plant" and self._plant_finished.done()
            if not finished and not self._is_dead(node):
                self._deactivate(node)
            if node == "plant" and not self._is_dead(node):
                self._spin_until(self._last_words, _LAST_WORDS_TIMEOUT, always=True)
        for process in self._processes.values():
            process.terminate()
        deadline = time.monotonic() + _EXIT_TIMEOUT
        for name, process in self._processes.items():
            try:
                process.wait(max(deadline - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                self._tell(f"the node {name} did not end within {_EXIT_TIMEOUT:g} s: killed")
                process.kill()
                process.wait()

    def _let_the_analyzer_catch_up(self) -> None:
        """Wait until it holds the plant's last sample; fail if it stops short of that."""
        last = int(self._outcome.plant.get(NEWEST_STAMP, 0))
        seen, seen_at = self._recorded, time.monotonic()
        while self._recorded < last and not self._is_dead("analyzer") and not self._hurry.done():
            self._spin_until(Future(), _RETRY_PERIOD, always=True)
            if self._recorded > seen:
                seen, seen_at = self._recorded, time.monotonic()
            elif time.monotonic() - seen_at > _CATCH_UP_TIMEOUT:
                missing = (last - max(self._recorded, self._first_recorded or 0)) * 1e-9
                self._fail(f"the analyzer did not take in the last {missing:g} s of samples")
                return

    def _deactivate(self, node: str) -> None:
        """Deactivate a node, unless somebody else has: rclpy leaves that request unanswered."""
        state = self._state_of(node, always=True)
        if state == _ACTIVE:
            self._ask_for_transition(node, Transition.TRANSITION_DEACTIVATE, always=True)
        elif not state and not self._hurry.done():
            self._tell(f"the node {node} does not answer")

    def _state_of(self, node: str, *, always: bool = False) -> str:
        """Return the state of a managed node's life cycle, nothing if it does not say."""
        answer = self._ask(GetState, f"{node}/get_state", GetState.Request(), always=always)
        return answer.current_state.label if answer is not None else ""

    def _ask_for_transition(self, node: str, transition: int, *, always: bool = False) -> bool:
        request = ChangeState.Request(transition=Transition(id=transition))
        answer = self._ask(ChangeState, f"{node}/change_state", request, always=always)
        done = answer is not None and answer.success
        if done and transition == Transition.TRANSITION_ACTIVATE:
            self._active.append(node)
        return done

    def _ask(self, kind: Any, name: str, request: Any, *, always: bool = False) -> Any:
        """Call a service and return its answer, None if none comes."""
        client = self._connected(kind, name, always)
        if client is None:
            return None
        answer = client.call_async(request)
        self._spin_until(answer, _ANSWER_TIMEOUT, always=always)
        return answer.result() if answer.done() else None

    def _connected(self, kind: Any, name: str, always: bool) -> Client | None:
        """Return a client that has found its service; None if there is no such service."""
        deadline = time.monotonic() + _ANSWER_TIMEOUT
        while not self._is_over(always) and time.monotonic() < deadline:
            if name not in self._clients:
                self._clients[name] = self._node.create_client(kind, name), time.monotonic()
            client, made_at = self._clients[name]
            if client.service_is_ready():
                return client
            if time.monotonic() - made_at > _MATCH_TIMEOUT:
                self._node.destroy_client(client)
                del self._clients[name]
            self._spin_until(Future(), _RETRY_PERIOD, always=always)
        return None

    def _spin_until(self, future: Future, timeout: float | None, *, always: bool = False) -> None:
        """Run callbacks until the future is done, time is over or, unless `always`, the run is.

        `always` ends where somebody is in a hurry.
        """
        until = Future()

        def finish(_: object = None) -> None:
            if not until.done():
                until.set_result(None)

        for reason in [future, *([self._hurry] if always else [self._stop, self._failed])]:
            reason.add_done_callback(finish)
        timer = self._node.create_timer(timeout, finish) if timeout is not None else None
        spin(self._executor, until)
        if timer is not None:
            self._node.destroy_timer(timer)

    def _spin_for(self, duration: float) -> None:
        self._spin_until(Future(), duration)

    def _is_dead(self, node: str) -> bool:
        process = self._processes.get(node)
        return process is not None and process.poll() is not None

    def _watch_processes(self) -> None:
        for name, process in self._processes.items():
            status = process.poll()
            if name == "plant" and status == 0 and self._last_words.done():
                self._finish()  # somebody has ended it in order
            elif status is not None:
                how = f"killed by signal {-status}" if status < 0 else f"exit status {status}"
                self._fail(f"the node {name} died ({how})")

    def _fail(self, why: str) -> None:
        if not self._failed.done():
            self._failed.set_result(why)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f"{self._namespace.rstrip('/')}/plant":
                self._outcome.plant = {entry.key: entry.value for entry in status.values}
                self._follow_plant()

    def _follow_plant(self) -> None:
        """Notice when the plant has come to its end, and tell when somebody pauses it."""
        plant = self._outcome.plant
        state = plant.get(STATE)
        if FAILURE in plant:
            self._fail(f"the plant could not go on: {plant[FAILURE]}")
        if state == _ACTIVE:
            if self._paused:
                self._tell("the plant goes on")
            self._paused = False
            if self._last_words.done():
                self._last_words = Future()
        elif NEWEST_STAMP in plant:
            if not self._last_words.done():
                self._last_words.set_result(None)
            if plant.get(FINISHED) == str(True) or state == "finalized":
                self._finish()
            elif state in _NEXT_TRANSITION and not (self._paused or self._ended):
                self._paused = True
                self._tell("the plant is paused: activate it to go on, or end the run with Ctrl-C")

    def _finish(self) -> None:
        if not self._plant_finished.done():
            self._plant_finished.set_result(None)

    def _on_recorded(self, message: Header) -> None:
        self._recorded = message.stamp.sec * NANOSECONDS + message.stamp.nanosec
        if self._first_recorded is None:
            self._first_recorded = self._recorded
        self._progress((self._recorded - self._first_recorded) * 1e-9)
