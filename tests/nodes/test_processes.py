"""Each node as `ros2 run` starts it: a process of its own, with ROS arguments."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from stickslip_ros.bags.reader import Recording
from stickslip_ros.messages.topics import CONTROL_FORCE, JOINT_STATES, Topic
from tests.nodes.graph import PATIENCE, Graph

Start = Callable[..., subprocess.Popen[str]]

FORCE_OF_OTHERS = Topic("/other/force", CONTROL_FORCE.type_name)


@pytest.fixture
def start(process_environment: dict[str, str]) -> Iterator[Start]:
    processes: list[subprocess.Popen[str]] = []

    def start(node: str, *ros_arguments: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", f"stickslip_ros.nodes.{node}"]
        process = subprocess.Popen(
            [*command, "--ros-args", *ros_arguments],
            env=process_environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        processes.append(process)
        return process

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def finish(process: subprocess.Popen[str], number: signal.Signals = signal.SIGINT) -> str:
    process.send_signal(number)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    return errors


def tells_of_both(bag: Path) -> bool:
    """Return whether a bag that still grows holds the parameters of plant and controller."""
    with Recording(bag) as recording:
        tables = (f"stickslip_ros/{node}" for node in ("plant", "washout_controller"))
        return all(recording.metadata(table) is not None for table in tables)


def test_nodes_started_singly_close_the_loop_and_the_bag(
    graph: Graph, start: Start, tmp_path: Path
) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    here = ("-r", "__ns:=/test")
    analyzer = start("analyzer", *here, "-p", f"bag:={tmp_path / 'bag'}")
    controller = start("washout_controller", *here)
    plant = start("plant", *here, "-p", "wait_for:=[washout_controller, analyzer]")
    graph.wait_until(lambda: len(heard) > 300, "the loop runs")
    graph.wait_until(partial(tells_of_both, tmp_path / "bag"), "it has asked for the parameters")
    finish(plant)
    finish(controller, signal.SIGTERM)
    assert "report" in finish(analyzer)
    with Recording(tmp_path / "bag") as recording:
        assert recording.complete
        stamps = [stamp for _, stamp, _ in recording.messages("/test/joint_states")]
    assert stamps == [1_000_000_000 + n * 10_000_000 for n in range(len(stamps))]
    assert len(stamps) > 300


def test_topics_are_remapped_and_parameters_come_from_a_file(
    graph: Graph, start: Start, tmp_path: Path
) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    file = tmp_path / "parameters.yaml"
    file.write_text(
        "/**/plant:\n  ros__parameters:\n    belt_speed: 1\n    reply_timeout: 0.1\n"
        "    friction:\n      law: coulomb\n",
        encoding="utf-8",
    )
    forces = graph.listen(FORCE_OF_OTHERS)
    remapped = ("-r", f"{CONTROL_FORCE.name}:={FORCE_OF_OTHERS.name}")
    start("plant", "-r", "__ns:=/test", "--params-file", str(file), *remapped)
    start("washout_controller", "-r", "__ns:=/test", *remapped)
    graph.wait_until(lambda: len(heard) > 10 and len(forces) > 10, "both run")


@pytest.mark.parametrize(
    ("node", "arguments", "named"),
    [
        ("plant", ("-p", "mass:=-1.0"), ("mass = -1.0", "above 0", "/plant")),
        ("plant", ("-p", "mass:=heavy"), ("mass = 'heavy'", "a finite number")),
        ("plant", ("-p", "masss:=1.0"), ("unknown parameter masss",)),
        ("plant", ("--params-file", "/nowhere/to/be/found.yaml"), ("/nowhere/to/be/found.yaml",)),
        ("washout_controller", ("-p", "corner_frequency:=.nan"), ("corner_frequency = nan",)),
        ("analyzer", ("-p", "window:=0"), ("window = 0", "at least 1")),
        ("analyzer", ("-p", "bag:=/proc/none/bag"), ("/proc/none/bag",)),
        ("replay", ("-p", "rate:=0"), ("rate = 0", "above 0")),
        ("replay", ("-p", "bag:=/nowhere"), ("the bag /nowhere does not exist",)),
    ],
)
def test_bad_parameters_end_the_process_with_one_line(
    start: Start, node: str, arguments: tuple[str, ...], named: tuple[str, ...]
) -> None:
    process = start(node, *arguments)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2, errors
    lines = [line for line in errors.splitlines() if line.strip()]
    assert len(lines) == 1
    for text in named:
        assert text in lines[0]


@pytest.mark.process
@pytest.mark.parametrize(
    ("command", "imported"),
    [
        (["-m", "stickslip_ros.nodes.plant"], "rclpy"),
        (["-m", "stickslip_ros.nodes.replay"], "rclpy"),
        (["plant_node"], "rclpy"),
        (["-m", "stickslip_ros.app.main", "simulate", "paper"], "difflib"),
    ],
)
def test_what_still_imports_ends_quietly(
    process_environment: dict[str, str], tmp_path: Path, command: list[str], imported: str
) -> None:
    slow = "import signal; print('importing', flush=True); signal.pause()"
    (tmp_path / f"{imported}.py").write_text(slow, encoding="utf-8")
    script = "from stickslip_ros.nodes.plant import main; main()"
    (tmp_path / "plant_node").write_text(script, encoding="utf-8")
    path = [str(tmp_path), *filter(None, [process_environment.get("PYTHONPATH")])]
    process_environment["PYTHONPATH"] = os.pathsep.join(path)
    with subprocess.Popen(
        [sys.executable, *command],
        cwd=tmp_path,
        env=process_environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "importing\n"
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, errors) == (-signal.SIGINT, "")


@pytest.mark.process
@pytest.mark.parametrize("node", ["plant", "washout_controller", "analyzer", "replay"])
def test_help_names_every_parameter(node: str) -> None:
    shown = subprocess.run(
        [sys.executable, "-m", f"stickslip_ros.nodes.{node}", "--help"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert "autostart" in shown
    assert "--ros-args" in shown


FULL = """
mount -t tmpfs -o size=64k tmpfs /dev/shm && dd if=/dev/zero of=/dev/shm/full 2>/dev/null
exec "$@"
"""


@pytest.mark.process
@pytest.mark.parametrize("code", ["stickslip_ros.nodes.plant", "stickslip_ros.app.main"])
def test_full_shared_memory_is_a_sentence(
    process_environment: dict[str, str], tmp_path: Path, code: str
) -> None:
    """Loading ROS into a process writes a little of it, and SIGBUS ends the process."""
    command = [sys.executable, "-m", code, *(["dashboard"] if "app" in code else [])]
    isolated = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c"]
    if subprocess.run([*isolated, "mount -t tmpfs tmpfs /dev/shm"], check=False).returncode != 0:
        pytest.skip("no namespaces here")
    done = subprocess.run(
        [*isolated, FULL, "sh", *command],
        env=process_environment, cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "shared memory is full: /dev/shm has 0 bytes free, and ROS needs" in line
