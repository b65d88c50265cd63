"""`--controller` of the commands that run a control law: its name, and refusals."""

from pathlib import Path

import pytest

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
        found = stickslip.json("simulate", two, "--base", "paper", "--duration", "50", *arguments)
        assert found["scenario"]["velocity_feedback_controller"]["law"] == "velocity_feedback"
        return found["amplitude"]

    gain = ("-p", "velocity_feedback_controller.velocity_gain=0.0")
    assert amplitude(*VELOCITY) < 0.05 < 0.1 < amplitude(*VELOCITY, *gain)


@pytest.mark.process
@pytest.mark.parametrize("how", [["--composed"], pytest.param([], marks=pytest.mark.long)])
def test_the_law_runs_as_a_node(stickslip: Run, two: str, how: list[str]) -> None:
    found = stickslip.json("run", two, "--base", "paper", *VELOCITY, "--duration", "5", *how)
    assert found["controller"] == "/feed_drive/velocity_feedback_controller"
    assert found["controller_command"] is None
    assert found["scenario"]["velocity_feedback_controller"]["velocity_gain"] == -0.5
