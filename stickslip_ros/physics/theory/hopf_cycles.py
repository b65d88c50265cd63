"""The limit cycle that is born at the critical linear gain, followed to other gains."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.equations import SPEED, WashoutGains
from stickslip_ros.physics.theory.critical_gains import critical_gains
from stickslip_ros.physics.theory.hopf import ComplexPair
from stickslip_ros.physics.theory.limit_cycles import LimitCycle, shoot
from stickslip_ros.physics.theory.linear import expand

_STEPS = 16
"""Gains between the critical one and the one that is wanted, closest where the cycle is small."""


def limit_cycle_from_hopf(drive: Drive, gains: WashoutGains) -> LimitCycle | None:
    """Return the limit cycle of the continuous loop (eq. 19) with `gains` (SI), stable or not.

    It is the one that branches off the equilibrium at the critical linear gain, above that gain if
    the Hopf point is supercritical and below it otherwise. Its first size is sqrt(-alpha / sigma),
    by the normal form; from gain to gain it is then extrapolated and solved for again. None if
    there is no critical gain, if the gain is on the other side of it, and where the cycle is lost
    on the way: where it ends or folds back.
    """
    critical = critical_gains(drive, gains)
    if critical is None:
        return None
    found: list[FloatArray] = []
    cycle = None
    for step in range(1, _STEPS + 1):
        part = (step / _STEPS) ** 2  # the size grows with the root of the distance
        linear = critical.linear + part * (gains.linear - critical.linear)
        at_gain = replace(gains, linear=linear)
        guess = (
            2.0 * found[-1] - found[-2]
            if len(found) > 1
            else _by_normal_form(drive, at_gain, critical.first_lyapunov_coefficient)
        )
        if guess is None:
            return None
        position, filter_state, period = guess.tolist()
        cycle = shoot(drive, position, period, gains=at_gain, filter_state=filter_state)
        if cycle is None or cycle.filter_state is None:
            return None
        found.append(np.array([cycle.position, cycle.filter_state, cycle.period]))
    return cycle


def _by_normal_form(drive: Drive, gains: WashoutGains, sigma: float) -> FloatArray | None:
    """Return displacement (m) and filter state (m) at the upward turning point, and period (s)."""
    expansion = expand(drive, gains)
    pair = None if expansion is None else ComplexPair.from_expansion(expansion)
    if pair is None or sigma * pair.growth >= 0.0:
        return None
    # Y = r cos(theta) is zero and rises at -pi/2.
    deviation = np.real(-1j * pair.right / pair.right[SPEED]) * drive.length_scale
    position, _, filter_state = (sqrt(-pair.growth / sigma) * deviation).tolist()
    period = 2.0 * pi / pair.frequency / drive.angular_frequency
    return np.array([drive.equilibrium_position + position, filter_state, period])
