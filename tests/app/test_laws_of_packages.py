"""Commands with laws of other packages, those of examples/ among them."""

import csv
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.scenarios.foreign_laws import CONTROLLERS
from tests.app.conftest import Run, RunOfItsOwn
from tests.docs.page import CHECKOUT
from tests.motion.dop853 import Curve, Dop853Drive, none
from tests.scenarios.foreign_laws import BRAKE, FALLING, write_example, write_package

pytestmark = pytest.mark.process

BROKEN = "cannot be imported: ModuleNotFoundError: No module named 'no_such'\n"
LUBRICATED = "lubricated_drive.yaml"
RELAY = ("feed_drive", "--controller", "relay_brake")
STRENGTH = ("--controller", "brake", "-p", "brake_controller.strength=0.3")


@pytest.fixture
def with_packages(process_environment: dict[str, str], tmp_path: Path) -> Run:
    """Run a command in a process that finds packages with laws, two of which are broken."""
    write_package(tmp_path, "brake", {"brake": BRAKE}, {"brake": "brake:Brake"}, CONTROLLERS.group)
    write_package(tmp_path, "bad", {"bad": "import no_such"}, {"bad": "bad:Law"}, CONTROLLERS.group)
    write_package(tmp_path, "falling", {"falling": FALLING}, {"falling": "falling:Falling"})
    write_package(tmp_path, "broken", {"broken": "import no_such"}, {"broken": "broken:Law"})
    write_example(tmp_path, "own_control_law")
    write_example(tmp_path, "own_friction_law")
    shutil.copy(CHECKOUT / "examples/own_friction_law" / LUBRICATED, tmp_path)
    return RunOfItsOwn(tmp_path, process_environment)


@pytest.mark.long
def test_the_example_of_friction_can_be_installed(
    process_environment: dict[str, str], tmp_path: Path
) -> None:
    """That of control is installed by docs/how-to/write-a-control-law.md."""
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    here = ["--no-index", "--no-deps", "--no-build-isolation", "--target", str(tmp_path)]
    source = shutil.copytree(CHECKOUT / "examples/own_friction_law", tmp_path / "source")
    subprocess.run([*pip, *here, str(source)], check=True)
    found = RunOfItsOwn(tmp_path, process_environment).json("list")
    assert "hess_soom" in {law["name"] for law in found["friction_laws"]}


@pytest.mark.parametrize(
    ("own", "foreign"),
    [
        (
            "--no-control -p plant.friction.law=linear -p plant.friction.slope=0.3",
            "--no-control -p plant.friction.law=falling -p plant.friction.fall=0.3",
        ),
        (
            "--controller velocity_feedback -p velocity_feedback_controller.velocity_gain=-0.3",
            "--controller brake -p brake_controller.strength=0.3",
        ),
    ],
)
@pytest.mark.long
def test_a_law_of_another_package_is_simulated_like_one_of_this(
    with_packages: Run, stickslip: Run, own: str, foreign: str
) -> None:
    arguments = ("simulate", "paper", "--duration", "100")
    expected = stickslip.json(*arguments, *own.split())
    found = with_packages.json(*arguments, *foreign.split())
    provenance = {"scenario", "overrides", "versions"}
    assert {**found, **dict.fromkeys(provenance)} == {**expected, **dict.fromkeys(provenance)}


def test_the_list_has_the_laws_of_other_packages_and_says_which_are_refused(
    with_packages: Run,
) -> None:
    done = with_packages("list")
    assert done.returncode == 0
    lines = [" ".join(line.split()) for line in done.stdout.splitlines()]
    for law, parameters in (
        ("falling Friction that falls with speed.", "static, fall"),
        ("brake Force against the velocity.", "strength, force_limit, start_after"),
    ):
        assert lines[lines.index(law) + 1] == f"parameters: {parameters}"
    assert done.stderr == (
        f"friction law broken is refused: broken:Law of package broken {BROKEN}"
        f"control law bad is refused: bad:Law of package bad {BROKEN}"
    )
    refused = with_packages("simulate", "paper", "--controller", "bad")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr == (
        f"stickslip simulate: --controller: control law bad is refused: bad:Law of package bad "
        f"{BROKEN}"
    )


