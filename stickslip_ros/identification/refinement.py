"""Fit of the simulated trajectory, through stick and slip, to the positions of records."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.identification.intervals import clustered_covariance, white_covariance
from stickslip_ros.identification.models import DELAY, Model
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.trajectory import Predictor

_STEP = 1e-6
"""Step of the differences, as a share of the value: the motion is exact to about 1e-13."""
_ALONE = 1e-5
"""Least share of a derivative that is not one of the others, for a coordinate that can be told."""
_COLOURED = 0.1
"""Correlation of successive errors above which they count as coloured."""
_INSIDE = 1e-9
"""Distance of the start of a search from its bounds, as a share of the value."""
_UNBOUNDED = 10.0
"""Error of a motion that is not bounded, in spans of the record."""


@dataclass(frozen=True)
class Segment:
    """Consecutive samples of a record that are predicted from a state of their own."""

    record: int
    start: int
    count: int


@dataclass(frozen=True, eq=False)
class Trajectories:
    """A model with the segments of records that it is to predict."""

    model: Model
    predictors: Sequence[Predictor]
    segments: Sequence[Segment]
    starts: FloatArray
    """Measured state at the start of each segment, m and m/s; shape (segments, 2)."""
    normal_force: float

    @cached_property
    def measured(self) -> FloatArray:
        """Positions of all segments, m."""
        return np.concatenate([self._own(segment) for segment in self.segments])

    @cached_property
    def block(self) -> IntArray:
        """Number of the segment of each position."""
        return np.repeat(np.arange(len(self.segments)), [each.count for each in self.segments])

    def _own(self, segment: Segment) -> FloatArray:
        position = self.predictors[segment.record].record.position
        return position[segment.start : segment.start + segment.count]

    def predicted(self, values: Mapping[str, float], starts: FloatArray) -> FloatArray:
        """Return the positions of all segments, m; far away where there is no motion."""
        span = _UNBOUNDED * float(np.ptp(self.measured))
        try:
            drive = self.model.drive(values, self.normal_force)
            found = np.concatenate(
                [
                    self.predictors[segment.record].positions(
                        drive, segment.start, segment.count, x, v, values.get(DELAY, 0.0)
                    )
                    for segment, (x, v) in zip(self.segments, starts.tolist(), strict=True)
                ]
            )
        except (InvalidInputError, RunError):
            found = np.full(len(self.measured), np.nan)
        middle = float(np.mean(self.measured))
        low, high = middle - span, middle + span
        return np.where(np.isfinite(found), np.clip(found, low, high), high)

    @property
    def fastest(self) -> float:
        """Fastest speed relative to the belt, m/s, by the starts of the segments."""
        belts = [
            self.predictors[segment.record].record.belt_velocity[segment.start]
            for segment in self.segments
        ]
        return max(float(np.abs(self.starts[:, 1] - belts).max()), 1e-12)

    def typical(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return a size of each coordinate that may be zero, SI units."""
        force = self.model.static_force(values)
        rate, period = force / self.fastest, self.predictors[0].record.period
        forces = dict.fromkeys(("bias_force", "static", "rise", "minimum", "kinetic"), force)
        return {**forces, "damping": rate, "viscous": rate, DELAY: period, "bristle_damping": rate}

    def chosen(self, which: BoolArray) -> "Trajectories":
        """Return the same with some of the segments."""
        segments = [each for each, used in zip(self.segments, which, strict=True) if used]
        return replace(self, segments=segments, starts=self.starts[which])


