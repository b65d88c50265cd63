"""How far belt speeds are from the Hopf speed."""

from dataclasses import replace

import pytest

from stickslip_ros.physics.model.courses import Sine
from stickslip_ros.physics.model.friction import Coulomb
from stickslip_ros.studies.hopf_distance import hopf_distance, hopf_ratio
from tests.physics.drives import FEED_DRIVE, PAPER


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_ratio_to_the_hopf_speed(direction: float) -> None:
    drive = replace(FEED_DRIVE, belt_speed=direction * 40.0)
    assert hopf_ratio(drive) == pytest.approx(40.0 / 0.048876, rel=1e-4)
    assert hopf_distance(drive) == (
        "40 m/s is 818.4 times the Hopf speed of 0.04888 m/s (belt speeds are in m/s)"
    )


def test_the_unit_drive_has_no_units() -> None:
    assert hopf_distance(PAPER) == "0.4 is 0.8184 times the Hopf speed of 0.4888"


@pytest.mark.parametrize(
    "change",
    [
        {"friction": Coulomb(0.4)},
        {"belt_speed": 0.0},
        {"stiffness": 0.0},  # not covered by the theory, like the next one
        {"load": Sine(amplitude=100.0)},
    ],
)
def test_without_a_hopf_speed_nothing_is_said(change: dict[str, object]) -> None:
    drive = replace(FEED_DRIVE, **change)
    assert hopf_ratio(drive) is None
    assert hopf_distance(drive) == ""
