"""`stickslip run`: the closed loop through the middleware, started as a user starts it."""

import json
import os
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from stickslip_ros.bags.reader import Recording
from stickslip_ros.messages.topics import DIAGNOSTICS
from stickslip_ros.nodes.base.managed import STATE
from tests.app.conftest import Run
from tests.nodes.graph import PATIENCE, Graph, wait_for

# Amplitude and stick fraction of the uncontrolled limit cycle at some belt speeds.
REFERENCE = {
    0.2: (0.318603222, 0.285506954),
    0.3: (0.394200937, 0.204072402),
    0.4: (0.434086183, 0.100062954),
    0.46: (0.337968726, 0.0),
}


@pytest.mark.parametrize(
    "belt_speed",
    [0.2, *(pytest.param(speed, marks=pytest.mark.long) for speed in (0.3, 0.4, 0.46))],
)
def test_figures_from_samples_are_those_of_the_limit_cycle(
    stickslip: Run, belt_speed: float
) -> None:
    speed = f"plant.belt_speed={belt_speed}"
    # Close to the Hopf speed the limit cycle is approached slowly.
    duration = "1500" if belt_speed == 0.46 else "300"
    done = stickslip(
        "run", "paper", "--no-control", "--composed", "-p", speed, "--duration", duration, "--json"
    )
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    amplitude, stick_fraction = REFERENCE[belt_speed]
    assert figures["report"]["amplitude"] == pytest.approx(amplitude, rel=1e-4)
    assert figures["report"]["stick_fraction"] == pytest.approx(stick_fraction, abs=2e-3)
    assert figures["samples"] == int(duration) * 100 + 1
    assert figures["lost_samples"] == figures["late_forces"] == figures["missed_deadlines"] == 0
    assert figures["scenario"]["plant"]["belt_speed"] == belt_speed
    assert figures["report"]["complete"]


@pytest.mark.process
def test_processes_and_composed_give_the_same_bytes(stickslip: Run, tmp_path: Path) -> None:
    payloads: dict[str, list[bytes]] = {}
    for how in ("processes", "composed"):
        flags = ["--composed"] if how == "composed" else []
        done = stickslip("run", "paper", "--duration", "5", "--bag", how, *flags)
        assert done.returncode == 0, done.stderr
        with Recording(tmp_path / how) as recording:
            for topic in ("joint_states", "control_force"):
                messages = recording.messages(f"/feed_drive/{topic}")
                payloads[f"{how} {topic}"] = [message for _, _, message in messages]
    for topic in ("joint_states", "control_force"):
        assert len(payloads[f"composed {topic}"]) == 501
        assert payloads[f"processes {topic}"] == payloads[f"composed {topic}"]


def test_the_washout_kills_the_vibration_of_the_feed_drive(stickslip: Run, tmp_path: Path) -> None:
    arguments = ["feed_drive", "--pace", "lockstep", "--duration", "7", "--bag", "bag"]
    assert stickslip("run", *arguments, "--composed").returncode == 0
    before = json.loads(stickslip("report", "bag", "--to", "5", "--json").stdout)
    after = json.loads(stickslip("report", "bag", "--from", "6", "--json").stdout)
    whole = json.loads(stickslip("report", "bag", "--json").stdout)
    assert before["regime"] == "stick_slip"
    assert after["amplitude"] < 0.01 * before["amplitude"]
    assert 50.0 < whole["peak_force"] < 150.0
    with Recording(tmp_path / "bag") as recording:
        position = recording.joint_states.position
    assert float(position[6000:].max() - position[6000:].min()) < 0.02 * before["amplitude"]


