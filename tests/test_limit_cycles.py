"""The motion's limit cycles against those of another integrator."""

from dataclasses import replace

import pytest

from stickslip_ros.measures.cycle_measures import Measures, Regime
from stickslip_ros.model.drive import Drive
from stickslip_ros.motion import RecordedMotion
from tests.drives import FEED_DRIVE, LIMIT_CYCLES, PAPER, LimitCycle, settled

# In natural periods. The slowest transient, at belt speed 0.46, dies out e-fold in four.
TRANSIENT, MEASURED = 400, 40


def measures(drive: Drive) -> Measures:
    return settled(RecordedMotion(drive, 0.0, 0.0), TRANSIENT, MEASURED, MEASURED)


def check(measured: Measures, cycle: LimitCycle, length: float = 1.0, time: float = 1.0) -> None:
    assert measured.cycles > 30
    assert measured.regime is (Regime.STICK_SLIP if cycle.stick_fraction else Regime.PURE_SLIP)
    assert measured.amplitude == pytest.approx(cycle.amplitude * length, rel=1e-8)
    assert measured.velocity_amplitude == pytest.approx(
        cycle.velocity_amplitude * length / time, rel=1e-8
    )
    assert measured.stick_fraction == pytest.approx(cycle.stick_fraction, abs=1e-8)
    assert measured.period == pytest.approx(cycle.period * time, rel=1e-8)
    assert measured.frequency == pytest.approx(1.0 / (cycle.period * time), rel=1e-8)
    assert measured.midpoint == pytest.approx(cycle.midpoint * length, rel=1e-8)


@pytest.mark.parametrize("cycle", LIMIT_CYCLES, ids=lambda cycle: f"belt speed {cycle.belt_speed}")
def test_limit_cycle_of_the_paper(cycle: LimitCycle) -> None:
    check(measures(replace(PAPER, belt_speed=cycle.belt_speed)), cycle)


def test_limit_cycle_in_si_units() -> None:
    (at_04,) = (cycle for cycle in LIMIT_CYCLES if cycle.belt_speed == 0.4)
    check(measures(FEED_DRIVE), at_04, length=1e-3, time=1e-2)
