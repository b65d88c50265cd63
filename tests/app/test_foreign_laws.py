"""Commands with friction laws of other packages, installed where the path finds them."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.app.conftest import Run
from tests.nodes.graph import PATIENCE
from tests.scenarios.foreign_laws import FALLING, write_package


@pytest.fixture
def with_packages(process_environment: dict[str, str], tmp_path: Path) -> Run:
    """Run a command in a process that finds a package with a law, and one that is broken."""
    write_package(tmp_path, "falling", {"falling": FALLING}, {"falling": "falling:Falling"})
    write_package(tmp_path, "broken", {"broken": "import no_such"}, {"broken": "broken:Law"})
    path = os.pathsep.join([str(tmp_path), process_environment.get("PYTHONPATH", "")])

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "stickslip_ros.app.main", *arguments],
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
    )
