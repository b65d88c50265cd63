"""The SROS2 policy against the topics and services that the nodes of a run use."""

import signal
import subprocess
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

import pytest
from rclpy.node import NodeNameNonExistentError

from tests.nodes.graph import Graph
from tests.nodes.processes import Processes

POLICY = Path(__file__).parents[2] / "config" / "sros2_policy.xml"
NAMESPACE = "/feed_drive"
NODES = ("plant", "washout_controller", "analyzer", "bringup")
RULES = ("publish", "subscribe", "reply", "request")

Uses = dict[str, dict[str, set[str]]]
"""Full names of topics and services by node and rule."""


def allowed() -> Uses:
    """Return what the policy allows each node."""
    uses: Uses = {}
    for profile in ElementTree.parse(POLICY).iter("profile"):
        node = profile.attrib["node"]
        assert profile.attrib["ns"] == NAMESPACE
        assert node not in uses
        uses[node] = {rule: set() for rule in RULES}
        for rules in profile:
            (rule,) = rules.attrib
            assert rules.attrib[rule] == "ALLOW"
            names = {full_name(expression.text or "", node) for expression in rules}
            assert len(names) == len(rules)
            uses[node][rule] |= names
    return uses


def full_name(name: str, node: str) -> str:
    if name.startswith("/"):
        return name
    return f"{NAMESPACE}/{name.replace('~', node, 1)}"


def look(graph: Graph, seen: Uses) -> None:
    """Add what the nodes there use at present."""
    observer = graph.observer
    ask = {
        "publish": observer.get_publisher_names_and_types_by_node,
        "subscribe": observer.get_subscriber_names_and_types_by_node,
        "reply": observer.get_service_names_and_types_by_node,
        "request": observer.get_client_names_and_types_by_node,
    }
    for node in NODES:
        for rule, names_of in ask.items():
            with suppress(NodeNameNonExistentError):
                seen[node][rule] |= {name for name, _ in names_of(node, NAMESPACE)}


@pytest.fixture(params=[pytest.param([], marks=pytest.mark.long), pytest.param(["--composed"])])
def run(
    request: pytest.FixtureRequest, processes: Processes, tmp_path: Path
) -> subprocess.Popen[bytes]:
    command = ["-m", "stickslip_ros.app.main", "run", "paper", "--pace", "realtime"]
    truth = ["-p", "plant.publish_truth=true"]
    return processes.start([*command, *truth, *request.param], cwd=tmp_path)


@pytest.mark.process
def test_each_node_is_allowed_what_it_uses_and_no_more(
    graph: Graph, run: subprocess.Popen[bytes]
) -> None:
    permitted = allowed()
    seen: Uses = {node: {rule: set() for rule in RULES} for node in NODES}
    # The clients of bringup live only as long as a question.
    lasting = [(n, r) for n in NODES for r in RULES if (n, r) != ("bringup", "request")]

    def is_all_seen() -> bool:
        assert run.poll() is None
        look(graph, seen)
        return all(permitted[node][rule] <= seen[node][rule] for node, rule in lasting)

    graph.wait_until(is_all_seen, "all that is allowed is used")
    run.send_signal(signal.SIGINT)

    def is_over() -> bool:
        look(graph, seen)  # bringup asks for states at the end
        return run.poll() is not None

    graph.wait_until(is_over, "the run ends")
    surplus = {(n, r): seen[n][r] - permitted[n][r] for n in NODES for r in RULES}
    assert not any(surplus.values()), surplus
