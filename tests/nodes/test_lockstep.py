"""Lockstep with an analyzer that is killed, and with a controller that is silent for some time."""

import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from stickslip_ros.nodes.base.managed import WARN
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.codec import pack_wrench, unpack_header
from stickslip_ros.record.topics import CONTROL_FORCE
from tests.nodes.graph import Graph
from tests.nodes.processes import Processes
from tests.nodes.samples import Samples

PERIOD = 10_000_000
FIRST = 1_000_000_000
NO_FORCE = "no control force"
SILENT_RECORDER = "the recorder has gone or is silent"


class Watch(Samples):
    """Further what the observer hears of a plant and its controller: forces, health, logs."""

    def __init__(self, graph: Graph, standard_error: Callable[[], str]) -> None:
        super().__init__(graph)
        self.forces: list[int] = []
        self._health = graph.health("plant")
        self._standard_error = standard_error
        self._logged = ""
        graph.subscribe(CONTROL_FORCE, lambda message: self.forces.append(unpack_header(message)))

    def further_health(self, count: int) -> list[tuple[bytes, str]]:
        """Wait until the plant has reported on its health again; return levels and messages."""
        reached = len(self._health)
        self._graph.wait_until(lambda: len(self._health) >= reached + count, "the plant reports")
        return [(status.level, status.message) for status in self._health[reached:]]

    def log_lines(self, text: str) -> list[str]:
        """Return the plant's log lines that contain a text."""
        self._logged += self._standard_error()
        return [
            line for line in self._logged.splitlines() if "[test.plant]" in line and text in line
        ]


@pytest.fixture
def watch(graph: Graph, capfd: pytest.CaptureFixture[str]) -> Watch:
    return Watch(graph, lambda: capfd.readouterr().err)


def add_plant(graph: Graph, controller: Any, *readers: str, **parameters: Any) -> Any:
    """Add a plant that is activated when the controller is active and it is matched with all."""
    wait_for = ["washout_controller", "observer", *readers]
    plant = graph.add(PlantNode, autostart=False, wait_for=wait_for, **parameters)
    plant.trigger_configure()
    graph.wait_until(lambda: controller.active, "the controller is active")
    graph.wait_until(lambda: plant.active or (plant.trigger_activate(), plant.active)[1], "matched")
    return plant


def grid(count: int) -> list[int]:
    return [FIRST + number * PERIOD for number in range(count)]


@pytest.mark.long
def test_a_killed_analyzer_holds_the_plant_up_once_until_another_is_back(
    graph: Graph, watch: Watch, processes: Processes
) -> None:
    timeout = 1.5
    analyzer = processes.node("analyzer")
    controller = graph.add(WashoutControllerNode, wait_for=["plant", "observer", "analyzer"])
    plant = add_plant(graph, controller, "analyzer", flow_window=200, reply_timeout=timeout)
    watch.wait_for(500)
    analyzer.kill()
    graph.wait_until(lambda: watch.log_lines(SILENT_RECORDER), "it is given up")
    given_up = len(watch.stamps)
    watch.wait_for(2000)
    # Every window of samples would have taken the timeout.
    assert sum(gap >= timeout for gap in watch.gaps(given_up)) < 5
    for level, message in watch.further_health(2):
        assert level == WARN
        assert SILENT_RECORDER in message
    processes.node("analyzer", wait_for="[plant]")
    graph.wait_until(lambda: watch.log_lines("the recorder is back"), "another one is waited for")
    plant.trigger_deactivate()
    figures = plant.diagnose()[2]
    graph.wait_until(lambda: len(watch.stamps) == figures["samples"], "every sample is heard")
    assert watch.stamps == grid(figures["samples"])
    assert figures["late_forces"] == 0
    assert len(watch.log_lines(SILENT_RECORDER)) == 1
    assert max(watch.gaps()) >= timeout


def test_in_real_time_the_log_tells_that_the_controller_is_lost_and_that_it_is_back(
    graph: Graph, watch: Watch
) -> None:
    controller = graph.add(WashoutControllerNode, wait_for=["observer", "plant"])
    slow = {"pace": "realtime", "rate": 20.0, "force_timeout": 0.3}
    plant = add_plant(graph, controller, **slow)
    watch.wait_for(10)
    graph.deactivate("washout_controller")
    graph.wait_until(lambda: watch.log_lines(NO_FORCE), "the loss is logged")
    watch.further_health(2)
    controller.trigger_activate()
    graph.wait_until(lambda: watch.log_lines("in time again"), "the return is logged")
    plant.trigger_deactivate()
    # A busy machine may have held a force up before, which is told as well.
    assert len(watch.log_lines(NO_FORCE)) == len(watch.log_lines("in time again"))


def test_time_in_which_the_plant_does_not_run_is_not_silence_of_others(
    graph: Graph, watch: Watch, monkeypatch: pytest.MonkeyPatch
) -> None:
    stopped = 0.0
    clock = SimpleNamespace(monotonic=lambda: time.monotonic() + stopped)
    monkeypatch.setattr("stickslip_ros.nodes.pacing.time", clock)
    plant = graph.add(PlantNode, wait_for=["observer"], reply_timeout=1e3)
    force = graph.publisher(CONTROL_FORCE, 1)
    for number, stamp in enumerate(grid(3)):
        graph.wait_until(lambda count=number + 1: len(watch.stamps) == count, "the sample")
        graph.run_for(0.5)
        stopped += 1e4
        graph.run_for(0.5)
        force.publish(pack_wrench(stamp, 0.25))
    graph.wait_until(lambda: len(watch.stamps) == 4, "the last sample")
    figures = plant.diagnose()[2]
    assert (figures["late_forces"], figures["dropped_messages"]) == (0, 0)
    assert not watch.log_lines(NO_FORCE)


def test_a_controller_that_falls_silent_is_waited_for_once_and_taken_back(
    graph: Graph, watch: Watch
) -> None:
    timeout = 1.0
    controller = graph.add(WashoutControllerNode, wait_for=["observer", "plant"])
    plant = add_plant(graph, controller, reply_timeout=timeout)
    watch.wait_for(100)
    assert plant.diagnose()[2]["late_forces"] == 0

    graph.deactivate("washout_controller")
    graph.wait_until(lambda: watch.log_lines(NO_FORCE), "it is given up")
    given_up = len(watch.stamps)
    watch.wait_for(500)  # in vain, if every one of them took the timeout
    for level, message in watch.further_health(2):
        assert level == WARN
        assert NO_FORCE in message

    controller.trigger_activate()
    graph.wait_until(
        lambda: watch.forces[-1:] > watch.stamps[given_up : given_up + 1], "forces come again"
    )
    watch.wait_for(10)
    late = plant.diagnose()[2]["late_forces"]
    watch.wait_for(300)
    plant.trigger_deactivate()
    _, message, figures = plant.diagnose()
    assert figures["late_forces"] == late > 500
    graph.wait_until(lambda: len(watch.stamps) == figures["samples"], "every sample is heard")
    graph.wait_until(lambda: watch.forces[-1:] == watch.stamps[-1:], "the last one is answered")
    assert watch.stamps == grid(figures["samples"])
    unanswered = set(watch.stamps) - set(watch.forces)
    too_late = figures.get("dropped: answers a sample that has passed", 0)
    assert late == len(unanswered) + too_late
    assert NO_FORCE not in message
    assert len(watch.log_lines(NO_FORCE)) == 1
    assert max(watch.gaps()) >= timeout
