"""Recorded runs for tests that need one."""

from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.codec import pack_joint_state, pack_wrench
from stickslip_ros.record.reader import Recording
from stickslip_ros.testing import own_domain
from tests.nodes.graph import Graph
from tests.record.runs import write_bag

SECOND = 1_000_000_000
STATES = "/test/joint_states"
FORCES = "/test/control_force"


def record_states(
    bag: Path, count: int, step: int = SECOND // 100, **contents: Mapping[str, Any]
) -> str:
    """Write as many joint states and forces, `step` ns apart, from 1 s on; return the path."""
    messages: list[tuple[str, int, bytes]] = []
    for number in range(count):
        stamp = SECOND + number * step
        state = pack_joint_state(stamp, (number, 0.0), (0.1, 0.4), (0.0, 0.0))
        messages += [(STATES, stamp, state), (FORCES, stamp, pack_wrench(stamp, 0.5 * number))]
    write_bag(bag, messages, **contents)
    return str(bag)


def start_loop(graph: Graph, bag: Path, **plant_parameters: object) -> tuple[Any, Any, Any]:
    """Return analyzer, controller and plant, at work."""
    analyzer = graph.add(AnalyzerNode, bag=str(bag))
    controller = graph.add(WashoutControllerNode, wait_for=["analyzer"])
    graph.wait_until(lambda: analyzer.active and controller.active, "both active")
    listeners = ["analyzer", "washout_controller"]
    plant = graph.add_active(PlantNode, wait_for=listeners, **plant_parameters)
    return analyzer, controller, plant


def close_the_loop(graph: Graph, bag: Path, **plant_parameters: object) -> None:
    """Record the closed loop in lockstep until the plant pauses by itself."""
    _, _, plant = start_loop(graph, bag, **plant_parameters)
    graph.wait_until(lambda: not plant.active, "plant pauses")
    for node in ("washout_controller", "analyzer"):
        graph.deactivate(node)


def record_run(bag: Path, **plant_parameters: object) -> None:
    """Record the closed loop in a graph of its own."""
    with own_domain() as domain, closing(Graph(domain)) as graph:
        close_the_loop(graph, bag, **plant_parameters)


def messages_of(bag: Path) -> dict[str, list[tuple[int, bytes]]]:
    """Return log times (ns) and serialized messages of a bag by topic."""
    with Recording(bag) as recording:
        messages: dict[str, list[tuple[int, bytes]]] = {topic: [] for topic in recording.topics}
        for topic, log_time, message in recording.messages(*recording.topics):
            messages[topic].append((log_time, message))
    return messages
