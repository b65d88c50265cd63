"""The fit of a simulated trajectory, through stick and slip, to what records have measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.covariance import block_covariance
from stickslip_ros.identification.filtered import filtered
from stickslip_ros.identification.fit import Fit, ForceErrors, Residuals
from stickslip_ros.identification.identified_law import DELAY, LAG, IdentifiedLaw
from stickslip_ros.identification.predictor import Predictor
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.segment_starts import Errors, best_starts
from stickslip_ros.identification.trajectories import Trajectories, segments_of

_OWN_SHARE = 1e-5
"""Least share of a derivative beside the others, for a coordinate that is identifiable."""
_SHORTEST_CYCLE, _REPEATED_CORRELATION = 20, 0.65
"""Samples of a cycle at least, and correlation of errors from which cycles are alike."""
_UNLIKE_CORRELATION = 0.3
"""Correlation below which errors have become unlike before they repeat."""


@dataclass(frozen=True, eq=False)
class Refinement(Fit):
    """The constants whose trajectories are nearest to the measured positions."""

    has_spring = True
    best: Errors
    """What the constants and the best starts leave, with derivatives by what is fitted."""

    @property
    @override
    def law(self) -> IdentifiedLaw:
        return self.best.task.law

    @property
    @override
    def directions(self) -> Sequence[float]:
        return self.best.task.directions

    @property
    @override
    def delay(self) -> float:
        return self.best.values.get(DELAY, 0.0)

    @property
    @override
    def scale(self) -> float:
        return float(np.std(self.best.task.positions))

    @property
    @override
    def point(self) -> FloatArray:
        return np.array([self.best.values[name] for name in self.best.names])

    @override
    def linearized(self) -> tuple[FloatArray, FloatArray, int]:
        return self._derivatives, self.best.residual, 2 * len(self.best.starts)

    @override
    def values_at(self, point: FloatArray) -> Mapping[str, float]:
        return {**self.best.values, **dict(zip(self.best.names, point.tolist(), strict=True))}

    @override
    def force_at(self, point: FloatArray, sign: float, speed: FloatArray) -> FloatArray:
        law = self.law.friction(self.values_at(point), 1.0)
        return np.array([-sign * float(law.coefficient(sign * w, sign)) for w in speed.tolist()])

    @override
    def errors(self, record: Record) -> ForceErrors:
        record = record.lagging(self.best.values.get(LAG, 0.0))
        columns = filtered(record, decimated=False, delay=self.delay)
        names = ("time", "position", "velocity", "acceleration", "relative_speed", "force")
        time, position, velocity, acceleration, speed, force = (
            getattr(columns, name)[columns.settled] for name in names
        )
        values = self.best.values
        law = self.law.friction(values, 1.0)
        friction = np.array(
            [float(law.coefficient(each, 1.0 if each > 0.0 else -1.0)) for each in speed]
        )
        model = values["mass"] * acceleration - friction - values["bias_force"]
        model += values["damping"] * velocity + values["stiffness"] * position
        return ForceErrors(time, position, speed, force - model, force - model - friction, force)

    @override
    def free_run(self, record: Record) -> FloatArray:
        task = self._divided(record, record.duration)
        count = task.segments[0].count
        values = self.best.values
        run = task.predicted(values, best_starts(task, values).starts)[:count]
        return np.concatenate([np.full(len(record.position) - len(run), np.nan), run])

    @override
    def residuals(self, record: Record) -> Residuals:
        own, values = self.best.task, self.best.values
        length = float(np.median([segment.count for segment in own.segments]))
        length *= own.predictors[0].record.period
        task = self._divided(replace(record, velocity=None), length)
        starts = best_starts(task, values).restarted().starts
        away = task.positions - task.predicted(values, starts)
        rows = np.concatenate([np.arange(s.start, s.start + s.count) for s in task.segments])
        measured = ~record.lost[rows]
        away, rows = away[measured], rows[measured]
        relative = (record.smoothed(1) - record.belt_velocity)[rows]
        time = record.period * rows.astype(float)
        return Residuals(time, record.position[rows], relative, away)

    def _divided(self, record: Record, length: float) -> Trajectories:
        """Return the task of predicting a record in segments of a length, s."""
        predictors = [Predictor(record)]
        segments, starts = segments_of([record], length)
        return replace(self.best.task, predictors=predictors, segments=segments, starts=starts)

    @property
    def correlation(self) -> float:
        """Correlation of successive errors."""
        first, second = self.best.residual[:-1], self.best.residual[1:]
        power = self.best.loss
        return float(first @ second) / power if power > 0.0 else 0.0

    @property
    @override
    def used(self) -> float:
        task = self.best.task
        samples = sum(segment.count for segment in task.segments)
        return samples / sum(len(each.record.position) for each in task.predictors)

    @property
    @override
    def repetition(self) -> int | None:
        return repetition_of(self.best.residual[self.best.task.of_positions])

    @cached_property
    def _derivatives(self) -> FloatArray:
        """Derivatives of the errors, at starts that follow them; shape (rows, numbers)."""
        return self.best.without_starts(self.best.by_names)

    def gain(self, name: str) -> tuple[float, float]:
        """Return what fitting one more coordinate would bring, to first order.

        It is the number of standard errors by which the coordinate would move, and the share of the
        square of the residual that would go; 0 for what the record cannot tell.
        """
        best, others = self.best, self._derivatives
        column = Errors.at(best.task, [name], best.values, best.starts).by_names
        norms = np.linalg.norm(others, axis=0)
        basis = np.linalg.qr(others / np.where(norms > 0.0, norms, 1.0))[0]
        alone = best.without_starts(column)[:, 0]
        alone -= basis @ (basis.T @ alone)
        size = float(alone @ alone)
        if size <= (_OWN_SHARE * float(np.linalg.norm(column))) ** 2:
            return 0.0, 0.0
        rest = best.residual - basis @ (basis.T @ best.residual)
        error = np.sqrt(block_covariance(alone[:, None], rest, 2 * len(best.starts))[0, 0])
        along = float(alone @ rest)
        return -along / size / float(error), along * along / size / float(rest @ rest)


def repetition_of(errors: FloatArray) -> int | None:
    """Return the number of samples after which errors repeat; None if they do not.

    It is the lag of the highest peak of their autocorrelation (G. E. P. Box, G. M. Jenkins, Time
    Series Analysis, 1970) behind the first lag at which they are unlike. Errors
    that are coloured only are alike over few samples, and less and less: their correlation falls,
    and does not rise again.
    """
    from scipy.signal import correlate, find_peaks

    found = correlate(errors, errors, method="fft")[len(errors) - 1 :][: len(errors) // 4]
    if not len(found) or not found[0] > 0.0:
        return None
    shares = found / found[0]
    unlike = np.flatnonzero(shares < _UNLIKE_CORRELATION)
    if not len(unlike):
        return None
    start = max(_SHORTEST_CYCLE, int(unlike[0]))
    peaks = find_peaks(shares[start:], height=_REPEATED_CORRELATION)[0] + start
    return int(peaks[np.argmax(shares[peaks])]) if len(peaks) else None
