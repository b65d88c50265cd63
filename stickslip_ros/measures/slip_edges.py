"""Edges of a slip: when it leaves one rest and when it lands in the next.

At an edge the distance from the rest grows with a power of time; the edge is where that power
extrapolates to zero, and what the powers that fit differ by is part of its error. A long rest that
creeps, as where positions drift, is a line.
"""

from math import copysign, hypot, sqrt
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.noise import medians
from stickslip_ros.measures.rests import Rest

_NEAR_STEPS = 0.6
"""Distance from a rest that is none, in steps of the encoder."""
_NEAR_NOISES = 4.0
"""Distance from a rest that is none, in standard deviations of the noise."""
_NEAR_SHARE = 1e-3
"""Distance from a rest that is none, as a share of the slip."""
_OVER = 3.0
"""Distance beyond a rest from which a slip overshoots it, in distances that are none."""
_FAR_SHARE = 0.25
"""Distance from a rest up to which an edge is fitted, as a share of the slip, at most."""
_FAR_NEARS = 40.0
"""Distance from a rest up to which an edge is fitted, in distances that are none, at most."""
_RELEASE_POWERS = np.array([[2.0], [3.0], [4.0], [6.0]])
"""Powers of time with which the distance may grow after a release: a friction that falls at once
leaves a constant force, one that falls with the speed lets the motion grow slowly."""
_LANDING_POWERS = np.array([[1.5], [2.0], [2.5]])
"""Powers of the time to a landing with which the distance may fall."""
_LONG, _MARGIN, _MOST_CREEP = 0.6, 0.15, 0.1
"""Length of a rest from which it may creep, in the time from its middle to that of the next (a sine
is slow for a third of its period); share of it at each end that may be bent and does not count for
its creep; largest creep, in slips."""
_BACK = 0.25
"""Travel of a slip, in its farthest distance from the rest, below which the slide comes back."""
_ROW_ERROR = 0.3
"""Least standard error of an edge, in sample periods."""
_SLIP_ERROR = 0.03
"""Least standard error of an edge, in durations of the slip."""


class SlipEdges(NamedTuple):
    """When a slip begins and ends, s, with the standard errors, and how far it travels, m."""

    release: float
    landing: float
    errors: tuple[float, float]
    travel: float

    @property
    def duration(self) -> float:
        """Time of the slip, s."""
        return self.landing - self.release


def slip_edges(
    time: FloatArray, position: FloatArray, before: Rest, after: Rest, noise: float, step: float
) -> SlipEdges:
    """Return the edges of the slip between two rests; SI units."""
    release, release_error = edge(time, position, before, after, noise, step)
    landing, landing_error = edge(time, position, after, before, noise, step)
    least = _SLIP_ERROR * (landing - release)
    errors = hypot(release_error, least), hypot(landing_error, least)
    return SlipEdges(release, landing, errors, after.level - before.level)


def edge(
    time: FloatArray, position: FloatArray, rest: Rest, other: Rest, noise: float, step: float
) -> tuple[float, float]:
    """Return when a slip from or to another rest begins or ends at a rest, s, and its error."""
    first, last = ((still.first + still.last) // 2 for still in (rest, other))
    way = 1 if last >= first else -1
    rows = np.arange(first, last + way, way)
    away, slip = position[rows] - rest.level, other.level - rest.level
    farthest = float(away[np.argmax(np.abs(away))])
    slip = slip if abs(slip) > _BACK * abs(farthest) else farthest
    size = abs(slip)
    near = max(_NEAR_STEPS * step, _NEAR_NOISES * noise, _NEAR_SHARE * size)
    if rest.last - rest.first > _LONG * len(rows):
        level, creep = _line(position, rest, near, _MOST_CREEP * size)
        away = position[rows] - level - creep * (rows - first)
    course = copysign(1.0, slip) * away
    # Where the middle of a rest leaves its level, any such row may be the edge.
    inner = course[: round((0.5 - _MARGIN) * abs(rest.last - rest.first))]
    unsure = int(np.count_nonzero(np.abs(inner) > near)) / sqrt(12.0)
    middle = int(np.argmax(course > size / 2.0))
    powers = _RELEASE_POWERS if way > 0 else _LANDING_POWERS
    row, error = _edge(course[: middle + 1], near, size, powers)
    period = abs(float(time[last] - time[first])) / max(abs(last - first), 1)
    return float(np.interp(row, np.arange(len(rows)), time[rows])), hypot(error, unsure) * period


def _line(position: FloatArray, rest: Rest, least: float, most: float) -> tuple[float, float]:
    """Return where a rest is in its middle, m, and its creep, m a row.

    A creep by less than the `least` travel in the rest, or by more than the `most`, m, is none.
    """
    margin = round(_MARGIN * (rest.last - rest.first))
    inner = position[rest.first + margin : rest.last - margin + 1]
    lag = np.arange(len(inner)) - (len(inner) - 1) / 2.0
    creep = float(lag @ inner) / max(float(lag @ lag), 1.0)
    if least < abs(creep) * (rest.last - rest.first) < most:
        return float(inner.mean()), creep
    return rest.level, 0.0


def _edge(course: FloatArray, near: float, size: float, powers: FloatArray) -> tuple[float, float]:
    """Return the row at which a course leaves zero on its way to a slip of this size; its error."""
    distance = np.abs(course)
    inside, over = (distance <= near).nonzero()[0], (medians(course) < -_OVER * near).nonzero()[0]
    over = over[over > inside[0]] if len(inside) else over[:0]
    if len(over):  # beyond the rest, from where the slide comes back
        inside, size = inside[inside < over[0]], -float(course.min())
    last = int(inside[-1]) if len(inside) else 0
    far = near + min(_FAR_SHARE * size, _FAR_NEARS * near)
    beyond = (distance[last + 1 :] > far).nonzero()[0]
    values = distance[last + 1 : last + 2 + int(beyond[0]) if len(beyond) else None]
    if len(values) < 3:
        # For so many rows noise or a step hides a distance that grows with the square of time. The
        # edge is put in their middle, with half of them as its error.
        hidden = max(len(values) - 0.5, 0.5) / (sqrt(far / near) - 1.0)
        return last + 0.5 - hidden / 2.0, hypot(_ROW_ERROR, 0.3, hidden / 2.0)
    half = (len(values) - 1) / 2.0
    middle, lag = last + 1.0 + half, np.arange(-half, half + 1.0)
    roots = values ** (1.0 / powers)
    offset, slope = roots.sum(axis=1) / len(lag), roots @ lag / (lag @ lag)
    fitted = np.maximum(offset[:, np.newaxis] + slope[:, np.newaxis] * lag, 0.0) ** powers
    squares = ((fitted - values) ** 2).sum(axis=1) + (near / 3.0) ** 2
    back = np.full(len(slope), middle - last)  # where the fit does not rise
    edges = middle - np.divide(offset, slope, out=back, where=slope > 0.0)
    edges = np.minimum(np.maximum(edges, 0.0), last + 1.0)
    weight = (squares.min() / squares) ** 2
    weight /= weight.sum()
    mean = float(weight @ edges)
    return mean, hypot(_ROW_ERROR, sqrt(float(weight @ (edges - mean) ** 2)))
