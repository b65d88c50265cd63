"""The task of a design, and the scenario of its proposal."""

from math import inf
from pathlib import Path

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.control import Washout
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.design import Design, Task
from tests.scenarios.files import scenario_file

WASHOUT = Washout(3.0, -2.0, 0.0)


def test_of_a_scenario_it_is_that_scenario_with_the_gains(tmp_path: Path) -> None:
    for number, (belt_speed, belt_speeds, expected) in enumerate(
        ((0.04, None, 0.04), (-0.04, None, -0.04), (0.04, (0.01, 0.03), 0.03),
         (-0.04, (0.05, 0.06), -0.05))
    ):  # fmt: skip
        overrides = (f"plant.belt_speed={belt_speed}", "plant.mass=90", "analyzer.window=7")
        scenario = load_scenario("feed_drive", overrides)
        text = Design(Task.from_scenario(scenario, belt_speeds), WASHOUT).parameter_file or ""
        (folder := tmp_path / str(number)).mkdir()
        read = load_scenario(scenario_file(folder, text))
        assert (read.plant.mass, read.plant.stiffness, read.analyzer.window) == (90.0, 1e6, 7)
        assert read.plant.belt_speed == expected
        assert read.controller.control_law == WASHOUT
        names = {name for name, value in scenario.as_dict()["plant"].items() if value != []}
        assert all(f'"{name}":' in text for name in names)


def test_the_range_of_belt_speeds() -> None:
    scenario = load_scenario("feed_drive")
    with pytest.raises(InvalidInputError, match="2 m/s to 1 m/s: the lower must be first"):
        Task.from_scenario(scenario, (2.0, 1.0))
    for belt_speeds in ((0.0, 1.0), (-1.0, 1.0), (0.1, inf)):
        with pytest.raises(InvalidInputError, match="must be above 0, at most"):
            Task.from_scenario(scenario, belt_speeds)
    with pytest.raises(InvalidInputError, match="must be given"):
        Task.from_scenario(scenario.overridden(["plant.belt_speed=0"]))
    with pytest.raises(InvalidInputError, match="gains are for a moving belt"):
        Task.from_scenario(load_scenario("axis", controller="pid"))
    for speed in (0.04, -0.04):
        about = scenario.overridden([f"plant.belt_speed={speed}"])
        assert Task.from_scenario(about).belt_speeds == pytest.approx((0.036, 0.044))
