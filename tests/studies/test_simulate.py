"""What an observer receives of a simulation, and what rounding leaves of a motion."""

from itertools import pairwise

import numpy as np
import pytest

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.show.run_history import RunHistory
from stickslip_ros.studies.simulate import simulate


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


@pytest.mark.parametrize("law", ["dahl", "lugre"])
@pytest.mark.parametrize("expects_control", ["false", "true"])
def test_what_rounding_leaves_of_a_motion_is_no_vibration(law: str, expects_control: str) -> None:
    """On a belt at rest, a friction force with a memory moves a slide at rest by some 1e-20 m."""
    names = {"belt_speed": "0.0", "friction.law": law, "expects_control": expects_control}
    overrides = [f"plant.{name}={value}" for name, value in names.items()]
    measures = simulate(load_scenario("feed_drive", overrides), 6.0)
    assert (measures.regime, measures.steady) == (Regime.STUCK, True)
