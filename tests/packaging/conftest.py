import os
import subprocess
from importlib import metadata
from pathlib import Path

import ament_index_python
import pytest

from tests.docs.shell import OURS, copy_checkout

PACKAGE = "stickslip_ros"
SOURCE = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def environment():
    """The environment variables for starting another installation."""
    kept = {name: value for name, value in os.environ.items() if name not in OURS}
    return {**kept, "PIP_COMPILE": "0"}


@pytest.fixture(scope="session")
def checkout(tmp_path_factory):
    """A copy of what git has or would take, so that no build touches the original."""
    copy = tmp_path_factory.mktemp("workspace") / PACKAGE
    copy_checkout(copy)
    return copy


@pytest.fixture(scope="session")
def executables():
    scripts = metadata.distribution(PACKAGE).entry_points.select(group="console_scripts")
    return {script.name for script in scripts}


@pytest.fixture
def find_executables(monkeypatch):
    """As ``ros2 run`` does: the ament index gives the prefix, lib/<package> the files."""

    def find(ament_prefix_path):
        monkeypatch.setenv("AMENT_PREFIX_PATH", str(ament_prefix_path))
        prefix = ament_index_python.get_packages_with_prefixes()[PACKAGE]
        folder = Path(prefix, "lib", PACKAGE)
        return {file.name: file for file in folder.iterdir() if os.access(file, os.X_OK)}

    return find


@pytest.fixture
def check_executable(tmp_path):
    """Starts an executable so that it ends by itself: a node by a typo, the script by --help."""

    def check(executable, environment):
        node = executable.name.endswith("_node")
        arguments = ["--ros-args", "-p", "no_such_parameter:=1"] if node else ["--help"]
        ended = subprocess.run(
            [executable, *arguments], env=environment, cwd=tmp_path, capture_output=True, text=True
        )
        if node:
            assert ended.returncode == 2, ended.stderr
            (line,) = ended.stderr.splitlines()
            assert "no_such_parameter" in line
        else:
            assert ended.returncode == 0, ended.stderr
            assert ended.stdout.startswith(f"usage: {executable.name}")

    return check
