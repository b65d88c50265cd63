"""An observer receives the forces of the simulation that is measured."""

from itertools import pairwise

import numpy as np
import pytest

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
