"""An analyzer that falls behind in real time: what it records, and what it tells as lost."""

from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from stickslip_ros.arrays import IntArray
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.managed import STATE
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.record.topics import DEEP, RECORDER_DEPTH
from tests.nodes.graph import Graph, wait_for

RATE = 5000.0


def stamps_of(bag: Path) -> IntArray:
    with Recording(bag) as recording:
        assert recording.complete
        return recording.joint_states.stamp


def counts_of_analyzer(bag: Path) -> tuple[str, str]:
    with Recording(bag) as recording:
        stored = recording.metadata("stickslip_ros/report") or {}
    return stored["samples"], stored["lost_samples"]


@pytest.mark.parametrize(
    "samples", [DEEP, pytest.param(RECORDER_DEPTH + 2 * DEEP, marks=pytest.mark.long)]
)
def test_what_waits_up_to_the_bound_is_recorded_and_beyond_it_is_counted(
    graph: Graph, tmp_path: Path, samples: int
) -> None:
    """Only the plant's own thread runs until it has published all samples."""
    bag = tmp_path / "bag"
    health = graph.health("plant")
    graph.add(AnalyzerNode, bag=str(bag))
    parameters = {"rate": RATE, "expects_control": False, "duration": (samples - 1) / RATE}
    plant = graph.add(PlantNode, pace="realtime", wait_for=["analyzer"], **parameters)
    graph.wait_until(lambda: plant.active, "the plant starts")
    wait_for(lambda: plant.diagnose()[2]["samples"] == samples, "all samples are published")
    graph.wait_until(lambda: is_paused(health), "the plant tells its counts")
    graph.deactivate("analyzer")

    stamps, report = stamps_of(bag), report_of_recording(bag)
    assert report["samples"] == len(stamps)
    assert report["samples"] + report["lost_samples"] == samples
    assert counts_of_analyzer(bag) == (str(report["samples"]), str(report["lost_samples"]))
    # Up to its history the plant keeps what a reader without processor has not taken.
    assert bool(report["lost_samples"]) == (samples > DEEP)


def is_paused(health: list[DiagnosticStatus]) -> bool:
    return bool(health) and {v.key: v.value for v in health[-1].values}[STATE] == "inactive"
