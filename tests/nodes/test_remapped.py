"""Remapped topics: the nodes find each other and wait for each other as usual."""

from contextlib import closing
from pathlib import Path

from stickslip_ros.record.reader import Recording
from tests.nodes.graph import Graph
from tests.nodes.runs import close_the_loop

REMAPPED = ("-r", "joint_states:=/x/y", "-r", "control_force:=/force", "-r", "recorded:=/held")


def test_the_loop_is_closed_and_recorded_under_other_names(domain: int, tmp_path: Path) -> None:
    with closing(Graph(domain, *REMAPPED)) as graph:
        close_the_loop(graph, tmp_path / "bag", flow_window=200, duration=10.0)
    with Recording(tmp_path / "bag") as recording:
        names = [name for name, _, _ in recording.messages("/x/y", "/force")]
        assert recording.complete
    assert (names.count("/x/y"), names.count("/force")) == (1001, 1001)
