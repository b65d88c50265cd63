"""Generated parts of the pages are those of today: docs/generate.py would change nothing."""

import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest
from diagnostic_msgs.msg import DiagnosticArray

from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.topics import DIAGNOSTICS
from tests.nodes.conftest import domain, graph  # noqa: F401 - fixtures used here
from tests.nodes.graph import Graph

DOCS = Path(__file__).parents[2] / "docs"
EVERY_NODE = ("plant", "washout_controller", "analyzer")
# Of the table, those that a run in which nothing goes wrong has none of.
RARE = {"dropped: …", "failure", "refusal", "waiting", "bag", "forecast"}


@pytest.fixture
def generate(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(DOCS)
    yield import_module("generate")
    del sys.modules["generate"]


def test_the_pages_are_as_they_would_be_made_today(generate: ModuleType) -> None:
    generated = {p.name for p in DOCS.glob("*.md") if "<!-- generated: " in p.read_text("utf-8")}
    assert generated == set(generate.PAGES)
    for page in generate.PAGES:
        text = (DOCS / page).read_text(encoding="utf-8")
        assert generate.filled(text) == text


def test_the_table_of_diagnostics_has_what_the_nodes_say(graph: Graph) -> None:  # noqa: F811
    heard: list[DiagnosticArray] = graph.listen(DIAGNOSTICS)
    for node in (AnalyzerNode, WashoutControllerNode, PlantNode):
        graph.add(node)

    def said() -> dict[str, set[str]]:
        """The keys of the newest status of each node that is at work."""
        newest = {status.name: status.values for array in heard for status in array.status}
        keys = {name.rpartition("/")[2]: {v.key for v in values} for name, values in newest.items()}
        return {name: found for name, found in keys.items() if found > {"state"}}

    graph.wait_until(lambda: said().keys() >= set(EVERY_NODE), "diagnostics of every node at work")
    documented = documented_keys()
    for node in EVERY_NODE:
        assert said()[node] - RARE == documented[node] - RARE


def documented_keys() -> dict[str, set[str]]:
    """The keys by node in the table of topics.md."""
    page = (DOCS / "topics.md").read_text(encoding="utf-8")
    found: dict[str, set[str]] = {node: set() for node in (*EVERY_NODE, "replay")}
    rows = page.split("| node | key | |")[1].split("\n\n")[0].splitlines()[2:]
    for row in rows:
        nodes, keys, *_ = (cell.strip() for cell in row.strip("|").split(" | "))
        nodes = nodes.replace("NAME_controller", "washout_controller")
        for node in found if nodes == "all" else nodes.split(", "):
            found[node] |= set(re.findall(r"`(.*?)`", keys))
    return found
