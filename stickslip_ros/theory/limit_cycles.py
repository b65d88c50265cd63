"""The limit cycles of a drive: that of a run, and all of the open loop.

They are found by shooting. Internal values are dimensionless (see `Drive`) except durations;
arguments and results are in SI units.
"""

from collections.abc import Iterator
from math import sqrt

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import EQUILIBRIUM_SPEED
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.drive import UNBOUNDED_SPEED, Drive
from stickslip_ros.model.drive_layout import POSITION, SPEED
from stickslip_ros.model.functions import zero_between
from stickslip_ros.motion.variational import ShootingMotion, TooStiffError
from stickslip_ros.theory.cycle_bounds import (
    averaged_growth,
    largest_cycle,
    least_cycle,
    release_position,
    without_memory,
)
from stickslip_ros.theory.linear import expand
from stickslip_ros.theory.requirements import (
    ONE_DEGREE,
    STATIC,
    SYMMETRIC,
    require,
    require_equilibrium,
)
from stickslip_ros.theory.shooting import AGREEMENT, LimitCycle, next_turn, solve

_ROUNDING = 1e-13
"""Share of the displacement below which a difference is rounding."""

_CORNER_DISTANCE = 1e-6
"""Relative distance within which the cycle that sticks is searched for."""

_MOST_TURNS = 200

_DISTANCE_RATIO = 1.1
"""Ratio of one distance to the previous one."""


def limit_cycle_of_run(
    drive: Drive,
    position: float,
    velocity: float = 0.0,
    *,
    control: ContinuousControl | None = None,
) -> LimitCycle | None:
    """Return the limit cycle that a motion leads to.

    The motion runs until it repeats itself. From there `shoot` finds the cycle.

    Parameters
    ----------
    drive : Drive
        Drive in SI units.
    position : float
        Displacement of the slide at the start, m.
    velocity : float, optional
        Velocity of the slide at the start, m/s.
    control : ContinuousControl, optional
        Continuous control in SI units, such as that of eq. 19, at rest at the start. By default the
        loop is open.

    Returns
    -------
    LimitCycle or None
        Limit cycle; None if the motion settles or is unbounded, if the iteration does not converge,
        if the motion is too stiff to follow, or if the belt is at rest.

    Raises
    ------
    InvalidInputError
        If friction differs between the directions, belt or load follow a signal, or the drive has
        no spring.
    """
    require_equilibrium("the limit cycle of a run", drive, control, SYMMETRIC)
    bounded = STATIC.lack(drive) is None and drive.motor is None
    if drive.belt_speed == 0.0 or (bounded and least_cycle(drive, control) is None):
        return None
    motion = ShootingMotion(drive, control)
    motion.restart(position, velocity)
    try:
        return _cycle_ahead(motion)
    except TooStiffError:
        return None


def limit_cycles(drive: Drive) -> list[LimitCycle]:
    """Return all limit cycles of the open loop, stable and unstable.

    The motion is planar, so that a cycle surrounds the equilibrium and crosses the half-line
    X' = 0, X < X_eq once. The motion from one such crossing to the next maps the half-line to
    itself; the cycles are the fixed points of this map. The search goes outward as long as the
    slide comes back.

    With friction that has a memory the search starts with the memory of the equilibrium, and each
    change of sign is a guess from which `shoot` solves for the cycle in all states: it finds the
    cycles on which the memory follows the motion quickly, and may miss others.

    Parameters
    ----------
    drive : Drive
        Drive in SI units.

    Returns
    -------
    list of LimitCycle
        Cycles, the smallest first. The list is empty if the belt is at rest, if no energy is
        gained, or if the motion is too stiff to follow.

    Raises
    ------
    InvalidInputError
        If friction differs between the directions, belt or load follow a signal, or the drive has
        no spring.
    """
    require("the search for limit cycles", drive, *ONE_DEGREE, SYMMETRIC)
    static = STATIC.lack(drive) is None
    if drive.belt_speed == 0.0 or (static and least_cycle(drive) is None):
        return []
    returns = _ReturnMap(drive)
    try:
        distances = [zero_between(returns.growth, *bracket) for bracket in returns.brackets()]
        cycles = [returns.cycle(distance) for distance in distances]
    except TooStiffError:
        return []
    return [cycle for cycle in cycles if cycle is not None]


def _cycle_ahead(motion: ShootingMotion) -> LimitCycle | None:
    """Return the cycle that the motion reaches within `_MOST_TURNS` upward turns."""
    drive = motion.drive
    state, duration = motion.state, 0.0
    for _ in range(_MOST_TURNS):
        arrival = next_turn(motion, state)
        if arrival is None:
            return None
        before = state
        state, duration = arrival
        if motion.rate[SPEED] < EQUILIBRIUM_SPEED * abs(drive.belt_speed) / drive.speed_scale:
            return None
        if np.abs(state - before).max() < AGREEMENT * np.abs(state).max():
            break
    return solve(motion, state, duration, motion.core.mode)


