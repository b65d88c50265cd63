"""The belt speeds at which the slide sticks once a cycle, and the highest of them, the onset."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import tanh

import numpy as np

from stickslip_ros.measures.breakpoints import Breakpoints
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.functions import zero_between
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.theory.cycle_bounds import (
    averaged_growth,
    first_found,
    least_cycle,
    release_position,
)
from stickslip_ros.theory.requirements import PLANAR, require

_AVERAGED_SPEEDS = np.geomspace(1e-4, 1e4, 200)
"""Dimensionless belt speeds between which averaging searches for an onset."""

_FOLLOWED_SPEEDS = np.geomspace(4.0, 0.02, 100)
"""Belt speeds tried for the exact onset, relative to the averaged one or the drive's."""

_Onset = tuple[float | None, str | None]
"""An onset, m/s, and the reason why there is none: one of them is None."""

_ROUNDING = 1e-12
"""Share of the belt speed below which a difference of speeds is rounding."""


@dataclass(frozen=True)
class StickingOnset:
    """Highest belt speed with a cycle that sticks, m/s, above zero."""

    approximate: float | None
    """Onset by averaging, m/s: the speed amplitude of a harmonic vibration equals the belt speed.

    For the cubic law this is sqrt(4/5) of the Hopf speed.
    """
    exact: float | None
    """Onset of the motion itself, m/s: a periodic orbit touches the belt speed; to rounding."""
    no_approximate: str | None
    """Sentence that says why there is no approximate speed, if there is none."""
    no_exact: str | None
    """Sentence that says why there is no exact speed, if there is none."""
    ranges: tuple[tuple[float, float], ...]
    """Least and highest belt speed (m/s) of each range with a cycle that sticks, ascending.

    Below the onset a slide may return to the belt with forces that friction cannot hold, and
    overtake it. The exact onset is the upper end of the last range.
    """
    followed: tuple[float, float]
    """Belt speeds (m/s) between which the ranges were searched for.

    A range that starts at the lower end continues below it.
    """


def sticking_onset(drive: Drive) -> StickingOnset:
    """Return the stick-slip onset speed over the belt speed.

    The search for the exact onset goes up to four times the approximate one or, without that, up to
    four times the belt speed of the drive.

    Parameters
    ----------
    drive : Drive
        Drive in SI units; its belt speed limits the search only.

    Returns
    -------
    StickingOnset
        Approximate and exact onset, m/s, and the ranges of sticking.

    Raises
    ------
    InvalidInputError
        If the friction law has a memory or differs between the directions, belt or load follow a
        signal, or the drive has no spring.
    RunError
        If the motion is too stiff to follow.
    """
    require("the stick-slip onset speed", drive, *PLANAR)
    approximate, no_approximate = _averaged(drive)
    reference = approximate or abs(drive.belt_speed) or drive.speed_scale
    speeds = (reference * _FOLLOWED_SPEEDS).tolist()
    exact, no_exact = _followed(drive, speeds)
    return StickingOnset(
        approximate=approximate,
        exact=exact,
        no_approximate=no_approximate,
        no_exact=no_exact,
        ranges=_ranges(drive, speeds, exact),
        followed=(speeds[-1], speeds[0]),
    )


def _averaged(drive: Drive) -> _Onset:
    """Return the approximate onset, or the reason why there is none."""
    growth = averaged_growth(drive, _AVERAGED_SPEEDS, _AVERAGED_SPEEDS)
    low, high = _AVERAGED_SPEEDS[[0, -1]] * drive.speed_scale
    if not np.any(growth):
        return None, (
            "by averaging vibrations up to the belt speed neither grow nor decay at any belt speed "
            f"from {low:.3g} to {high:.3g} m/s"
        )
    growing = np.flatnonzero(growth > 0.0)
    if len(growing) == 0:
        return None, f"by averaging it sticks at no belt speed from {low:.3g} to {high:.3g} m/s"
    highest = int(growing[-1])
    if highest == len(_AVERAGED_SPEEDS) - 1:
        return None, f"by averaging it still sticks at {high:.3g} m/s, the highest belt speed tried"
    if growth[highest + 1] == 0.0:
        last = _AVERAGED_SPEEDS[highest] * drive.speed_scale
        return None, (
            f"by averaging it still sticks at {last:.3g} m/s, and at higher belt speeds vibrations "
            "up to the belt speed neither grow nor decay"
        )
    onset = zero_between(
        lambda speed: float(averaged_growth(drive, speed, speed)),
        *_AVERAGED_SPEEDS[highest : highest + 2],
    )
    return onset * drive.speed_scale, None


def _followed(drive: Drive, speeds: Sequence[float]) -> _Onset:
    """Return the exact onset, or the reason why there is none; the speeds to try descend."""

    def excess(speed: float) -> float:
        return _at_speed(drive, speed, release_excess)

    above = None
    for speed in speeds:
        if excess(speed) > 0.0:
            break
        above = speed
    else:
        return None, f"it sticks at no belt speed from {speeds[-1]:.3g} to {speeds[0]:.3g} m/s"
    if above is not None:
        return zero_between(lambda speed: np.tanh(excess(speed)), speed, above), None
    sticking = next(
        (speed for speed in speeds if release_margin(replace(drive, belt_speed=speed)) > 0.0), 0.0
    )
    if sticking == speed:
        return None, f"it still sticks at {speed:.3g} m/s, the highest belt speed tried"
    return None, (
        f"above {sticking:.3g} m/s, up to {speed:.3g} m/s at least, it overtakes the belt and does "
        "not stick: no orbit touches the belt speed"
    )


