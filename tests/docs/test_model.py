"""docs/model.md: its drawing is that of the script, and the parameters on it exist."""

import re
import runpy

import pytest

from stickslip_ros.scenarios.parameter_field import known_parameters
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from tests.docs.page import CHECKOUT

PAGE = (CHECKOUT / "docs/model.md").read_text(encoding="utf-8")
PARAMETERS = sorted(set(re.findall(r"`(plant|washout_controller)\.([\w.]+)`", PAGE)))


def test_the_drawing_is_that_of_the_script() -> None:
    script = runpy.run_path(str(CHECKOUT / "docs/model_drawing.py"))
    assert (CHECKOUT / "docs/model.svg").read_text(encoding="utf-8") == script["drawing"]()


@pytest.mark.parametrize(("node", "name"), PARAMETERS)
def test_a_parameter_of_the_table_exists(node: str, name: str) -> None:
    assert name in known_parameters(NODE_PARAMETERS[node])


def test_every_number_of_the_drive_and_its_controller_is_in_the_table() -> None:
    drive = {"mass", "damping", "stiffness", "normal_force", "belt_speed"}
    assert {("plant", name) for name in drive} <= set(PARAMETERS)
    gains = {"corner_frequency", "linear_gain", "cubic_gain"}
    assert {("washout_controller", name) for name in gains} <= set(PARAMETERS)
