"""Belt speeds at which a loop is stable; test_stability_figure has the maps over the gains."""

from dataclasses import replace

import pytest

from stickslip_ros.model.signals import sine
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.theory.hopf import hopf_points
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.theory.stability_map import stable_feeds
from tests.drives import FEED_DRIVE


def test_the_feeds_that_hold_end_where_a_vibration_starts() -> None:
    (hopf,) = hopf_points(FEED_DRIVE)
    scenario = load_scenario("feed_drive")
    law, sampling = scenario.controller.control_law, scenario.plant.linear_sampling
    ranges = stable_feeds(FEED_DRIVE, None, sampling)
    assert ranges is not None
    ((first, last),) = ranges
    assert first == pytest.approx(hopf.belt_speed, rel=1e-3)
    assert last == pytest.approx(0.4)
    ranges = stable_feeds(FEED_DRIVE, law, sampling)
    assert ranges is not None
    ((first, _),) = ranges
    for speed, stable in ((first * 1.001, True), (first * 0.999, False)):
        moved = replace(FEED_DRIVE, belt_speed=speed)
        loop = LinearSampledLoop.from_drive(moved, *sampling)
        assert loop is not None
        assert (loop.spectral_radius(law) < 1.0) is stable
    for drive in (
        replace(FEED_DRIVE, belt_speed=0.0),
        replace(FEED_DRIVE, belt=sine(amplitude=0.01)),
    ):
        assert stable_feeds(drive, None, sampling) is None
