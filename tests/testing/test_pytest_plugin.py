import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.nodes.graph import PATIENCE

IN_A_TEST = """
import sys

import pytest

def test_imports_nothing_before_it_is_used():
    assert "stickslip_ros.testing" not in sys.modules
    assert "numpy" not in sys.modules

LOOPS = []

@pytest.mark.parametrize("number", range(2))
def test_runs(closed_loop, number):
    loop = closed_loop("paper", "plant.belt_speed=0.3", controller=None)
    assert len(loop.run(0.1).states.stamp) == 11
    LOOPS.append(loop)

def test_is_closed_after_the_test():
    for loop in LOOPS:
        with pytest.raises(Exception, match="not open"):
            loop.run(0.1)
"""


@pytest.mark.process
@pytest.mark.parametrize("capture", ["fd", pytest.param("sys", marks=pytest.mark.long)])
def test_the_fixture_in_a_user_test(tmp_path: Path, capture: str) -> None:
    (tmp_path / "test_it.py").write_text(IN_A_TEST, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "stickslip_ros.pytest_plugin"]
    command.append(f"--capture={capture}")
    environment = os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    finished = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=2 * PATIENCE
    )
    assert "4 passed" in finished.stdout, finished.stdout + finished.stderr
