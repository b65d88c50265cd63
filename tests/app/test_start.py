"""Modules that a start of the command line loads, and leaves for later: speed, without a clock."""

import subprocess
import sys
from pathlib import Path

import pytest

from stickslip_ros.app.commands import COMMANDS
from tests.nodes.graph import PATIENCE

pytestmark = pytest.mark.process

ROOT = Path(__file__).parents[2]

HEAVY = {
    *("heyoka", "importlib.metadata", "matplotlib", "mcap", "numpy", "numpy.ma", "numpy.random"),
    *("pandas", "pint", "rclpy", "rich", "scipy", "xarray", "yaml"),
}
"""Modules that take long to import, each more than a tenth of what Python itself takes."""
READING = {"mcap", "numpy", "yaml"}
"""Modules that the report of a bag needs."""
INTEGRATING = {"heyoka", "numpy", "yaml"}
"""Modules that a simulation needs."""

PROGRAM = """
import sys
sys.argv[0] = "stickslip"
try:
    {code}
finally:
    print("loaded:", *(set(sys.modules) & set({heavy!r})), file=sys.stderr)
"""
MAIN = "from stickslip_ros.app.main import main; main()"


SHOW = """from contextlib import suppress
    from stickslip_ros.app.main import main
    def show(words):
        with suppress(SystemExit):
            main(words.split())
    """
"""Defines a function that runs a command."""


def start(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run code in a process of its own; its last line on standard error is what it has loaded."""
    return subprocess.run(
        [sys.executable, "-c", PROGRAM.format(code=code, heavy=sorted(HEAVY)), *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )


def loaded(code: str, *arguments: str) -> set[str]:
    """Run code in a process of its own; return which of the heavy packages it has loaded."""
    done = start(code, *arguments)
    assert done.returncode == 0, done.stderr
    return set(done.stderr.splitlines()[-1].split()[1:])


def test_help_and_version_load_nothing_heavy() -> None:
    words = ["--help", *(f"{name} --help" for name in COMMANDS)]
    each = "\n    ".join(f"show({word!r})" for word in words)
    assert loaded(f"import stickslip_ros; {SHOW}{each}") == set()
    assert loaded(MAIN, "--version") == {"importlib.metadata"}


@pytest.mark.parametrize(
    ("code", "arguments", "needed"),
    [
        (MAIN, "simulate paper --duration 1", INTEGRATING),
        (MAIN, "report bags/reference", READING),
        ("import stickslip_ros as ss; ss.simulate('paper', duration=1)", "", INTEGRATING),
    ],
)
def test_what_is_short_loads_what_it_computes_with(
    code: str, arguments: str, needed: set[str]
) -> None:
    assert loaded(code, *arguments.split()) - {"rich"} == needed


def test_what_has_no_motion_loads_no_integrator() -> None:
    nodes = ("analyzer", "controller", "running.bringup")
    modules = ", ".join(f"stickslip_ros.nodes.{name}" for name in nodes)
    assert loaded(f"import {modules}") & {"heyoka", "matplotlib", "scipy"} == set()


def without(package: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command as where a package is not installed."""
    return start(f"sys.modules[{package!r}] = None; {MAIN}", *arguments)


def test_a_run_says_what_it_starts_before_it_loads_ros_and_names_it(tmp_path: Path) -> None:
    bag = str(tmp_path / "bag")
    done = without("rclpy", "run", "paper", "--duration", "5", "--bag", bag, "--json")
    assert done.returncode == 1
    started = "paper: lockstep, duration 5; starting the nodes in processes of their own"
    assert done.stderr.startswith(f"{started}; recording to {bag}")
    assert done.stdout == ""
    assert "needs ROS 2, of which rclpy is not installed" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("command", ["dashboard", "run paper --dashboard"])
def test_what_the_dashboard_needs_is_named(command: str) -> None:
    done = without("nicegui", *command.split())
    assert done.returncode == 1
    assert "pip install 'stickslip_ros[dashboard]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_run_of_exact_samples_needs_no_scipy() -> None:
    run = """from stickslip_ros.testing import ClosedLoop
    with ClosedLoop("paper") as loop:
        assert loop.run(20.0).lost_samples == 0
    """
    assert "scipy" not in loaded(run)


def test_commands_and_nodes_leave_the_other_processors_to_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    done = start("import os, stickslip_ros; print(os.environ['OPENBLAS_NUM_THREADS'])")
    assert done.stdout == "1\n"