@dataclass(frozen=True, eq=False)
class Refinement:
    """The constants whose trajectories are nearest to the measured positions."""

    task: Trajectories
    free: Sequence[str]
    """Coordinates that are fitted."""
    values: Mapping[str, float]
    """All coordinates."""
    starts: FloatArray
    """Fitted state at the start of each segment, m and m/s; shape (segments, 2)."""
    residual: FloatArray
    """Predicted less measured positions, m."""

    @property
    def losses(self) -> FloatArray:
        """Mean square of the residual in each segment, m^2."""
        squares = self.residual * self.residual
        block = self.task.block
        return np.bincount(block, squares) / np.bincount(block)

    @cached_property
    def derivatives(self) -> FloatArray:
        """Derivatives of the positions by `free`, then by the starts."""
        return self.derivatives_by(self.free)

    def derivatives_by(self, names: Sequence[str]) -> FloatArray:
        """Return the derivatives of the positions by coordinates, then by the starts."""
        base = self.residual + self.task.measured
        return _derivatives(self.task, names, self.values, self.starts, base)

    @property
    def correlation(self) -> float:
        """Correlation of successive errors."""
        first, second = self.residual[:-1], self.residual[1:]
        power = float(self.residual @ self.residual)
        return float(first @ second) / power if power > 0.0 else 0.0

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of `free`."""
        return self.covariance_of(self.derivatives)[: len(self.free), : len(self.free)]

    def covariance_of(self, derivatives: FloatArray) -> FloatArray:
        """Return the covariance of coordinates by whose derivatives it is fitted."""
        if abs(self.correlation) < _COLOURED or len(self.task.segments) < 3:
            return white_covariance(derivatives, self.residual)
        return clustered_covariance(derivatives, self.residual, self.task.block)

    def gain(self, name: str) -> tuple[float, float]:
        """Return what fitting one more coordinate would bring, to first order.

        It is the number of standard errors by which the coordinate would move, and the share of the
        square of the residual that would go; 0 for what the record cannot tell.
        """
        others, column = self.derivatives, self.derivatives_by([name])[:, 0]
        norms = np.linalg.norm(others, axis=0)
        basis = np.linalg.qr(others / np.where(norms > 0.0, norms, 1.0))[0]
        alone = column - basis @ (basis.T @ column)
        size = float(alone @ alone)
        if size <= (_ALONE * float(np.linalg.norm(column))) ** 2:
            return 0.0, 0.0
        rest = self.residual - basis @ (basis.T @ self.residual)
        error = np.sqrt(self.covariance_of(np.column_stack([alone]))[0, 0])
        along = float(alone @ rest)
        return -along / size / float(error), along * along / size / float(rest @ rest)


def refine(
    task: Trajectories,
    free: Sequence[str],
    values: Mapping[str, float],
    starts: FloatArray | None = None,
    *,
    most: int = 30,
    interior: bool = False,
) -> Refinement:
    """Fit coordinates and the states at the starts of the segments.

    Parameters
    ----------
    task : Trajectories
        Model and segments.
    free : sequence of str
        Coordinates to fit; with none, only the starts are fitted.
    values : mapping
        All coordinates at the start of the search.
    starts : array of shape (segments, 2), optional
        States at the start of the search. By default the measured ones.
    most : int, optional
        Largest number of steps.
    interior : bool, optional
        Whether the search stays off the bounds. By default it may walk along them, which takes
        fewer steps, and may stay there for good.

    Returns
    -------
    Refinement
        The nearest trajectories.
    """
    from scipy.optimize import least_squares

    begin = task.starts if starts is None else starts
    first = np.array([*(values[name] for name in free), *begin.ravel()])
    count, span = len(free), float(np.ptp(task.measured))
    bounds = np.full((2, len(first)), np.inf) * [[-1.0], [1.0]]
    if count:
        each = [task.model.bounds(name, values, task.fastest) for name in free]
        bounds[:, :count] = np.transpose(each)
    noise = 1e-3 * span

    def split(point: FloatArray) -> tuple[dict[str, float], FloatArray]:
        given = dict(zip(free, point[:count].tolist(), strict=True))
        return {**values, **given}, point[count:].reshape(-1, 2)

    def residual(point: FloatArray) -> FloatArray:
        return (task.predicted(*split(point)) - task.measured) / noise

    def derivatives(point: FloatArray) -> FloatArray:
        given, states = split(point)
        return _derivatives(task, free, given, states, task.predicted(given, states)) / noise

    solve: Any = least_squares  # its types know no function for jac
    found = solve(
        residual,
        np.clip(first, *(bounds + _INSIDE * np.abs(first) * [[1.0], [-1.0]])),
        derivatives,
        bounds=bounds,
        method="trf" if interior else "dogbox",
        x_scale="jac",
        ftol=1e-7,
        xtol=1e-8,
        gtol=1e-12,
        max_nfev=most,
    )
    best, states = split(found.x)
    return Refinement(task, free, best, states, found.fun * noise)


def _derivatives(
    task: Trajectories,
    names: Sequence[str],
    values: Mapping[str, float],
    starts: FloatArray,
    base: FloatArray,
) -> FloatArray:
    """Return the derivatives of the positions by coordinates, then by each start.

    They are differences from the positions `base`. The starts of all segments are moved at once: a
    start has no part in other segments.
    """
    columns: list[FloatArray] = []
    typical = task.typical(values)
    for name in names:
        step = _STEP * max(abs(values[name]), typical.get(name, 0.0))
        moved = task.predicted({**values, name: values[name] + step}, starts)
        columns.append((moved - base) / step)
    block = task.block
    by_start = np.zeros((len(block), 2 * len(starts)))
    steps = _STEP * np.maximum(np.abs(task.starts).max(axis=0), 1e-9)
    rows = np.arange(len(block))
    for axis, step in enumerate(steps.tolist()):
        shift = np.where(np.arange(2) == axis, step, 0.0)
        by_start[rows, 2 * block + axis] = (task.predicted(values, starts + shift) - base) / step
    return np.column_stack([*columns, by_start])


def segments_of(records: Sequence[Record], length: float) -> tuple[list[Segment], FloatArray]:
    """Return segments of records about as long as asked, and the measured state at their starts.

    They start where the slide is fastest relative to the belt: a slide that sticks has no velocity
    of its own.

    Parameters
    ----------
    records : sequence of Record
        The records.
    length : float
        Length of a segment, s.

    Returns
    -------
    list of Segment, array of shape (segments, 2)
        Segments that follow each other; position, m, and velocity, m/s.
    """
    from scipy.signal import savgol_filter

    segments: list[Segment] = []
    starts: list[FloatArray] = []
    for number, record in enumerate(records):
        total = len(record.position)
        window = 11
        smooth: FloatArray = np.asarray(savgol_filter(record.position, window, 3))
        speed: FloatArray = np.asarray(
            savgol_filter(record.position, window, 3, deriv=1, delta=record.period)
        )
        relative = np.abs(speed - record.belt_velocity)
        relative[[*range(window // 2)]] = -1.0
        count = max(round(total * record.period / length), 1)
        edges = np.linspace(0, total, count + 1).astype(int)
        reach = max((edges[1] - edges[0]) // 5, 1)
        places = [0]
        for edge in edges[1:-1]:
            around = np.arange(max(edge - reach, 0), min(edge + reach, total))
            places.append(int(around[np.argmax(relative[around])]))
        places.append(total)
        for low, high in pairwise(places):
            segments.append(Segment(number, low, high - low))
            starts.append(np.array([smooth[low], speed[low]]))
    return segments, np.array(starts)
