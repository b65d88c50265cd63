"""Start the nodes of a run, as processes or composed in one, and stop them in order."""

import os
import signal
import sys
import tempfile
import time
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lifecycle_msgs.msg import Transition
from rclpy.node import Node
from rclpy.task import Future

from stickslip_ros.errors import RunError
from stickslip_ros.nodes.base.child_process import EXIT_TIMEOUT, ChildProcesses, how_it_ended
from stickslip_ros.nodes.base.clients import ACTIVE, NEXT_TRANSITION, LifecycleClient, setting_call
from stickslip_ros.nodes.base.managed import REFUSAL, WAITING
from stickslip_ros.nodes.base.network import domain_of_environment, lock_namespace
from stickslip_ros.nodes.base.process import ROS_ARGUMENTS, ros_session
from stickslip_ros.nodes.base.spinner import Spinner, signal_handlers_kept, stop_on_signals
from stickslip_ros.nodes.running.controller_search import ControllerSearch
from stickslip_ros.nodes.running.run_monitor import Notify, OnSimulatedTime, RunMonitor
from stickslip_ros.record.topics import force_topics
from stickslip_ros.scenarios import full_name
from stickslip_ros.scenarios.files import Scenario, parameter_file
from stickslip_ros.scenarios.sections import section_matches

_READY_TIMEOUT = 30.0
_ANSWER_TIMEOUT = 5.0
_DISCOVERY_TIME = 3.0
"""Time, s, after which a problem is reported: a shorter one may be due to discovery."""
_WATCH_PERIOD = 0.1


@dataclass(frozen=True)
class RunOutcome:
    """Result of a run."""

    interrupted: bool
    """Whether SIGINT, SIGTERM or SIGHUP ended it."""
    plant: dict[str, str]
    """The plant's last values, as in its diagnostics."""
    controller: str | None
    """Full name of the node that was the controller."""
    recording_failure: str
    """Why the analyzer could not continue to record; empty if it could."""


class NothingRecordedError(RunError):
    """A run failed before its analyzer could record: a bag of that name is of another one."""


