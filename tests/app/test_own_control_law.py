"""examples/own_control_law: a control law that a package names by an entry point."""

import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.docs.page import CHECKOUT
from tests.nodes.graph import PATIENCE

PACKAGE = CHECKOUT / "examples/own_control_law"
GROUP = "stickslip_ros.control_laws"

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def with_package(process_environment: dict[str, str], tmp_path: Path) -> Run:
    """Run a command in a process that finds the package as if it were installed."""
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text(encoding="utf-8"))
    (module,) = project["tool"]["setuptools"]["py-modules"]
    (tmp_path / f"{module}.py").write_bytes((PACKAGE / f"{module}.py").read_bytes())
    described = tmp_path / f"{module}-0.1.0.dist-info"
    described.mkdir()
    (described / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 0.1.0\n")
    laws = project["project"]["entry-points"][GROUP].items()
    lines = [f"{name} = {place}" for name, place in laws]
    (described / "entry_points.txt").write_text("\n".join([f"[{GROUP}]", *lines, ""]))
    path = os.pathsep.join([str(tmp_path), process_environment.get("PYTHONPATH", "")])

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "stickslip_ros.app.main", *arguments],
            env=process_environment | {"PYTHONPATH": path.rstrip(os.pathsep)},
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            cwd=tmp_path,
        )

    return run


@pytest.mark.process
def test_it_suppresses_the_vibration_in_simulate(with_package: Run) -> None:
    arguments = ("simulate", "feed_drive", "--controller", "relay_brake", "--duration", "5")
    braked = with_package(*arguments, "--json")
    assert braked.returncode == 0, braked.stderr
    assert json.loads(braked.stdout)["regime"] == "equilibrium"
    off = "relay_brake_controller.braking_force=0.0"
    free = json.loads(with_package(*arguments, "-p", off, "--json").stdout)
    assert free["regime"] == "stick_slip"


@pytest.mark.process
def test_a_sweep_varies_its_constants(with_package: Run) -> None:
    done = with_package(
        "sweep", "feed_drive", "--controller", "relay_brake", "--json",
        "--over", "relay_brake_controller.braking_force=0:120:3",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["regime"] == ["stick_slip", "equilibrium", "equilibrium"]


@pytest.mark.process
def test_continuous_control_is_refused_by_name(with_package: Run) -> None:
    done = with_package(
        "simulate", "feed_drive", "--controller", "relay_brake", "--continuous-control"
    )
    assert done.returncode == 2
    refusal = done.stderr.splitlines()[-1]
    assert "--continuous-control: the control law relay_brake is defined for samples" in refusal
