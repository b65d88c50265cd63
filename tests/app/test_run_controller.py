"""`stickslip run` with a user's controller: a node that does not depend on this package."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from stickslip_ros.record.reader import Recording
from tests.app.conftest import Run, Start, ended
from tests.app.test_run import children, command, is_complete, is_running
from tests.nodes.conftest import processes  # noqa: F401 - a fixture used here
from tests.nodes.graph import wait_for
from tests.nodes.processes import Processes, wait_for_samples
from tests.testing import controllers

pytestmark = pytest.mark.process

Install = Callable[..., str]


def damper(node: str) -> str:
    """Return a script that runs one of the controllers that are written as by a user."""
    return f"""
import runpy, sys
sys.argv.insert(1, {node!r})
runpy.run_path({controllers.__file__!r}, run_name="__main__")
"""


@pytest.fixture
def install(
    process_environment: dict[str, str], tmp_path_factory: pytest.TempPathFactory
) -> Install:
    """Install a script into a package of a user's; return how the controller is named."""
    prefix = tmp_path_factory.mktemp("prefix")
    process_environment["AMENT_PREFIX_PATH"] = str(prefix)
    marker = prefix / "share/ament_index/resource_index/packages/my_controllers"
    marker.parent.mkdir(parents=True)
    marker.touch()
    folder = prefix / "lib/my_controllers"
    folder.mkdir(parents=True)

    def install(script: str, name: str = "damper", interpreter: str = sys.executable) -> str:
        executable = folder / name
        executable.write_text(f"#!{interpreter}\n{script}", encoding="utf-8")
        executable.chmod(0o755)
        return f"my_controllers/{name}"

    return install


def read_until(process: subprocess.Popen[str], text: str) -> str:
    """Return the first line on standard error, from now on, that has the text."""
    return next((line for line in process.stderr if text in line), "")


SCENARIO = """
/**/plant:
  ros__parameters: {reply_timeout: 1.0}
/**/damper:
  ros__parameters: {gain: 0.5}
/**/dumper:
  ros__parameters: {gain: 0.5}
"""


FURTHER = ("--", "--ros-args", "-p", "gain:=2.0")  # the scenario says otherwise


@pytest.mark.parametrize(
    ("node", "flags", "gain"),
    [
        pytest.param("Damper", (), 0.5, marks=pytest.mark.long),
        ("ManagedDamper", ("--composed", *FURTHER), 2.0),
    ],
)
def test_a_controller_of_a_user(
    stickslip: Run, install: Install, tmp_path: Path, node: str, flags: tuple[str, ...], gain: float
) -> None:
    if flags:
        name = install(damper(node))
    else:
        name = "my_controller.py"
        (tmp_path / name).write_text(damper(node), encoding="utf-8")
    (tmp_path / "my.yaml").write_text(SCENARIO, encoding="utf-8")
    arguments = ("my.yaml", "--duration", "2", "--bag", "bag", "--json")
    done = stickslip("run", *arguments, "--controller", name, *flags)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["samples"], result["late_forces"], result["lost_samples"]) == (201, 0, 0)
    assert result["controller"] == "/feed_drive/damper"
    assert result["controller_command"] == " ".join([name, *flags[2:]])
    assert "my.yaml: section /**/dumper matches no node" in done.stderr
    assert "/**/damper" not in done.stderr
    assert "ended as it should" in done.stderr
    with Recording(tmp_path / "bag") as recording:
        states, forces = recording.joint_states, recording.control_forces
    assert forces.stamp.tolist() == states.stamp.tolist()
    assert forces.force.tolist() == (-gain * states.velocity).tolist()


