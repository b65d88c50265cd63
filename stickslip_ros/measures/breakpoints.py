"""Breakpoints: points of a motion between which displacement and speed have no extremes.

The motion records them exactly; from samples they are interpolated. The cycle measures then only
compare and subtract.
"""

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


STICK_SHARE = 0.01
"""Share of the belt speed up to which a slide sticks whose friction has a memory.

Such a slide never has exactly the speed of the belt. On a belt at rest it is a share of the fastest
relative speed so far.
"""


def breakpoints_from_samples(
    time: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    belt_velocity: FloatArray,
    *,
    stick_speed: float = 0.0,
    exact_times: BoolArray | bool = True,
) -> Breakpoints:
    """Return the samples of a motion with interpolated stick edges, turning points and peaks.

    A sample sticks when its relative speed is at most `stick_speed` (m/s). Between two samples the
    displacement is interpolated by the cubic that has both positions and both velocities. The
    arrays have equal length n and SI units; the result has the n samples and the inserted points.
    No peaks are inserted in the n - 1 intervals whose time is not exact: they follow from distance
    over time and could be far too high.
    """
    stuck = np.abs(velocity - belt_velocity) <= stick_speed
    breakpoints = Breakpoints(
        time, position, velocity, np.concatenate([[False], stuck[1:] & stuck[:-1]])
    )
    edges = np.flatnonzero(stuck[1:] != stuck[:-1])
    exact = np.broadcast_to(exact_times, len(time[1:]))
    if len(edges) > 0:
        landing = stuck[edges + 1]
        breakpoints = _with_stick_edges(breakpoints, edges, landing, belt_velocity, stick_speed)
        exact = np.insert(exact, edges, exact[edges])
    sticking = breakpoints.sticking[1:]
    # A slide that moves exactly with the belt turns with it; one that is only near the belt's
    # velocity may turn while it sticks.
    return _with_interior_points(breakpoints, ~sticking | (stick_speed > 0.0), ~sticking & exact)


def _insert(breakpoints: Breakpoints, at: npt.NDArray[np.intp], new: Breakpoints) -> Breakpoints:
    columns = zip(vars(breakpoints).values(), vars(new).values(), strict=True)
    return Breakpoints(*(np.insert(column, at, inserted) for column, inserted in columns))


def _with_stick_edges(
    breakpoints: Breakpoints,
    edges: npt.NDArray[np.intp],
    landing: BoolArray,
    belt_velocity: FloatArray,
    stick_speed: float,
) -> Breakpoints:
    """Insert the instant at which the slide lands or leaves in the intervals that are `edges`.

    For a part s of the interval, next to its slipping end, the velocity differs from that of the
    sticking end; for the other part it equals it. The difference is r at the slipping end and has
    the power p of the time from where it starts: p = 1 on landing (it falls linearly) and p = 2 on
    leaving (the spring has just reached the limit). The displacement relative to a slide with the
    velocity of the sticking end is then r s / (p + 1). Where s would be longer than the interval,
    it is the interval, and p follows from this displacement. The edge is where the relative speed
    is `stick_speed`: with 0 at the end of s, otherwise within s.
    """
    at_stick, at_slip = np.where(landing, edges + 1, edges), np.where(landing, edges, edges + 1)
    riding, slipping = breakpoints.velocity[at_stick], breakpoints.velocity[at_slip]
    stick_excess, slip_excess = riding - belt_velocity[at_stick], slipping - belt_velocity[at_slip]
    step = breakpoints.time[edges + 1] - breakpoints.time[edges]
    displacement = breakpoints.position[edges + 1] - breakpoints.position[edges] - riding * step
    difference = slipping - riding
    power = np.where(landing, 1.0, 2.0)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        slip_time = np.nan_to_num((power + 1.0) * displacement / difference, nan=0.0)
        whole = slip_time > step
        slip_time = np.clip(slip_time, 0.0, step)
        power = np.where(whole, np.maximum(difference * step / displacement - 1.0, 0.0), power)
        # The part of the difference within which the slide already, or still, sticks.
        limit = np.copysign(stick_speed, slip_excess)
        part = (limit - stick_excess) / (slip_excess - stick_excess)
        near_time = slip_time * part ** (1.0 / power)
    near = difference * part * near_time / (power + 1.0)
    slip_time = slip_time - near_time
    instant = np.where(landing, slip_time, step - slip_time)
    riding_from = np.where(
        landing, breakpoints.position[edges + 1] - riding * step, breakpoints.position[edges]
    )
    edge_breakpoints = Breakpoints(
        breakpoints.time[edges] + instant,
        riding_from + riding * instant + np.where(landing, -near, near),
        riding + difference * part,
        ~landing,
    )
    sticking = breakpoints.sticking.copy()
    sticking[edges + 1] = landing
    breakpoints = replace(breakpoints, sticking=sticking)
    return _insert(breakpoints, edges + 1, edge_breakpoints)


def _with_interior_points(
    breakpoints: Breakpoints, may_turn: BoolArray, may_peak: BoolArray
) -> Breakpoints:
    """Insert turning points and peaks of the velocity in the intervals that may have them.

    In each interval the velocity is start + slope u + curvature u^2, for u from 0 to 1.
    """
    step, velocity = np.diff(breakpoints.time), breakpoints.velocity
    start, end = velocity[:-1], velocity[1:]
    with np.errstate(all="ignore"):
        mean = np.diff(breakpoints.position) / step
        slope, curvature = 6.0 * mean - 4.0 * start - 2.0 * end, 3.0 * (start + end - 2.0 * mean)
        peak = -slope / (2.0 * curvature)
        # The form of the root without cancellation.
        root = np.sqrt(slope * slope - 4.0 * curvature * start)
        turn = -2.0 * start / (slope + np.copysign(root, end - start))
        turn = np.where((turn > 0.0) & (turn < 1.0), turn, start / (start - end))
        turns = may_turn & (start * end < 0.0)
        peaks = may_peak & (peak > 0.0) & (peak < 1.0)
    # A jump onto the belt takes no time: there are no points within it.
    at, is_peak = np.nonzero(np.column_stack([turns, peaks]) & (step > 0.0)[:, None])
    u = np.where(is_peak, peak[at], turn[at])
    order = np.lexsort((u, at))
    u, at, is_peak = u[order], at[order], is_peak[order]
    step, start, slope, curvature = (column[at] for column in (step, start, slope, curvature))
    new = Breakpoints(
        breakpoints.time[at] + u * step,
        breakpoints.position[at] + step * u * (start + u * (slope / 2.0 + u * curvature / 3.0)),
        np.where(is_peak, start + u * (slope + u * curvature), 0.0),
        breakpoints.sticking[at + 1],
    )
    return _insert(breakpoints, at + 1, new)