def test_a_control_law_of_another_package_is_shown_and_in_the_schema(with_packages: Run) -> None:
    row = with_packages.json("show", "paper", *STRENGTH)["parameters"]["brake_controller"]
    strength = row["strength"]
    assert (strength["value"], strength["source"], strength["unit"]) == (0.3, "override", "N s/m")
    assert '"brake_controller": {' in with_packages("schema").stdout


@pytest.mark.parametrize(
    "how", [["--composed"], pytest.param([], marks=pytest.mark.long)], ids=["composed", "processes"]
)
def test_a_control_law_of_another_package_runs_as_a_node(
    with_packages: Run, how: list[str]
) -> None:
    found = with_packages.json("run", "paper", *STRENGTH, "--duration", "5", *how)
    assert found["controller"] == "/feed_drive/brake_controller"
    assert found["report"]["peak_force"] > 0.0


@pytest.mark.long
def test_the_relay_brake_suppresses_the_vibration(with_packages: Run) -> None:
    force = "relay_brake_controller.braking_force"
    braked = with_packages.json("simulate", *RELAY, "--duration", "5")
    assert braked["regime"] == "equilibrium"
    swept = with_packages.json("sweep", *RELAY, "--over", f"{force}=0:120:3")
    assert swept["regime"] == ["stick_slip", "equilibrium", "equilibrium"]
    refused = with_packages("simulate", *RELAY, "--continuous-control")
    assert refused.returncode == 2
    assert (
        "--continuous-control: the control law relay_brake is defined for samples"
        in (refused.stderr.splitlines()[-1])
    )


def hess_soom(static: float, decay_speed: float) -> Curve:
    return lambda w: 0.1 + (static - 0.1) / (1.0 + (w / decay_speed) ** 2) + 0.4 * w


def test_a_lubricated_drive_moves_as_its_law_says(with_packages: Run, tmp_path: Path) -> None:
    start = ("-p", "plant.initial.position=1e-3", "-p", "plant.initial.velocity=-0.02")
    out = ("--duration", "1.3", "--out", "run.csv")  # s: 20 natural periods
    found = with_packages.json("simulate", LUBRICATED, "--no-control", *start, *out)
    assert found["regime"] == "stick_slip"
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


@pytest.mark.long
def test_its_theory_is_that_of_the_law(with_packages: Run) -> None:
    same = [f"-p=plant.friction.reverse.{name}=nan" for name in ("static", "decay_speed")]
    one = with_packages.json("stability", LUBRICATED, "--no-control", *same)
    # Friction falls by as much as the damper takes: c = N d/dw [0.2 / (1 + w^2/s^2) + 0.4 w].
    w = np.roots([1.0, 0.0, 2.0 * 0.02**2, -2.0 * 0.2 * 0.02**2 / 0.6, 0.02**4])
    speeds = sorted(w[(abs(w.imag) < 1e-12) & (w.real > 0.0)].real)
    assert one["open_loop"]["hopf_speeds"] == pytest.approx(speeds, rel=1e-9)
    both = with_packages.json("stability", LUBRICATED)
    assert both["open_loop"]["hopf_speeds"] != pytest.approx(speeds, rel=1e-3)


@pytest.mark.long
def test_its_constants_are_checked(with_packages: Run, stickslip: Run) -> None:
    for override, refusal in (
        ("reverse.static=0.05", "kinetic = 0.1 must not exceed friction.reverse.static = 0.05"),
        ("decay_speed=0.0", "decay_speed = 0.0 is invalid: must be a finite number"),
    ):
        done = with_packages("simulate", LUBRICATED, "-p", f"plant.friction.{override}")
        assert (done.returncode, done.stdout) == (2, "")
        assert refusal in done.stderr
        assert done.stderr.count("\n") == 1
    done = stickslip("simulate", LUBRICATED)  # without the package
    assert (done.returncode, done.stdout) == (2, "")
    assert "friction.law = 'hess_soom' is invalid: must be one of" in done.stderr
