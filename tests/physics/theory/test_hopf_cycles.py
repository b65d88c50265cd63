"""The limit cycle that is born at the critical gain: stable above it, or unstable below."""

from dataclasses import replace

import numpy as np
import pytest

from stickslip_ros.physics.measures.cycle_measures import CycleMeter, Measures, Regime
from stickslip_ros.physics.model.control import Washout
from stickslip_ros.physics.motion.variational import ShootingMotion
from stickslip_ros.physics.theory.critical_gains import critical_gains, limit_cycle_from_hopf
from stickslip_ros.physics.theory.limit_cycles import limit_cycle_of_run
from tests.physics.drives import PAPER

SUBCRITICAL = Washout(0.2, -0.16, 2.0)
"""Beyond the critical gain (-0.148), with more cubic gain than the critical one (0.649)."""


def settled(gains: Washout, position: float, filter_state: float) -> Measures:
    """What the loop does from there in the end; the slide rests at the start."""
    motion = ShootingMotion(PAPER, gains)
    motion.start(np.array([position, 0.0, filter_state]))
    motion.advance(300.0 * PAPER.natural_period)
    motion.take_breakpoints()
    motion.advance(20.0 * PAPER.natural_period)
    meter = CycleMeter(window=10)
    meter.feed(motion.take_breakpoints(), PAPER.belt_speed)
    return meter.measures()


def test_an_unstable_cycle_separates_rest_from_vibration() -> None:
    critical = critical_gains(PAPER, SUBCRITICAL)
    assert critical is not None
    assert critical.first_lyapunov_coefficient > 0.0
    cycle = limit_cycle_from_hopf(PAPER, SUBCRITICAL)
    assert cycle is not None
    assert cycle.filter_state is not None
    assert cycle.multipliers[0].real > 1.0
    assert not cycle.stable
    distance = PAPER.equilibrium_position - cycle.position
    for factor, regime in ((0.99, Regime.EQUILIBRIUM), (1.01, Regime.STICK_SLIP)):
        start = PAPER.equilibrium_position - factor * distance
        found = settled(SUBCRITICAL, start, factor * cycle.filter_state)
        assert found.regime is regime
    outer = limit_cycle_of_run(PAPER, 0.0, gains=SUBCRITICAL)
    assert outer is not None
    assert outer.stable
    assert outer.position < cycle.position


@pytest.mark.parametrize("corner_frequency", [0.2, 2.0])
def test_a_stable_cycle_is_the_one_that_a_run_leads_to(corner_frequency: float) -> None:
    critical = critical_gains(PAPER, Washout(corner_frequency, 0.0, -1.0))
    assert critical is not None
    gains = Washout(corner_frequency, 0.8 * critical.linear, -1.0)
    cycle, by_run = (
        limit_cycle_from_hopf(PAPER, gains),
        limit_cycle_of_run(PAPER, 0.0, gains=gains),
    )
    assert cycle is not None
    assert by_run is not None
    assert cycle.stable
    assert cycle.position == pytest.approx(by_run.position, rel=1e-9)
    assert cycle.period == pytest.approx(by_run.period, rel=1e-9)


def test_none_on_the_other_side_of_the_critical_gain() -> None:
    assert limit_cycle_from_hopf(PAPER, Washout(2.0, -1.0, 0.0)) is None
    assert limit_cycle_from_hopf(PAPER, replace(SUBCRITICAL, linear_gain=-0.13)) is None
    assert limit_cycle_from_hopf(PAPER, Washout(10.0, -1.0, 0.0)) is None
    resting = replace(PAPER, belt_speed=0.0)
    assert limit_cycle_from_hopf(resting, SUBCRITICAL) is None
