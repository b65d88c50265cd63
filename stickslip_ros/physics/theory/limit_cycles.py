"""Limit cycles as solutions of a boundary-value problem, stable or not, with Floquet multipliers.

They are found by shooting on the event-exact motion: the state after one period must be the state
at its start (Seydel, Practical Bifurcation and Stability Analysis, ch. 7). A cycle starts where
the slide turns upward: X' = 0 and X'' > 0. Internal values are dimensionless (see `Drive`) except
durations; arguments and results are in SI units.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isclose, sqrt
from typing import Any, Self

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.breakpoints import Breakpoints
from stickslip_ros.physics.measures.cycle_measures import EQUILIBRIUM_SPEED, CycleMeter, Measures
from stickslip_ros.physics.model.control import ContinuousControl
from stickslip_ros.physics.model.dimensionless_drive import POSITION, SPEED
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.drive_system import UNBOUNDED_SPEED
from stickslip_ros.physics.model.functions import zero_between
from stickslip_ros.physics.model.hybrid import Mode
from stickslip_ros.physics.motion.variational import ShootingMotion, TooStiffError
from stickslip_ros.physics.theory.cycle_bounds import (
    averaged_growth,
    follow,
    largest_cycle,
    least_cycle,
    longest_return,
    release_position,
    without_memory,
)
from stickslip_ros.physics.theory.linear import expand
from stickslip_ros.physics.theory.requirements import (
    AUTONOMOUS,
    SPRING,
    STATIC,
    SYMMETRIC,
    require,
)

_ROUNDING = 1e-13
"""Share of the displacement below which a difference is rounding."""

_AGREEMENT = 1e-6
"""Relative tolerance for a turn of a run, or a measured period, to agree with the previous one."""

_CORNER_DISTANCE = 1e-6
"""Relative distance within which the cycle that sticks is searched for."""

_DISTANCE_RATIO = 1.1
"""Ratio of one distance to the previous one."""


@dataclass(frozen=True)
class LimitCycle:
    """Periodic motion, from one upward turning point to the next; SI units."""

    position: float
    """Displacement at the turning point, m."""
    filter_states: tuple[float, ...]
    """States of the control at the turning point, times the unit of displacement, N/k."""
    period: float
    """Period, s."""
    multipliers: tuple[complex, ...]
    """Floquet multipliers without the trivial one, the largest first; the last is 0 with stick."""
    measures: Measures
    """Measures of one cycle."""
    memory: tuple[float, ...] = ()
    """Memory of the friction law at the turning point, SI units, in the order of its `states`."""

    @property
    def filter_state(self) -> float | None:
        """The state of control that has one, such as W of eq. 17, m; None for any other."""
        return self.filter_states[0] if len(self.filter_states) == 1 else None

    @property
    def stable(self) -> bool:
        """Whether motions that start nearby return to the cycle."""
        return all(abs(multiplier) < 1.0 for multiplier in self.multipliers)


def shoot(
    drive: Drive,
    position: float,
    period: float,
    *,
    control: ContinuousControl | None = None,
    filter_state: float | Sequence[float] = 0.0,
    memory: Sequence[float] | None = None,
) -> LimitCycle | None:
    """Return the limit cycle near a guess, by Newton's method.

    Orbits that belong to a family or close only after several turns do not count. Neither do those
    that are too stiff to follow.

    Parameters
    ----------
    drive : Drive
        Drive in SI units.
    position : float
        Guess of the displacement at an upward turning point, m.
    period : float
        Guess of the period, s.
    control : ContinuousControl, optional
        Continuous control in SI units, such as that of eq. 19. By default the loop is open.
    filter_state : float or sequence of float, optional
        Guess of the states of the control at the turning point, times N/k: in m for W of eq. 17.
        One number applies to all of them. It is used with `control` only.
    memory : sequence of float, optional
        Guess of the memory of the friction law at the turning point, SI units. By default it is
        that of the equilibrium.

    Returns
    -------
    LimitCycle or None
        Limit cycle; None if the iteration does not converge to one, or if the belt is at rest.

    Raises
    ------
    InvalidInputError
        If belt or load follow a signal, or the drive has no spring.

    Examples
    --------
    The system of the paper:

    >>> from stickslip_ros.physics.model.drive import Drive
    >>> from stickslip_ros.physics.model.friction import Stribeck
    >>> from stickslip_ros.physics.theory.limit_cycles import shoot
    >>> drive = Drive(mass=1.0, damping=0.02, stiffness=1.0, normal_force=1.0,
    ...               belt_speed=0.4, friction=Stribeck(0.4, 0.25, 0.5))
    >>> round(shoot(drive, position=-0.1, period=6.4).period, 6)
    6.392424
    """
    require("shooting", drive, SPRING, AUTONOMOUS)
    if drive.belt_speed == 0.0:
        return None
    motion = ShootingMotion(drive, control)
    state = motion.state_at(position, filter_state, memory)
    try:
        return _solve(motion, state, period)
    except TooStiffError:
        return None


def limit_cycle_of_run(
    drive: Drive,
    position: float,
    velocity: float = 0.0,
    *,
    control: ContinuousControl | None = None,
    turns: int = 200,
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
    turns : int, optional
        Largest number of upward turns to run.

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
    require("the limit cycle of a run", drive, SPRING, AUTONOMOUS, SYMMETRIC)
    static = STATIC.lack(drive) is None
    if drive.belt_speed == 0.0 or (static and least_cycle(drive, control) is None):
        return None
    motion = ShootingMotion(drive, control)
    motion.restart(position, velocity)
    try:
        return _cycle_ahead(motion, turns)
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

    Examples
    --------
    The system of the paper:

    >>> from stickslip_ros.physics.model.drive import Drive
    >>> from stickslip_ros.physics.model.friction import Stribeck
    >>> from stickslip_ros.physics.theory.limit_cycles import limit_cycles
    >>> drive = Drive(mass=1.0, damping=0.02, stiffness=1.0, normal_force=1.0,
    ...               belt_speed=0.4, friction=Stribeck(0.4, 0.25, 0.5))
    >>> (cycle,) = limit_cycles(drive)
    >>> round(cycle.measures.amplitude, 6), cycle.stable
    (0.434086, True)
    """
    require("the search for limit cycles", drive, SPRING, AUTONOMOUS, SYMMETRIC)
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


