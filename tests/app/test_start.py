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
    "heyoka",
    "matplotlib",
    "mcap",
    "numpy",
    "pint",
    "rclpy",
    "rich",
    "scipy",
    "yaml",
}
"""Packages that take long to import, each more than a tenth of what Python itself takes."""
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
    words = ["--version", "--help", *(f"{name} --help" for name in COMMANDS)]
    each = "\n    ".join(f"show({word!r})" for word in words)
    assert loaded(f"import stickslip_ros; {SHOW}{each}") == set()


@pytest.mark.parametrize(
    ("arguments", "needed"),
    [
        (("simulate", "paper", "--duration", "1"), INTEGRATING),
        (("report", "bags/reference"), READING),
    ],
)
def test_a_short_command_loads_what_it_computes_with(
    arguments: tuple[str, ...], needed: set[str]
) -> None:
    assert loaded(MAIN, *arguments) - {"rich"} == needed


@pytest.mark.parametrize("module", ["nodes.analyzer", "nodes.controller", "running.bringup"])
def test_what_has_no_motion_loads_no_integrator(module: str) -> None:
    assert loaded(f"import stickslip_ros.{module}") & {"heyoka", "matplotlib", "scipy"} == set()


def test_a_run_says_what_it_starts_before_it_loads_ros(tmp_path: Path) -> None:
    without_ros = f"sys.modules['rclpy'] = None; {MAIN}"
    bag = str(tmp_path / "bag")
    done = start(without_ros, "run", "paper", "--duration", "5", "--bag", bag, "--json")
    assert done.returncode == 1
    started = "paper: lockstep, duration 5; starting the nodes in processes of their own"
    assert done.stderr.startswith(f"{started}; recording to {bag}")
    assert done.stdout == ""
