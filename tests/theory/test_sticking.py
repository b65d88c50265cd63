"""The stick-slip onset speed, by averaging and in the motion."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Exponential, FrictionLaw, Linear, Stribeck
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.theory.cycle_bounds import averaged_growth
from stickslip_ros.theory.limit_cycles import limit_cycles
from stickslip_ros.theory.sticking import sticking_onset
from tests.drives import FEED_DRIVE, PAPER
from tests.theory.closed_forms import CubicLoop

SUDDEN = replace(PAPER, friction=Exponential(0.4, 0.25, 0.05, 0.0))


def sticks(drive: Drive) -> bool:
    """Whether the plain motion, left alone from rest on the belt, still sticks at the end."""
    motion = RecordedMotion(drive, 0.0, drive.belt_speed)
    motion.advance(150.0 * drive.natural_period)
    motion.take_breakpoints()
    motion.advance(3.0 * drive.natural_period)
    return bool(motion.take_breakpoints().sticking.any())


@pytest.mark.parametrize("damping", [0.0, 0.01, 0.02, 0.4])
def test_averaging_of_the_cubic_law_has_a_closed_form(damping: float) -> None:
    drive = replace(PAPER, damping=damping)
    expected = CubicLoop.from_drive(drive).sticking_onset
    assert sticking_onset(drive).approximate == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("law", [PAPER.friction, SUDDEN.friction, Linear(0.4, 0.3)])
@pytest.mark.parametrize("amplitude", [0.05, 0.3, 0.9])
def test_averaged_growth_is_the_work_of_friction_on_a_harmonic(
    law: FrictionLaw, amplitude: float
) -> None:
    """By another quadrature, with the phases where the slide overtakes the belt split off."""
    belt_speed = 0.3
    overtakes = float(np.arccos(min(1.0, belt_speed / amplitude)))

    def power(phase: float, sign: float) -> float:
        relative_speed = amplitude * np.cos(phase) - belt_speed
        return float(law.coefficient(relative_speed, sign)) * float(np.cos(phase))

    work = quad(power, 0.0, overtakes, args=(1.0,), epsabs=1e-13)[0]
    work += quad(power, overtakes, np.pi, args=(-1.0,), epsabs=1e-13)[0]
    found = averaged_growth(replace(PAPER, friction=law), belt_speed, amplitude)
    tolerance = 1e-12 if amplitude <= belt_speed else 5e-3
    assert float(found) == pytest.approx(2.0 / np.pi * work - 0.02 * amplitude, abs=tolerance)


@pytest.mark.parametrize("drive", [PAPER, SUDDEN], ids=["cubic", "exponential"])
def test_the_cycle_sticks_just_below_the_exact_onset_and_not_just_above(drive: Drive) -> None:
    onset = sticking_onset(drive).exact
    below, above = (replace(drive, belt_speed=onset * (1.0 + part)) for part in (-1e-8, 1e-8))
    assert sticks(below)
    assert not sticks(above)
    assert any(cycle.measures.regime is Regime.STICK_SLIP for cycle in limit_cycles(below))
    assert all(cycle.measures.regime is Regime.PURE_SLIP for cycle in limit_cycles(above))


def test_it_scales_and_does_not_depend_on_the_speed_or_direction_of_the_belt() -> None:
    onset = sticking_onset(PAPER)
    for belt_speed in (-0.3, 0.0, 7.0):
        assert sticking_onset(replace(PAPER, belt_speed=belt_speed)) == onset
    in_si = sticking_onset(FEED_DRIVE)
    assert in_si.exact == pytest.approx(onset.exact / 10.0, rel=1e-11)


@pytest.mark.parametrize(
    ("law", "damping", "by_averaging", "words"),
    [
        (Coulomb(0.4), 0.02, "sticks at no", "sticks at no belt speed"),
        (Coulomb(0.4), 0.0, "neither grow nor decay", "sticks at no belt speed"),
        (PAPER.friction, 0.5, "sticks at no", "sticks at no belt speed"),
        (SUDDEN.friction, 0.0, "still sticks at", "still sticks at"),
        (Linear(0.4, 0.45), 0.02, "still sticks at", "overtakes the belt and does not stick"),
        (Linear(0.4, 2.5), 0.02, "still sticks at", "sticks at no belt speed"),
        # The forces on the slide balance up to the speed of the belt, but for the spring's.
        (Linear(0.4, 0.02), 0.02, "neither grow nor decay", "sticks at no belt speed"),
        (Linear(0.4, 0.45), 0.45, "neither grow nor decay", "sticks at no belt speed"),
    ],
)
def test_where_there_is_no_onset_a_sentence_says_why(
    law: FrictionLaw, damping: float, by_averaging: str, words: str
) -> None:
    onset = sticking_onset(replace(PAPER, friction=law, damping=damping))
    assert onset.approximate is None
    assert onset.exact is None
    assert by_averaging in onset.no_approximate
    assert words in onset.no_exact


def test_sticking_ends_near_the_minimum_of_friction_where_the_law_is_stiff() -> None:
    """The slide then creeps along the law, and only its falling branch throws it off."""
    drive = replace(PAPER, friction=Stribeck(0.4, 0.25, 3e-3))
    onset, cubic = sticking_onset(drive), CubicLoop.from_drive(drive)
    assert onset.approximate == pytest.approx(cubic.sticking_onset)
    assert onset.exact == pytest.approx(cubic.hopf_speed, rel=1e-4)


@pytest.mark.long
@settings(max_examples=5)
@given(
    st.one_of(
        st.builds(Stribeck, st.just(0.4), st.floats(0.1, 0.39), st.floats(0.05, 2.0)),
        st.builds(
            Exponential, st.just(0.4), st.floats(0.1, 0.39), st.floats(0.05, 2.0), st.just(0.0)
        ),
    ),
    st.floats(0.005, 1.0),
)
def test_a_cycle_that_sticks_exists_up_to_the_onset(law: FrictionLaw, damping: float) -> None:
    drive = replace(PAPER, friction=law, damping=damping)
    onset = sticking_onset(drive).exact
    assume(onset is not None)
    for share in (0.5, 0.999, 1.001, 1.5):
        cycles = limit_cycles(replace(drive, belt_speed=share * onset))
        # Far below the onset a large one may overtake the belt, too fast to stick on the way.
        sticking = [
            cycle
            for cycle in cycles
            if cycle.measures.regime is Regime.STICK_SLIP
            or (share == 0.5 and (cycle.measures.velocity_amplitude or 0.0) > share * onset)
        ]
        assert len(sticking) == (share < 1.0)


def test_a_stiff_drive_sticks_in_two_ranges_of_belt_speeds() -> None:
    stiff = replace(PAPER, stiffness=1000.0)
    onset = sticking_onset(stiff)
    low, high = onset.ranges
    assert low == pytest.approx((onset.followed[0], 0.18888), rel=1e-4)
    assert high == pytest.approx((0.39236, 0.43716), rel=1e-4)
    assert high[1] == onset.exact
    for belt_speed in (low[1], high[0], high[1]):
        below, above = (replace(stiff, belt_speed=belt_speed * (1.0 + d)) for d in (-1e-4, 1e-4))
        assert sticks(below) == (belt_speed != high[0])
        assert sticks(above) == (belt_speed == high[0])
    for belt_speed in (0.2, 0.25, 0.3, 0.35):
        assert not sticks(replace(stiff, belt_speed=belt_speed))