def _cycle_ahead(motion: ShootingMotion, turns: int) -> LimitCycle | None:
    """Return the cycle that the motion reaches within this number of upward turns."""
    drive = motion.drive
    state, duration = motion.state, 0.0
    for _ in range(turns):
        found = _next_turn(motion, state)
        if found is None:
            return None
        before = state
        state, duration = found
        if motion.rate[SPEED] < EQUILIBRIUM_SPEED * abs(drive.belt_speed) / drive.speed_scale:
            return None
        if np.abs(state - before).max() < _AGREEMENT * np.abs(state).max():
            break
    return _solve(motion, state, duration, motion.mode)


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
        found = _next_turn(self._motion, self._state(distance))
        if found is None:
            return UNBOUNDED_SPEED if self._motion.unbounded else -distance
        growth = (self._equilibrium - float(found[0][0])) - distance
        return 0.0 if abs(growth) < _ROUNDING * (distance + abs(self._equilibrium)) else growth

    def cycle(self, distance: float) -> LimitCycle | None:
        """Return the limit cycle at that distance."""
        state = self._state(distance)
        found = _next_turn(self._motion, state)
        if found is None:
            return None
        turn, duration = found
        follows = len(self._motion.drive.friction.states) > 0
        return _solve(self._motion, turn if follows else state, duration, self._motion.mode)

    def brackets(self) -> Iterator[tuple[float, float]]:
        """Yield pairs of distances between which the growth changes sign."""
        inner, inner_growth, inner_slope = 0.0, 0.0, 0.0
        outer, turned, landed = self._innermost, False, False
        corners = self._corners()
        while True:
            growth, slope, lands = self.growth(outer), self._slope(), self._motion.landed
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
        return self._motion.landed

    def _corners(self) -> list[float]:
        """Return two distances, just inside and just outside a cycle that sticks, if there is one.

        Inside it the growth may rise as steeply as the law. Every slide that stuck comes there.
        """
        drive = self._motion.drive
        position = release_position(drive) / drive.length_scale
        released = self._rest.copy()
        released[[POSITION, SPEED]] = position, drive.belt_speed / drive.speed_scale
        found = _next_turn(self._motion, released)
        if found is None:
            return []
        distance = self._equilibrium - float(found[0][0])
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
        return float(self._motion.derivatives[0, 0]) - 1.0

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
    by_friction = 10.0 * (belt_speed + drive.friction.static)
    return max(by_friction, 2.0 * float(growing.max(initial=0.0)))


def _next_turn(motion: ShootingMotion, state: FloatArray) -> tuple[FloatArray, float] | None:
    """Return state and time (s) of the next upward turn, or None; the motion is left there."""
    motion.start(state)
    turns = (_first_turn(breakpoints) for breakpoints in follow(motion))
    turn = next((turn for turn in turns if turn is not None), None)
    if turn is None:
        return None
    motion.start(state)
    motion.advance(turn)
    end = motion.state
    end[SPEED] = 0.0
    return end, turn


def _first_turn(breakpoints: Breakpoints) -> float | None:
    velocity = breakpoints.velocity
    upward = np.flatnonzero((velocity[:-2] < 0.0) & (velocity[1:-1] == 0.0) & (velocity[2:] > 0.0))
    return float(breakpoints.time[upward[0] + 1]) if len(upward) > 0 else None


