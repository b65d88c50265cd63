"""How well are deadlines met at 1 kHz?

Ours: the scenario `feed_drive` with plant, controller and analyzer, which records a bag, on one
EventsExecutor as in `stickslip run --composed`, or as three processes. The deadline of sample n is
n periods after sample 0. Lateness is the time just before the sample is published, minus its
deadline; it is not accumulated. A deadline is missed if the lateness exceeds one period. The force
used for a step has the age 0 if it answers the sample at the start of the step.

Peers: a loop that only sleeps until each deadline is the limit of Python on this machine. A timer
node is the common solution: `create_timer`, a JointState built and published in its callback, on a
SingleThreadedExecutor; its sample n is its n-th call.

All run in turns, one slice at a time, while the others are idle. The values are over all slices.
"""

import os
import time
from array import array
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState

from benchmarks.lateness import SLEEP_LOOP, lateness, lateness_rows, sleep_loop, times_of
from benchmarks.parties import ObservedPlant, Slice, closed_loop, party, results_by_turns, ros
from benchmarks.slices import Row, compare_times, show
from stickslip_ros.record.codec import unpack_header
from stickslip_ros.samples import Sample

RATE = 1000.0
PERIOD = 1.0 / RATE
ROUNDS = 6
SAMPLES = 10_000
FIRST_SAMPLES = 500
HANDFUL = 5
P99_AIM = 1.0 / 1.2
TIMER = "timer node"


@dataclass(frozen=True)
class Timings:
    """The results of a slice."""

    times: "array[float]"
    """Time just before each sample was published, s."""
    plant_time: float
    """Processor time of the process that publishes, s."""
    whole_time: float
    """Processor time of all processes, s."""
    ages: "array[int] | None" = None
    """Age in periods of the force used for each step."""

    @property
    def lateness(self) -> NDArray[np.float64]:
        """Lateness of each sample but the first, s."""
        return lateness(self.times, PERIOD)


class TimedPlant(ObservedPlant):
    """Stores when it publishes each sample, and which forces it has received by then."""

    def start(self) -> None:
        samples = self.parameters.last_sample or 0
        self.times = times_of(samples + 1)
        self.ages = array("l", bytes(8 * (samples + 1)))
        self._answered = -1
        super().start()

    def _publish(self, sample: Sample) -> None:
        number = self._loop.sample_number
        self.times[number] = time.monotonic()
        self.ages[number] = number - 1 - self._answered
        super()._publish(sample)

    def _on_force(self, unpack: Callable[[bytes], tuple[int, float]], message: bytes) -> None:
        super()._on_force(unpack, message)
        self._answered = max(self._answered, self._loop.stamps.number(unpack_header(message)))


@contextmanager
def ours(composed: bool) -> Generator[Slice[Timings]]:
    with closed_loop(TimedPlant, "feed_drive", composed=composed) as loop:

        def run(samples: int) -> Timings:
            others = [process.pid for process in loop.processes]
            own, whole = time.process_time(), sum(map(processor_time, others))
            loop.run(samples)
            own = time.process_time() - own
            whole = own + sum(map(processor_time, others)) - whole
            return Timings(loop.plant.times, own, whole, loop.plant.ages[1:])

        yield run


def processor_time(process: int) -> float:
    """Return the processor time that a process has used so far, s."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def bare_loop() -> Generator[Slice[Timings]]:
    def run(samples: int) -> Timings:
        used = time.process_time()
        times = sleep_loop(samples + 1, PERIOD)
        used = time.process_time() - used
        return Timings(times, used, used)

    yield run


class TimerNode(Node):
    """The common way to publish at a rate."""

    def __init__(self) -> None:
        super().__init__("timer_node")
        self._writer = self.create_publisher(JointState, "joint_states", 10)

    def begin(self, samples: int) -> None:
        self.times = times_of(samples + 1)
        self.done = Future()
        self._number = 0
        self._ticks = self.create_timer(PERIOD, self._on_tick)

    def _on_tick(self) -> None:
        message = JointState()
        message.header.stamp = self.get_clock().now().to_msg()
        message.name = ["slide", "belt"]
        message.position = [0.1, 0.2]
        message.velocity = [0.3, 0.4]
        message.effort = [0.5, -0.5]
        self.times[self._number] = time.monotonic()
        self._writer.publish(message)
        self._number += 1
        if self._number == len(self.times):
            self.destroy_timer(self._ticks)
            self.done.set_result(None)


@contextmanager
def timer_node() -> Generator[Slice[Timings]]:
    with ros():
        node = TimerNode()
        executor = SingleThreadedExecutor()
        executor.add_node(node)

        def run(samples: int) -> Timings:
            used = time.process_time()
            node.begin(samples)
            executor.spin_until_future_complete(node.done)
            used = time.process_time() - used
            return Timings(node.times, used, used)

        yield run


def deadline_rows(
    name: str, ours: Sequence[Timings], against: str, peer: Sequence[Timings], *, goals: bool
) -> list[Row]:
    late, peer_late = (np.concatenate([t.lateness for t in timings]) for timings in (ours, peer))
    missed, peer_missed = (float(np.sum(each > PERIOD)) for each in (late, peer_late))
    what = f"{name}, missed of {len(late)} (ratio: to peer + {HANDFUL})"
    ratio = (peer_missed + HANDFUL) / max(missed, 1.0)
    return [
        *lateness_rows(name, late, against, peer_late, p99_aim=P99_AIM if goals else None),
        Row(what, "", missed, against, peer_missed, ratio, aim=1.0 if goals else None),
    ]


def force_rows(name: str, ours: Sequence[Timings]) -> list[Row]:
    ages = np.concatenate([timings.ages for timings in ours if timings.ages])
    return [
        Row(f"{name}, steps with their own force", "1", float(np.mean(ages == 0))),
        Row(f"{name}, age of force p99", "periods", float(np.quantile(ages, 0.99))),
        Row(f"{name}, age of force max", "periods", float(np.max(ages))),
    ]


def load_rows(name: str, ours: Sequence[Timings], peer: Sequence[Timings]) -> list[Row]:
    def per_sample(timings: Sequence[Timings], which: str) -> list[float]:
        return [getattr(t, which) / len(t.lateness) for t in timings]

    peers = per_sample(peer, "plant_time")
    rows = [
        compare_times(
            f"{name}, processor per sample, {what}", per_sample(ours, which), TIMER, peers
        )
        for what, which in (("plant", "plant_time"), ("all nodes", "whole_time"))
    ]
    return rows[1:] if name == "composed" else rows


def measure() -> list[Row]:
    parties = {
        "composed": party(ours, True),
        "processes": party(ours, False),
        SLEEP_LOOP: party(bare_loop),
        TIMER: party(timer_node),
    }
    timings, failures = results_by_turns(ROUNDS, parties, samples_after_the_first)
    rows: list[Row] = []
    for name in ("composed", "processes"):
        if name not in timings:
            continue
        for peer in (SLEEP_LOOP, TIMER):
            if peer in timings:
                goals = peer == SLEEP_LOOP
                rows += deadline_rows(name, timings[name], peer, timings[peer], goals=goals)
        rows += force_rows(name, timings[name])
        if TIMER in timings:
            rows += load_rows(name, timings[name], timings[TIMER])
    return rows + failures


def samples_after_the_first(run: Slice[Timings]) -> int:
    """Run a first slice; return the samples of each of the others."""
    run(FIRST_SAMPLES)
    return SAMPLES


if __name__ == "__main__":
    show(__doc__, measure)
