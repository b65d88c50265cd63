"""An observer receives exactly the simulation that is measured."""

from itertools import pairwise

import numpy as np
import pytest

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.physics.measures.sample_meter import MeasuredMotion
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.simulate import simulate


class Seen:
    """Keeps all that an observer is shown."""

    def __init__(self) -> None:
        self.motion: list[MeasuredMotion] = []
        self.friction: list[tuple[FloatArray, FloatArray]] = []
        self.control: list[tuple[FloatArray, FloatArray]] = []

    def take_motion(self, motion: MeasuredMotion) -> None:
        self.motion.append(motion)

    def take_friction(self, time: FloatArray, force: FloatArray) -> None:
        self.friction.append((time, force))

    def take_control(self, time: FloatArray, force: FloatArray, acted: BoolArray) -> None:
        assert acted.all()
        self.control.append((time, force))


@pytest.mark.parametrize(("name", "duration"), [("paper", 100.0), ("feed_drive", 2.0)])
def test_an_observer_changes_no_measure_and_sees_every_cycle_end(
    name: str, duration: float
) -> None:
    scenario = load_scenario(name, ["plant.expects_control=false"])
    seen = Seen()
    measures = simulate(scenario, duration, observer=seen)
    assert measures == simulate(scenario, duration)
    cycles = [cycle for motion in seen.motion for cycle in motion.cycles]
    ends = [end for motion in seen.motion for end in motion.cycle_ends]
    assert len(ends) == len(cycles) > 10
    assert np.diff(ends) == pytest.approx([cycle.period for cycle in cycles[1:]], rel=1e-12)


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
