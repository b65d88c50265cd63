"""The motion's limit cycles against those of another integrator."""

from dataclasses import replace

import pytest

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.motion import RecordedMotion
from tests.drives import LIMIT_CYCLES, PAPER, LimitCycle, settled

# In natural periods. The slowest transient, at belt speed 0.46, dies out e-fold in four.
TRANSIENT, MEASURED = 400, 40


@pytest.mark.parametrize("cycle", LIMIT_CYCLES, ids=lambda cycle: f"belt speed {cycle.belt_speed}")
def test_limit_cycle_of_the_paper(cycle: LimitCycle) -> None:
    motion = RecordedMotion(replace(PAPER, belt_speed=cycle.belt_speed), 0.0, 0.0)
    measured = settled(motion, TRANSIENT, MEASURED, MEASURED)
    assert measured.cycles > 30
    assert measured.regime is (Regime.STICK_SLIP if cycle.stick_fraction else Regime.PURE_SLIP)
    assert measured.amplitude == pytest.approx(cycle.amplitude, rel=1e-8)
    assert measured.velocity_amplitude == pytest.approx(cycle.velocity_amplitude, rel=1e-8)
    assert measured.stick_fraction == pytest.approx(cycle.stick_fraction, abs=1e-8)
    assert measured.period == pytest.approx(cycle.period, rel=1e-8)
    assert measured.frequency == pytest.approx(1.0 / cycle.period, rel=1e-8)
    assert measured.midpoint == pytest.approx(cycle.midpoint, rel=1e-8)
