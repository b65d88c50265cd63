from math import pi

import pytest

from tests.physics.drives import FEED_DRIVE, PAPER


def test_the_scales_of_the_paper_are_one() -> None:
    assert PAPER.angular_frequency == PAPER.length_scale == PAPER.speed_scale == 1.0
    assert PAPER.damping_coefficient == 0.02
    assert PAPER.natural_period == 2.0 * pi


def test_scales_of_a_feed_drive() -> None:
    assert FEED_DRIVE.angular_frequency == pytest.approx(100.0)  # sqrt(1e6 / 100)
    assert FEED_DRIVE.natural_period == pytest.approx(2.0 * pi / 100.0)
    assert FEED_DRIVE.length_scale == pytest.approx(1e-3)  # 1000 / 1e6
    assert FEED_DRIVE.speed_scale == pytest.approx(0.1)  # 1000 / sqrt(1e6 * 100)
    assert FEED_DRIVE.damping_coefficient == pytest.approx(0.02)  # 200 / sqrt(1e6 * 100)
