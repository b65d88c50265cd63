"""Phase portraits against closed forms, reference limit cycles and critical gains."""

from dataclasses import replace
from math import log

import numpy as np
import pytest

from stickslip_ros.paper.portraits import SETTLED, Portrait, PortraitCase, portraits
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.physics.model.control import Washout
from stickslip_ros.physics.model.friction import Coulomb, Linear
from stickslip_ros.physics.motion.motion import Motion
from tests.physics.drives import LIMIT_CYCLES, PAPER, LimitCycle

DECAY = 0.05
"""Beta of a slide that only slips under Coulomb friction: the belt is faster than it ever gets."""

DECAYING = PortraitCase(
    "decays", replace(PAPER, damping=2 * DECAY, belt_speed=0.6, friction=Coulomb(0.4))
)
RUNS_AWAY = PortraitCase("runs away", replace(PAPER, belt_speed=0.2, friction=Linear(0.4, 0.9)))


def portrait(case: PortraitCase) -> Portrait:
    (only,) = portraits([case])
    return only


def test_trajectory_of_a_decaying_vibration() -> None:
    found = portrait(DECAYING)
    time = found.trajectory.time
    frequency = np.sqrt(1.0 - DECAY**2)
    fading = 0.4 * np.exp(-DECAY * time)
    position = 0.4 - fading * (
        np.cos(frequency * time) + DECAY / frequency * np.sin(frequency * time)
    )
    velocity = fading / frequency * np.sin(frequency * time)
    assert time[0] == 0.0
    assert time[-1] == pytest.approx(600.0 * np.pi)
    assert np.diff(time).max() < 0.11
    assert found.trajectory.position == pytest.approx(position, abs=1e-9)
    assert found.trajectory.velocity == pytest.approx(velocity, abs=1e-9)
    assert found.drive.equilibrium_position == pytest.approx(0.4)
    assert found.measures.regime is Regime.EQUILIBRIUM
    assert found.least_relative_speed == pytest.approx(0.6)


def test_settling_time_of_a_decaying_vibration() -> None:
    found = portrait(DECAYING)
    # The speed fades as 0.4 exp(-beta t) from cycle to cycle.
    expected = log(0.4 / (SETTLED * 0.6)) / DECAY
    assert found.settling_time == pytest.approx(expected, abs=2.0 * np.pi)


@pytest.mark.parametrize("cycle", LIMIT_CYCLES, ids=lambda cycle: f"belt speed {cycle.belt_speed}")
def test_last_cycles_are_the_limit_cycle(cycle: LimitCycle) -> None:
    found = portrait(PortraitCase("", replace(PAPER, belt_speed=cycle.belt_speed)))
    last = found.last_cycles
    assert found.measures.amplitude == pytest.approx(cycle.amplitude, rel=1e-8)
    assert found.measures.stick_fraction == pytest.approx(cycle.stick_fraction, abs=1e-8)
    assert last.time[-1] - last.time[0] == pytest.approx(5.0 * cycle.period, abs=0.1)
    assert last.position.max() - last.position.min() == pytest.approx(2.0 * cycle.amplitude)
    assert last.velocity.max() - last.velocity.min() == pytest.approx(2 * cycle.velocity_amplitude)
    assert found.least_relative_speed is not None
    assert (found.least_relative_speed == 0.0) == (cycle.stick_fraction > 0.0)


def test_what_still_changes_has_no_settling_time() -> None:
    # At the Hopf speed itself the amplitude falls as one over the root of time.
    hopf = replace(PAPER, belt_speed=(0.43 / 1.8) ** 0.5)
    assert portrait(PortraitCase("", hopf, duration=600.0)).settling_time is None
    assert portrait(PortraitCase("", replace(PAPER, belt_speed=0.3), duration=600.0)).settling_time


def test_a_diverging_motion_ends_and_does_not_affect_the_others() -> None:
    bounded = PortraitCase("", replace(PAPER, belt_speed=0.3), duration=100.0)
    before, away, after = portraits([bounded, RUNS_AWAY, bounded])
    assert away.runs_away
    assert away.settling_time is None
    assert away.least_relative_speed is None
    # Computed with another integrator: the speed passes 10 at 14.6.
    passes = away.time_beyond(10.0)
    assert passes == pytest.approx(14.6, abs=0.05)
    motion = Motion(RUNS_AWAY.drive, 0.0, 0.0)
    motion.advance(passes)
    assert abs(motion.velocity) == pytest.approx(10.0, rel=1e-3)
    assert before.time_beyond(10.0) is None
    assert after.measures.stick_fraction == pytest.approx(before.measures.stick_fraction)
    assert after.trajectory.position.tolist() == before.trajectory.position.tolist()


@pytest.mark.parametrize(
    ("corner_frequency", "gain", "rests"),
    [(2.0, -0.9, False), (2.0, -1.0, True), (0.2, -0.13, False), (0.2, -0.16, True)],
)
def test_the_critical_gain_separates_vibration_from_rest(
    corner_frequency: float, gain: float, rests: bool
) -> None:
    gains = Washout(corner_frequency, gain, 0.0)
    found = portrait(PortraitCase("", PAPER, gains, duration=3000.0))
    assert (found.measures.regime is Regime.EQUILIBRIUM) == rests


def test_a_controlled_case_may_follow_one_without_control() -> None:
    free = PortraitCase("", PAPER, duration=100.0)
    idle = PortraitCase("", PAPER, Washout(2.0, 0.0, 0.0), duration=100.0)
    strong = PortraitCase("", PAPER, Washout(2.0, -1.5, 0.0), duration=100.0)
    first, controlled, second, third = portraits([free, strong, idle, free])
    amplitudes = [other.measures.amplitude for other in (second, third)]
    assert amplitudes == pytest.approx([first.measures.amplitude] * 2, rel=1e-9)
    assert controlled.measures.amplitude != pytest.approx(first.measures.amplitude, rel=1e-2)


def test_a_run_too_short_for_a_cycle() -> None:
    found = portrait(PortraitCase("", PAPER, duration=3.0))
    assert found.measures.regime is None
    assert found.settling_time is None
    assert len(found.last_cycles) == len(found.trajectory)
