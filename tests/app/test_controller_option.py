"""`--controller` of the commands that run a control law: its name, and refusals."""

import json
from pathlib import Path

import pytest

from stickslip_ros.physics.model.control import CONTROL_LAWS
from stickslip_ros.scenarios.files import load_scenario
from tests.app.conftest import Run

TWO = "/**/washout_controller: {ros__parameters: {linear_gain: -2.0}}\n" + (
    "/**/velocity_feedback_controller: {ros__parameters: {velocity_gain: -0.5}}\n"
)
VELOCITY = ("--controller", "velocity_feedback")


@pytest.fixture
def two(tmp_path: Path) -> str:
    """Write a scenario file with sections for two controllers."""
    (tmp_path / "two.yaml").write_text(TWO)
    return "two.yaml"


def test_the_law_is_simulated(stickslip: Run, two: str) -> None:
    def amplitude(*arguments: str) -> float:
        done = stickslip(
            "simulate", two, "--base", "paper", "--duration", "50", "--json", *arguments
        )
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        assert found["scenario"]["velocity_feedback_controller"]["law"] == "velocity_feedback"
        return found["amplitude"]

    gain = ("-p", "velocity_feedback_controller.velocity_gain=0.0")
    assert amplitude(*VELOCITY) < 0.05 < 0.1 < amplitude(*VELOCITY, *gain)


@pytest.mark.parametrize(
    "command",
    [
        ("show",),
        ("simulate", "--duration", "1"),
        ("stability",),
        ("sweep", "--over", "plant.belt_speed=0.2:0.3:2"),
        ("basin", "--sample", "2", "--position=0:1", "--velocity=0:1"),
        ("run", "--duration", "1"),
    ],
    ids=lambda command: command[0],
)
def test_of_several_controllers_the_option_names_one(
    stickslip: Run, two: str, command: tuple[str, ...]
) -> None:
    name, *further = command
    done = stickslip(name, two, *further)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"stickslip {name}: two.yaml: has sections for the controllers washout_controller and "
        "velocity_feedback_controller: name the control law to use, by --controller NAME\n"
    )


def test_without_control_no_controller_has_to_be_named(stickslip: Run, two: str) -> None:
    assert stickslip("simulate", two, "--no-control", "--duration", "1").returncode == 0


def test_show_has_the_controller_in_use(stickslip: Run, two: str) -> None:
    shown = json.loads(stickslip("show", two, *VELOCITY, "--json").stdout)["parameters"]
    assert list(shown) == ["plant", "velocity_feedback_controller", "analyzer"]
    gain = shown["velocity_feedback_controller"]["velocity_gain"]
    assert (gain["value"], gain["source"], gain["unit"]) == (-0.5, "file", "N s/m")
    lines = [line.split() for line in stickslip("show", two, *VELOCITY).stdout.splitlines()]
    assert ["velocity_gain", "-0.5", "file"] in lines  # dimensionless


def test_new_writes_the_section_of_the_law(stickslip: Run, tmp_path: Path) -> None:
    assert stickslip("new", "mine.yaml", "--from", "paper", *VELOCITY).returncode == 0
    mine = load_scenario(str(tmp_path / "mine.yaml"))
    assert mine.as_dict() == load_scenario("paper", controller="velocity_feedback").as_dict()


def test_list_has_every_control_law(stickslip: Run) -> None:
    found = json.loads(stickslip("list", "--json").stdout)["control_laws"]
    assert [law["name"] for law in found] == list(CONTROL_LAWS)
    assert found[0]["parameters"][0] == "washout_controller.corner_frequency"
    assert found[1]["description"].startswith("Force proportional to velocity and displacement")


@pytest.mark.parametrize(
    ("command", "given", "reason"),
    [
        ("simulate", "velocity_fedback", "--controller: unknown control law velocity_fedback; did"),
        ("run", "velocity_fedback", "--controller: unknown control law velocity_fedback; did you"),
        ("show", "my/damper", "--controller: my/damper is refused: must be the name of a control"),
        ("simulate", "damper.py", "--controller: damper.py is refused: must be the name of a"),
    ],
)
def test_what_is_no_law_is_refused(stickslip: Run, command: str, given: str, reason: str) -> None:
    done = stickslip(command, "paper", "--controller", given)
    assert (done.returncode, done.stdout) == (2, "")
    assert reason in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_law_takes_no_arguments(stickslip: Run) -> None:
    done = stickslip("run", "paper", *VELOCITY, "--", "--ros-args")
    assert done.returncode == 2
    assert done.stderr == (
        "stickslip run: -- --ros-args: arguments after -- are for a script or executable of "
        "--controller, and velocity_feedback is a control law\n"
    )


@pytest.mark.process
@pytest.mark.parametrize("how", [["--composed"], []], ids=["composed", "processes"])
def test_the_law_runs_as_a_node(stickslip: Run, two: str, how: list[str]) -> None:
    arguments = (two, "--base", "paper", *VELOCITY, "--duration", "5", "--json", *how)
    done = stickslip("run", *arguments)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["controller"] == "/feed_drive/velocity_feedback_controller"
    assert found["controller_command"] is None
    assert found["scenario"]["velocity_feedback_controller"]["velocity_gain"] == -0.5
