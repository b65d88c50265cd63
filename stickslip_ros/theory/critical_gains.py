"""The theory of gains without sampling, eq. 19: critical gains, and the cycle that starts there."""

from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf, isfinite, isinf, isnan, nan, pi, sqrt

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import ContinuousControl, Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import MEMORY, POSITION, SPEED
from stickslip_ros.theory.gain_intervals import GainInterval, gains_of, nearest_to_zero
from stickslip_ros.theory.linear import expand
from stickslip_ros.theory.requirements import ONE_DEGREE, SMOOTH, STATIC, require
from stickslip_ros.theory.shooting import LimitCycle, shoot

_ROUNDING = 1e-9
"""Square of a frequency, in that of the drive, below which it is rounding."""

_STEPS = 16
"""Number of gains from the critical to the requested one, densest where the cycle is small."""


@dataclass(frozen=True)
class CriticalGains:
    """Critical gains of the closed loop, and the direction of the bifurcation there."""

    linear: float
    """Critical linear gain k1*, N s/m; the equilibrium is stable below it."""
    first_lyapunov_coefficient: float
    """sigma at k1* with the given cubic gain, dimensionless (see `HopfPoint`)."""
    cubic: float | None
    """Cubic gain at which sigma changes sign, N s^3/m^3; below it small vibrations are stable."""


def critical_gains(drive: Drive, gains: ContinuousControl) -> CriticalGains | None:
    """Return the critical gains for a cutoff frequency and a cubic gain.

    Parameters
    ----------
    drive : Drive
        Drive in SI units.
    gains : ContinuousControl
        Continuous control in SI units: `Washout`, whose linear gain is not used.

    Returns
    -------
    CriticalGains or None
        Critical gains in SI units; None if the belt is at rest, if no linear gain stabilises the
        equilibrium, or for any other control.

    Raises
    ------
    InvalidInputError
        If belt or load follow a signal, or the drive has no spring.
    """
    require("the critical gain", drive, *ONE_DEGREE)
    washout, unit = gains_of(gains), drive.force_scale / drive.speed_scale
    if washout is None:
        return None
    without, with_unit = (expand(drive, replace(washout, linear_gain=gain)) for gain in (0.0, unit))
    if without is None or with_unit is None:
        return None
    dimensionless = _critical_linear_gain(without.jacobian, with_unit.jacobian)
    if dimensionless is None:
        return None
    linear = dimensionless * unit
    critical = replace(washout, linear_gain=linear)
    if SMOOTH.lack(drive) is not None:
        return CriticalGains(linear, nan, None)
    sigma = _sigma(drive, critical)
    # sigma is affine in the cubic gain: only the third derivatives contain it, linearly. With a
    # large one the rounding of the other terms does not matter.
    large = 1e9 * drive.force_scale / drive.speed_scale**3
    without, with_large = (
        _sigma(drive, replace(critical, cubic_gain=cubic)) for cubic in (0.0, large)
    )
    slope = with_large - without
    cubic = 0.0 - without / slope * large if slope != 0.0 else None
    return CriticalGains(linear, sigma, cubic)


def why_no_linear_gain(drive: Drive, gains: Washout) -> str | None:
    """Return why no linear gain stabilises the equilibrium on a moving belt; None on one at rest.

    The sentence is for a drive without critical gains.
    """
    expansion = expand(drive)
    if expansion is None:
        return None
    if STATIC.lack(drive) is not None:
        return "no linear gain stabilises the equilibrium"
    product = expansion.jacobian[SPEED, SPEED] * gains.scaled(drive).corner_frequency
    return (
        "no linear gain stabilises the equilibrium: by the Routh-Hurwitz criterion p d must be "
        f"below 1 and is {product:.4g} (p the slope of friction less damping, d the cutoff "
        "frequency, dimensionless)"
    )


