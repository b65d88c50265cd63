from dataclasses import replace
from math import pi

import numpy as np
import pytest

from stickslip_ros.physics.measures.breakpoints import Breakpoints, breakpoints_from_samples
from stickslip_ros.physics.measures.cycle_measures import CycleMeter, Measures
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.motion import RecordedMotion
from tests.physics.drives import LIMIT_CYCLES, PAPER

CYCLES = 15


def breakpoints_both_ways(drive: Drive, per_cycle: int) -> tuple[Breakpoints, Breakpoints]:
    """The breakpoints of some natural periods: the motion's own, and those from its samples."""
    motion = RecordedMotion(drive, 0.0, 0.0)
    motion.advance(200.0 * drive.natural_period)
    motion.take_breakpoints()
    step = drive.natural_period / per_cycle
    rows = [(motion.position, motion.velocity)]
    for _ in range(CYCLES * per_cycle):
        motion.advance(step)
        rows.append((motion.position, motion.velocity))
    position, velocity = np.array(rows).T
    belt = np.full(len(rows), drive.belt_speed)
    time = step * np.arange(len(rows))
    return motion.take_breakpoints(), breakpoints_from_samples(time, position, velocity, belt)


def measured(breakpoints: Breakpoints, belt_speed: float) -> Measures:
    meter = CycleMeter(window=CYCLES)
    meter.feed(breakpoints, belt_speed)
    return meter.measures()


@pytest.mark.parametrize("belt_speed", [cycle.belt_speed for cycle in LIMIT_CYCLES] + [-0.3])
@pytest.mark.parametrize(
    ("per_cycle", "error", "stick_error"), [(600, 1e-8, 1e-5), (100, 1e-6, 1e-4)]
)
def test_samples_measure_what_the_motion_itself_measures(
    belt_speed: float, per_cycle: int, error: float, stick_error: float
) -> None:
    own, sampled = breakpoints_both_ways(replace(PAPER, belt_speed=belt_speed), per_cycle)
    expected, measures = measured(own, belt_speed), measured(sampled, belt_speed)
    assert measures.cycles == expected.cycles >= CYCLES - 3
    assert measures.regime is expected.regime
    assert measures.amplitude == pytest.approx(expected.amplitude, rel=error)
    assert measures.velocity_amplitude == pytest.approx(expected.velocity_amplitude, rel=error)
    assert measures.midpoint == pytest.approx(expected.midpoint, rel=error)
    assert measures.period == pytest.approx(expected.period, rel=error)
    assert measures.frequency == pytest.approx(expected.frequency, rel=error)
    assert measures.stick_fraction == pytest.approx(expected.stick_fraction, abs=stick_error)


def test_coarse_samples_of_a_sine_give_its_turning_points() -> None:
    time = np.linspace(0.05, 4.0 * pi, 50)  # 25 a cycle
    breakpoints = breakpoints_from_samples(time, np.sin(time), np.cos(time), np.full(50, 2.0))
    turning = breakpoints[breakpoints.velocity == 0.0]
    assert turning.time == pytest.approx([pi / 2, 3 * pi / 2, 5 * pi / 2, 7 * pi / 2], abs=1e-3)
    assert turning.position == pytest.approx([1.0, -1.0, 1.0, -1.0], abs=1e-4)
    assert breakpoints.velocity.max() == pytest.approx(1.0, abs=1e-4)
    assert set(time) <= set(breakpoints.time)
    assert np.all(np.diff(breakpoints.time) >= 0.0)
    assert not breakpoints.sticking.any()


def test_samples_on_the_belt_stick() -> None:
    """The slide rides the belt from the second to the fourth of five samples."""
    velocity = np.array([0.1, 0.5, 0.5, 0.5, 0.3])
    position = np.array([0.0, 0.35, 0.85, 1.35, 1.75])
    breakpoints = breakpoints_from_samples(np.arange(5.0), position, velocity, np.full(5, 0.5))
    stuck = breakpoints[breakpoints.sticking]
    assert set(stuck.time) >= {1.0, 2.0, 3.0}
    assert np.all(stuck.velocity == 0.5)
    # In the first interval it falls 0.15 short of the belt: 0.4 s / 2 at relative speed, 0.75 s
    # of slip; in the last one 0.1: 0.2 s' / 3, more than there is time, so it left at once.
    landed, left = stuck.time[0] - 0.25, stuck.time[-1]
    assert landed == pytest.approx(0.75)
    assert left == pytest.approx(3.0)


def test_a_pair_of_equal_stamps_does_no_harm() -> None:
    time = np.array([0.0, 1.0, 1.0, 2.0])
    breakpoints = breakpoints_from_samples(time, np.sin(time), np.cos(time), np.full(4, 2.0))
    assert np.isfinite(breakpoints.time).all()
    assert np.isfinite(breakpoints.position).all()
    assert np.isfinite(breakpoints.velocity).all()
