"""The limit cycle that starts at the critical linear gain, continued to other gains."""

from dataclasses import replace
from math import isnan, pi, sqrt

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.control import ContinuousControl, WashoutGains
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.drive_system import MEMORY, POSITION, SPEED
from stickslip_ros.physics.theory.critical_gains import critical_gains
from stickslip_ros.physics.theory.gain_intervals import covered_gains
from stickslip_ros.physics.theory.hopf import ComplexPair
from stickslip_ros.physics.theory.limit_cycles import LimitCycle, shoot
from stickslip_ros.physics.theory.linear import expand

_STEPS = 16
"""Number of gains from the critical to the requested one, densest where the cycle is small."""


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
        Continuous control in SI units: `WashoutGains`, at whose linear gain the cycle is requested.

    Returns
    -------
    LimitCycle or None
        Limit cycle in SI units. None if there is no critical gain (see `critical_gains`), if the
        gain is on the other side of it, and where the cycle is lost on the way: where it ends or
        folds back.

    Examples
    --------
    The system of the paper, at a linear gain just above the critical one of -0.9353:

    >>> from stickslip_ros.physics.model.drive import Drive
    >>> from stickslip_ros.physics.model.control import WashoutGains
    >>> from stickslip_ros.physics.model.friction import Stribeck
    >>> from stickslip_ros.physics.theory.hopf_cycles import limit_cycle_from_hopf
    >>> drive = Drive(mass=1.0, damping=0.02, stiffness=1.0, normal_force=1.0,
    ...               belt_speed=0.4, friction=Stribeck(0.4, 0.25, 0.5))
    >>> cycle = limit_cycle_from_hopf(drive, WashoutGains(2.0, linear=-0.9, cubic=-1.0))
    >>> round(cycle.measures.amplitude, 4), cycle.stable
    (0.1154, True)
    """
    own, critical = covered_gains(gains), critical_gains(drive, gains)
    if own is None or critical is None:
        return None
    found: list[FloatArray] = []
    cycle = None
    for step in range(1, _STEPS + 1):
        part = (step / _STEPS) ** 2  # the amplitude grows with the root of the distance
        linear = critical.linear + part * (own.linear - critical.linear)
        at_gain = replace(own, linear=linear)
        guess = (
            2.0 * found[-1] - found[-2]
            if len(found) > 1
            else _by_normal_form(drive, at_gain, critical.first_lyapunov_coefficient)
        )
        if guess is None:
            return None
        position, filter_state, period, *memory = guess.tolist()
        cycle = shoot(
            drive, position, period, gains=at_gain, filter_state=filter_state, memory=memory
        )
        if cycle is None or cycle.filter_state is None:
            return None
        found.append(np.array([cycle.position, cycle.filter_state, cycle.period, *cycle.memory]))
    return cycle


def _by_normal_form(drive: Drive, gains: WashoutGains, sigma: float) -> FloatArray | None:
    """Return what a cycle has at the upward turning point.

    That are displacement (m), filter state (m), period (s), and the memory of the law (SI).
    """
    expansion = expand(drive, gains)
    pair = None if expansion is None else ComplexPair.from_expansion(expansion)
    if expansion is None or pair is None or isnan(sigma) or sigma * pair.growth >= 0.0:
        return None
    # Y = r cos(theta) is zero and rises at -pi/2.
    deviation = sqrt(-pair.growth / sigma) * np.real(-1j * pair.right / pair.right[SPEED])
    units = [drive.scales.factor(unit) for unit in drive.friction.states.values()]
    memory = (expansion.equilibrium + deviation)[MEMORY : MEMORY + len(units)] / units
    position, filter_state = deviation[[POSITION, -1]] * drive.length_scale
    period = 2.0 * pi / pair.frequency / drive.angular_frequency
    return np.array([drive.equilibrium_position + position, filter_state, period, *memory])
