"""The theory of gains without sampling: critical gains of the loop of eq. 19."""

from dataclasses import dataclass, replace

from stickslip_ros.physics.model.control import ContinuousControl, WashoutGains
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.drive_system import SPEED
from stickslip_ros.physics.theory.gain_intervals import covered_gains
from stickslip_ros.physics.theory.hopf import first_lyapunov_coefficient
from stickslip_ros.physics.theory.linear import expand, hurwitz_determinants
from stickslip_ros.physics.theory.requirements import AUTONOMOUS, SPRING, STATIC, require

_ROUNDING = 1e-9
"""Relative change of a determinant with the gain below which it is treated as zero."""


@dataclass(frozen=True)
class CriticalGains:
    """Critical gains of the closed loop, and the direction of the bifurcation there."""

    linear: float
    """Critical linear gain k1*, N s/m; the equilibrium is stable below it."""
    first_lyapunov_coefficient: float
    """sigma at k1* with the given cubic gain, dimensionless (see `first_lyapunov_coefficient`)."""
    cubic: float | None
    """Cubic gain at which sigma changes sign, N s^3/m^3; below it small vibrations are stable."""


def critical_gains(drive: Drive, gains: ContinuousControl) -> CriticalGains | None:
    """Return the critical gains for a cutoff frequency and a cubic gain.

    Parameters
    ----------
    drive : Drive
        Drive in SI units.
    gains : ContinuousControl
        Continuous control in SI units: `WashoutGains`, whose linear gain is not used.

    Returns
    -------
    CriticalGains or None
        Critical gains in SI units; None if the belt is at rest, if no linear gain stabilises the
        equilibrium, or for any other control.

    Raises
    ------
    InvalidInputError
        If the friction law has a memory, belt or load follow a course, or the drive has no spring.

    Examples
    --------
    The system of the paper:

    >>> from stickslip_ros.physics.model.drive import Drive
    >>> from stickslip_ros.physics.model.control import WashoutGains
    >>> from stickslip_ros.physics.model.friction import Stribeck
    >>> from stickslip_ros.physics.theory.critical_gains import critical_gains
    >>> drive = Drive(mass=1.0, damping=0.02, stiffness=1.0, normal_force=1.0,
    ...               belt_speed=0.4, friction=Stribeck(0.4, 0.25, 0.5))
    >>> critical = critical_gains(drive, WashoutGains(2.0, linear=0.0, cubic=-1.0))
    >>> round(critical.linear, 6), round(critical.cubic, 4)
    (-0.935296, 31.468)
    """
    require("the critical gain", drive, SPRING, AUTONOMOUS, STATIC)
    own = covered_gains(gains)
    linear = None if own is None else _critical_linear_gain(drive, own)
    if own is None or linear is None:
        return None
    critical = replace(own, linear=linear)
    sigma = _sigma(drive, critical)
    # sigma is affine in the cubic gain: only the third derivatives contain it, linearly. With a
    # large one the rounding of the other terms does not matter.
    large = 1e9 * drive.normal_force / drive.speed_scale**3
    without, with_large = (_sigma(drive, replace(critical, cubic=cubic)) for cubic in (0.0, large))
    slope = with_large - without
    cubic = 0.0 - without / slope * large if slope != 0.0 else None
    return CriticalGains(linear, sigma, cubic)


def why_no_linear_gain(drive: Drive, gains: WashoutGains) -> str | None:
    """Return why no linear gain stabilises the equilibrium on a moving belt; None on one at rest.

    The sentence is for a drive without critical gains.
    """
    expansion = expand(drive)
    if expansion is None:
        return None
    product = expansion.jacobian[SPEED, SPEED] * gains.scaled(drive).corner_frequency
    return (
        "no linear gain stabilises the equilibrium: by the Routh-Hurwitz criterion p d must be "
        f"below 1 and is {product:.4g} (p the slope of friction less damping, d the cutoff "
        "frequency, dimensionless)"
    )


def _critical_linear_gain(drive: Drive, gains: WashoutGains) -> float | None:
    """Return the linear gain at which the last determinant of Routh and Hurwitz changes sign.

    A static friction law enters the Jacobian of eq. 20 by its slope at the belt speed only. The
    determinant is then affine in the gain: two values give its zero.
    """
    unit = drive.normal_force / drive.speed_scale
    margins: list[float] = []
    for linear in (0.0, unit):
        expansion = expand(drive, replace(gains, linear=linear))
        if expansion is None:
            return None
        margins.append(float(hurwitz_determinants(expansion.jacobian)[-1]))
    slope = margins[1] - margins[0]
    least = _ROUNDING * max(1.0, *map(abs, margins))
    return None if slope > -least else -margins[0] / slope * unit


def _sigma(drive: Drive, gains: WashoutGains) -> float:
    expansion = expand(drive, gains)
    assert expansion is not None
    sigma = first_lyapunov_coefficient(expansion)
    assert sigma is not None
    return sigma