def test_ctrl_c_closes_the_bag(
    start_stickslip: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    process = start_stickslip("run", "feed_drive", "--bag", "bag", "--json")
    wait_for_samples(process, tmp_path / "bag")
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, errors
    assert json.loads(output)["report"]["complete"]


def test_a_node_that_dies_is_named_and_the_bag_closed(
    start_stickslip: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    process = start_stickslip("run", "feed_drive", "--bag", "bag")
    wait_for_samples(process, tmp_path / "bag")
    for child in children(process.pid):
        if b"stickslip_ros.nodes.controller" in command(child):
            os.kill(child, signal.SIGKILL)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "washout_controller died (killed by signal 9)" in errors
    with Recording(tmp_path / "bag") as recording:
        assert recording.complete


def test_samples_that_the_analyzer_has_not_taken_in_at_the_end_are_waited_for(
    start_stickslip: Callable[..., subprocess.Popen[str]],
    domain: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    graph = Graph(domain)
    health = graph.listen(DIAGNOSTICS)
    in_real_time = ("--pace", "realtime", "--duration", "3")
    process = start_stickslip("run", "paper", *in_real_time, "--bag", "bag", "--json")
    graph.wait_until(lambda: "active" in states_of_plant(health), "the plant is active")
    (analyzer,) = (child for child in children(process.pid) if b"nodes.analyzer" in command(child))
    os.kill(analyzer, signal.SIGSTOP)
    graph.wait_until(lambda: states_of_plant(health)[-1] == "inactive", "the plant pauses")
    os.kill(analyzer, signal.SIGCONT)
    graph.close()
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    result = json.loads(output)
    assert (result["samples"], result["report"]["complete"]) == (301, True)


@pytest.mark.parametrize("flags", [(), pytest.param(("--composed",), marks=pytest.mark.long)])
@pytest.mark.parametrize(("pace", "duration"), [("realtime", 4), ("lockstep", None)])
def test_a_plant_that_is_deactivated_pauses_the_run(
    start_stickslip: Callable[..., subprocess.Popen[str]],
    domain: int,
    monkeypatch: pytest.MonkeyPatch,
    pace: str,
    duration: int | None,
    flags: tuple[str, ...],
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    graph = Graph(domain)
    health = graph.listen(DIAGNOSTICS)

    def ask_for(transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        assert graph.call(ChangeState, "/feed_drive/plant/change_state", request).success

    until = ("--duration", str(duration)) if duration else ()
    process = start_stickslip("run", "paper", "--pace", pace, *until, *flags, "--json")
    graph.wait_until(lambda: "active" in states_of_plant(health), "the plant is active")
    ask_for(Transition.TRANSITION_DEACTIVATE)
    told = len(states_of_plant(health))
    graph.wait_until(lambda: len(states_of_plant(health)) > told + 2, "it stays paused")
    assert states_of_plant(health)[-1] == "inactive"
    assert process.poll() is None
    ask_for(Transition.TRANSITION_ACTIVATE)
    graph.wait_until(lambda: states_of_plant(health)[-1] == "active", "it goes on")
    graph.close()
    if duration is None:
        process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == (0 if duration else 130), errors
    assert errors.count("the plant is paused") == errors.count("the plant continues") == 1
    result = json.loads(output)
    assert result["report"]["complete"]
    assert result["lost_samples"] == 0 or pace == "realtime"
    if duration:  # each of the two segments has a sample 0
        assert result["samples"] == duration * 100 + 2


def states_of_plant(health: list[DiagnosticArray]) -> list[str]:
    """Return in which states of its life cycle the plant has said to be, the newest last."""
    told = [s for array in health for s in array.status if s.name == "/feed_drive/plant"]
    return [entry.value for status in told for entry in status.values if entry.key == STATE]


def test_no_node_outlives_a_run_that_is_killed(
    start_stickslip: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    process = start_stickslip("run", "feed_drive", "--bag", "bag")
    wait_for_samples(process, tmp_path / "bag")
    nodes = children(process.pid)
    assert len(nodes) == 3
    process.kill()
    process.wait()
    wait_for(lambda: not any(is_running(node) for node in nodes), "the nodes end")
    with Recording(tmp_path / "bag") as recording:
        assert recording.complete


def command(pid: int) -> bytes:
    return Path(f"/proc/{pid}/cmdline").read_bytes()


def is_running(pid: int) -> bool:
    status = Path(f"/proc/{pid}/stat")
    return status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z"


def children(pid: int) -> list[int]:
    return [
        int(child)
        for task in Path(f"/proc/{pid}/task").iterdir()
        for child in (task / "children").read_text().split()
    ]


def wait_for_samples(process: subprocess.Popen[str], bag: Path) -> None:
    """Wait until a running recorder has flushed some samples."""
    wait_for(lambda: sum(file.stat().st_size for file in bag.glob("*.mcap")) > 20_000, "samples")
    assert process.poll() is None
