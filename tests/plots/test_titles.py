"""Titles of figures."""

import pytest

from stickslip_ros.plots.titles import title_of
from stickslip_ros.scenarios.files import load_scenario

FREE = "plant.expects_control=false"


@pytest.mark.parametrize(
    ("overrides", "title"),
    [
        ([], "Simulated run, feed_drive, washout control"),
        ([FREE], "Simulated run, feed_drive, no control"),
        (["plant.damping=3.0"], "Simulated run, feed_drive plant.damping=3.0, washout control"),
        (
            ["plant.damping=3.0", FREE, "plant.damping=4.0"],
            "Simulated run, feed_drive plant.damping=4.0, no control",
        ),
    ],
)
def test_a_title_names_what_is_shown_the_drive_and_the_control(
    overrides: list[str], title: str
) -> None:
    assert title_of("Simulated run", load_scenario("feed_drive", overrides)) == title


def test_what_varies_in_the_figure_is_not_in_the_title() -> None:
    scenario = load_scenario("feed_drive", ["plant.belt_speed=0.03", "plant.damping=3.0", FREE])
    title = title_of("Bifurcation diagram", scenario, ["plant.belt_speed"])
    assert title == "Bifurcation diagram, feed_drive plant.damping=3.0, no control"
