"""Commands with laws of other packages, installed where the path finds them."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from stickslip_ros.scenarios.foreign_laws import CONTROLLERS
from tests.app.conftest import Run
from tests.nodes.graph import PATIENCE
from tests.scenarios.foreign_laws import BRAKE, FALLING, write_package


@pytest.fixture
def with_packages(process_environment: dict[str, str], tmp_path: Path) -> Run:
    """Run a command in a process that finds a package with a law, and one that is broken."""
    group = CONTROLLERS.group
    write_package(tmp_path, "brake", {"brake": BRAKE}, {"brake": "brake:Brake"}, group)
    write_package(tmp_path, "bad", {"bad": "import no_such"}, {"bad": "bad:Law"}, group)
    write_package(tmp_path, "falling", {"falling": FALLING}, {"falling": "falling:Falling"})
    write_package(tmp_path, "broken", {"broken": "import no_such"}, {"broken": "broken:Law"})
    path = os.pathsep.join([str(tmp_path), process_environment.get("PYTHONPATH", "")])

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "stickslip_ros.app.main", *arguments],
            cwd=tmp_path,
            env=process_environment | {"PYTHONPATH": path.rstrip(os.pathsep)},
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )

    return run


@pytest.mark.process
def test_a_law_of_another_package_is_simulated_like_one_of_this(
    with_packages: Run, stickslip: Run
) -> None:
    arguments = ("simulate", "paper", "--no-control", "--duration", "200", "--json")
    own = ("-p", "plant.friction.law=linear", "-p", "plant.friction.slope=0.3")
    foreign = ("-p", "plant.friction.law=falling", "-p", "plant.friction.fall=0.3")
    expected = json.loads(stickslip(*arguments, *own).stdout)
    done = with_packages(*arguments, *foreign)
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    assert found["amplitude"] > 0.1
    measures = expected.keys() - {"scenario", "overrides", "versions"}
    assert {key: found[key] for key in measures} == {key: expected[key] for key in measures}


@pytest.mark.process
def test_the_list_has_the_laws_of_other_packages_and_says_which_are_refused(
    with_packages: Run,
) -> None:
    done = with_packages("list")
    assert done.returncode == 0
    lines = [" ".join(line.split()) for line in done.stdout.splitlines()]
    place = lines.index("falling Friction that falls with speed.")
    assert lines[place + 1] == "parameters: static, fall"
    assert done.stderr == (
        "friction law broken is refused: broken:Law of package broken cannot be imported: "
        "ModuleNotFoundError: No module named 'no_such'\n"
        "control law bad is refused: bad:Law of package bad cannot be imported: "
        "ModuleNotFoundError: No module named 'no_such'\n"
    )
    assert lines[lines.index("brake Force against the velocity.") + 1] == (
        "parameters: strength, force_limit, start_after"
    )


STRENGTH = ("--controller", "brake", "-p", "brake_controller.strength=0.3")


@pytest.mark.process
def test_a_control_law_of_another_package_is_like_one_of_this(
    with_packages: Run, stickslip: Run
) -> None:
    own = ("--controller", "velocity_feedback", "-p")
    arguments = ("simulate", "paper", "--duration", "100", "--json")
    expected = json.loads(
        stickslip(*arguments, *own, "velocity_feedback_controller.velocity_gain=-0.3").stdout
    )
    found = json.loads(with_packages(*arguments, *STRENGTH).stdout)
    measures = expected.keys() - {"scenario", "overrides", "versions"}
    assert {key: found[key] for key in measures} == {key: expected[key] for key in measures}


@pytest.mark.process
def test_a_control_law_of_another_package_is_swept_shown_and_in_the_schema(
    with_packages: Run,
) -> None:
    swept = with_packages(
        *("sweep", "paper", "--controller", "brake", "--json"),
        *("--over", "brake_controller.strength=0.2:0.4:2", "--transient", "20"),
    )
    assert swept.returncode == 0, swept.stderr
    assert "brake_controller.strength" in swept.stdout
    shown = json.loads(with_packages("show", "paper", *STRENGTH, "--json").stdout)
    row = shown["parameters"]["brake_controller"]["strength"]
    assert (row["value"], row["source"], row["unit"]) == (0.3, "override", "N s/m")
    assert "brake_controller" in json.loads(with_packages("schema").stdout)["definitions"]


@pytest.mark.process
def test_a_refused_control_law_gives_its_reason(with_packages: Run) -> None:
    done = with_packages("simulate", "paper", "--controller", "bad")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "stickslip simulate: --controller: control law bad is refused: bad:Law of package bad "
        "cannot be imported: ModuleNotFoundError: No module named 'no_such'\n"
    )


@pytest.mark.process
@pytest.mark.parametrize("how", [["--composed"], []], ids=["composed", "processes"])
def test_a_control_law_of_another_package_runs_as_a_node(
    with_packages: Run, how: list[str]
) -> None:
    done = with_packages("run", "paper", *STRENGTH, "--duration", "5", "--json", *how)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["controller"] == "/feed_drive/brake_controller"
    assert found["report"]["peak_force"] > 0.0
