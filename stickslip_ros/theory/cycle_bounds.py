"""Bounds on a cycle: where the belt releases the slide, how long and how far the slide may go.

The statements on energy are exact, except that g is evaluated at a finite number of speeds. With x
the distance from the equilibrium, dimensionless, x'' + x = g(x') in the open loop, where
g(y) = mu(y - v0) - mu(-v0) - 2 beta y, and the energy (x^2 + x'^2) / 2 changes by g dx.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import sqrt
from typing import Any, TypeVar

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.breakpoints import Breakpoints
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.control.base import seen_by
from stickslip_ros.model.drive import UNBOUNDED_SPEED, Drive
from stickslip_ros.model.equations import acceleration, guide_reaction, reaction
from stickslip_ros.model.friction import SteadyPart
from stickslip_ros.motion.motion import RecordedMotion
from stickslip_ros.theory.requirements import ONE_MASS, PLANAR, SPRING, require

_Found = TypeVar("_Found")

_PHASES = 2.0 * np.pi * np.arange(1024) / 1024

_MEAN_ROUNDING = 4.0 * float(np.finfo(float).eps)
"""Share of its terms below which a mean is rounding."""

_ROUNDING = 16.0 * float(np.finfo(float).eps)
"""Share of its terms below which g is rounding."""


def release_position(drive: Drive) -> float:
    """Return the displacement (m) at which the belt releases the slide without control.

    There friction is at its limit and the slide is not yet accelerated:
    k x + c v_belt - bias = N mu_s. Raises InvalidInputError without a spring.
    """
    require("the release by the belt", drive, ONE_MASS, SPRING)
    forward, backward = drive.friction.limits
    limit = drive.normal_force * (backward if drive.belt_speed >= 0.0 else -forward)
    return (limit - reaction(drive, 0.0, drive.belt_speed, 0.0)) / drive.stiffness


def longest_return(drive: Drive, control: ContinuousControl | None = None) -> float:
    """Return a time (s) within which a slide comes back if it ever does; the belt moves.

    It may stick, and creep at a similar speed, as far as static friction can bend the spring.
    Continuous control that pushes a slide at rest softens or stiffens the spring.
    """
    if control is not None:
        scaled = control.scaled(drive)
        spring, mass = _static_force(scaled, 0.0) - _static_force(scaled, 1.0), drive.mass
        left = 1.0 + spring  # it is a spring beside that of the slide
        if drive.motor is not None:  # behind that of the transmission; both carry slide and motor
            left, mass = max(spring, 0.0) / (1.0 + max(spring, 0.0)), mass + drive.motor.mass
        stiffness = drive.stiffness * left if left > 0.0 else drive.stiffness
        drive = replace(drive, mass=mass, stiffness=stiffness, motor=None)
    return 4.0 * drive.natural_period + 2.0 * loading_time(drive)


def _static_force(control: ContinuousControl, position: float) -> float:
    """Return the force of a control at rest, of slide and motor at one position."""
    seen = seen_by(control, position, 0.0, (position, 0.0))
    return float(control.control_force(*seen, control.rest(*seen)))


def loading_time(drive: Drive) -> float:
    """Return the time (s) in which the belt bends the spring from one limit to the other.

    Raises InvalidInputError without a spring.
    """
    require("the loading by the belt", drive, SPRING)
    forward, backward = drive.friction.limits
    bent = (forward + backward) * (drive.normal_force / drive.stiffness)
    return bent / abs(drive.belt_speed)


def follow(motion: RecordedMotion) -> Iterator[Breakpoints]:
    """Yield all breakpoints of a recording `motion` so far, repeatedly, up to `longest_return`."""
    drive = motion.drive
    breakpoints, now = Breakpoints.empty(), 0.0
    longest = longest_return(drive, motion.control)
    while now < longest and not motion.unbounded:
        step = max(now, drive.natural_period) / 4.0
        motion.advance(step)
        now += step
        breakpoints = breakpoints.followed_by(motion.take_breakpoints())
        yield breakpoints


def first_found(
    motion: RecordedMotion, find: Callable[[Breakpoints], _Found | None]
) -> _Found | None:
    """Return what `find` first finds as the motion is followed; None if it finds nothing."""
    hits = map(find, follow(motion))
    return next((hit for hit in hits if hit is not None), None)


def least_cycle(drive: Drive, control: ContinuousControl | None = None) -> float | None:
    """Return the least speed, dimensionless, at which energy may be gained; the belt moves.

    It is the speed in the open loop, where every cycle turns at least as far from the equilibrium,
    or under continuous `control` (SI). None if there is no such speed: on a cycle the
    gain balances the loss, so that there is no cycle up to `UNBOUNDED_SPEED`, unless energy is
    conserved. Raises InvalidInputError for a drive that it does not cover, see `requirements`.
    """
    require("the energy of a cycle", drive, *PLANAR)
    speed, force = _net_force(drive)
    if control is not None:
        force = force + control.scaled(drive).bound(speed)
    with np.errstate(invalid="ignore"):  # an infinite bound at rest
        gaining = np.abs(speed)[speed * force > 0.0]
    return None if len(gaining) == 0 else 0.95 * float(gaining.min())


def largest_cycle(drive: Drive) -> float | None:
    """Return a distance below the equilibrium (dimensionless) beyond which no cycle turns upward.

    This holds for cycles that do not stick; the belt moves. With g >= -l and g <= p at speeds from
    0 to v0, g <= -u above and g >= -n below, u > n >= 0, a slide that turns at -d turns next at
    d' >= d - 2 n if it comes back to -d, and passes v0 within v0^2 / D of either turning point,
    where D = d - 2 n - max(l, p) is at least sqrt(2) v0. The energy then changes by less than
    2 (p + n) v0^2 / D - 2 (u - n) (D - v0^2 / D). None if there is no such u.
    """
    require("the energy of a cycle", drive, *PLANAR)
    speed, force = _net_force(drive)
    belt_speed = abs(drive.belt_speed) / drive.speed_scale
    above, below = force[speed > belt_speed], force[speed <= 0.0]
    between = force[(speed >= 0.0) & (speed <= belt_speed)]
    p, low = float(between.max()), -float(between.min())
    u, n = -float(above.max()), -float(below.min())
    if u <= n:
        return None
    return 2.0 * n + max(low, p) + belt_speed * sqrt(max(2.0, (u + p) / (u - n)))


def without_memory(drive: Drive) -> Drive:
    """Return a drive with the friction that its law has in steady slip.

    Bounds on its cycles are no bounds on those of the drive, but a guide for a search.
    """
    law = drive.friction
    return replace(drive, friction=SteadyPart(law)) if law.states else drive


def _net_force(drive: Drive) -> tuple[FloatArray, FloatArray]:
    """Return speeds y on both sides of rest and of the belt speed, and g there."""
    unit = drive.dimensionless
    law, belt_speed = unit.friction, abs(drive.belt_speed) / drive.speed_scale
    least = 1e-6 * min(belt_speed, drive.friction.characteristic_speed / drive.speed_scale)
    distances = np.geomspace(least, UNBOUNDED_SPEED, 2048)
    relative_speed = np.concatenate(
        [-belt_speed - distances, [-belt_speed], -distances, distances,
        (distances - belt_speed)[distances < belt_speed]]
    )  # fmt: skip
    speed = relative_speed + belt_speed
    friction: Any = law.coefficient(relative_speed, np.sign(relative_speed))
    at_rest = float(law.at_rest(belt_speed))
    damped = -guide_reaction(unit, speed)
    held = reaction(unit, at_rest + unit.bias_force, speed, damped)
    force = acceleration(unit, friction, held)
    terms = np.abs(friction) + abs(at_rest) + np.abs(held - at_rest)
    return speed, np.where(np.abs(force) < _ROUNDING * terms, 0.0, force)


def averaged_growth(drive: Drive, belt_speed: Any, amplitude: Any) -> FloatArray:
    """Return twice dA/dt of the speed amplitude A, for a belt speed above zero.

    It is (1/pi) int_0^{2 pi} mu(A cos t - v0) cos t dt - 2 beta A (Guckenheimer and Holmes,
    Nonlinear Oscillations, section 4.1, of eq. 5). All values are dimensionless, and the arguments
    may be arrays. The trapezoidal rule is exact to rounding while A <= v0, where the slide does not
    overtake the belt, if the law's characteristic speed is not much below v0 / 10,000. A result
    that cannot be distinguished from rounding is zero. Raises InvalidInputError for a friction law
    that has a memory or differs between the directions, for a belt or load with a signal, and
    without a spring.
    """
    require("averaging", drive, *PLANAR)
    law = drive.dimensionless.friction
    belt_speed, amplitude = np.asarray(belt_speed, float), np.asarray(amplitude, float)
    relative_speed = np.multiply.outer(amplitude, np.cos(_PHASES)) - belt_speed[..., np.newaxis]
    friction = law.coefficient(relative_speed, np.where(relative_speed > 0.0, 1.0, -1.0))
    damping = drive.damping_coefficient * amplitude
    growth = 2.0 * np.mean(friction * np.cos(_PHASES), axis=-1) - damping
    rounding = _MEAN_ROUNDING * (np.max(np.abs(friction), axis=-1) + damping)
    return np.where(np.abs(growth) < rounding, 0.0, growth)
