"""The loop with the washout controller acting without sampling, eq. 19: its critical gains."""

from dataclasses import dataclass, replace

from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.equations import WashoutGains
from stickslip_ros.physics.theory.hopf import first_lyapunov_coefficient
from stickslip_ros.physics.theory.linear import expand, hurwitz_determinants

_ROUNDING = 1e-9
"""Change of a determinant with the gain, as a share of it, below which it is taken for none."""


@dataclass(frozen=True)
class CriticalGains:
    """Where the closed loop becomes unstable, and to which side the vibration then begins."""

    linear: float
    """Critical linear gain k1*, N s/m: the equilibrium is stable below it."""
    first_lyapunov_coefficient: float
    """sigma there, under the cubic gain given (see `theory.hopf`); dimensionless."""
    cubic: float | None
    """Cubic gain at which sigma changes sign, N s^3/m^3; below it small vibrations are stable."""


def critical_gains(drive: Drive, gains: WashoutGains) -> CriticalGains | None:
    """Return the critical gains for the corner frequency and the cubic gain of `gains` (SI units).

    None if the belt rests, or if no linear gain stabilises the equilibrium.
    """
    linear = _critical_linear_gain(drive, gains)
    if linear is None:
        return None
    critical = replace(gains, linear=linear)
    sigma = _sigma(drive, critical)
    # sigma is affine in the cubic gain, which the third derivatives alone contain, linearly. A
    # large one drowns the rounding of the rest.
    large = 1e9 * drive.normal_force / drive.speed_scale**3
    without, with_large = (_sigma(drive, replace(critical, cubic=cubic)) for cubic in (0.0, large))
    slope = with_large - without
    cubic = 0.0 - without / slope * large if slope != 0.0 else None
    return CriticalGains(linear, sigma, cubic)


def _critical_linear_gain(drive: Drive, gains: WashoutGains) -> float | None:
    """Return the linear gain at which Routh and Hurwitz' last determinant changes sign.

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
