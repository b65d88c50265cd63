"""The closed loop: sampled as the nodes do it, and continuous as in the paper."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stickslip_ros.measures.cycle_measures import Measures, Regime
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Linear
from stickslip_ros.motion import Motion, RecordedMotion
from stickslip_ros.motion.controller import Controller
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.motion.simulation import simulate_continuous, simulate_sampled
from tests.drives import LIMIT_CYCLES, PAPER

SECOND = 10**9
Simulate = Callable[..., tuple[Measures, Motion]]
PAPER_GAINS = Washout(corner_frequency=2.0, linear_gain=-1.0, cubic_gain=-1.0)


def sampled(
    washout: Washout | None, duration: float, drive: Drive = PAPER, **options: Any
) -> tuple[Measures, Motion]:
    motion = RecordedMotion(drive, 0.0, 0.0)
    loop = SampledLoop(motion, 100.0, SECOND)
    controller = None if washout is None else Controller(washout)
    return simulate_sampled(loop, motion, controller, duration, CycleMeter(20), **options), motion


def continuous(
    washout: Washout | None, duration: float, drive: Drive = PAPER, **options: Any
) -> tuple[Measures, Motion]:
    motion = RecordedMotion(drive, 0.0, 0.0, washout)
    return simulate_continuous(motion, washout, duration, CycleMeter(20), **options), motion


@pytest.mark.parametrize("simulate", [sampled, continuous])
def test_without_control_it_is_the_motion_alone(simulate: Simulate) -> None:
    measures, motion = simulate(None, 400.0)
    alone = Motion(PAPER, 0.0, 0.0)
    alone.advance(400.0)
    assert motion.position == pytest.approx(alone.position, abs=1e-10)
    assert motion.velocity == pytest.approx(alone.velocity, abs=1e-10)
    (cycle,) = (cycle for cycle in LIMIT_CYCLES if cycle.belt_speed == 0.4)
    assert measures.regime is Regime.STICK_SLIP
    assert measures.cycles == 20
    assert measures.amplitude == pytest.approx(cycle.amplitude, rel=1e-8)
    assert measures.period == pytest.approx(cycle.period, rel=1e-8)
    assert measures.stick_fraction == pytest.approx(cycle.stick_fraction, abs=1e-8)


@pytest.mark.parametrize("simulate", [sampled, continuous])
def test_a_motion_that_runs_away_ends_early_as_unbounded(simulate: Simulate) -> None:
    drive = replace(PAPER, friction=Linear(static=0.4, slope=0.9))
    measures, motion = simulate(None, 1e4, drive=drive)
    assert motion.unbounded
    assert measures.regime is Regime.UNBOUNDED
    assert measures.frequency is None


@pytest.mark.parametrize("simulate", [sampled, continuous])
def test_progress_rises_to_one(simulate: Simulate) -> None:
    shares: list[float] = []
    simulate(PAPER_GAINS, 300.0, progress=shares.append)
    assert len(shares) > 3
    assert np.all(np.diff(shares) > 0.0)
    assert shares[-1] == pytest.approx(1.0)
