"""Missed deadlines are counted correctly, by a clock of the test on which sending takes time."""

from threading import Event, Lock

import pytest

from stickslip_ros.nodes import pacing
from stickslip_ros.nodes.pacing import RealtimePacer
from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.motion.motion import Motion
from stickslip_ros.samples import Sample
from stickslip_ros.scenarios.parameters import PlantParameters
from tests.nodes.graph import PATIENCE

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
