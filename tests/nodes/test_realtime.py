"""Real time when the analyzer or a reader is stopped or falls behind, and when it lasts.

`python -m benchmarks.soak` runs for longer.
"""

import os
import signal
from fractions import Fraction
from itertools import product
from pathlib import Path
from threading import Lock

import pytest

from benchmarks.soak import lines, soak
from stickslip_ros.motion.motion import Motion
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.nodes.analyzer import AnalyzerNode
from stickslip_ros.nodes.pacing import RealtimePacer
from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.record.topics import DEEP, JOINT_STATES
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from tests.nodes.graph import Graph, states_of, wait_for
from tests.nodes.processes import Processes
from tests.nodes.samples import Samples


def test_after_millions_of_samples_the_deadline_is_exact() -> None:
    motion = Motion(PlantParameters().as_drive(), 0.0, 0.0)
    for rate, factor in product((3.0, 1000.0 / 3.0, 1000.0, 44_100.0), (1.0, 0.1, 7.0)):
        loop = SampledLoop(motion, rate, 1_000_000_000)
        pacer = RealtimePacer(loop, lambda _: None, lambda: None, Lock(), factor, lambda _: None)
        first = Fraction(pacer.deadline(0))
        for number in (1, 1_000_003, 3_600_000, 86_400_000):
            exact = number / (Fraction(rate) * Fraction(factor))
            assert abs(Fraction(pacer.deadline(number)) - first - exact) < 1e-6


def processor_time(pid: int) -> float:
    """Return the processor time, s, that a process has taken."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.long
@pytest.mark.parametrize(
    ("end", "reliability"),
    [(signal.SIGSTOP, "RELIABLE"), (signal.SIGSTOP, "BEST_EFFORT"), (signal.SIGKILL, "RELIABLE")],
)
def test_a_reader_that_is_stopped_or_killed_costs_the_plant_nothing(
    graph: Graph, processes: Processes, end: signal.Signals, reliability: str
) -> None:
    """The shared memory of Fast DDS would cost 0.4 ms for each sample, or stand still for 1 s.

    A second plant, to which the reader does not listen, tells what a sample costs meanwhile. On a
    busy machine one comparison may mislead; what a reader costs shows in all of them.
    """
    samples = Samples(graph)
    stranger = processes.stranger(reliability)
    common = {"pace": "realtime", "rate": 500.0, "expects_control": False}
    plant = processes.node("plant", **common, wait_for="[stranger]")
    other = processes.node("plant", **common, namespace="/other")

    def relative_cost(count: int) -> float:
        """Return the plant's processor time in that of the other, for so many samples."""
        began = [processor_time(process.pid) for process in (plant, other)]
        samples.wait_for(count)
        taken = [processor_time(process.pid) for process in (plant, other)]
        return (taken[0] - began[0]) / (taken[1] - began[1])

    samples.wait_for(500)
    usual = max(relative_cost(500) for _ in range(3))
    first = len(samples.stamps)
    stranger.send_signal(end)
    samples.wait_for(1500)  # some effects take seconds to show
    assert any(relative_cost(1000) < 1.6 * usual for _ in range(5))
    assert max(samples.gaps(first)) < 0.9
    assert samples.stamps == [samples.stamps[0] + n * 2_000_000 for n in range(len(samples.stamps))]


RATE = 5000.0


@pytest.mark.parametrize("samples", [DEEP, pytest.param(4 * DEEP, marks=pytest.mark.long)])
def test_what_waits_up_to_the_bound_is_recorded_and_beyond_it_is_counted(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, samples: int
) -> None:
    """Only the plant's own thread runs until it has published all samples."""
    # Fewer samples fill a shorter queue of the recorder, which still takes it in several parts.
    monkeypatch.setattr("stickslip_ros.record.topics.RECORDER_DEPTH", 2 * DEEP)
    bag = tmp_path / "bag"
    health = graph.health("plant")
    graph.add(AnalyzerNode, bag=str(bag))
    parameters = {"rate": RATE, "expects_control": False, "duration": (samples - 1) / RATE}
    plant = graph.add_active(PlantNode, pace="realtime", wait_for=["analyzer"], **parameters)
    wait_for(lambda: plant.diagnose()[2]["samples"] == samples, "all samples are published")
    graph.wait_until(lambda: states_of(health)[-1:] == ["inactive"], "the plant tells its counts")
    graph.deactivate("analyzer")

    with Recording(bag) as recording:
        assert recording.complete
        stored = recording.metadata("stickslip_ros/report")
        recorded = len(recording.joint_states)
    report = report_of_recording(bag)
    assert report["samples"] == recorded
    assert report["samples"] + report["lost_samples"] == samples
    for name in ("samples", "lost_samples"):
        assert stored[name] == str(report[name])
    # Up to its history the plant keeps what a reader without processor has not taken.
    assert bool(report["lost_samples"]) == (samples > DEEP)


SECONDS, WARM_UP = 20.0, 10.0
GROWTH = 2e6
SAMPLE = 2e3
"""Bytes, at most, that a state and its force take which wait for a reader."""


@pytest.mark.long
@pytest.mark.timeout(900)
def test_a_run_in_real_time_lasts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.soak.WARM_UP", WARM_UP)
    outcome = soak(SECONDS, composed=False, burners=1, directory=tmp_path)
    print(*lines(outcome), sep="\n")
    run, missing = outcome.run, outcome.missing_stamps
    assert run["samples"] + missing == 1000 * SECONDS + 1
    assert run["lost_samples"] == missing
    # History ends on a machine that does not let the analyzer run for seconds.
    assert missing == 0 or outcome.largest_backlog >= JOINT_STATES.depth
    assert run["missed_deadlines"] >= outcome.missed_deadlines
    # The first force is zero, and so is none: whether it was late does not show in the motion.
    hidden = 1 + missing + outcome.hidden_steps
    assert 0 <= run["late_forces"] - outcome.late_forces <= hidden
    assert outcome.unexplained_steps == 0
    if outcome.furthest_behind < 500 * (SECONDS - WARM_UP):  # all are warm before the end
        assert set(outcome.memory) == {"main", "plant", "controller", "analyzer"}
    for process, sizes in outcome.memory.items():
        room = GROWTH + SAMPLE * outcome.furthest_behind
        assert max(sizes) - sizes[0] < room, process