def _ranges(
    drive: Drive, speeds: Sequence[float], onset: float | None
) -> tuple[tuple[float, float], ...]:
    """Return the ranges of belt speeds, ascending, at which a slide that stuck sticks again."""

    def margin(speed: float) -> float:
        return tanh(_at_speed(drive, speed, release_margin))

    tried = [(speed, margin(speed)) for speed in speeds if onset is None or speed < onset]
    if onset is not None:  # below it there is a range, however narrow
        tried.insert(0, (onset * (1.0 - 1e-9), 1.0))
    tried.reverse()
    edges = [
        zero_between(margin, speed, next_speed)
        for (speed, before), (next_speed, now) in pairwise(tried)
        if (before > 0.0) != (now > 0.0)
    ]
    (lowest, first), (highest, last) = tried[0], tried[-1]
    if first > 0.0:
        edges.insert(0, lowest)
    if last > 0.0:
        edges.append(highest if onset is None else onset)
    return tuple(zip(edges[::2], edges[1::2], strict=True))


def _at_speed(drive: Drive, speed: float, margin: Callable[[Drive], float]) -> float:
    """Return a margin at a belt speed, -1 if there is no cycle."""
    at_speed = replace(drive, belt_speed=speed)
    return -1.0 if least_cycle(at_speed) is None else margin(at_speed)


def release_excess(drive: Drive) -> float:
    """Return the share of the belt speed by which the slide's next upward speed exceeds it.

    The belt moves, at a speed above zero, and has released the slide.

    -1 if the slide does not move upward again. Above the belt speed friction reverses: there
    the peak is that of the parabola which starts with the slide's acceleration and loses v0 of
    it per unit of time, as an orbit does that touches. Raises RunError for a motion too stiff
    to follow.
    """
    peak = first_found(_released(drive), lambda part: _highest(part, drive.belt_speed))
    if peak is None:
        return -1.0
    position, velocity = peak
    excess = velocity / drive.belt_speed - 1.0
    if abs(excess) > _ROUNDING:
        return excess
    acceleration = (release_position(drive) - position) / drive.length_scale
    excess = (acceleration / (drive.belt_speed / drive.speed_scale)) ** 2 / 2.0
    return excess if excess > _ROUNDING else 0.0


def release_margin(drive: Drive) -> float:
    """Return a value above zero if the slide sticks again, and below zero if it does not.

    It is zero where the slide only just sticks: because it only just reaches the belt speed, or
    because its force is the largest that friction can hold. A slide that overtakes the belt
    sticks when it falls back to the belt speed, or never: in the plane of position and speed
    its orbit then encloses all previous ones. Raises RunError like `release_excess`.
    """
    excess = release_excess(drive)
    if excess <= 0.0:
        return excess
    position = first_found(_released(drive), lambda part: _entry(part, drive.belt_speed))
    if position is None:
        return -1.0
    return min(excess, (release_position(drive) - position) / drive.length_scale)


def _released(drive: Drive) -> RecordedMotion:
    """Return the motion of a slide that the belt has just released."""
    motion = RecordedMotion(drive, release_position(drive), drive.belt_speed)
    motion.take_breakpoints()
    return motion


def _highest(breakpoints: Breakpoints, belt_speed: float) -> tuple[float, float] | None:
    """Return position and velocity where the slide is fastest, between two backward motions.

    If it reaches the belt speed: there. None while the motion has not got so far.
    """
    backward = breakpoints.velocity < 0.0
    forward = np.flatnonzero(np.logical_or.accumulate(backward) & ~backward)
    if len(forward) == 0:
        return None
    swing = breakpoints[forward[0] :]
    over = np.flatnonzero(swing.velocity < 0.0)
    arrived = np.flatnonzero(swing.velocity >= belt_speed * (1.0 - _ROUNDING))
    if len(arrived) > 0 and not np.any(over < arrived[0]):
        row = int(arrived[0])
    elif len(over) > 0:
        row = int(np.argmax(swing.velocity[: over[0]]))
    else:
        return None
    return float(swing.position[row]), float(swing.velocity[row])


def _entry(breakpoints: Breakpoints, belt_speed: float) -> float | None:
    """Return the position where the slide sticks, or falls back to the belt speed from above.

    This is after the slide went back; None while the motion has not got so far.
    """
    level = belt_speed * (1.0 + _ROUNDING)
    returned = np.logical_or.accumulate(breakpoints.velocity < 0.0)
    over = np.logical_or.accumulate(returned & (breakpoints.velocity > level))
    sticks = returned & np.append(breakpoints.sticking[1:], False)
    rows = np.flatnonzero(sticks | (over & (breakpoints.velocity <= level)))
    return float(breakpoints.position[rows[0]]) if len(rows) > 0 else None
