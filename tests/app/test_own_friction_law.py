"""examples/own_friction_law: a friction law that an installed package names by an entry point."""

import csv
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.docs.page import CHECKOUT
from tests.nodes.graph import PATIENCE
from tests.physics.motion.dop853 import Curve, Dop853Drive, none

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the package into a directory, without a network."""
    folder = tmp_path_factory.mktemp("own_friction_law")
    source = shutil.copytree(CHECKOUT / "examples/own_friction_law", folder / "source")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    here = ["--no-index", "--no-deps", "--no-build-isolation", "--target", folder / "installed"]
    subprocess.run([*pip, *here, source], check=True)
    return folder


@pytest.fixture
def with_package(process_environment: dict[str, str], installed: Path, tmp_path: Path) -> Run:
    """Run a command in a process that finds the package."""
    shutil.copy(installed / "source/lubricated_drive.yaml", tmp_path)
    places = [str(installed / "installed"), process_environment.get("PYTHONPATH", "")]
    path = os.pathsep.join(places).rstrip(os.pathsep)

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "stickslip_ros.app.main", *arguments],
            env=process_environment | {"PYTHONPATH": path},
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            cwd=tmp_path,
        )

    return run


def hess_soom(static: float, decay_speed: float) -> Curve:
    return lambda w: 0.1 + (static - 0.1) / (1.0 + (w / decay_speed) ** 2) + 0.4 * w


@pytest.mark.process
def test_a_scenario_with_the_law_moves_as_the_law_says(with_package: Run, tmp_path: Path) -> None:
    start = ("-p", "plant.initial.position=1e-3", "-p", "plant.initial.velocity=-0.02")
    out = ("--duration", "1.3", "--out", "run.csv")  # s: 20 natural periods
    done = with_package("simulate", "lubricated_drive.yaml", "--no-control", *start, *out, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["regime"] == "stick_slip"
    with (tmp_path / "run.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    drive = Dop853Drive(
        mass=100.0,
        damping=200.0,
        stiffness=1e6,
        forward=hess_soom(0.3, 0.02),
        backward=hess_soom(0.32, 0.025),
        belt=none().plus(0.03),
        normal=none().plus(1000.0),
    )
    times = np.array([float(row["time"]) for row in rows])
    reference = drive.run(1e-3, -0.02, times)
    assert len(reference.sticks) > 10
    for name in ("position", "velocity"):
        found = np.array([float(row[name]) for row in rows])
        expected = getattr(reference, name)
        assert np.abs(found - expected).max() < 1e-9 * np.ptp(expected)


@pytest.mark.process
def test_its_theory_is_that_of_the_law(with_package: Run) -> None:
    same = (
        "-p",
        "plant.friction.reverse.static=nan",
        "-p",
        "plant.friction.reverse.decay_speed=nan",
    )
    done = with_package("stability", "lubricated_drive.yaml", "--no-control", *same, "--json")
    assert done.returncode == 0, done.stderr
    # Friction falls by as much as the damper takes: c = N d/dw [0.2 / (1 + w^2/s^2) + 0.4 w].
    w = np.roots([1.0, 0.0, 2.0 * 0.02**2, -2.0 * 0.2 * 0.02**2 / 0.6, 0.02**4])
    speeds = sorted(w[(abs(w.imag) < 1e-12) & (w.real > 0.0)].real)
    assert json.loads(done.stdout)["open_loop"]["hopf_speeds"] == pytest.approx(speeds, rel=1e-9)
    both = json.loads(with_package("stability", "lubricated_drive.yaml", "--json").stdout)
    assert both["open_loop"]["hopf_speeds"] != pytest.approx(speeds, rel=1e-3)


@pytest.mark.process
@pytest.mark.parametrize(
    ("override", "refusal"),
    [
        (
            "plant.friction.kinetic=0.31",
            "friction.kinetic = 0.31 must not exceed friction.static = 0.3",
        ),
        (
            "plant.friction.reverse.static=0.05",
            "friction.kinetic = 0.1 must not exceed friction.reverse.static = 0.05",
        ),
        ("plant.friction.decay_speed=0.0", "decay_speed = 0.0 is refused: must be a finite number"),
        ("plant.friction.reverse.decay_speed=-1.0", "reverse.decay_speed = -1.0 is refused"),
    ],
)
def test_its_constants_are_checked(with_package: Run, override: str, refusal: str) -> None:
    done = with_package("simulate", "lubricated_drive.yaml", "-p", override)
    assert (done.returncode, done.stdout) == (2, "")
    assert refusal in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.process
def test_without_the_package_the_scenario_is_refused(stickslip: Run, installed: Path) -> None:
    done = stickslip("simulate", str(installed / "source/lubricated_drive.yaml"))
    assert (done.returncode, done.stdout) == (2, "")
    assert "friction.law = 'hess_soom' is refused: must be one of" in done.stderr
