"""Missed deadlines and late forces: counted, told when they are too many, and forecast."""

from pathlib import Path
from threading import Event, Lock

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from stickslip_ros.motion.motion import Motion
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.nodes import pacing
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.base.managed import FORECAST
from stickslip_ros.nodes.pacing import RealtimePacer
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.timing import Forecast, TimingMonitor, forecast
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.samples import Sample
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from tests.nodes.graph import PATIENCE, Graph, states_of

MILLISECOND = 1e-3


class Clock:
    """Stands in for the module `time`: it goes on only while somebody sleeps or sends."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        self.now += duration


@pytest.mark.parametrize(
    ("stalls", "missed", "largest_lateness"),
    [
        ({}, 0, 0.0),
        ({5: 0.9}, 0, 0.9),
        ({5: 1.1}, 1, 1.1),
        # Samples 5 to 14 come by 10.5 ms, 9.5 ms, ... 1.5 ms late; sample 15 by half a period.
        ({5: 10.5}, 10, 10.5),
        ({5: 2.7, 6: 2.7}, 5, 4.4),
        ({5: 2.7, 90: 2.7}, 4, 2.7),
    ],
)
def test_a_deadline_is_missed_when_the_next_one_has_passed(
    monkeypatch: pytest.MonkeyPatch, stalls: dict[int, float], missed: int, largest_lateness: float
) -> None:
    clock = Clock()
    monkeypatch.setattr(pacing, "time", clock)
    ended = Event()

    def publish(sample: Sample) -> None:
        clock.now += stalls.get(loop.sample_number, 0.0) * MILLISECOND

    motion = Motion(PlantParameters().as_drive(), 0.0, 0.0)
    loop = SampledLoop(motion, 1000.0, 1_000_000_000)
    pacer = RealtimePacer(loop, publish, lambda: None, Lock(), 1.0, lambda _: ended.set())
    pacer.start(100)
    assert ended.wait(PATIENCE)
    pacer.stop()
    assert loop.sample_number == 100
    assert pacer.missed_deadlines == missed
    assert pacer.largest_lateness == pytest.approx(largest_lateness * MILLISECOND, abs=1e-9)


@pytest.mark.parametrize(
    ("late", "missed", "words"),
    [
        (0, 0, ""),
        (9, 10, ""),
        (410, 0, "41 % of the latest forces came late"),
        (0, 280, "28 % of the latest samples missed their deadlines"),
        (1000, 0, "100 % of the latest forces came late"),
        (410, 280, "41 % of the latest forces came late or not at all and 28 %"),
    ],
)
def test_more_than_a_hundredth_is_a_complaint(late: int, missed: int, words: str) -> None:
    complaint = TimingMonitor().check(1000, late, missed, controlled=True)
    assert complaint.startswith(words)
    assert bool(complaint) == bool(words) == ("lower rate or real_time_factor" in complaint)


def test_only_the_latest_checks_count_and_none_without_a_controller() -> None:
    timing = TimingMonitor()
    assert timing.check(1000, 100, 0, controlled=True)
    assert [timing.check(1000 * n, 100, 0, controlled=True) for n in range(2, 13)][-1] == ""
    timing = TimingMonitor()
    assert timing.check(1000, 1000, 0, controlled=False) == ""
    assert timing.check(2000, 1005, 0, controlled=True) == ""
    assert timing.check(3000, 1500, 0, controlled=True) != ""


def test_a_plant_whose_controller_answers_every_third_sample_warns_and_so_does_the_bag(
    graph: Graph, often_diagnosed: None, tmp_path: Path
) -> None:
    health = graph.health("plant")
    graph.add(AnalyzerNode, bag=str(tmp_path / "bag"))
    graph.answer_every_third_sample()
    plant = graph.add(PlantNode, pace="realtime", rate=500.0, wait_for=["observer", "analyzer"])
    graph.wait_until(
        lambda: any(
            status.level == DiagnosticStatus.WARN and "forces came late" in status.message
            for status in health
        ),
        "a warning",
    )
    plant.trigger_deactivate()
    graph.wait_until(lambda: states_of(health)[-1:] == ["inactive"], "the plant tells its counts")
    graph.deactivate("analyzer")
    counts, report = plant.diagnose()[2], report_of_recording(tmp_path / "bag")
    assert counts["late_forces"] > 0.6 * counts["samples"]
    assert report["samples"] == counts["samples"]
    assert report["late_forces"] == counts["late_forces"]
    assert report["missed_deadlines"] == counts["missed_deadlines"]
    assert report["in_time"] is False
    share = 100.0 * counts["late_forces"] / counts["samples"]
    two_digits = float(f"{share:.2g}")
    assert report["notes"][0].startswith(f"the regime is doubtful: {two_digits:g} % of the forces")


@pytest.mark.parametrize(
    ("waits", "rate", "sentence"),
    [
        ([0.5e-3] * 1000, 1000.0, "1 kHz: about 0 % of the forces will be late"),
        ([0.5e-3] * 995 + [1.0] * 5, 1000.0, "1 kHz: about 0.5 % of the forces will be late"),
        (
            [0.5e-3] * 800 + [2.1e-3] * 195 + [1.0] * 5,
            1000.0,
            "1 kHz: about 20 % of the forces will be late; 400 Hz would do",
        ),
        ([3.0] * 10, 50.0, "50 Hz: about 100 % of the forces will be late; 300 mHz would do"),
    ],
)
def test_the_rate_that_would_do_is_that_at_which_few_forces_would_be_late(
    waits: list[float], rate: float, sentence: str
) -> None:
    assert forecast(waits, rate) == sentence


def test_a_force_ends_the_wait_of_the_samples_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every third sample is answered, half a period after it; the first second is left out."""
    now = 0.0
    monkeypatch.setattr("stickslip_ros.nodes.timing.time.monotonic", lambda: now)
    expected = forecast([0.025, 0.015, 0.005] * 67, 100.0)
    observed = Forecast(100.0, lambda number: number / 100.0)
    for number in range(0, 303, 3):
        now = (number + 0.5) / 100.0
        assert observed.sentence == ""
        observed.answered(number)
    assert observed.sentence == expected
    assert expected == "100 Hz: about 67 % of the forces will be late; 40 Hz would do"


def test_a_plant_forecasts_a_long_run_and_not_a_short_one(graph: Graph) -> None:
    graph.answer_every_third_sample()
    plant = graph.add(PlantNode, pace="realtime", rate=200.0, wait_for=["observer"], duration=60.5)
    graph.wait_until(lambda: FORECAST in plant.diagnose()[2], "a forecast")
    sentence = plant.diagnose()[2][FORECAST]
    assert sentence.startswith("200 Hz: about ")
    assert float(sentence.split()[3]) > 60.0
    assert sentence.endswith("Hz would do")
