"""The fit of a simulated trajectory, through stick and slip, to what records have measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import sqrt

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import FloatArray, rms
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
_ROUNDING = 1.4
"""Errors, in rounding errors of the encoder, up to which they are those of the encoder."""
_WHITE_CORRELATION = 0.3
"""Correlation of successive errors up to which they are noise: rounding leaves some."""
_EXACT_SHARE = 1e-9
"""Share of the motion up to which an error is none: recordings of simulations have no noise."""
_SHORTEST_CYCLE, _REPEATED_CORRELATION = 20, 0.65
"""Samples of a cycle at least, and correlation of errors from which cycles are alike."""
_UNLIKE_CORRELATION = 0.3
"""Correlation below which errors have become unlike before they repeat."""
OPTIONAL = ("damping", "bias_force", DELAY, LAG)
"""Constants that are fitted only if the record asks for them, besides those of the law."""


@dataclass(frozen=True, eq=False)
class Refinement(Errors, Fit):
    """The constants, `names`, whose trajectories are nearest to the measured positions."""

    has_spring = True

    @property
    @override
    def law(self) -> IdentifiedLaw:
        return self.task.law

    @property
    @override
    def directions(self) -> Sequence[float]:
        return self.task.directions

    @property
    @override
    def scale(self) -> float:
        return float(np.std(self.task.positions))

    @property
    @override
    def point(self) -> FloatArray:
        return np.array([self.values[name] for name in self.names])

    @override
    def linearized(self) -> tuple[FloatArray, FloatArray, int]:
        return self._derivatives, self.residual, 2 * len(self.starts)

    @override
    def values_at(self, point: FloatArray) -> Mapping[str, float]:
        return {**self.values, **dict(zip(self.names, point.tolist(), strict=True))}

    @override
    def errors(self, record: Record) -> ForceErrors:
        record = record.lagging(self.values[LAG])
        columns = filtered(record, decimated=False, delay=self.delay)
        names = ("time", "position", "velocity", "acceleration", "relative_speed", "force")
        time, position, velocity, acceleration, speed, force = (
            getattr(columns, name)[columns.settled] for name in names
        )
        values = self.values
        law = self.law.friction(values, 1.0)
        friction = np.array([float(law.coefficient(w, 1.0 if w > 0.0 else -1.0)) for w in speed])
        model = values["mass"] * acceleration - friction - values["bias_force"]
        model += values["damping"] * velocity + values["stiffness"] * position
        return ForceErrors(time, position, speed, force - model, force - model - friction, force)

    @override
    def free_run(self, record: Record) -> FloatArray:
        task = self._divided(record, record.duration)
        first = task.segments[0].samples.start
        run = best_starts(task, self.values).outputs[: len(record.position) - first]
        return np.concatenate([np.full(first, np.nan), run])

    @override
    def residuals(self, record: Record) -> Residuals:
        samples = np.bincount(self.task.block[self.task.of_positions])
        length = float(np.median(samples)) * self.task.records[0].period
        task = self._divided(replace(record, velocity=None), length)
        away = task.positions - best_starts(task, self.values).restarted().outputs
        rows = np.arange(task.segments[0].samples.start, len(record.position))
        measured = ~record.lost[rows]
        away, rows = away[measured], rows[measured]
        relative = (record.smoothed(1) - record.belt_velocity)[rows]
        return Residuals(record.period * rows, record.position[rows], relative, away)

    def _divided(self, record: Record, length: float) -> Trajectories:
        """Return the task of predicting a record in segments of a length, s."""
        return replace(self.task, segments=segments_of([Predictor(record)], length))

    @property
    def is_white(self) -> bool:
        """Whether errors are noise, as far as their successive ones tell, or none."""
        along = float(self.residual[:-1] @ self.residual[1:])
        exact = rms(self.residual) < _EXACT_SHARE * self.scale
        return exact or abs(along) < _WHITE_CORRELATION * self.loss

    @property
    def is_rounding(self) -> bool:
        """Whether the errors of positions are as small as those of the encoder.

        They repeat where a slide sticks and the belt moves by whole steps of it between samples.
        """
        task = self.task
        step = min(record.resolution for record in task.records)
        rows = task.of_positions
        return rms(self.residual[rows]) < _ROUNDING * step / sqrt(12.0) * rms(task.weight[rows])

    @override
    def used(self, records: Sequence[Record]) -> float:
        return len(self.task.positions) / sum(len(record.position) for record in records)

    @property
    @override
    def repetition(self) -> int | None:
        return repetition_of(self.residual[self.task.of_positions])

    @cached_property
    def _derivatives(self) -> FloatArray:
        """Derivatives of the errors, at starts that follow them; shape (rows, numbers)."""
        return self.without_starts(self.by_names)

    @cached_property
    def _more(self) -> Errors:
        """The same errors, with the derivatives by the constants that could be fitted besides."""
        names = {*OPTIONAL, *self.law.optional}.difference(self.names)
        if not any(record.held_forces[0].any() for record in self.task.records):
            names -= {DELAY, LAG}  # nothing is late
        return Errors.at(self.task, sorted(names), self.values, self.starts)

    def gain(self, name: str) -> tuple[float, float]:
        """Return what fitting one more of `OPTIONAL`, or of those of the law, would bring.

        It is, to first order, the number of standard errors by which it would move, and the share
        of the square of the residual that would go; 0 for what the record cannot tell.
        """
        others, more = self._derivatives, self._more
        if name not in more.names:
            return 0.0, 0.0
        column = more.by_names[:, [[*more.names].index(name)]]
        norms = np.linalg.norm(others, axis=0)
        basis = np.linalg.qr(others / np.where(norms > 0.0, norms, 1.0))[0]
        alone = self.without_starts(column)[:, 0]
        alone -= basis @ (basis.T @ alone)
        size = float(alone @ alone)
        if size <= (_OWN_SHARE * float(np.linalg.norm(column))) ** 2:
            return 0.0, 0.0
        rest = self.residual - basis @ (basis.T @ self.residual)
        error = np.sqrt(block_covariance(alone[:, None], rest, 2 * len(self.starts))[0, 0])
        along = float(alone @ rest)
        return -along / size / float(error), along * along / size / float(rest @ rest)


def loss_of(fit: Refinement) -> float:
    """Return the squared error of a fit."""
    return fit.loss


def repetition_of(errors: FloatArray) -> int | None:
    """Return the number of samples after which errors repeat; None if they do not.

    It is the lag of the highest peak of their autocorrelation (G. E. P. Box, G. M. Jenkins, Time
    Series Analysis, 1970) behind the first lag at which they are unlike. Errors
    that are coloured only are alike over few samples, and less and less: their correlation falls,
    and does not rise again.
    """
    from scipy.signal import correlate, find_peaks

    products = correlate(errors, errors, method="fft")[len(errors) - 1 :][: len(errors) // 4]
    if not len(products) or not products[0] > 0.0:
        return None
    shares = products / products[0]
    unlike = np.flatnonzero(shares < _UNLIKE_CORRELATION)
    if not len(unlike):
        return None
    start = max(_SHORTEST_CYCLE, int(unlike[0]))
    peaks = find_peaks(shares[start:], height=_REPEATED_CORRELATION)[0] + start
    return int(peaks[np.argmax(shares[peaks])]) if len(peaks) else None
