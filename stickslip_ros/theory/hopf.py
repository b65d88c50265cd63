"""Hopf bifurcations over the belt speed: points, crossing speeds and Lyapunov coefficients."""

from dataclasses import dataclass, replace
from math import nan

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.drive import Drive, number_text
from stickslip_ros.model.functions import zero_between
from stickslip_ros.theory.linear import Expansion, expand, hurwitz_determinants, jacobians
from stickslip_ros.theory.requirements import SMOOTH, SYMMETRIC, require_equilibrium

_BELT_SPEEDS = np.geomspace(1e-6, 1e3, 4001)
"""Dimensionless belt speeds, half a percent apart, between which sign changes are searched for."""
_ON_AXIS = 1e-6
"""Share of its frequency up to which the growth of a pair is rounding."""


@dataclass(frozen=True)
class HopfPoint:
    """Belt speed at which a pair of eigenvalues crosses the imaginary axis."""

    belt_speed: float
    """Belt speed, m/s, above zero if friction is the same in both directions.

    There is then a mirrored point at the opposite speed.
    """
    angular_frequency: float
    """Imaginary part of the pair, rad/s: the frequency of the vibration that starts here."""
    crossing_speed: float
    """Rate of change of the pair's real part with the belt speed, 1/s per m/s; eq. 11 and 22."""
    first_lyapunov_coefficient: float
    """sigma, dimensionless; see `Expansion.first_lyapunov_coefficient`.

    It is nan where friction has no second derivative, as that of the elasto-plastic law.
    """

    @property
    def supercritical(self) -> bool:
        """Whether a stable vibration is known to start here with a small amplitude."""
        return self.first_lyapunov_coefficient < 0.0


def hopf_points(drive: Drive, control: ContinuousControl | None = None) -> list[HopfPoint]:
    """Return the Hopf points over the belt speed.

    It covers every friction law, at constant belt speed and normal force. The search covers belt
    speeds from 1e-6 to 1e3 N/sqrt(k m). It may miss two points closer than half a percent. If
    friction differs between the directions, the points are those of the direction of the belt.

    Parameters
    ----------
    drive : Drive
        Drive in SI units; of its belt speed at most the sign is used.
    control : ContinuousControl, optional
        Continuous control in SI units, such as that of eq. 19. By default the loop is open.

    Returns
    -------
    list of HopfPoint
        Points in SI units, in order of the belt speed.

    Raises
    ------
    InvalidInputError
        If belt or load follow a signal, or the drive has no spring.
    """
    require_equilibrium("the search for Hopf points", drive, control)
    smooth = SMOOTH.lack(drive) is None
    mirrored = SYMMETRIC.lack(drive) is None
    belt_speeds = _BELT_SPEEDS if mirrored or drive.belt_speed >= 0.0 else -_BELT_SPEEDS
    margins = _hopf_margins(drive, control, belt_speeds)
    before = np.flatnonzero(np.sign(margins[:-1]) * np.sign(margins[1:]) < 0.0)
    points: list[HopfPoint] = []
    for row in before:
        speed = zero_between(
            lambda v: float(_hopf_margins(drive, control, np.array([v]))[0]),
            float(belt_speeds[row]),
            float(belt_speeds[row + 1]),
        )
        at_point = replace(drive, belt_speed=speed * drive.speed_scale)
        expansion = expand(at_point, control)
        assert expansion is not None
        crossing, sigma = expansion.crossing_speed, expansion.first_lyapunov_coefficient
        if crossing is None or sigma is None or not _crosses(expansion):
            continue
        points.append(
            HopfPoint(
                belt_speed=at_point.belt_speed,
                angular_frequency=float(expansion.eigenvalues[0].imag) * drive.angular_frequency,
                crossing_speed=crossing * drive.angular_frequency / drive.speed_scale,
                first_lyapunov_coefficient=sigma if smooth else nan,
            )
        )
    return points


def hopf_ratio(drive: Drive) -> float | None:
    """Return the belt speed over the nearest critical speed; None without one or at zero speed.

    A drive that the theory does not cover has none.
    """
    try:
        speeds = [point.belt_speed for point in hopf_points(drive)]
    except InvalidInputError:
        return None
    speed = abs(drive.belt_speed)
    if not speeds or speed == 0.0:
        return None
    return min((speed / hopf for hopf in speeds), key=lambda ratio: max(ratio, 1.0 / ratio))


def hopf_distance(drive: Drive) -> str:
    """Return a clause on the belt speed and the nearest critical speed, which reveals a wrong unit.

    It is empty without a critical speed.
    """
    ratio = hopf_ratio(drive)
    if ratio is None:
        return ""
    speed = abs(drive.belt_speed)
    here, nearest = (number_text(drive, value, "m/s") for value in (speed, speed / ratio))
    clause = f"{here} is {ratio:.4g} times the critical speed of {nearest}"
    return clause if drive.is_dimensionless else f"{clause} (belt speeds are in m/s)"


def _crosses(expansion: Expansion) -> bool:
    """Return whether a complex pair is on the imaginary axis, to rounding.

    Otherwise two real eigenvalues have opposite signs, or the margin is rounding.
    """
    values = expansion.eigenvalues[expansion.eigenvalues.imag > 0.0]
    return bool(np.any(np.abs(values.real) < _ON_AXIS * np.abs(values.imag)))


def _hopf_margins(
    drive: Drive, control: ContinuousControl | None, belt_speeds: FloatArray
) -> FloatArray:
    return hurwitz_determinants(jacobians(drive, control, belt_speeds))[:, -1]
