"""Stick edges from positions with noise, of motions with known edges."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from stickslip_ros.measures.stick_fit import fit_stick
from tests.examples import examples

FREQUENCY = 100.0
BELT = 0.04


def around_a_stick(stick_time: float, drop: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return times and positions on a belt that moves, without damping.

    r'' + w^2 r = -w^2 v (t - t_departure) - drop, in closed form: before the landing it is
    r'' + w^2 r = w^2 v s - drop backwards in time.
    """
    time = np.arange(-0.5 * stick_time - 0.010, 0.5 * stick_time + 0.010, 1e-4)
    w, dropped = FREQUENCY, drop / FREQUENCY**2
    before, after = (np.maximum(side * time - 0.5 * stick_time, 0.0) for side in (-1.0, 1.0))
    # r(0) = r'(0) = 0 at the landing, forced by w^2 v (s + before) - drop.
    landing = (BELT * stick_time - dropped) * (1.0 - np.cos(w * before))
    landing += BELT * (before - np.sin(w * before) / w)
    leaving = BELT * (after - np.sin(w * after) / w) + dropped * (1.0 - np.cos(w * after))
    return time, landing - leaving + BELT * time


@examples(quick=2, thorough=12)
@given(st.floats(0.003, 0.04), st.floats(-0.002, 0.002), st.floats(0.0, 0.3), st.floats(0.9, 1.1))
def test_edges_of_an_exact_motion_are_found(
    stick_time: float, shift: float, drop: float, told: float
) -> None:
    """Also where the friction drops at the departure, and where the belt speed is told wrong."""
    time, position = around_a_stick(stick_time, drop)
    fit = fit_stick(time + shift, position, told * BELT, FREQUENCY, stick_time + 0.001)
    assert fit.landing == pytest.approx(shift - stick_time / 2.0, abs=5e-5)
    assert fit.departure == pytest.approx(shift + stick_time / 2.0, abs=5e-5)
    assert fit.belt_speed == pytest.approx(BELT, rel=1e-3)
    assert fit.offset == pytest.approx(-BELT * shift, abs=2e-7)


@pytest.mark.parametrize("scale", [0.2, 0.3])
def test_edges_on_a_steep_curve_are_found(scale: float) -> None:
    """The friction falls by 0.375 (1 - e^-|r'/s|), in natural units: the form converges."""
    stick_time, fall = 0.01, 0.375
    time = np.arange(-0.5 * stick_time - 0.010, 0.5 * stick_time + 0.010, 1e-4)
    position = BELT * time
    for side, gap in ((-1.0, stick_time * FREQUENCY), (1.0, 0.0)):
        since = (side * time - 0.5 * stick_time) * FREQUENCY

        def rates(at: float, r: np.ndarray, side: float = side, gap: float = gap) -> list[float]:
            drop = fall * np.expm1(-abs(r[1] / scale))
            return [side * r[1], side * (drop - (r[0] + side * at - gap))]

        span = float(since.max())
        found = solve_ivp(
            rates, (0.0, span), [0.0, 0.0], "DOP853", rtol=1e-11, atol=1e-13, dense_output=True
        )
        position += BELT / FREQUENCY * found.sol(np.maximum(since, 0.0))[0]
    fit = fit_stick(time, position, BELT, FREQUENCY, stick_time + 0.001)
    assert fit.landing == pytest.approx(-stick_time / 2.0, abs=1e-7)
    assert fit.departure == pytest.approx(stick_time / 2.0, abs=1e-7)


@pytest.mark.parametrize(
    ("stick_time", "seeds"),
    [(0.010, 8), *(pytest.param(each, 20, marks=pytest.mark.long) for each in (0.003, 0.030))],
)
def test_under_noise_the_stick_time_is_within_its_error(stick_time: float, seeds: int) -> None:
    """The errors, over their standard error, have a deviation near one.

    A mean over forms of the friction scatters less than the one form whose errors these are.
    """
    time, position = around_a_stick(stick_time)
    random, errors = np.random.default_rng(1), []
    for _ in range(seeds):
        noise = 1e-7 * random.standard_normal(len(time))
        fit = fit_stick(time, position + noise, BELT, FREQUENCY, stick_time)
        variance = fit.squares / (len(time) - fit.jacobian.shape[1])
        covariance = np.linalg.inv(fit.jacobian.T @ fit.jacobian) * variance
        errors.append((fit.stick_time - stick_time) / covariance[1, 1] ** 0.5)
    assert 0.6 < np.std(errors) < 1.3
    assert abs(np.mean(errors)) < 0.6


def test_a_motion_that_stays_below_the_belt_has_no_stick() -> None:
    """The harmonic x' = v - gap at its highest; a stick in it, at any speed, has no duration."""
    gap, w = 1e-3, FREQUENCY
    time = np.arange(-0.012, 0.012, 1e-4)
    position = (BELT - gap) / w * np.sin(w * time)
    with_stick = fit_stick(time, position, BELT, FREQUENCY, 0.002)
    touching = fit_stick(time, position, with_stick.belt_speed, FREQUENCY, 0.0)
    assert touching.squares < 1e-18
    assert with_stick.stick_time < 1e-5
    assert with_stick.belt_speed == pytest.approx(BELT - gap, rel=1e-4)
