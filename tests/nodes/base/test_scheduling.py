"""Real-time scheduling of a node's process."""

import os
import subprocess
import sys
from itertools import count
from pathlib import Path

import pytest

from stickslip_ros.nodes.base import scheduling
from stickslip_ros.nodes.base.scheduling import schedule_process, share_missed
from stickslip_ros.scenarios.parameter_group import NodeParameters
from tests.nodes.graph import Graph
from tests.nodes.processes import Processes
from tests.nodes.samples import Samples

_WITHOUT_RIGHTS = """
import os, resource
from stickslip_ros.nodes.base.scheduling import schedule_process
from stickslip_ros.scenarios.parameter_group import NodeParameters
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, 65536))
if os.geteuid() == 0:
    os.setuid(65534)
print(*schedule_process(NodeParameters(thread_priority=50, lock_memory=True)), sep="\\n")
"""


def test_by_default_nothing_changes() -> None:
    before = os.sched_getscheduler(0), os.sched_getaffinity(0)
    assert schedule_process(NodeParameters()) == []
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0)) == before


def test_a_processor_that_is_not_there_is_named() -> None:
    (refusal,) = schedule_process(NodeParameters(cpu_affinity=4000))
    assert refusal.startswith("cpu_affinity = 4000 has no effect: ")
    assert f"this machine has {os.cpu_count()} processors" in refusal


@pytest.mark.process
def test_without_rights_each_refusal_is_a_sentence_with_its_remedy() -> None:
    done = subprocess.run(
        [sys.executable, "-c", _WITHOUT_RIGHTS], capture_output=True, text=True, check=True
    )
    priority, memory = done.stdout.splitlines()
    assert priority.startswith("thread_priority = 50 has no effect: ")
    assert "rtprio 99" in priority
    assert memory.startswith("lock_memory = True has no effect: ")
    assert "memlock unlimited" in memory


@pytest.mark.process
def test_every_thread_of_an_active_plant_runs_as_asked(graph: Graph, processes: Processes) -> None:
    processor = min(os.sched_getaffinity(0))
    try:
        allowed = os.sched_getscheduler(os.getpid()) == os.SCHED_OTHER
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    except PermissionError:
        allowed = False
    samples = Samples(graph)
    plant = processes.node(
        "plant",
        pace="realtime",
        expects_control=False,
        cpu_affinity=processor,
        **({"thread_priority": 40} if allowed else {}),
    )
    samples.wait_for(2)  # the pacer's thread has started
    threads = [int(task.name) for task in Path(f"/proc/{plant.pid}/task").iterdir()]
    assert len(threads) > 2
    for thread in threads:
        assert os.sched_getaffinity(thread) == {processor}
        assert not allowed or os.sched_getscheduler(thread) == os.SCHED_FIFO
        assert not allowed or os.sched_getparam(thread).sched_priority == 40


def test_of_a_loop_that_only_sleeps_each_late_return_counts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = Clock()
    monkeypatch.setattr(scheduling, "time", clock)
    assert share_missed(0.25, 5.0) == 5 / 20


class Clock:
    """Time that only sleeping moves; every fourth sleep lasts 0.375 s too long."""

    def __init__(self) -> None:
        self._now = 0.0
        self._number = count(1)

    def monotonic(self) -> float:
        return self._now

    def sleep(self, wait: float) -> None:
        self._now += wait + (0.375 if next(self._number) % 4 == 0 else 0.0)
