"""An observer receives the forces of the simulation that is measured, and does not change it."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from stickslip_ros.measures.cycle_measures import Measures, Regime
from stickslip_ros.motion.trajectory import TrajectoryRecorder
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.show.run_history import RunHistory
from stickslip_ros.studies.simulate import simulate
from tests.studies.studies import free, paper


@pytest.mark.parametrize("continuous", [False, True])
def test_forces_and_friction_are_seen_with_the_motion(continuous: bool) -> None:
    scenario = load_scenario("paper", ["plant.rate=10.0", "washout_controller.start_after=5.0"])
    seen = RunHistory()
    simulate(scenario, 20.0, continuous=continuous, observer=seen)
    (time, force), (end, friction) = seen.control.columns(), seen.friction.columns()
    assert len(seen.dropped.columns()[0]) == 0
    step = scenario.plant.as_drive().natural_period / 60.0
    assert all(0.0 < later - earlier <= step * 1.001 for earlier, later in pairwise(time))
    assert end == pytest.approx(np.append(time[1:], 20.0))
    assert not force[time < 4.99].any()
    assert force[time > 5.01].any()
    assert np.abs(friction).max() <= scenario.plant.as_drive().friction.static + 1e-12


@pytest.mark.parametrize("belt_speed", [0.4, 2.0])
@pytest.mark.parametrize("continuous", [False, True])
def test_a_slide_that_settles_slowly_is_measured_the_same_when_it_is_drawn(
    continuous: bool, belt_speed: float
) -> None:
    """Overdamped, it never turns: what counts is the motion since a breakpoint."""
    slow = "plant.damping=30.0", "plant.rate=2.0", f"plant.belt_speed={belt_speed}"
    scenario = paper(*slow) if continuous else free(*slow)

    def measured(**seen: Any) -> Measures:
        return simulate(scenario, 300.0, continuous=continuous, **seen)

    alone = measured()
    assert alone.regime is Regime.EQUILIBRIUM
    others = {"observer": RunHistory()}, {"recorder": TrajectoryRecorder(scenario.plant.rate)}
    for other in (*others, others[0] | others[1]):
        found = measured(**other)
        assert (found.regime, found.steady) == (alone.regime, alone.steady)
        for name in ("amplitude", "velocity_amplitude", "midpoint"):
            assert getattr(found, name) == pytest.approx(getattr(alone, name), rel=1e-9)


@pytest.mark.parametrize("law", ["dahl", "lugre"])
@pytest.mark.parametrize("expects_control", ["false", "true"])
def test_what_rounding_leaves_of_a_motion_is_no_vibration(law: str, expects_control: str) -> None:
    """On a belt at rest, a friction force with a memory moves a slide at rest by some 1e-20 m."""
    names = {"belt_speed": "0.0", "friction.law": law, "expects_control": expects_control}
    overrides = [f"plant.{name}={value}" for name, value in names.items()]
    measures = simulate(load_scenario("feed_drive", overrides), 6.0)
    assert (measures.regime, measures.steady) == (Regime.STUCK, True)
