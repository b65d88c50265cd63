"""Commands without ROS work where it is not installed; others name the missing package."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.process

WITHOUT = (
    "import sys; sys.modules[sys.argv.pop(1)] = None; sys.argv[0] = 'stickslip'; "
    "from stickslip_ros.app.main import main; main()"
)


@pytest.mark.parametrize(
    ("missing", "command", "status", "shown"),
    [
        ("rclpy", "simulate paper --duration 50", 0, "amplitude"),
        ("rclpy", "run paper", 1, "needs ROS 2, of which rclpy is not installed"),
        ("nicegui", "dashboard", 1, "pip install 'stickslip_ros[dashboard]'"),
        ("nicegui", "run paper --dashboard", 1, "pip install 'stickslip_ros[dashboard]'"),
    ],
)
def test_commands(missing: str, command: str, status: int, shown: str, tmp_path: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT, missing, *command.split()],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == status, done.stderr
    assert shown in done.stdout + done.stderr
    assert "Traceback" not in done.stderr
