"""The kinds of sweeps."""

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.studies.plan import Axis
from stickslip_ros.studies.study import sweep_study
from tests.studies.studies import free, paper

SPEED = Axis("plant.belt_speed", 0.2, 0.4, 3)
DAMPING = Axis("plant.damping", 0.01, 0.03, 3)
STATIC = Axis("plant.friction.static", 0.4, 0.5, 2)
GAIN = Axis("washout_controller.linear_gain", -2.0, 0.0, 6)


def test_what_is_no_sweep_is_refused() -> None:
    for axes, message in (
        ([], "^0 parameters: a sweep is over one or"),
        ([SPEED, DAMPING, STATIC], "^3 parameters: a sweep is over one or"),
        ([SPEED, GAIN], "without control there is no controller"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            sweep_study(free(), axes)


def test_values_that_change_nothing_are_refused() -> None:
    for scenario, text, reason in (
        (free(), "plant.friction.viscous=0:5:2", "by the law stribeck; laws that use it: coulomb"),
        (paper(), "plant.belt.amplitude=0:1:2", "by the kind none; kinds that use it: step"),
        (paper(), "plant.duration=1:5:2", "in this study"),
        (paper(), "plant.reply_timeout=1:5:2", "in this study"),
        (free(), "plant.rate=50:100:2", "in this study"),
        (free(), "plant.sensor.position_resolution=0:1e-06:2", "in this study"),
        (free(), "plant.force_delay=0:0.01:2", "in this study"),
        (free(), "plant.actuator.time_constant=0:0.01:2", "in this study"),
    ):
        name = text.partition("=")[0]
        with pytest.raises(InvalidInputError, match=f"^{text}: {name} is not used {reason}"):
            sweep_study(scenario, [Axis.parse(text)])


def test_values_that_change_something_at_some_point_are_taken() -> None:
    seeds = Axis("plant.force_jitter_seed", 0, 4, 2)
    assert sweep_study(paper(), [seeds, Axis("plant.force_jitter", 0.0, 1e-3, 2)]).plan.size == 4
    assert sweep_study(paper(), [Axis("plant.rate", 50.0, 100.0, 2)]).plan.size == 2
