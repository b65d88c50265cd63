"""Shooting for a limit cycle, stable or not, with its Floquet multipliers.

On the event-exact motion the state after one period must be the state at its start (Seydel,
Practical Bifurcation and Stability Analysis, ch. 7). A cycle starts where the slide turns upward:
X' = 0 and X'' > 0. Internal values are dimensionless (see `Drive`) except durations; arguments and
results are in SI units.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isclose
from typing import Any, Self

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.breakpoints import Breakpoints
from stickslip_ros.measures.cycle_measures import Measures
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import SPEED
from stickslip_ros.model.hybrid import Mode
from stickslip_ros.motion.variational import ShootingMotion, TooStiffError
from stickslip_ros.samples import RESTING_MOTOR, MotorSample
from stickslip_ros.theory.cycle_bounds import first_found, longest_return
from stickslip_ros.theory.requirements import require_equilibrium

AGREEMENT = 1e-6
"""Relative tolerance for a turn of a run, or a measured period, to agree with the previous one."""


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
    motor: MotorSample | None = None
    """State of the motor at the turning point; None if it is ideal."""

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
    motor: MotorSample = RESTING_MOTOR,
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
    motor : MotorSample, optional
        Guess of the state of a motor at the turning point. By default it is at rest at 0.

    Returns
    -------
    LimitCycle or None
        Limit cycle; None if the iteration does not converge to one, or if the belt is at rest.

    Raises
    ------
    InvalidInputError
        If belt or load follow a signal, or the drive has no spring.
    """
    require_equilibrium("shooting", drive, control)
    if drive.belt_speed == 0.0:
        return None
    motion = ShootingMotion(drive, control)
    state = motion.state_at(position, filter_state, memory, motor)
    try:
        return solve(motion, state, period)
    except TooStiffError:
        return None


def next_turn(motion: ShootingMotion, state: FloatArray) -> tuple[FloatArray, float] | None:
    """Return state and time (s) of the next upward turn, or None; the motion is left there."""
    motion.start(state)
    turn = first_found(motion, _first_turn)
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
        outcome = motion.shot.matrix, motion.rate, motion.shot.landed, motion.core.mode
        return cls(unknowns, residual, miss, *outcome)

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
        eigenvalues = np.linalg.eigvals((self.transition - by_time_of_turn)[np.ix_(kept, kept)])
        multipliers = sorted(eigenvalues.astype(complex).tolist(), key=abs, reverse=True)
        if self.landed:
            multipliers[-1] = 0j  # exactly zero: a stick forgets its landing
        return tuple(multipliers)


def solve(
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
    if measures.period is not None and not isclose(measures.period, period, rel_tol=AGREEMENT):
        return None
    return LimitCycle(
        position=float(start[0]) * drive.length_scale,
        filter_states=tuple(
            (start[motion.core.system.slots.control] * drive.length_scale).tolist()
        ),
        period=period,
        multipliers=shot.multipliers(),
        measures=replace(measures, steady=True, trend=None),
        memory=motion.memory_of(start),
        motor=motion.motor_of(start),
    )
