"""Segments of records, the positions that a model predicts for them, and their derivatives."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import groupby, pairwise
from typing import Any

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.identification.identified_law import DELAY, LAG, IdentifiedLaw
from stickslip_ros.identification.predictor import Predictor, steady_memory
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.time_limit import TimeLimit
from stickslip_ros.model.drive import Drive, in_units_of
from stickslip_ros.model.drive_layout import MEMORY
from stickslip_ros.model.friction import LAWS
from stickslip_ros.model.plain_drive import drive_system
from stickslip_ros.motion.motion import Motion
from stickslip_ros.motion.variational import VariationalMotion

_STEP = 1e-4
"""Step, as a share of the value, of constants that are linear in the coordinates."""
_MOTION_STEP = 1e-5
"""Step, as a share of the value, of what a motion has no derivatives by."""
_LEAST = 1e-9
"""Share of its usual size that a constant has instead of 0."""
_ROUGH_SAMPLES = 5
"""Samples at the start of a record whose velocity is rough."""
_LONG_DELAY = 100.0
"""Size of a delay and of a lag from which steps are made, in sample periods."""
_RUN_TIME, _DIFFERENCE_TIME = 1e-5, 7e-6
"""Usual processor time of a sample with its derivatives, s, and of each difference, s, without a
memory; each of its states takes as long again."""
_UNBOUNDED_ERROR = 10.0
"""Error of a motion that is not bounded, in spans of the record."""


@dataclass(frozen=True, eq=False)
class Segment:
    """Consecutive samples of a record that are predicted from a state of their own."""

    predictor: Predictor
    samples: slice
    state: FloatArray
    """Measured position and velocity at the start, m and m/s."""

    @property
    def belt_speed(self) -> float:
        """Belt speed at the start, m/s."""
        return float(self.predictor.record.belt_velocity[self.samples.start])


@dataclass(frozen=True, eq=False)
class Trajectories:
    """A law with the segments of records that it is to predict.

    Each has a state of its own at its start, as in multiple shooting (H. G. Bock, Numerical
    treatment of inverse problems in chemical reaction kinetics, 1981), but need not join the next:
    what a model lacks does not grow over a record.
    """

    law: IdentifiedLaw
    directions: Sequence[float]
    """Signs of the relative speed in the records: 1, -1 or both."""
    segments: Sequence[Segment]
    """Segments, those of a record after one another."""
    normal_force: float
    """Normal force, N: in its units the simulated motion is of the order of 1."""
    limit: TimeLimit
    """Time after which a search ends."""

    @property
    def records(self) -> Sequence[Record]:
        """Records of the segments."""
        return [*dict.fromkeys(segment.predictor.record for segment in self.segments)]

    @cached_property
    def starts(self) -> FloatArray:
        """Measured state at the start of each segment, m and m/s; shape (segments, 2)."""
        return np.array([segment.state for segment in self.segments])

    @cached_property
    def measured(self) -> FloatArray:
        """Outputs of all segments: positions, m, and then velocities, m/s, of each."""
        return self._joined(lambda predictor: predictor.measured)

    @cached_property
    def weight(self) -> FloatArray:
        """Weight of the error of each output; that of velocities in s."""
        return self._joined(lambda predictor: predictor.weight)

    @cached_property
    def positions(self) -> FloatArray:
        """Measured positions of all segments, m."""
        return self.measured[self.of_positions]

    @cached_property
    def parts(self) -> Sequence[slice]:
        """Rows of each segment."""
        ends = np.cumsum([0, *self._counts]).tolist()
        return [slice(low, high) for low, high in pairwise(ends)]

    @cached_property
    def block(self) -> IntArray:
        """Number of the segment of each row."""
        return np.repeat(np.arange(len(self.segments)), self._counts)

    @cached_property
    def of_positions(self) -> BoolArray:
        """Which rows are those of positions."""
        return self._joined(lambda predictor: np.indices(predictor.measured.shape)[0] == 0)

    @property
    def _counts(self) -> Sequence[int]:
        return [segment.predictor.measured[:, segment.samples].size for segment in self.segments]

    def _joined(self, values: Callable[[Predictor], Any]) -> Any:
        """Return rows of all segments from values of shape (outputs, samples) of each record."""
        rows = [values(part.predictor)[:, part.samples].ravel() for part in self.segments]
        return np.concatenate(rows)

    def sensitivities(
        self, values: Mapping[str, float], starts: FloatArray, names: Sequence[str]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the outputs of all segments, and their derivatives: zero without a motion.

        The derivatives are those by coordinates, SI units, shape (rows, names), and by position and
        velocity at the start of the own segment, shape (rows, 2).
        """
        count = len(self.measured)
        outputs = np.full(count, np.nan)
        by_names, by_start = np.zeros((count, len(names))), np.zeros((count, 2))
        others = [name for name in names if name in (DELAY, LAG, *self.law.by_differences)]
        by_equations = [name for name in names if name not in others]
        work = _RUN_TIME + _DIFFERENCE_TIME * len(others)
        self.limit.spend(count * work * (1.0 + len(LAWS[self.law.name].states)))
        # At 0 a constant may drop out of the equations, and its derivatives with it.
        zeros = [name for name in by_equations if values[name] == 0.0]
        values = {**values, **self._steps(values, zeros, _LEAST)}
        try:
            drive = self._drive(values)
            moved = [
                (step, self._drive({**values, name: values[name] + step}))
                for name, step in self._steps(values, by_equations, _STEP).items()
            ]

            def by_coordinates(function: Callable[[Drive], FloatArray]) -> FloatArray:
                base = function(drive)
                columns = [(function(other) - base) / step for step, other in moved]
                return np.column_stack(columns) if columns else np.empty((len(base), 0))

            of_constants = by_coordinates(partial(_constants_of, drive))
            scaled = in_units_of(drive, drive)
            units = 1.0 / scaled.length_scale, 1.0 / scaled.speed_scale
            runs = self._runs(scaled, values, starts, VariationalMotion)
            each_segment = zip(self.parts, self.segments, starts.tolist(), runs, strict=True)
            for part, segment, (_, velocity), (predicted, rows) in each_segment:
                order = rows.shape[1] - len(of_constants)
                derivatives = rows[:, order:] @ of_constants
                if order > MEMORY:
                    memory = by_coordinates(
                        lambda other, speeds=(velocity, segment.belt_speed): np.array(
                            steady_memory(other, *speeds)
                        )
                    )
                    derivatives += rows[:, MEMORY:order] @ memory / scaled.length_scale
                outputs[part] = predicted
                by_names[part, [names.index(name) for name in by_equations]] = derivatives
                by_start[part] = rows[:, :2] * units
        except (InvalidInputError, RunError):
            outputs[:] = np.nan
        outputs = self._bounded(outputs)
        for name, step in self._steps(values, others, _MOTION_STEP).items():
            moved_outputs = self._predicted({**values, name: values[name] + step}, starts)
            by_names[:, names.index(name)] = (moved_outputs - outputs) / step
        return outputs, by_names, by_start

    def _steps(
        self, values: Mapping[str, float], names: Sequence[str], share: float
    ) -> dict[str, float]:
        """Return a step of each coordinate, by its size."""
        fastest, long = self.fastest, _LONG_DELAY * self.records[0].period
        sizes = {
            name: long if name in (DELAY, LAG) else self.law.size(name, values, fastest)
            for name in names
        }
        return {name: share * max(abs(values[name]), size) for name, size in sizes.items()}

    def _predicted(self, values: Mapping[str, float], starts: FloatArray) -> FloatArray:
        """Return the outputs of all segments; far away where there is no motion."""
        try:
            runs = self._runs(self._drive(values), values, starts, Motion)
            outputs = np.concatenate([output for output, _ in runs])
        except (InvalidInputError, RunError):
            outputs = np.full(len(self.measured), np.nan)
        return self._bounded(outputs)

    def _drive(self, values: Mapping[str, float]) -> Drive:
        """Return the drive of coordinates; raises InvalidInputError if there is none."""
        drive = self.law.drive(values, self.normal_force)
        refusal = drive.friction.refusal()
        if refusal is not None:
            raise InvalidInputError(refusal)
        return drive

    def _runs(
        self, drive: Drive, values: Mapping[str, float], starts: FloatArray, kind: type[Motion]
    ) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Yield the outputs of each segment, and their derivatives; see `Predictor.followed`."""
        pairs = zip(self.segments, starts, strict=True)
        for predictor, segments_of_record in groupby(pairs, key=lambda pair: pair[0].predictor):
            segments, begun = zip(*segments_of_record, strict=True)
            parts = [segment.samples for segment in segments]
            followed = predictor.lagging(values[LAG]).followed
            yield from followed(drive, parts, np.array(begun), values[DELAY], kind)

    def _bounded(self, outputs: FloatArray) -> FloatArray:
        span = _UNBOUNDED_ERROR * float(np.ptp(self.measured))
        low, high = self.measured - span, self.measured + span
        return np.where(np.isfinite(outputs), np.clip(outputs, low, high), high)

    @property
    def fastest(self) -> float:
        """Fastest speed relative to the belt, m/s, by the starts of the segments."""
        belts = [segment.belt_speed for segment in self.segments]
        return max(float(np.abs(self.starts[:, 1] - belts).max()), 1e-12)


def _constants_of(drive: Drive, other: Drive) -> FloatArray:
    """Return the free constants of another drive, in the units of a drive."""
    system = drive_system(in_units_of(drive, other))
    return np.array([system.constants[name] for name in system.free_constants])


def segments_of(predictors: Sequence[Predictor], length: float) -> Sequence[Segment]:
    """Return segments of about a length, s.

    They follow each other up to the end of each record, and start where the slide is fastest
    relative to the belt: a slide that sticks has no velocity of its own, and friction with a memory
    is that of steady slip there.
    """
    segments: list[Segment] = []
    for predictor in predictors:
        record = predictor.record
        total = len(record.position)
        smooth, speed = record.smoothed(0), record.smoothed(1)
        relative = np.abs(speed - record.belt_velocity)
        relative[:_ROUGH_SAMPLES] = -1.0
        count = max(round(total * record.period / length), 1)
        edges = np.linspace(0, total, count + 1).astype(int)
        reach = max((edges[1] - edges[0]) // 5, 1)
        near = [slice(max(edge - reach, 0), edge + reach) for edge in edges[:-1].tolist()]
        places = [window.start + int(np.argmax(relative[window])) for window in near]
        if record.velocity_weight > 0.0 and record.velocity is not None:
            speed = record.velocity
        states = np.column_stack([smooth, speed])
        segments += [
            Segment(predictor, slice(low, high), states[low])
            for low, high in pairwise([*places, total])
        ]
    return segments
