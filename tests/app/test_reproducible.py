"""The same scenario gives the same bag, bit for bit, in every way of running it and under load."""

import json
from pathlib import Path

import pytest

from tests.app.conftest import Run
from tests.nodes.processes import busy_machine
from tests.nodes.runs import messages_of

SECOND = 1_000_000_000
TOPICS = {"joint_states", "control_force", "applied_disturbance", "dropped_force"}
AFTER_STAMP = slice(12, None)
"""Of a serialized message: what follows encapsulation, seconds and nanoseconds."""

PAPER = [
    *("paper", "--pace=lockstep", "--duration=5", "-p=plant.belt_speed=0.3"),
    *("-p=plant.disturbance.kind=sine", "-p=plant.disturbance.amplitude=0.05"),
    *("-p=plant.disturbance.frequency=0.7", "-p=plant.disturbance.start=1.0"),
    *("-p=plant.disturbance.duration=3.0", "-p=plant.force_delay=0.0037"),
    "-p=plant.force_jitter=0.021",
]
SLOW = [
    *("paper", "--composed", "--duration=2"),
    "-p=plant.rate=15",  # a force that takes a twentieth of a second is in time
    *("-p=plant.disturbance.kind=step", "-p=plant.disturbance.amplitude=0.1"),
    *("-p=plant.disturbance.start=0.5", "-p=plant.force_delay=0.03"),
]


@pytest.mark.long
def test_lockstep_gives_the_same_bag_composed_in_processes_and_on_a_busy_machine(
    stickslip: Run, tmp_path: Path
) -> None:
    def run(bag: str, *arguments: str) -> None:
        done = stickslip("run", *PAPER, "--bag", bag, *arguments)
        assert done.returncode == 0, done.stderr

    run("composed", "--composed")
    with busy_machine():
        run("composed_busy", "--composed")
        run("processes_busy")
    messages = messages_of(tmp_path / "composed")
    counts = {topic.rpartition("/")[2]: len(heard) for topic, heard in messages.items()}
    assert counts.keys() == TOPICS
    assert counts["joint_states"] == counts["control_force"] == 501
    assert counts["applied_disturbance"] > 200
    assert counts["dropped_force"] > 60
    for other in ("composed_busy", "processes_busy"):
        assert messages_of(tmp_path / other) == messages, other


@pytest.mark.long
def test_real_time_without_late_forces_gives_what_lockstep_does(
    stickslip: Run, tmp_path: Path
) -> None:
    def run(bag: str, pace: str) -> int:
        """Return how many forces were late."""
        done = stickslip("run", *SLOW, f"--pace={pace}", "--bag", bag, "--json")
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)["late_forces"]

    assert run("lockstep", "lockstep") == 0
    attempts = [f"realtime_{number}" for number in range(40)]
    in_time = next((bag for bag in attempts if run(bag, "realtime") == 0), None)
    if in_time is None:
        pytest.fail("the machine is too busy to answer in time")

    lockstep, realtime = messages_of(tmp_path / "lockstep"), messages_of(tmp_path / in_time)
    start = realtime["/feed_drive/joint_states"][0][0]
    assert start > 1_000 * SECOND
    assert lockstep.keys() == realtime.keys()
    for topic in lockstep:
        assert [(stamp - SECOND, data[AFTER_STAMP]) for stamp, data in lockstep[topic]] == [
            (stamp - start, data[AFTER_STAMP]) for stamp, data in realtime[topic]
        ], topic
    assert len(lockstep["/feed_drive/joint_states"]) == 31
