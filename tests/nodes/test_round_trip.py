"""Run, record, report, replay into a second analyzer, record again; also under other names."""

import json
from contextlib import closing
from pathlib import Path

import pytest

from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.replay import ReplayNode
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.report import report_of_recording
from tests.nodes.graph import Graph
from tests.nodes.runs import close_the_loop, messages_of, record_run

REFERENCE = Path(__file__).parents[2] / "bags" / "reference"


def test_what_is_replayed_and_recorded_again_is_the_same(graph: Graph, tmp_path: Path) -> None:
    """With sensor, actuator, disturbance and the truth."""
    first, second = tmp_path / "first", tmp_path / "second"
    step = {"disturbance.kind": "step", "disturbance.amplitude": 0.1, "disturbance.start": 20.0}
    encoder = {"sensor.position_resolution": 1e-4, "sensor.velocity": "difference"}
    truth = {"actuator.time_constant": 0.05, "publish_truth": True}
    record_run(first, belt_speed=0.45, duration=30.0, **step, **encoder, **truth)

    # The nodes that are replayed tell no parameters: the noise is found from the samples. Nor do
    # they tell their timing.
    graph.add(AnalyzerNode, bag=str(second))
    replay = graph.add(ReplayNode, bag=str(first), rate=1e6, wait_for=["analyzer"])
    graph.wait_until(lambda: replay.diagnose()[2] and not replay.active, "the bag is replayed")
    graph.deactivate("analyzer")

    messages = messages_of(first)
    for topic in ("joint_states", "control_force", "true_joint_states", "applied_force"):
        assert len(messages[f"/test/{topic}"]) == 3001
    assert messages["/test/true_joint_states"] != messages["/test/joint_states"]
    assert len(messages["/test/applied_disturbance"]) > 0
    assert messages_of(second) == messages
    told = {"late_forces": 0, "missed_deadlines": 0, "in_time": True}
    assert report_of_recording(first) == report_of_recording(second) | told


def test_the_reference_bag_is_reported_as_ever() -> None:
    report = report_of_recording(REFERENCE)
    expected = json.loads(REFERENCE.with_suffix(".json").read_text())
    assert expected.pop("bag") == "bags/reference"
    del expected["versions"]
    assert report.keys() == expected.keys()
    assert report["drift"] == pytest.approx(expected.pop("drift"), rel=1e-6)
    errors = expected.pop("errors")
    # Rounding of the cycles may differ: it is a part of their scatter.
    assert report["errors"] == pytest.approx(errors, rel=1e-6, abs=1e-15)
    for name, value in expected.items():
        exact = not isinstance(value, float)
        assert report[name] == (value if exact else pytest.approx(value, rel=1e-12, abs=0.0)), name


REMAPPED = ("-r", "joint_states:=/x/y", "-r", "control_force:=/force", "-r", "recorded:=/held")


def test_the_loop_is_closed_and_recorded_under_other_names(domain: int, tmp_path: Path) -> None:
    with closing(Graph(domain, *REMAPPED)) as graph:
        close_the_loop(graph, tmp_path / "bag", flow_window=200, duration=10.0)
    with Recording(tmp_path / "bag") as recording:
        names = [name for name, _, _ in recording.messages("/x/y", "/force")]
        assert recording.complete
    assert (names.count("/x/y"), names.count("/force")) == (1001, 1001)
