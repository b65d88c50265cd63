"""Breakpoints: points of a motion between which displacement and speed have no extremes.

The motion records them exactly; from samples they are interpolated. The cycle measures then only
compare and subtract.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import BoolArray, FloatArray, Table


@dataclass(frozen=True)
class Breakpoints(Table):
    """Breakpoints of a part of a motion, as columns of equal length, in order of time.

    `len(breakpoints)` is the number of rows, and `breakpoints[rows]` selects rows.
    """

    time: FloatArray
    """Time, s; shape (n,)."""
    position: FloatArray
    """Displacement of the slide, m; shape (n,)."""
    velocity: FloatArray
    """Velocity of the slide, m/s, exactly zero at turning points; shape (n,)."""
    sticking: BoolArray
    """Whether the slide stuck to the belt since the previous breakpoint; shape (n,)."""

    @property
    def stuck(self) -> BoolArray:
        """Whether the slide stuck next to each breakpoint, before or after it; shape (n,)."""
        return self.sticking | np.append(self.sticking[1:], False)[: len(self)]

    @classmethod
    def empty(cls) -> Self:
        """Return no breakpoints: columns of length 0.

        Returns
        -------
        Breakpoints
            Table without rows.
        """
        none = np.empty(0)
        return cls(none, none, none, np.empty(0, dtype=bool))


def breakpoints_from_samples(
    time: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    belt_velocity: FloatArray,
    *,
    exact_times: bool = True,
) -> Breakpoints:
    """Return the samples of a motion with interpolated stick edges, turning points and peaks.

    A sample sticks when its velocity is that of the belt. Between two samples the displacement is
    interpolated by the cubic that has both positions and both velocities. The arrays have equal
    length n and SI units; the result has the n samples and the inserted points. Without
    `exact_times` no peaks are inserted: they follow from distance over time and could be far too
    high.
    """
    stuck = velocity == belt_velocity
    breakpoints = Breakpoints(
        time, position, velocity, np.concatenate([[False], stuck[1:] & stuck[:-1]])
    )
    breakpoints = _with_stick_edges(breakpoints, stuck, belt_velocity)
    breakpoints = _with_interior_points(breakpoints, _Cubics.turning_points, velocity=0.0)
    if exact_times:
        breakpoints = _with_interior_points(breakpoints, _Cubics.velocity_peaks)
    return breakpoints


def _insert(breakpoints: Breakpoints, at: npt.NDArray[np.intp], new: Breakpoints) -> Breakpoints:
    columns = zip(vars(breakpoints).values(), vars(new).values(), strict=True)
    return Breakpoints(*(np.insert(column, at, inserted) for column, inserted in columns))


def _with_stick_edges(
    breakpoints: Breakpoints, stuck: BoolArray, belt_velocity: FloatArray
) -> Breakpoints:
    """Insert the instant at which the slide lands on the belt or leaves it.

    The slide slips for a part s of the interval, next to its slipping end, where the relative
    speed is r; for the other part it moves with the belt. The displacement relative to the belt is
    then r s / 2 on landing (the relative speed falls linearly) and r s / 3 on leaving (the spring
    has just reached the limit, so the relative speed starts quadratically).
    """
    edges = np.flatnonzero(stuck[1:] != stuck[:-1])
    if len(edges) == 0:
        return breakpoints
    landing = stuck[edges + 1]
    belt = np.where(landing, belt_velocity[edges + 1], belt_velocity[edges])
    step = breakpoints.time[edges + 1] - breakpoints.time[edges]
    relative_displacement = (
        breakpoints.position[edges + 1] - breakpoints.position[edges] - belt * step
    )
    slipping_speed = (
        np.where(landing, breakpoints.velocity[edges], breakpoints.velocity[edges + 1]) - belt
    )
    order = np.where(landing, 2.0, 3.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        slip_time = np.nan_to_num(order * relative_displacement / slipping_speed, nan=0.0)
    slip_time = np.clip(slip_time, 0.0, step)
    stick_time = step - slip_time
    instant = np.where(landing, slip_time, stick_time)
    riding_from = np.where(
        landing, breakpoints.position[edges + 1] - belt * step, breakpoints.position[edges]
    )
    edge_breakpoints = Breakpoints(
        breakpoints.time[edges] + instant, riding_from + belt * instant, belt, ~landing
    )
    sticking = breakpoints.sticking.copy()
    sticking[edges + 1] = landing
    breakpoints = replace(breakpoints, sticking=sticking)
    return _insert(breakpoints, edges + 1, edge_breakpoints)


@dataclass(frozen=True)
class _Cubics:
    """The cubics of n intervals: velocity start + slope u + curvature u^2 for u from 0 to 1."""

    start: FloatArray
    end: FloatArray
    slope: FloatArray
    curvature: FloatArray

    @classmethod
    def through(cls, breakpoints: Breakpoints) -> Self:
        step = np.diff(breakpoints.time)
        start, end = breakpoints.velocity[:-1], breakpoints.velocity[1:]
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = np.diff(breakpoints.position) / step
        curvature = 3.0 * (start + end - 2.0 * mean)
        return cls(start, end, 6.0 * mean - 4.0 * start - 2.0 * end, curvature)

    def turning_points(self) -> FloatArray:
        """Return u where the velocity crosses zero, NaN where it does not."""
        with np.errstate(all="ignore"):
            root = np.sqrt(self.slope * self.slope - 4.0 * self.curvature * self.start)
            # The form of the root without cancellation.
            u = -2.0 * self.start / (self.slope + np.copysign(root, self.end - self.start))
            straight = self.start / (self.start - self.end)
        u = np.where((u > 0.0) & (u < 1.0), u, straight)
        return np.where(self.start * self.end < 0.0, u, np.nan)

    def velocity_peaks(self) -> FloatArray:
        """Return u where the velocity has an extreme, NaN where it has none."""
        with np.errstate(all="ignore"):
            u = -self.slope / (2.0 * self.curvature)
        return np.where((u > 0.0) & (u < 1.0), u, np.nan)


def _with_interior_points(
    breakpoints: Breakpoints, find: Callable[[_Cubics], FloatArray], velocity: float | None = None
) -> Breakpoints:
    """Insert the points that `find` returns for slip, with `velocity` where it is known."""
    cubics = _Cubics.through(breakpoints)
    u = np.where(breakpoints.sticking[1:], np.nan, find(cubics))
    # A jump onto the belt takes no time: there are no points within it.
    at = np.flatnonzero(np.isfinite(u) & (np.diff(breakpoints.time) > 0.0))
    if len(at) == 0:
        return breakpoints
    u, step = u[at], np.diff(breakpoints.time)[at]
    start, slope, curvature = cubics.start[at], cubics.slope[at], cubics.curvature[at]
    reached = start + u * (slope + u * curvature)
    new = Breakpoints(
        breakpoints.time[at] + u * step,
        breakpoints.position[at] + step * u * (start + u * (slope / 2.0 + u * curvature / 3.0)),
        reached if velocity is None else np.full(len(at), velocity),
        np.zeros(len(at), dtype=bool),
    )
    return _insert(breakpoints, at + 1, new)
