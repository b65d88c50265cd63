"""Simulation, sampled as the nodes do it and without samples: measures, progress, its end."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stickslip_ros.measures.cycle_measures import Measures, Regime
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Linear
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.motion.simulation import simulate_continuous, simulate_sampled
from tests.drives import LIMIT_CYCLES, PAPER


def sampled(drive: Drive, duration: float, **options: Any) -> Measures:
    motion = RecordedMotion(drive, 0.0, 0.0)
    loop = SampledLoop(motion, 100.0, 10**9)
    return simulate_sampled(loop, motion, None, duration, CycleMeter(20), **options)


def continuous(drive: Drive, duration: float, **options: Any) -> Measures:
    motion = RecordedMotion(drive, 0.0, 0.0)
    return simulate_continuous(motion, None, duration, CycleMeter(20), **options)


both = pytest.mark.parametrize("simulate", [sampled, continuous])
Simulate = Callable[..., Measures]


@both
def test_the_motion_is_measured_and_progress_rises_to_one(simulate: Simulate) -> None:
    shares: list[float] = []
    measures = simulate(PAPER, 400.0, progress=shares.append)
    (cycle,) = (cycle for cycle in LIMIT_CYCLES if cycle.belt_speed == 0.4)
    assert measures.regime is Regime.STICK_SLIP
    assert measures.cycles == 20
    assert measures.amplitude == pytest.approx(cycle.amplitude, rel=1e-8)
    assert measures.period == pytest.approx(cycle.period, rel=1e-8)
    assert measures.stick_fraction == pytest.approx(cycle.stick_fraction, abs=1e-8)
    assert len(shares) > 3
    assert np.all(np.diff(shares) > 0.0)
    assert shares[-1] == pytest.approx(1.0)


@both
def test_a_motion_that_runs_away_ends_early_as_unbounded(simulate: Simulate) -> None:
    drive = replace(PAPER, friction=Linear(static=0.4, slope=0.9))
    measures = simulate(drive, 1e4)
    assert measures.regime is Regime.UNBOUNDED
    assert measures.frequency is None