@pytest.mark.parametrize(
    ("script", "interpreter", "named"),
    [
        (damper("Mortal"), sys.executable, "/feed_drive/damper died (exit status 3)"),
        ("raise SystemExit(3)", sys.executable, "my_controllers/damper died (exit status 3)"),
        ("", "/nowhere/python", "cannot be started: No such file"),
    ],
    ids=["dies", "ends at once", "cannot start"],
)
def test_a_controller_that_dies_ends_the_run(
    stickslip: Run, install: Install, tmp_path: Path, script: str, interpreter: str, named: str
) -> None:
    name = install(script, interpreter=interpreter)
    done = stickslip("run", "paper", "--composed", "--bag", "bag", "--controller", name)
    assert done.returncode == 1
    assert named in done.stderr
    assert "Traceback" not in done.stderr
    assert "Mortal" not in script or is_complete(tmp_path / "bag")


@pytest.mark.long
def test_a_controller_that_never_closes_the_loop(
    stickslip: Run, install: Install, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip_ros.nodes.running.bringup._READY_TIMEOUT", 10.0)
    done = stickslip("run", "paper", "--controller", install(damper("ForceOnly")))
    assert done.returncode == 1
    assert "my_controllers/damper was not ready within 10 s" in done.stderr
    lacking = "publishes /feed_drive/control_force but does not read /feed_drive/joint_states"
    assert f"/feed_drive/damper {lacking}" in done.stderr.splitlines()[-1]


@pytest.mark.long
def test_a_controller_that_never_answers_and_is_deaf_is_killed_at_the_end(
    stickslip: Run, install: Install
) -> None:
    impatient = ("-p", "plant.reply_timeout=0.5", "--duration", "3", "--json")
    done = stickslip("run", "paper", *impatient, "--controller", install(damper("DeafAndMute")))
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("no control force arrives") == 1
    result = json.loads(done.stdout)
    assert (result["samples"], result["late_forces"]) == (301, 300)
    assert "my_controllers/damper ends neither on SIGINT nor on SIGTERM: killed" in done.stderr


@pytest.mark.long
def test_no_controller_outlives_the_run(
    start_stickslip: Start, install: Install, tmp_path: Path
) -> None:
    """Not even behind a shell that is deaf to what asks it to end, and when the run is killed."""
    script = tmp_path / "damper.py"
    script.write_text(damper("Damper"), encoding="utf-8")
    shell = f"trap '' INT TERM\n{sys.executable} {script} \"$@\" &\nwhile :; do wait; done\n"
    name = install(shell, interpreter="/bin/sh")
    process = start_stickslip("run", "paper", "--bag", "bag", "--composed", "--controller", name)
    wait_for_samples(process, tmp_path / "bag")
    (guard,) = children(process.pid)
    (shell_process,) = children(guard)
    (node,) = children(shell_process)
    assert str(script).encode() in command(node)
    process.kill()
    process.wait()
    wait_for(lambda: not any(map(is_running, (guard, shell_process, node))), "they end")


@pytest.fixture
def start_damper(
    process_environment: dict[str, str],
    processes: Processes,  # noqa: F811
    tmp_path: Path,
) -> Callable[[str], object]:
    """Start a controller in a namespace, of which no run knows."""
    script = tmp_path / "damper.py"
    script.write_text(damper("Damper"), encoding="utf-8")
    environment = process_environment | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    return lambda namespace: processes.start(
        [script, "--ros-args", "-r", f"__ns:={namespace}"], env=environment
    )


def test_an_external_controller_is_waited_for(
    start_stickslip: Start, start_damper: Callable[[str], object]
) -> None:
    """Other nodes are not treated as the controller."""
    start_damper("/other")
    arguments = ("paper", "--composed", "--external-controller", "--duration", "2", "--json")
    process = start_stickslip("run", *arguments)
    waits = read_until(process, "waiting for a controller")
    assert waits.endswith(
        "a node that reads /feed_drive/joint_states and publishes /feed_drive/control_force "
        "or /feed_drive/joint_commands\n"
    )
    assert read_until(process, "/other/damper reads").endswith(
        "reads /other/joint_states, the plant publishes /feed_drive/joint_states\n"
    )
    start_damper("/feed_drive")
    output, _ = ended(process, 0)
    result = json.loads(output)
    assert (result["samples"], result["late_forces"]) == (201, 0)
    assert (result["controller"], result["controller_command"]) == ("/feed_drive/damper", None)
