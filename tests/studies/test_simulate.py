"""An observer receives the forces of the simulation that is measured."""

from itertools import pairwise

import numpy as np
import pytest

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.measures.sample_meter import MeasuredMotion
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.simulate import simulate


class Seen:
    """Keeps the forces that an observer is shown."""

    def __init__(self) -> None:
        self.friction: list[tuple[FloatArray, FloatArray]] = []
        self.control: list[tuple[FloatArray, FloatArray]] = []

    def take_motion(self, motion: MeasuredMotion) -> None:
        """It is that of a run without an observer: `stickslip simulate --plot` is tested for it."""

    def take_friction(self, time: FloatArray, force: FloatArray) -> None:
        self.friction.append((time, force))

    def take_control(self, time: FloatArray, force: FloatArray, acted: BoolArray) -> None:
        assert acted.all()
        self.control.append((time, force))


@pytest.mark.parametrize("continuous", [False, True])
def test_forces_and_friction_are_seen_with_the_motion(continuous: bool) -> None:
    scenario = load_scenario("paper", ["plant.rate=10.0", "washout_controller.start_after=5.0"])
    seen = Seen()
    simulate(scenario, 20.0, continuous=continuous, observer=seen)
    time, force = (np.concatenate(columns) for columns in zip(*seen.control, strict=True))
    end, friction = (np.concatenate(columns) for columns in zip(*seen.friction, strict=True))
    step = scenario.plant.as_drive().natural_period / 60.0
    assert all(0.0 < later - earlier <= step * 1.001 for earlier, later in pairwise(time))
    assert end == pytest.approx(np.append(time[1:], 20.0))
    assert not force[time < 4.99].any()
    assert force[time > 5.01].any()
    assert np.abs(friction).max() <= scenario.plant.as_drive().friction.static + 1e-12
