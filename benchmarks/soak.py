"""Is the closed loop stable over a long time? Soak test of `stickslip run` on a busy machine.

The run is in real time. The slide of this drive slips all the time, so that every force affects its
motion. Another process observes:

- the memory of each process, every second;
- the samples, by the stamps in the bag;
- the deadlines: the middleware provides the time at which it sent each sample. If this time is
  after the deadline of the next sample, the deadline was missed. The plant reads the clock after it
  has sent the sample, and therefore may count more missed deadlines, but not fewer;
- the late forces: each step of the motion in the bag shows which force acted.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from array import array
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from stickslip_ros.motion.motion import Motion
from stickslip_ros.nodes.base.endpoints import message_class, qos_profile
from stickslip_ros.nodes.base.network import domain_variables, own_domain
from stickslip_ros.nodes.base.process import loopback_session
from stickslip_ros.record.codec import unpack_header
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.topics import JOINT_STATES, RECORDED, Topic
from stickslip_ros.scenarios.files import DEFAULT_NAMESPACE, load_scenario
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.stamps import NANOSECONDS

SCENARIO = "feed_drive"
OVERRIDES = (
    "plant.pace=realtime",
    "plant.belt_speed=0.046",
    "plant.initial.position=0.0005",
    "washout_controller.linear_gain=-100.0",
    "washout_controller.start_after=0.0",
)

WARM_UP = 30.0
"""Time of the run, s, once it is recorded, after which the memory of a process stays constant."""
HIDDEN, UNEXPLAINED = -1, -2
"""In place of the age of a force."""
_LOOK_PERIOD = 0.02
_MEMORY_PERIOD = 1.0
_SAME_SPEED = 1e-14
"""Difference, m/s, up to which speeds are equal; different forces cause a greater one."""
_PAGE = os.sysconf("SC_PAGE_SIZE")


class Sendings:
    """Messages of a topic: their stamps, and when the middleware sent them, ns of wall time."""

    def __init__(self, node: Node, topic: Topic) -> None:
        self.stamps, self.sent = array("q"), array("q")
        self.largest_delay = 0
        """Largest time from sending to reception here, ns."""
        self._subscription = node.create_subscription(
            message_class(topic.type_name),
            f"{DEFAULT_NAMESPACE}/{topic.name}",
            print,
            qos_profile(topic),
            raw=True,
        )

    @property
    def span(self) -> float:
        """Time from the first to the last, s."""
        return (self.stamps[-1] - self.stamps[0]) / NANOSECONDS if self.stamps else 0.0

    def take(self) -> None:
        """Take what waits."""
        handle = self._subscription.handle
        with handle:
            while taken := handle.take_message(self._subscription.msg_type, True):
                sent = taken[1]["source_timestamp"]
                self.stamps.append(unpack_header(taken[0]))
                self.sent.append(sent)
                self.largest_delay = max(self.largest_delay, time.time_ns() - sent)


@dataclass(frozen=True)
class Outcome:
    """The result of a soak test."""

    run: dict[str, Any]
    """The report of `stickslip run`."""
    memory: dict[str, list[int]]
    """Resident memory by process, bytes, after the warm-up."""
    seen: int
    """Samples that the observer also received."""
    missing_stamps: int
    """Gaps between the stamps in the bag, in samples."""
    largest_backlog: int
    """Largest number of samples that waited to be recorded."""
    furthest_behind: int
    """Largest number of samples by which analyzer, controller or observer were behind."""
    missed_deadlines: int
    """Deadlines that were certainly missed."""
    late_forces: int
    """Late forces according to the motion."""
    hidden_steps: int
    """Steps of the motion whose next sample, or a force that may have acted, is not in the bag."""
    unexplained_steps: int
    """Steps of the motion that none of the forces that may have acted explains."""


def soak(duration: float, *, composed: bool, burners: int, directory: Path) -> Outcome:
    """Run the drive for a duration (s) with `burners` busy processes; write the bag to `directory`.

    Raises RuntimeError if the run fails.
    """
    bag = directory / "bag"
    with own_domain() as domain, loopback_session(domain, ["--ros-args"]) as spinner:
        outside = Node("outside", context=spinner.executor.context)
        samples, recorded = Sendings(outside, JOINT_STATES), Sendings(outside, RECORDED)
        memory: dict[str, list[int]] = {}
        next_look = 0.0
        with _burning(burners), _run(duration, domain, bag, composed=composed) as process:
            while process.poll() is None:
                samples.take()
                recorded.take()
                warm = recorded.span >= WARM_UP and samples.span < duration
                if warm and time.monotonic() >= next_look:
                    next_look = time.monotonic() + _MEMORY_PERIOD
                    _look_at_memory(process.pid, memory)
                time.sleep(_LOOK_PERIOD)
            output, _ = process.communicate()
        outside.destroy_node()
    if process.returncode != 0:
        raise RuntimeError(f"stickslip run ended with the status {process.returncode}")
    plant = load_scenario(SCENARIO, OVERRIDES).plant
    period = 1.0 / plant.rate
    with Recording(bag) as recording:
        stamps, answered = recording.joint_states.stamp, recording.control_forces.stamp
        ages = force_ages(recording, plant)
    largest_backlog = _largest_backlog(samples, recorded, period)
    behind = max(samples.largest_delay, int(np.diff(answered).max())) / NANOSECONDS / period
    return Outcome(
        run=json.loads(output),
        memory=memory,
        seen=len(samples.stamps),
        missing_stamps=round((stamps[-1] - stamps[0]) * plant.rate / NANOSECONDS) + 1 - len(stamps),
        largest_backlog=largest_backlog,
        furthest_behind=max(largest_backlog, round(behind)),
        missed_deadlines=_missed_deadlines(samples, period),
        late_forces=int(np.sum(ages > 0)),
        hidden_steps=int(np.sum(ages == HIDDEN)),
        unexplained_steps=int(np.sum(ages == UNEXPLAINED)),
    )


def force_ages(recording: Recording, parameters: PlantParameters) -> NDArray[np.int64]:
    """Return the age, in periods, of the force that acted from each sample to the next.

    Without a force, the age is larger than any other. It is `HIDDEN` if the next sample, or one of
    the forces that may have acted, is missing in the bag; `UNEXPLAINED` if none of them acted.
    """
    states, forces = recording.joint_states, recording.control_forces

    def number_of(stamp: int) -> int:
        return round((stamp - int(states.stamp[0])) * parameters.rate / NANOSECONDS)

    numbers = [number_of(stamp) for stamp in states.stamp.tolist()]
    positions, velocities = states.position.tolist(), states.velocity.tolist()
    answered = map(number_of, forces.stamp.tolist())
    force_of = dict(zip(answered, forces.force.tolist(), strict=True))
    longest_held = int(parameters.force_timeout * parameters.rate)
    motion = Motion(parameters.as_drive(), positions[0], velocities[0])
    ages = np.full(len(numbers) - 1, HIDDEN)
    newest = 0
    for place, (number, following) in enumerate(pairwise(numbers)):
        if following > number + 1:
            continue
        oldest = max(newest, number - longest_held)
        # Its own force or, most likely otherwise, the one that was held before.
        possible = dict.fromkeys([number, oldest, *range(number - 1, oldest, -1)])
        known = [sample for sample in possible if sample in force_of]
        if len(known) == len(possible):
            ages[place] = UNEXPLAINED
        for sample in [*known, -1]:
            motion.restart(positions[place], velocities[place])
            motion.force = 0.0 if sample < 0 else force_of[sample]
            motion.advance(1.0 / parameters.rate)
            if abs(motion.velocity - velocities[place + 1]) < _SAME_SPEED:
                ages[place] = number - sample
                newest = max(newest, sample)
                break
    return ages


def _missed_deadlines(samples: Sendings, period: float) -> int:
    stamps, sent = np.array(samples.stamps), np.array(samples.sent)
    after_stamp = sent - stamps
    # No sample is sent before its deadline: this bounds the deadline of sample 0 from above.
    longest_start = after_stamp.min()
    return int(np.sum(after_stamp - longest_start > period * NANOSECONDS))


def _largest_backlog(samples: Sendings, recorded: Sendings, period: float) -> int:
    """Return the largest number of samples sent between two reports of the recorded stamp.

    Of samples that the observer lost, too, those after a report count as if sent before it.
    """
    last = len(samples.stamps) - 1
    following = np.minimum(np.searchsorted(samples.sent, recorded.sent[1:], side="right"), last)
    behind = np.array(samples.stamps)[following] - np.array(recorded.stamps[:-1])
    return round(float(behind.max()) / (period * NANOSECONDS))


@contextmanager
def _run(
    duration: float, domain: int, bag: Path, *, composed: bool
) -> Generator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "stickslip_ros.app.main", "run", SCENARIO, "--json"]
    command += ["--bag", str(bag), "--duration", str(duration)]
    command += ["--composed"] if composed else []
    command += [part for override in OVERRIDES for part in ("-p", override)]
    environment = os.environ | domain_variables(domain)
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()  # also ends its nodes
        process.wait()


@contextmanager
def _burning(count: int) -> Generator[None]:
    burners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()


def _look_at_memory(pid: int, memory: dict[str, list[int]]) -> None:
    processes = list(_processes(pid))
    if len(processes) < len(memory):  # the nodes have ended, and the command reads the bag
        return
    for name, process in processes:
        try:
            pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
        except (OSError, IndexError):  # it has ended
            continue
        memory.setdefault(name, []).append(pages * _PAGE)


def _processes(pid: int) -> Iterator[tuple[str, int]]:
    """Yield a process and its child processes, each with the name of its module."""
    for process in [pid, *_children(pid)]:
        try:
            arguments = Path(f"/proc/{process}/cmdline").read_text().split("\0")
        except OSError:
            continue
        if "-m" in arguments:
            yield arguments[arguments.index("-m") + 1].rpartition(".")[2], process


def _children(pid: int) -> list[int]:
    children: list[int] = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            children += map(int, task.read_text().split())
        except OSError:
            continue
    return children


def lines(outcome: Outcome) -> Iterator[str]:
    """Yield the result of a soak test as lines of text."""
    run = outcome.run
    yield f"samples          {run['samples']} recorded, {outcome.seen} received by the observer"
    yield f"lost samples     {run['lost_samples']}; by the stamps {outcome.missing_stamps}"
    yield f"largest backlog  {outcome.largest_backlog} samples waiting to be recorded"
    yield f"furthest behind  {outcome.furthest_behind} samples, of all readers"
    yield f"missed deadlines {run['missed_deadlines']}; for sure {outcome.missed_deadlines}"
    yield f"late forces      {run['late_forces']}; by the motion {outcome.late_forces}"
    yield f"hidden           {outcome.hidden_steps} steps of the motion, by what is not in the bag"
    yield f"unexplained      {outcome.unexplained_steps} steps of the motion"
    for name, sizes in outcome.memory.items():
        quarters = np.array_split(np.array(sizes) / 1e6, 4)
        warm = quarters[0][0]
        growth = ", ".join(f"+{quarter.max() - warm:.2f}" for quarter in quarters)
        yield (
            f"memory           {name}: {warm:.1f} MB after {WARM_UP:g} s; in the quarters of the "
            f"time since, at most {growth} MB"
        )


def main() -> None:
    """Run a soak test with the options of the command line, and print the result."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=30.0, help="(default: %(default)g)")
    parser.add_argument("--composed", action="store_true", help="all nodes in one process")
    parser.add_argument(
        "--burners", type=int, default=1, help="number of busy processes (default: %(default)s)"
    )
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        outcome = soak(
            60.0 * chosen.minutes,
            composed=chosen.composed,
            burners=chosen.burners,
            directory=Path(directory),
        )
    print(*lines(outcome), sep="\n")


if __name__ == "__main__":
    main()