def _critical_linear_gain(without: FloatArray, with_unit: FloatArray) -> float | None:
    """Return the end nearest to zero of the gains with which the equilibrium is stable.

    The characteristic polynomial is p(s) + k s^2 r(s): the filter passes no constant speed, and a
    constant force causes none. Where s = j w is an eigenvalue, p conj(r) is real, which is a
    polynomial equation for w^2, and k = p/(w^2 r).
    """
    p = np.poly(without)
    r = (np.poly(with_unit) - p)[1:-2]
    on_axis = [polynomial * 1j ** np.arange(len(polynomial))[::-1] for polynomial in (p, r)]
    squares = np.roots(np.polymul(on_axis[0], on_axis[1].conj()).imag[::2])
    squares = squares.real[
        (squares.real > _ROUNDING) & (np.abs(squares.imag) < 1e-6 * abs(squares))
    ]
    w = np.sqrt(squares)
    ends = (np.polyval(on_axis[0], w) / (squares * np.polyval(on_axis[1], w))).real
    stable = [
        GainInterval(low, high)
        for low, high in pairwise([-inf, *sorted(ends.tolist()), inf])
        if np.linalg.eigvals(without + _between(low, high) * (with_unit - without)).real.max() < 0.0
    ]
    end = nearest_to_zero(stable).critical if stable else inf
    return end if isfinite(end) else None


def _between(low: float, high: float) -> float:
    """Return a number in an interval, also an unbounded one."""
    if isinf(low):
        return high - 1.0 - abs(high) if isfinite(high) else 0.0
    return low + 1.0 + abs(low) if isinf(high) else 0.5 * (low + high)


def _sigma(drive: Drive, gains: Washout) -> float:
    expansion = expand(drive, gains)
    assert expansion is not None
    assert expansion.first_lyapunov_coefficient is not None
    return expansion.first_lyapunov_coefficient


def limit_cycle_from_hopf(drive: Drive, gains: ContinuousControl) -> LimitCycle | None:
    """Return the limit cycle that starts at the critical linear gain, with continuous control.

    It is a cycle of eq. 19, stable or not. It branches off the equilibrium at the critical linear
    gain: above that gain if the Hopf point is supercritical and below it otherwise. Its first size
    is sqrt(-alpha / sigma), by the normal form. From gain to gain it is then extrapolated and
    solved for again.

    Parameters
    ----------
    drive : Drive
        Drive in SI units.
    gains : ContinuousControl
        Continuous control in SI units: `Washout`, at whose linear gain the cycle is requested.

    Returns
    -------
    LimitCycle or None
        Limit cycle in SI units. None if there is no critical gain (see `critical_gains`), if the
        gain is on the other side of it, and where the cycle is lost on the way: where it ends or
        folds back.
    """
    washout, critical = gains_of(gains), critical_gains(drive, gains)
    if washout is None or critical is None:
        return None
    branch: list[FloatArray] = []
    cycle = None
    for step in range(1, _STEPS + 1):
        part = (step / _STEPS) ** 2  # the amplitude grows with the root of the distance
        linear = critical.linear + part * (washout.linear_gain - critical.linear)
        at_gain = replace(washout, linear_gain=linear)
        guess = (
            2.0 * branch[-1] - branch[-2]
            if len(branch) > 1
            else _by_normal_form(drive, at_gain, critical.first_lyapunov_coefficient)
        )
        if guess is None:
            return None
        position, filter_state, period, *memory = guess.tolist()
        cycle = shoot(
            drive, position, period, control=at_gain, filter_state=filter_state, memory=memory
        )
        if cycle is None or cycle.filter_state is None:
            return None
        branch.append(np.array([cycle.position, cycle.filter_state, cycle.period, *cycle.memory]))
    return cycle


def _by_normal_form(drive: Drive, gains: Washout, sigma: float) -> FloatArray | None:
    """Return what a cycle has at the upward turning point.

    That are displacement (m), filter state (m), period (s), and the memory of the law (SI).
    """
    expansion = expand(drive, gains)
    pair = None if expansion is None else expansion.pair
    if expansion is None or pair is None or isnan(sigma) or sigma * pair.growth >= 0.0:
        return None
    # Y = r cos(theta) is zero and rises at -pi/2.
    deviation = sqrt(-pair.growth / sigma) * np.real(-1j * pair.right / pair.right[SPEED])
    units = [drive.scales.factor(unit) for unit in drive.friction.states.values()]
    memory = (expansion.equilibrium + deviation)[MEMORY : MEMORY + len(units)] / units
    position, filter_state = deviation[[POSITION, -1]] * drive.length_scale
    period = 2.0 * pi / pair.frequency / drive.angular_frequency
    return np.array([drive.equilibrium_position + position, filter_state, period, *memory])
