"""The critical gains of the washout controller, and the limit cycle that starts there."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Linear, Stribeck
from stickslip_ros.motion.variational import ShootingMotion
from stickslip_ros.theory.critical_gains import critical_gains, limit_cycle_from_hopf
from stickslip_ros.theory.hopf import hopf_points
from stickslip_ros.theory.limit_cycles import limit_cycle_of_run
from stickslip_ros.theory.linear import expand
from tests.drives import PAPER, settled
from tests.theory.closed_forms import CubicLoop

cubic_drives = st.builds(
    lambda mass, stiffness, normal_force, damping, belt_speed, static, drop, speed: Drive(
        mass=mass,
        damping=damping * sqrt(stiffness * mass),
        stiffness=stiffness,
        normal_force=normal_force,
        belt_speed=belt_speed * normal_force / sqrt(stiffness * mass),
        friction=Stribeck(
            static, static * (1.0 - drop), speed * normal_force / sqrt(stiffness * mass)
        ),
    ),
    mass=st.floats(0.1, 1e3),
    stiffness=st.floats(0.1, 1e6),
    normal_force=st.floats(0.1, 1e4),
    damping=st.floats(0.0, 0.5),
    belt_speed=st.floats(0.05, 1.0),
    static=st.floats(0.1, 1.0),
    drop=st.floats(0.1, 1.0),
    speed=st.floats(0.2, 1.0),
)


@given(cubic_drives, st.floats(0.05, 5.0), st.floats(-10.0, 10.0))
def test_the_general_theory_agrees_with_the_closed_forms(
    drive: Drive, corner_frequency: float, cubic: float
) -> None:
    forms, expansion = CubicLoop.from_drive(drive), expand(drive)
    assert expansion.equilibrium[0] == pytest.approx(forms.equilibrium, rel=1e-12, abs=1e-12)
    assert expansion.jacobian[1, 1] == pytest.approx(forms.trace, rel=1e-12, abs=1e-12)
    force, speed = drive.normal_force, drive.speed_scale
    if forms.hopf_speed is None or forms.hopf_speed > 1e-5:  # lower ones are not looked for
        points = hopf_points(drive)
        assert (forms.hopf_speed is None) == (points == [])
        for point in points:
            found = point.belt_speed / speed, point.crossing_speed * speed / drive.angular_frequency
            assert found == pytest.approx((forms.hopf_speed, forms.crossing_speed), rel=1e-12)
            assert point.angular_frequency == pytest.approx(drive.angular_frequency, rel=1e-12)
            sigma = point.first_lyapunov_coefficient
            assert sigma == pytest.approx(forms.first_lyapunov_coefficient, rel=1e-12)

    # Next to where no gain stabilises any more, everything is steep.
    assume(abs(1.0 - forms.trace * corner_frequency) > 0.1)
    gains = Washout(corner_frequency * drive.angular_frequency, 0.0, cubic * force / speed**3)
    critical, expected = critical_gains(drive, gains), forms.critical_linear_gain(corner_frequency)
    if expected is None:
        assert critical is None
        return
    scale = 1.0 + abs(expected)
    assert critical.linear * speed / force == pytest.approx(expected, abs=1e-12 * scale)
    sigma = forms.critical_lyapunov_coefficient(corner_frequency, cubic)
    cubic_gain = forms.critical_cubic_gain(corner_frequency)
    assert critical.first_lyapunov_coefficient == pytest.approx(sigma, rel=1e-9, abs=1e-12)
    # The cubic gain acts on what the filter lets through, next to nothing at a high corner.
    assert critical.cubic * speed**3 / force == pytest.approx(cubic_gain, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(("slope", "corner_frequency"), [(0.82, 1.25), (0.32, 1.0 / 0.3)])
def test_no_gain_stabilises_at_the_very_end(slope: float, corner_frequency: float) -> None:
    drive = replace(PAPER, friction=Linear(0.4, slope))  # p d = 1 but for rounding
    assert critical_gains(drive, Washout(corner_frequency, 0.0, -1.0)) is None


SUBCRITICAL = Washout(0.2, -0.16, 2.0)
"""Beyond the critical gain (-0.148), with more cubic gain than the critical one (0.649)."""


def ends_in(gains: Washout, position: float, filter_state: float) -> Regime | None:
    """Final motion of the loop from there; the slide rests at the start."""
    motion = ShootingMotion(PAPER, gains)
    motion.start(np.array([position, 0.0, filter_state]))
    return settled(motion, 300.0, 20.0, window=10).regime


def test_an_unstable_cycle_separates_rest_from_vibration() -> None:
    critical = critical_gains(PAPER, SUBCRITICAL)
    assert critical.first_lyapunov_coefficient > 0.0
    cycle = limit_cycle_from_hopf(PAPER, SUBCRITICAL)
    assert cycle.multipliers[0].real > 1.0
    assert not cycle.stable
    distance = PAPER.equilibrium_position - cycle.position
    for factor, regime in ((0.99, Regime.EQUILIBRIUM), (1.01, Regime.STICK_SLIP)):
        start = PAPER.equilibrium_position - factor * distance
        assert ends_in(SUBCRITICAL, start, factor * cycle.filter_state) is regime
    outer = limit_cycle_of_run(PAPER, 0.0, control=SUBCRITICAL)
    assert outer.stable
    assert outer.position < cycle.position


@pytest.mark.parametrize("corner_frequency", [0.2, 2.0])
def test_a_stable_cycle_is_the_one_that_a_run_leads_to(corner_frequency: float) -> None:
    critical = critical_gains(PAPER, Washout(corner_frequency, 0.0, -1.0))
    gains = Washout(corner_frequency, 0.8 * critical.linear, -1.0)
    cycle = limit_cycle_from_hopf(PAPER, gains)
    by_run = limit_cycle_of_run(PAPER, 0.0, control=gains)
    assert cycle.stable
    assert cycle.position == pytest.approx(by_run.position, rel=1e-9)
    assert cycle.period == pytest.approx(by_run.period, rel=1e-9)


def test_none_on_the_other_side_of_the_critical_gain() -> None:
    assert limit_cycle_from_hopf(PAPER, Washout(2.0, -1.0, 0.0)) is None
    assert limit_cycle_from_hopf(PAPER, replace(SUBCRITICAL, linear_gain=-0.13)) is None
    assert limit_cycle_from_hopf(PAPER, Washout(10.0, -1.0, 0.0)) is None
    resting = replace(PAPER, belt_speed=0.0)
    assert critical_gains(resting, SUBCRITICAL) is None
    assert limit_cycle_from_hopf(resting, SUBCRITICAL) is None