@dataclass(frozen=True)
class _Shot:
    """Motion from an upward turning point over a guessed period, and the state at its end."""

    unknowns: FloatArray
    """State at the start, with the period in the place of the speed, which is zero."""
    residual: FloatArray
    """State at the end minus that at the start."""
    miss: float
    """Largest component of the residual, relative to the displacement at the start.

    The displacement is measured from zero or from rest, whichever is larger.
    """
    transition: FloatArray
    """Derivatives of the state at the end by the state at the start."""
    rate: FloatArray
    """Derivative of the state at the end by time."""
    landed: bool
    """Whether the slide stuck on the way."""
    mode: Mode
    """Mode at the end, in which the next shot starts."""

    @classmethod
    def fire(cls, motion: ShootingMotion, unknowns: FloatArray, mode: Mode | None) -> Self | None:
        """Return the shot; None if it does not start upward, or does not end."""
        drive = motion.drive
        start, period = unknowns.copy(), float(unknowns[SPEED]) / drive.angular_frequency
        start[SPEED] = 0.0
        motion.start(start, mode)
        distance = float(motion.rate[SPEED])
        # Closer than this the state is treated as the equilibrium.
        smallest = 1e-6 * abs(drive.belt_speed) / drive.speed_scale
        if distance < smallest or not 0.0 < period < longest_return(drive, motion.control):
            return None
        motion.advance(period)
        if motion.unbounded:
            return None
        residual = motion.state - start
        miss = float(np.abs(residual).max()) / max(abs(float(start[0])), distance)
        found = motion.derivatives, motion.rate, motion.landed, motion.mode
        return cls(unknowns, residual, miss, *found)

    def newton_step(self) -> FloatArray:
        """Return the change of the unknowns after which the linearised motion would close."""
        jacobian = self.transition - np.eye(len(self.residual))
        jacobian[:, SPEED] = self.rate
        step: Any = np.linalg.lstsq(jacobian, -self.residual)[0]
        return step

    def multipliers(self) -> tuple[complex, ...]:
        """Return the eigenvalues of the derivative of the map from one upward turn to the next."""
        by_time_of_turn = np.outer(self.rate, self.transition[SPEED]) / self.rate[SPEED]
        kept = np.delete(np.arange(len(self.rate)), SPEED)
        found = np.linalg.eigvals((self.transition - by_time_of_turn)[np.ix_(kept, kept)])
        multipliers = sorted(found.astype(complex).tolist(), key=abs, reverse=True)
        if self.landed:
            multipliers[-1] = 0j  # exactly zero: a stick forgets its landing
        return tuple(multipliers)


def _solve(
    motion: ShootingMotion, state: FloatArray, period: float, mode: Mode | None = None
) -> LimitCycle | None:
    """Solve for the cycle by Newton's method; each step is halved until the residual decreases.

    The iteration ends where rounding prevents any further decrease. None if the residual is still
    too large, or if a multiplier of one shows that the cycle belongs to a family.
    """
    guess = state.copy()
    guess[SPEED] = period * motion.drive.angular_frequency
    shot = _Shot.fire(motion, guess, mode)
    if shot is None:
        return None
    for _ in range(40):
        nearer = _nearer(motion, shot)
        if nearer is None:
            break
        shot = nearer
    if shot.miss > 1e-12 or any(abs(m - 1.0) < 1e-10 for m in shot.multipliers()):
        return None
    return _cycle(motion, shot)


def _nearer(motion: ShootingMotion, shot: _Shot) -> _Shot | None:
    step = shot.newton_step()
    for halvings in range(10):
        trial = _Shot.fire(motion, shot.unknowns + 2.0**-halvings * step, shot.mode)
        if trial is not None and trial.miss < shot.miss:
            return trial
    return None


def _cycle(motion: ShootingMotion, shot: _Shot) -> LimitCycle | None:
    """Return the cycle that a shot closes; None if it took several turns."""
    drive = motion.drive
    start = shot.unknowns.copy()
    start[SPEED] = 0.0
    period = float(shot.unknowns[SPEED]) / drive.angular_frequency
    motion.start(start, shot.mode)
    motion.advance(2.25 * period)  # the meter needs both sides of an upward turning point
    meter = CycleMeter(window=1)
    meter.feed(motion.take_breakpoints(), drive.belt_speed)
    measures = meter.measures()
    if measures.period is not None and not isclose(measures.period, period, rel_tol=_AGREEMENT):
        return None
    return LimitCycle(
        position=float(start[0]) * drive.length_scale,
        filter_states=tuple((motion.filter_states_of(start) * drive.length_scale).tolist()),
        period=period,
        multipliers=shot.multipliers(),
        measures=replace(measures, steady=True, trend=None),
        memory=motion.memory_of(start),
    )
