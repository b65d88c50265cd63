"""What needs no ROS works where there is none."""

import subprocess
import sys

import pytest

WITHOUT_ROS = (
    "import sys; sys.modules['rclpy'] = None; sys.argv[0] = 'stickslip'; "
    "from stickslip_ros.app.main import main; main()"
)


@pytest.mark.parametrize(
    ("arguments", "status", "shown"),
    [
        (("simulate", "paper", "--duration", "50"), 0, "amplitude"),
        (("run", "paper"), 1, "needs ROS 2, of which rclpy is not installed"),
    ],
)
def test_commands(arguments: tuple[str, ...], status: int, shown: str, tmp_path: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_ROS, *arguments],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == status, done.stderr
    assert shown in done.stdout + done.stderr
    assert "Traceback" not in done.stderr
