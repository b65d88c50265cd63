import shutil
import subprocess
import sys

import pytest

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def workspace(checkout, environment):
    """The package built by colcon in a workspace, with this Python."""
    colcon = [sys.executable, "-m", "colcon", "build"]
    subprocess.run(colcon, cwd=checkout.parent, env=environment, check=True)
    return checkout.parent / "install" / checkout.name


@pytest.fixture(scope="module")
def sourced(workspace, environment):
    """The environment of a shell that has sourced the workspace."""
    script = ". ./local_setup.bash && env -0"
    shown = subprocess.check_output(
        ["bash", "-c", script], cwd=workspace.parent, env=environment, text=True
    )
    return dict(line.split("=", 1) for line in shown.split("\0") if line)


def test_sourcing_puts_the_prefix_on_the_ament_prefix_path(workspace, sourced):
    assert sourced["AMENT_PREFIX_PATH"] == str(workspace)


def test_sourcing_puts_the_command_on_the_path(workspace, sourced):
    found = shutil.which("stickslip", path=sourced["PATH"])
    assert found == str(workspace / "lib" / workspace.name / "stickslip")
    assert "usage: stickslip" in subprocess.check_output([found, "--help"], env=sourced, text=True)


def test_manifest_and_configuration_are_installed(workspace, checkout):
    share = workspace / "share" / workspace.name
    assert (share / "package.xml").read_text() == (checkout / "package.xml").read_text()
    written = {file.name for file in (checkout / "config").iterdir()}
    assert written
    assert {file.name for file in (share / "config").iterdir()} == written


def test_ros2_run_finds_and_starts_every_executable(
    sourced, executables, find_executables, check_executable
):
    found = find_executables(sourced["AMENT_PREFIX_PATH"])
    assert found.keys() == executables
    for executable in found.values():
        check_executable(executable, sourced)