def node_parameters(scenario: Scenario, bag: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters of the nodes that a scenario needs, in the order of activation.

    The nodes do not activate themselves, and record to `bag`.
    """
    values = scenario.as_dict()
    values["analyzer"]["bag"] = str(bag)
    # A command does not tell at which sample it acts; the effort of the actuator does.
    plant = scenario.plant
    if plant.command_rule == "newest" and plant.effort == "actuator":
        joints = {"joint": plant.slide_name, "belt_joint": plant.belt_name}
        values["analyzer"] |= {"force_type": "effort", **joints}
    # The analyzer may know the parameters of the plant of a short run only at its end.
    reading = scenario.reading
    if reading.stick_speed and not reading.noisy:
        values["analyzer"]["stick_speed"] = reading.stick_speed
    controllers = [scenario.controller.node] if scenario.plant.expects_control else []
    nodes = ["analyzer", *controllers, "plant"]
    return {node: {**values[node], "autostart": False} for node in nodes}


def run_nodes(
    scenario: Scenario,
    *,
    namespace: str,
    bag: Path,
    composed: bool = False,
    controller: Sequence[str] | None = None,
    on_simulated_time: OnSimulatedTime = lambda _: None,
    notify: Notify = lambda _: None,
) -> RunOutcome:
    """Run the scenario's nodes until the plant has finished or a signal arrives.

    If the plant is deactivated from outside, the run continues when it is activated again.

    `controller` is the command (executable and arguments) of a user's controller that replaces
    ours; a managed (lifecycle) node is configured and activated. If the command is empty, the
    plant waits for a controller that is started elsewhere.
    Every node is deactivated, and the bag is closed, before this returns or raises RunError: a node
    died, or did not become ready (NothingRecordedError before it records). Raises InvalidInputError
    if the namespace has another run, or ROS refuses the settings of the environment.
    """
    with (
        lock_namespace(namespace, domain_of_environment()),
        signal_handlers_kept(),
        ros_session() as spinner,
    ):
        supervisor = _Supervisor(
            spinner, scenario, namespace, controller, on_simulated_time, notify
        )
        return supervisor.run(bag, composed)


class _ManagedNodes:
    """Requests states and transitions of nodes; keeps which of them were activated."""

    def __init__(self, spinner: Spinner, node: Node) -> None:
        self.active: list[str] = []
        self._spinner, self._node = spinner, node
        self._clients: dict[str, LifecycleClient] = {}

    def client(self, name: str) -> LifecycleClient:
        if name not in self._clients:
            self._clients[name] = LifecycleClient(self._spinner, self._node, name, 15.0)
        return self._clients[name]

    def change_state(self, name: str, transition: int) -> bool:
        done = self.client(name).change_state(transition)
        if done and transition == Transition.TRANSITION_ACTIVATE:
            self.active.append(name)
        return done


class _Supervisor:
    """Starts the nodes of a run, changes their states, monitors them and ends them."""

    def __init__(
        self,
        spinner: Spinner,
        scenario: Scenario,
        namespace: str,
        user_controller: Sequence[str] | None,
        on_simulated_time: OnSimulatedTime,
        notify: Notify,
    ) -> None:
        self._scenario = scenario
        self._namespace = namespace
        self._user_controller = user_controller
        self._notify = notify
        self._notified: set[str] = set()
        self._controller: str | None = None
        self._node = Node("bringup", namespace=namespace)
        self._spinner = spinner
        self._spinner.add(self._node)
        self._stop, self._hurry = Future(), Future()
        self._failure: str | None = None
        stop_on_signals(self._spinner.executor, self._stop, self._hurry)
        self._spinner.is_cut_short = self._is_ended
        self._search = ControllerSearch(
            self._node, namespace, ("analyzer", "plant"), force_topics(scenario.plant.force_type)
        )
        self._processes = ChildProcesses()
        self._nodes = _ManagedNodes(self._spinner, self._node)
        self._monitor = RunMonitor(
            self._node, fail=self._fail, notify=notify, on_simulated_time=on_simulated_time
        )
        self._node.create_timer(_WATCH_PERIOD, self._watch_processes, clock=self._spinner.clock)

    def run(self, bag: Path, composed: bool) -> RunOutcome:
        parameters = node_parameters(self._scenario, bag)
        nodes = list(parameters)
        # The analyzer subscribes when it becomes active; its writers check that it is matched.
        for node in nodes[1:]:
            parameters[node]["wait_for"] = [other for other in nodes if other != node]
        ours = self._scenario.controller.node
        if ours in nodes:
            self._controller = full_name(self._namespace, ours)
        if self._user_controller is not None:
            nodes.remove(ours)
        try:
            # It is removed once the nodes have read it: a killed run could not remove it later.
            with tempfile.TemporaryDirectory(prefix="stickslip_ros_") as directory:
                file = Path(directory, "parameters.yaml")
                file.write_text(parameter_file(parameters), encoding="utf-8")
                if composed:
                    from stickslip_ros.nodes.running.composition import (
                        add_nodes,  # loads what they need
                    )

                    chosen = {name: parameters[name] for name in nodes}
                    add_nodes(self._spinner, chosen, self._namespace)
                else:
                    self._spawn(nodes, file)
                if self._user_controller:
                    self._start_user_controller(self._user_controller, file)
                # A client that exists before the node appears is discovered along with the rest of
                # this process; one that is created later may take a second or two.
                for node in nodes:
                    self._nodes.client(node)
                self._bring_up(nodes)
            self._spinner.spin_until(lambda: self._monitor.finished, period=0.03)
        finally:
            self._bring_down()
        if self._failure is not None:
            raise (RunError if "analyzer" in self._nodes.active else NothingRecordedError)(
                self._failure
            )
        failure = self._monitor.recording_failure
        return RunOutcome(self._stop.done(), self._monitor.plant, self._controller, failure)

    def _is_ended(self) -> bool:
        return self._stop.done() or self._failure is not None

    def _spawn(self, nodes: Iterable[str], file: Path) -> None:
        signal.signal(signal.SIGTSTP, self._suspend)
        arguments = [*ROS_ARGUMENTS, "--params-file", str(file), "-r", f"__ns:={self._namespace}"]
        controller = self._scenario.controller
        for name in nodes:
            command = [sys.executable, "-m", f"stickslip_ros.nodes.{name}", *arguments]
            if name == controller.node:
                law = ["-p", f"law:={controller.law}"]
                command[2:] = ["stickslip_ros.nodes.controller", *arguments, *law]
            self._processes.start(name, command)

    def _suspend(self, *_: object) -> None:
        """Stop this process on Ctrl-Z; the signal does not reach the nodes."""
        self._notify("suspended: the nodes continue, but are not monitored; fg resumes the run")
        signal.raise_signal(signal.SIGSTOP)

    def _start_user_controller(self, command: Sequence[str], file: Path) -> None:
        executable, *further = command
        in_namespace = ["--ros-args", "-r", f"__ns:={self._namespace}"]
        # The scenario may contain parameters of its own; overrides are in the other file. The
        # user's arguments come last, so they take precedence.
        files = ["--params-file", str(self._scenario.path), "--params-file", str(file)]
        interpreter = [] if os.access(executable, os.X_OK) else [sys.executable]
        command = [*interpreter, executable, *in_namespace, *files, "--", *further]
        self._processes.start(executable, command, guarded=True)

    def _bring_up(self, nodes: Collection[str]) -> None:
        self._configure(nodes)
        if self._user_controller is not None:
            self._connect_user_controller(self._user_controller)
        for node in nodes:
            if node == "plant" and self._user_controller is not None:
                self._await_controller(active=True)
                # It has to match our readers, too, and our side is not notified of that.
                self._spinner.spin_for(0.3)
            self._take_through(node, Transition.TRANSITION_ACTIVATE)

    def _configure(self, nodes: Iterable[str]) -> None:
        """Configure all nodes at the same time."""
        clients = [self._nodes.client(node) for node in nodes]
        for client in clients:
            client.start_change(Transition.TRANSITION_CONFIGURE)
        self._spinner.spin_until(
            lambda: not [client for client in clients if not client.change_ended()], _ANSWER_TIMEOUT
        )
        for client in clients:
            self._take_through(client.name, Transition.TRANSITION_CONFIGURE)

    def _take_through(self, node: str, transition: int) -> None:
        """Take a node through a transition; repeat the request while it waits for other nodes."""
        name, values = full_name(self._namespace, node), self._monitor.values
        configures, ready = transition == Transition.TRANSITION_CONFIGURE, False

        def is_settled() -> bool:
            nonlocal ready
            ready = self._nodes.change_state(node, transition)
            refused = REFUSAL in values.get(name, {})
            return ready or refused or (configures and self._is_named_twice(name))

        self._spinner.spin_until(
            is_settled,
            _READY_TIMEOUT,
            # Only an activation waits for others; a node logs each request that it must refuse.
            period=0.5 if configures else 0.02,
        )
        told = values.get(name, {})
        if REFUSAL in told:
            self._fail(f"{node} could not start: {told[REFUSAL]}")
        elif not ready and not self._is_ended():
            why = f"did not become ready within {_READY_TIMEOUT:g} s"
            why += f" ({told[WAITING]})" if WAITING in told else ""
            if self._is_named_twice(name):
                why = "could not start: another node has its name, and answers in its place"
            self._fail(f"{node} {why}")

    def _is_named_twice(self, name: str) -> bool:
        nodes = self._node.get_node_names_and_namespaces()
        return [full_name(namespace, node) for node, namespace in nodes].count(name) > 1

    def _connect_user_controller(self, command: Sequence[str]) -> None:
        """Wait for the user's controller; our nodes are activated once connected to it.

        Nothing is recorded yet: the wait may take long, and Ctrl-C ends it.
        """
        if not command:
            self._notify(f"waiting for a controller: a node that {self._search.task}")
        controller = self._await_controller(active=False)
        if controller is None:
            return
        if command:
            self._processes.rename(command[0], controller)
        name = controller.rpartition("/")[2]
        for node, others in (("analyzer", [name]), ("plant", ["analyzer", name])):
            self._spinner.spin_until(setting_call(self._node, node, {"wait_for": others}).pursue)
        nodes = self._node.get_node_names_and_namespaces()
        for section in self._scenario.other_sections:
            if not any(section_matches(section, full_name(ns, name)) for name, ns in nodes):
                self._notify(f"{self._scenario.path}: section {section} matches no node")

    def _await_controller(self, *, active: bool) -> str | None:
        """Wait for the controller, or for it to be active; return None if the run ends first.

        Problems that persist are reported to the user. A controller that this run started must be
        ready in time.
        """
        started = time.monotonic()
        problem_since: dict[str, float] = {}
        while not self._is_ended():
            self._controller, problems = self._look_for_controller(active)
            if self._controller is not None:
                return self._controller
            now = time.monotonic()
            problem_since = {what: problem_since.get(what, now) for what in problems}
            for what, since in problem_since.items():
                if now - since > _DISCOVERY_TIME and what not in self._notified:
                    self._notified.add(what)
                    self._notify(what)
            if self._user_controller and now - started > _READY_TIMEOUT:
                why = "; ".join([f"there is no active node that {self._search.task}", *problems])
                self._fail(
                    f"{self._user_controller[0]} was not ready within {_READY_TIMEOUT:g} s: {why}"
                )
            self._spinner.spin_for(_WATCH_PERIOD)
        return None

    def _look_for_controller(self, active: bool) -> tuple[str | None, list[str]]:
        """Return the controller and one sentence for each problem.

        A managed controller that this run started takes one step towards its active state.
        """
        controllers, managed = self._search.controllers(), self._search.managed()
        # Before it is configured, it may have no topics: only its namespace identifies it.
        namespace = self._namespace.rstrip("/")
        candidates = [node for node in managed if node.rpartition("/")[0] == namespace]
        problems = list(self._search.near_misses())
        for node in dict.fromkeys([*controllers, *candidates]):
            if node in controllers and not (active and node in managed):
                return node, []
            state = self._nodes.client(node).state()
            if state == ACTIVE:
                if node in controllers:
                    return node, []
                continue
            problems.append(f"the managed node {node} is {state or 'silent'}")
            if self._user_controller and state in NEXT_TRANSITION:
                self._nodes.change_state(node, NEXT_TRANSITION[state])
        return None, problems

    def _bring_down(self) -> None:
        """Deactivate the active nodes, the analyzer last, and end the processes.

        After a second signal, no answer is waited for.
        """
        self._monitor.ending = True
        self._spinner.is_cut_short = self._hurry.done
        for node in reversed(self._nodes.active):
            if node == "analyzer":
                self._let_the_analyzer_catch_up()
            finished = node == "plant" and self._monitor.finished
            if not finished and not self._is_dead(node):
                self._deactivate(node)
            if node == "plant" and not self._is_dead(node):
                self._spinner.spin_until(lambda: self._monitor.plant_stopped, timeout=2.0)
            if node == "analyzer" and not self._is_dead(node):
                self._spinner.spin_until(lambda: self._monitor.recording_ended, timeout=2.0)
        for name in self._processes.end():
            self._notify(f"the node {name} did not end within {EXIT_TIMEOUT:g} s: killed")

    def _let_the_analyzer_catch_up(self) -> None:
        """Wait until the analyzer has the plant's last sample; fail if it makes no progress."""
        while self._monitor.unrecorded > 0.0 and not self._is_dead("analyzer"):
            before = self._monitor.unrecorded
            goes_on = self._spinner.spin_until(
                lambda b=before: self._monitor.unrecorded < b or self._is_dead("analyzer"),
                timeout=10.0,
            )
            if not goes_on:
                if not self._hurry.done():
                    self._fail(f"the analyzer did not receive the last {before:g} s of samples")
                return

    def _deactivate(self, node: str) -> None:
        """Deactivate a node if it is active; a user's may not answer an invalid request."""
        state = self._nodes.client(node).state()
        if state == ACTIVE:
            self._nodes.change_state(node, Transition.TRANSITION_DEACTIVATE)
        elif not state and not self._hurry.done():
            self._notify(f"the node {node} does not answer")

    def _is_dead(self, node: str) -> bool:
        return node in self._processes.ended()

    def _watch_processes(self) -> None:
        for name, status in self._processes.ended().items():
            if name == "plant" and status == 0 and self._monitor.plant_stopped:
                self._monitor.finished = True  # it was ended in order from outside
            else:
                self._fail(f"the node {name} died ({how_it_ended(status)})")

    def _fail(self, why: str) -> None:
        if self._failure is None:
            self._failure = why
