"""Each node as `ros2 run` starts it: a process of its own, with ROS arguments."""

import os
import signal
import subprocess
from functools import partial
from importlib import import_module
from pathlib import Path

import pytest

from stickslip_ros import nodes
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.topics import JOINT_STATES
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS, ReplayParameters
from tests.nodes.graph import PATIENCE, Graph, wait_for
from tests.nodes.processes import Processes


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
    graph: Graph, processes: Processes, tmp_path: Path
) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    here = ("-r", "__ns:=/test")
    file = tmp_path / "parameters.yaml"
    file.write_text("/**/plant: {ros__parameters: {belt_speed: 1, friction: {law: coulomb}}}\n")
    analyzer = processes.piped("analyzer", *here, "-p", f"bag:={tmp_path / 'bag'}")
    controller = processes.piped("washout_controller", *here)
    waiting = ("-p", "wait_for:=[washout_controller, analyzer]")
    plant = processes.piped("plant", *here, "--params-file", str(file), *waiting)
    graph.wait_until(lambda: len(heard) > 300, "the loop runs")
    graph.wait_until(partial(tells_of_both, tmp_path / "bag"), "it has asked for the parameters")
    finish(plant)
    finish(controller, signal.SIGTERM)
    assert "report" in finish(analyzer)
    with Recording(tmp_path / "bag") as recording:
        assert recording.complete
        states = recording.joint_states
    count = len(states)
    assert count > 300
    assert states.stamp.tolist() == [1_000_000_000 + n * 10_000_000 for n in range(count)]
    assert states.belt_velocity.tolist() == [1.0] * count


@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)]
)
def test_a_node_that_closes_ignores_further_signals(
    processes: Processes, number: signal.Signals
) -> None:
    """Of which `timeout` and `ros2 launch` send more than one."""
    plant = processes.piped("plant", "-r", "__ns:=/test", "-p", "expects_control:=false")
    assert plant.stderr is not None
    while "active" not in plant.stderr.readline():
        assert plant.poll() is None
    wait_for(lambda: plant.send_signal(number) or plant.poll() is not None, "it ends")
    assert plant.returncode == 0, plant.stderr.read()


def test_a_parameter_file_without_a_section_for_the_node_is_named(
    processes: Processes, tmp_path: Path
) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text("/axis/plant: {ros__parameters: {belt_speed: 1.0}}\n")
    plant = processes.piped("plant", "-r", "__ns:=/test", "--params-file", str(file))
    assert plant.stderr is not None
    assert f"{file} has no section for /test/plant; it has /axis/plant" in plant.stderr.readline()


@pytest.mark.parametrize(
    ("node", "arguments", "named"),
    [
        ("plant", ("-p", "mass:=-1.0"), ("mass = -1.0", "above 0", "/plant")),
        pytest.param(
            "plant", ("--params-file", "/no/file.yaml"), ("/no/file.yaml",), marks=pytest.mark.long
        ),
        pytest.param(
            "analyzer", ("-p", "bag:=/proc/no/bag"), ("/proc/no/bag",), marks=pytest.mark.long
        ),
        ("controller", ("-p", "law:=washuot"), ("unknown control law washuot; did you mean wash",)),
    ],
)
def test_bad_parameters_end_the_process_with_one_line(
    processes: Processes, node: str, arguments: tuple[str, ...], named: tuple[str, ...]
) -> None:
    process = processes.piped(node, *arguments)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2, errors
    lines = [line for line in errors.splitlines() if line.strip()]
    assert len(lines) == 1
    for text in named:
        assert text in lines[0]


@pytest.mark.parametrize(
    ("command", "imported"),
    [
        (["-m", "stickslip_ros.nodes.plant"], "rclpy"),
        (["plant_node"], "rclpy"),
        (["-m", "stickslip_ros.app.main", "simulate", "paper"], "difflib"),
    ],
)
def test_what_still_imports_ends_quietly(
    processes: Processes,
    process_environment: dict[str, str],
    tmp_path: Path,
    command: list[str],
    imported: str,
) -> None:
    slow = "import signal; print('importing', flush=True); signal.pause()"
    (tmp_path / f"{imported}.py").write_text(slow, encoding="utf-8")
    script = "from stickslip_ros.nodes.plant import main; main()"
    (tmp_path / "plant_node").write_text(script, encoding="utf-8")
    path = [str(tmp_path), *filter(None, [process_environment.get("PYTHONPATH")])]
    process_environment["PYTHONPATH"] = os.pathsep.join(path)
    piped = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = processes.start(command, cwd=tmp_path, **piped)
    assert process.stdout.readline() == "importing\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, errors) == (-signal.SIGINT, "")


def test_help_names_every_parameter(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["node", "--help"])
    for node, model in {**NODE_PARAMETERS, "replay": ReplayParameters()}.items():
        name = node if Path(nodes.__path__[0], f"{node}.py").exists() else "controller"
        with pytest.raises(SystemExit) as ended:
            import_module(f"stickslip_ros.nodes.{name}").main()
        shown = capsys.readouterr().out
        assert ended.value.code == 0
        assert "--ros-args" in shown
        if node == name:
            assert all(f"  {parameter}  (" in shown for parameter in model.known)
