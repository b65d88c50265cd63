"""The critical gains of the washout controller: the paper's, closed forms, and eigenvalues."""

from dataclasses import replace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from stickslip_ros.physics.model.control import Washout
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import Exponential, Linear
from stickslip_ros.physics.theory.closed_forms import CubicLoop
from stickslip_ros.physics.theory.critical_gains import critical_gains
from stickslip_ros.physics.theory.linear import expand
from tests.physics.drives import PAPER
from tests.physics.theory.test_hopf import cubic_drives


@pytest.mark.parametrize(
    ("belt_speed", "damping", "corner_frequency", "gain"),
    [(0.49, 0.01, 2.0, -0.0396), (0.4, 0.02, 2.0, -0.935), (0.4, 0.02, 0.2, -0.148)],
)
def test_critical_linear_gains_of_the_paper(
    belt_speed: float, damping: float, corner_frequency: float, gain: float
) -> None:
    drive = replace(PAPER, belt_speed=belt_speed, damping=damping)
    critical = critical_gains(drive, Washout(corner_frequency, 0.0, 0.0))
    assert critical is not None
    assert critical.linear == pytest.approx(gain, rel=3e-3)


@given(cubic_drives, st.floats(0.05, 5.0), st.floats(-10.0, 10.0))
def test_the_general_theory_agrees_with_the_closed_forms(
    drive: Drive, corner_frequency: float, cubic: float
) -> None:
    force, speed = drive.normal_force, drive.speed_scale
    gains = Washout(corner_frequency * drive.angular_frequency, 0.0, cubic * force / speed**3)
    forms = CubicLoop.from_drive(drive)
    assert forms is not None
    expected = forms.critical_linear_gain(corner_frequency)
    critical = critical_gains(drive, gains)
    # Next to where no gain stabilises any more, everything is steep.
    assume(abs(1.0 - forms.trace * corner_frequency) > 0.1)
    if expected is None:
        assert critical is None
        return
    assert critical is not None
    scale = 1.0 + abs(expected)
    assert critical.linear * speed / force == pytest.approx(expected, abs=1e-12 * scale)
    sigma = forms.critical_lyapunov_coefficient(corner_frequency, cubic)
    cubic_gain = forms.critical_cubic_gain(corner_frequency)
    assert sigma is not None
    assert cubic_gain is not None
    assert critical.first_lyapunov_coefficient == pytest.approx(sigma, rel=1e-9, abs=1e-12)
    assert critical.cubic is not None
    # The cubic gain acts on what the filter lets through, next to nothing at a high corner.
    assert critical.cubic * speed**3 / force == pytest.approx(cubic_gain, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("law", [PAPER.friction, Exponential(0.4, 0.25, 0.2, 0.01)])
def test_the_pair_is_on_the_axis_at_the_critical_gain(law: Exponential) -> None:
    drive = replace(PAPER, friction=law)
    gains = Washout(0.5, 0.0, 0.0)
    critical = critical_gains(drive, gains)
    assert critical is not None
    for offset, stable in ((-1e-3, True), (1e-3, False)):
        expansion = expand(drive, replace(gains, linear_gain=critical.linear + offset))
        assert expansion is not None
        assert expansion.stable is stable
        assert bool(expansion.eigenvalues[0].real < 0.0) is stable
    at_gain = expand(drive, replace(gains, linear_gain=critical.linear))
    assert at_gain is not None
    assert abs(at_gain.eigenvalues[0].real) < 1e-14
    assert critical.cubic is not None
    neutral = critical_gains(drive, replace(gains, cubic_gain=critical.cubic))
    assert neutral is not None
    assert abs(neutral.first_lyapunov_coefficient) < 1e-13


@pytest.mark.parametrize(("slope", "corner_frequency"), [(0.82, 1.25), (0.32, 1.0 / 0.3)])
def test_no_gain_stabilises_at_the_very_end(slope: float, corner_frequency: float) -> None:
    drive = replace(PAPER, friction=Linear(0.4, slope))  # p d = 1 but for rounding
    assert critical_gains(drive, Washout(corner_frequency, 0.0, -1.0)) is None


def test_no_gain_stabilises_where_the_filter_passes_too_little() -> None:
    drive = replace(PAPER, belt_speed=0.2)  # p = 0.358
    too_fast = Washout(3.0, 0.0, 0.0)
    assert critical_gains(drive, too_fast) is None
    for linear in (-1e3, -10.0, -1.0, 0.0, 1.0, 1e3):
        expansion = expand(drive, replace(too_fast, linear_gain=linear))
        assert expansion is not None
        assert not expansion.stable
    assert critical_gains(replace(PAPER, belt_speed=0.0), too_fast) is None
