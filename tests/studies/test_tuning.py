"""Gains by the rule: they meet the goal, and none near them do it and damp faster."""

from dataclasses import replace

import numpy as np
import pytest

from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.studies.case_outcome import Disturbance
from stickslip_ros.studies.drive_loops import DriveLoops, Tuned
from stickslip_ros.studies.goal import Goal
from stickslip_ros.studies.tuning import Tuning
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop

FEEDS = (0.01, 0.04)


def scenario(**values: float) -> Scenario:
    found = load_scenario("feed_drive", ["plant.sensor.position_resolution=2e-7"])
    return found.changed({"plant.sensor.velocity": "difference", "plant.rate": 2000.0, **values})


def goal() -> Goal:
    return Goal.from_scenario(scenario(), FEEDS, [Disturbance("step", 40.0)], force_limit=600.0)


def tune(drive: Scenario, law: str, goal: Goal) -> Tuned:
    return Tuning(DriveLoops(drive, law, goal)).best()


@pytest.mark.parametrize(
    "law",
    [
        "velocity_feedback",
        *(
            pytest.param(law, marks=pytest.mark.long)
            for law in ("washout", "pid", "disturbance_observer", "cascade")
        ),
    ],
)
def test_the_gains_meet_the_goal_and_others_near_them_damp_no_faster(law: str) -> None:
    found = tune(scenario(), law, goal())
    assert found.remark is None
    assert found.delay_margin is None or found.delay_margin >= goal().delay_margin
    assert found.peak_force <= 600.0
    plant = scenario().plant
    loops = [
        LinearSampledLoop.from_drive(
            replace(plant.as_drive(), belt_speed=feed), plant.rate, 0.0, plant.sensor
        )
        for feed in FEEDS
    ]
    rates = [loop.decay_rate(found.law) for loop in loops if loop is not None]
    assert found.decay_rate == pytest.approx(min(rates), rel=1e-9)
    assert found.decay_rate > 0.0
    rng = np.random.default_rng(0)
    for _ in range(10):
        gains = {name: getattr(found.law, name) for name in found.law.tuned}
        other = {name: value * rng.uniform(0.9, 1.1) for name, value in gains.items()}
        fixed = replace(found.law, **other)
        faster = min(loop.decay_rate(fixed) for loop in loops if loop is not None)
        if faster > 1.15 * found.decay_rate:
            pytest.fail(f"{other} damps with {faster}, not {found.decay_rate}")


def test_a_slower_controller_is_tuned_as_at_its_rate() -> None:
    slow = {"plant.rate": 500.0}, {"plant.answer_every": 4, "plant.sensor.difference_samples": 4}
    drives = [scenario(**values) for values in slow]
    impulse = Disturbance("impulse", 400.0), Disturbance("impulse", 1600.0)
    goals = [
        Goal.from_scenario(drive, FEEDS, [push], 600.0)
        for drive, push in zip(drives, impulse, strict=True)
    ]
    assert goals[0] == goals[1]
    tunings = [DriveLoops(drive, "velocity_feedback", goals[0]) for drive in drives]
    for one, other in zip(*(tuning.plants for tuning in tunings), strict=True):
        assert np.array_equal(one.frequency, other.frequency)
        assert np.array_equal(one.by_control, other.by_control)


@pytest.mark.long
def test_a_law_that_is_not_linear_gets_the_gains_of_its_linear_part() -> None:
    pid, reset = (tune(scenario(), law, goal()) for law in ("pid", "reset_integral"))
    for name in pid.law.tuned:
        assert getattr(pid.law, name) == getattr(reset.law, name)