class _ReturnMap:
    """Map from a distance below the equilibrium, where the slide turns upward, to the next one."""

    def __init__(self, drive: Drive) -> None:
        self._motion = ShootingMotion(drive)
        expansion = expand(drive)
        assert expansion is not None
        self._rest = expansion.equilibrium
        self._equilibrium = float(self._rest[POSITION])
        guide = without_memory(drive)
        speed = min(abs(drive.belt_speed), drive.friction.characteristic_speed) / drive.speed_scale
        self._innermost = max(1e-4 * min(speed, 1.0), least_cycle(guide) or 0.0)
        self._outermost = _outermost(guide)

    def growth(self, distance: float) -> float:
        """Return the growth of the distance; -`distance` if the slide does not turn again."""
        arrival = next_turn(self._motion, self._state(distance))
        if arrival is None:
            return UNBOUNDED_SPEED if self._motion.unbounded else -distance
        growth = (self._equilibrium - float(arrival[0][0])) - distance
        return 0.0 if abs(growth) < _ROUNDING * (distance + abs(self._equilibrium)) else growth

    def cycle(self, distance: float) -> LimitCycle | None:
        """Return the limit cycle at that distance."""
        state = self._state(distance)
        arrival = next_turn(self._motion, state)
        if arrival is None:
            return None
        turn, duration = arrival
        follows = len(self._motion.drive.friction.states) > 0
        return solve(self._motion, turn if follows else state, duration, self._motion.core.mode)

    def brackets(self) -> Iterator[tuple[float, float]]:
        """Yield pairs of distances between which the growth changes sign."""
        inner, inner_growth, inner_slope = 0.0, 0.0, 0.0
        outer, turned, landed = self._innermost, False, False
        corners = self._corners()
        while True:
            growth, slope, lands = self.growth(outer), self._slope(), self._motion.shot.landed
            turns = growth != -outer
            if self._motion.unbounded or (turned and not turns):
                return
            turned = turns
            if growth * inner_growth < 0.0:
                yield inner, outer
            elif inner_slope * inner_growth < 0.0 < slope * growth:
                peak = self._peak(inner, outer, growth)
                if peak is not None:
                    yield inner, peak
                    yield peak, outer
            if growth != 0.0:
                inner, inner_growth, inner_slope = outer, growth, slope
            if outer >= self._outermost:
                return
            if lands and not landed:
                landed, outer = True, self._last_landing(outer)
            else:
                further = [
                    outer * _DISTANCE_RATIO,
                    *(corner for corner in corners if corner > outer),
                ]
                outer = min(further)

    def _last_landing(self, first: float) -> float:
        """Return nearly the largest distance from which the slide sticks before it turns.

        Orbits do not cross, so that it sticks from all distances between this one and `first`. All
        of them have the same next turn: the cycle that sticks is the only one there.
        """
        if self._lands(self._outermost):
            return self._outermost
        low, high = first, self._outermost
        while high > _DISTANCE_RATIO * low:
            middle = sqrt(low * high)
            low, high = (middle, high) if self._lands(middle) else (low, middle)
        return low

    def _lands(self, distance: float) -> bool:
        self.growth(distance)
        return self._motion.shot.landed

    def _corners(self) -> list[float]:
        """Return two distances, just inside and just outside a cycle that sticks, if there is one.

        Inside it the growth may rise as steeply as the law. Every slide that stuck comes there.
        """
        drive = self._motion.drive
        position = release_position(drive) / drive.length_scale
        released = self._rest.copy()
        released[[POSITION, SPEED]] = position, drive.belt_speed / drive.speed_scale
        arrival = next_turn(self._motion, released)
        if arrival is None:
            return []
        distance = self._equilibrium - float(arrival[0][0])
        return [distance * (1.0 - _CORNER_DISTANCE), distance * (1.0 + _CORNER_DISTANCE)]

    def _peak(self, inner: float, outer: float, growth: float) -> float | None:
        """Return a distance at which the growth has another sign than at both ends, if any.

        From either end the growth approaches zero, and it is nearest where its slope changes sign.
        """
        for _ in range(60):
            middle = (inner + outer) / 2.0
            if self.growth(middle) * growth < 0.0:
                return middle
            if self._slope() * growth < 0.0:
                inner = middle
            else:
                outer = middle
        return None

    def _slope(self) -> float:
        """Return the derivative of the latest growth; the time of the turn does not affect it.

        There Y = X' is zero.
        """
        return float(self._motion.shot.matrix[0, 0]) - 1.0

    def _state(self, distance: float) -> FloatArray:
        return self._rest - distance * np.eye(len(self._rest))[POSITION]


def _outermost(drive: Drive) -> float:
    """Return a distance beyond which there are no limit cycles but those that stick.

    Where energy gives no bound: at a distance of many N/k friction is weak, unless it damps
    strongly, and averaging correctly predicts whether the vibration grows.
    """
    largest = largest_cycle(drive)
    if largest is not None:
        return largest
    belt_speed = abs(drive.belt_speed) / drive.speed_scale
    amplitudes = np.geomspace(belt_speed, UNBOUNDED_SPEED, 200)
    growing = amplitudes[averaged_growth(drive, belt_speed, amplitudes) > 0.0]
    by_friction = 10.0 * (belt_speed + drive.dimensionless.friction.static)
    return max(by_friction, 2.0 * float(growing.max(initial=0.0)))
