"""The data of the paper's figures: parameters and results.

Phase portraits are compared with closed forms, reference limit cycles and critical gains.
"""

from dataclasses import replace
from functools import cache
from math import log, sqrt

import numpy as np
import pytest

from reproduction.figures import (
    SETTLED,
    BifurcationFigure,
    Portrait,
    PortraitCase,
    compute_figure,
    portrait_of,
)
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.friction import Coulomb, Linear
from stickslip_ros.motion.motion import Motion
from tests.drives import LIMIT_CYCLES, PAPER, LimitCycle

DECAY = 0.05
"""Beta of a slide that only slips under Coulomb friction: the belt is faster than it ever gets."""

DECAYING = PortraitCase(
    "decays", replace(PAPER, damping=2 * DECAY, belt_speed=0.6, friction=Coulomb(0.4))
)
RUNS_AWAY = PortraitCase("runs away", replace(PAPER, belt_speed=0.2, friction=Linear(0.4, 0.9)))


@cache
def over_belt_speed() -> BifurcationFigure:
    return compute_figure(2, points=11)


def portraits(number: int) -> list[list[Portrait]]:
    figure = compute_figure(number)
    assert figure.number == number
    assert figure.portraits == tuple(p for panel in figure.panels for p in panel.portraits)
    return [list(panel.portraits) for panel in figure.panels]


def regimes(figure: BifurcationFigure) -> list[Regime | None]:
    return figure.columns.regime.tolist()


def test_the_parameter_of_a_bifurcation_diagram_is_all_that_varies() -> None:
    for number in (2, 3, 4, 5):
        figure = compute_figure(number, points=5)
        values, drives = figure.values, figure.drives
        varied = {
            2: [drive.belt_speed for drive in drives],
            3: [drive.damping / 2.0 for drive in drives],
            4: [drive.stiffness for drive in drives],
            5: [drive.friction.static / getattr(drive.friction, "minimum", 0) for drive in drives],
        }
        for name, column in varied.items():
            assert column == pytest.approx(values if name == number else [column[0]] * 5)


def test_over_the_belt_speed_sticking_ends_and_then_the_vibration() -> None:
    figure = over_belt_speed()
    assert figure.values.tolist() == pytest.approx(np.linspace(0.0, 1.0, 11).tolist())
    assert regimes(figure) == [
        Regime.STUCK,
        *[Regime.STICK_SLIP] * 4,
        *[Regime.EQUILIBRIUM] * 6,
    ]


def test_theory_adds_the_unstable_equilibria_and_the_last_of_each_transition() -> None:
    figure = over_belt_speed()
    found = figure.unstable_equilibria
    # Eq. 9: v_b1 = 0.4888. On a belt at rest there is no equilibrium of slip.
    assert np.isfinite(found).tolist() == [False, *[True] * 4, *[False] * 6]
    # Eq. 6: X0 = mu_s - a v0 + b v0^3.
    values = figure.values[1:5]
    assert found[1:5] == pytest.approx(0.4 - 0.45 * values + 0.6 * values**3, rel=1e-12)
    marks = figure.transitions
    assert marks["Hopf point"] == pytest.approx(0.48876, abs=1e-5)
    assert marks["limit of sticking"] == pytest.approx(0.4395, abs=1e-3)


def test_over_the_damping_the_vibration_ends_at_the_hopf_point() -> None:
    figure = compute_figure(3, points=11)
    hopf = (0.45 - 1.8 * 0.477**2) / 2.0
    vibrates = [regime is Regime.PURE_SLIP for regime in regimes(figure)]
    # Close to the Hopf point the motion is slow to settle.
    clear = np.abs(figure.values - hopf) > 0.003
    assert np.array(vibrates)[clear].tolist() == (figure.values < hopf)[clear].tolist()


def test_over_the_stiffness_sticking_does_not_end() -> None:
    assert set(regimes(compute_figure(4, points=5))) == {Regime.STICK_SLIP}


def test_over_the_friction_ratio_vibration_and_sticking_begin() -> None:
    assert regimes(compute_figure(5, points=3)) == [Regime.EQUILIBRIUM, *[Regime.STICK_SLIP] * 2]


def test_near_the_hopf_speed_amplitudes_follow_the_averaged_ones() -> None:
    for damping, panel in zip((0.01, 0.02), portraits(12)[1::2], strict=True):
        hopf_squared = (0.45 - damping) / 1.8
        for portrait in panel:
            assert portrait.drive.damping == damping
            square = hopf_squared - portrait.drive.belt_speed**2
            averaged = 2.0 * sqrt(max(square, 0.0))
            assert portrait.measures.velocity_amplitude == pytest.approx(averaged, abs=0.005)


def test_settling_time_of_a_decaying_vibration() -> None:
    found = portrait_of(DECAYING)
    # The speed fades as 0.4 exp(-beta t) from cycle to cycle.
    expected = log(0.4 / (SETTLED * 0.6)) / DECAY
    assert found.settling_time == pytest.approx(expected, abs=2.0 * np.pi)


@pytest.mark.parametrize("cycle", LIMIT_CYCLES, ids=lambda cycle: f"belt speed {cycle.belt_speed}")
def test_last_cycles_are_the_limit_cycle(cycle: LimitCycle) -> None:
    found = portrait_of(PortraitCase("", replace(PAPER, belt_speed=cycle.belt_speed)))
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
    assert portrait_of(PortraitCase("", hopf, duration=600.0)).settling_time is None
    assert portrait_of(
        PortraitCase("", replace(PAPER, belt_speed=0.3), duration=600.0)
    ).settling_time


def test_a_diverging_motion_ends_and_does_not_affect_the_others() -> None:
    bounded = PortraitCase("", replace(PAPER, belt_speed=0.3), duration=100.0)
    before, away, after = map(portrait_of, [bounded, RUNS_AWAY, bounded])
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
