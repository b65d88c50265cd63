"""States at the starts of segments: those from which given constants fit best."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.identification.trajectories import Trajectories

_RANK = 1e-9
"""Share of the largest singular value below which the start of a segment is not identifiable."""
ROUGH_TOLERANCE, _FINAL_TOLERANCE = 0.03, 1e-6
"""Starts are good enough if better ones would lower the squared error by less than this share:
while the constants change, and at their end."""
_SHORTEST_STEP = 1e-3
"""A start whose steps are shortened below this share of a full one is not changed further."""
_START_STEPS = 8
"""Largest number of steps of the starts for one set of constants."""
_OUTLIER_LOSS_RATIO = 3.0
"""The start of a segment is doubted if its squared error is larger than that of the median one by
this factor."""
_OUTLIER_SHARE = 0.1
"""Share of the squared error from which segments with such starts spoil the fit of the others."""
_KICKS = (0.0, 0.5, -0.5, 2.0, -2.0)
"""Changes of the velocity at such a start, in errors of position per period."""


@dataclass(frozen=True, eq=False)
class Errors:
    """Weighted errors that constants and starts leave, with their derivatives."""

    task: Trajectories
    names: Sequence[str]
    """Coordinates by which there are derivatives."""
    values: Mapping[str, float]
    """All coordinates."""
    starts: FloatArray
    """State at the start of each segment, m and m/s; shape (segments, 2)."""
    outputs: FloatArray
    """Predicted outputs; see `Trajectories.measured`."""
    by_names: FloatArray
    """Derivatives of the residual by `names`; shape (rows, names)."""
    by_start: FloatArray
    """Derivatives of the residual by the start of the own segment; shape (rows, 2)."""

    @classmethod
    def at(
        cls,
        task: Trajectories,
        names: Sequence[str],
        values: Mapping[str, float],
        starts: FloatArray,
    ) -> Self:
        """Return the errors of coordinates from states of shape (segments, 2)."""
        outputs, by_names, by_start = task.sensitivities(values, starts, names)
        weight = task.weight[:, None]
        return cls(task, names, values, starts, outputs, weight * by_names, weight * by_start)

    @cached_property
    def residual(self) -> FloatArray:
        """Predicted less measured outputs, weighted, m."""
        return self.task.weight * (self.outputs - self.task.measured)

    @property
    def loss(self) -> float:
        """Sum of the squared errors, m^2."""
        return float(self.residual @ self.residual)

    @property
    def losses(self) -> FloatArray:
        """Mean square of the weighted errors in each segment, m^2."""
        return self._sums(self.residual) / self._sums(self.task.weight)

    @property
    def has_outliers(self) -> bool:
        """Whether much of the error is that of a few segments: their starts may be wrong."""
        losses = self.losses
        return float(losses[self._doubted].sum()) > _OUTLIER_SHARE * float(losses.sum())

    def without_starts(self, columns: FloatArray) -> FloatArray:
        """Return the part of columns, shape (rows, columns), that no change of starts explains."""
        projected = np.array(columns)
        for part, (basis, _) in zip(self.task.parts, self._bases, strict=True):
            projected[part] -= basis @ (basis.T @ projected[part])
        return projected

    def steps(self, column: FloatArray) -> FloatArray:
        """Return the changes of the starts that explain a column best; shape (segments, 2)."""
        return np.array(
            [
                inverse @ (basis.T @ column[part])
                for part, (basis, inverse) in zip(self.task.parts, self._bases, strict=True)
            ]
        )

    def settled(self, tolerance: float = _FINAL_TOLERANCE) -> Self:
        """Return the errors from starts that are best up to a share of the squared error.

        The start of a segment has no part in the others: each takes steps of its own length.
        """
        settled, share = self, np.ones(len(self.starts))
        least = tolerance / len(self.starts)
        for _ in range(_START_STEPS):
            left = settled.without_starts(settled.residual[:, None])[:, 0]
            gains = settled._sums(settled.residual) - settled._sums(left)
            gain = (gains > least * settled.loss) & (share >= _SHORTEST_STEP)
            if not gain.any():
                break
            starts = settled.starts - share[:, None] * settled.steps(settled.residual)
            settled, better = settled._better(settled._part(starts, gain), gain)
            share = np.where(better, np.minimum(2.0 * share, 1.0), 0.25 * share)
        return settled

    def moved(self, starts: FloatArray) -> Self:
        """Return the errors of the same coordinates from other states."""
        return self.at(self.task, self.names, self.values, starts)

    def restarted(self) -> Self:
        """Return the errors from what kicks of the measured starts lead to, where that is better.

        They are the same if no segment fits much worse than the others.
        """
        if not self.has_outliers:
            return self
        restarted, doubted = self, self._doubted
        rough = np.sqrt(np.median(restarted.losses)) / self.task.records[0].period
        for kick in _KICKS:
            other = self._part(self.task.starts + np.array([0.0, kick * rough]), doubted).settled()
            restarted, _ = restarted._better(other, doubted)
        return restarted

    @property
    def _doubted(self) -> BoolArray:
        """Which segments fit much worse than the others."""
        losses = self.losses
        return losses > _OUTLIER_LOSS_RATIO * np.median(losses)

    def _part(self, starts: FloatArray, chosen: BoolArray) -> Self:
        """Return the errors in some segments, from other states of all."""
        pairs = zip(self.task.segments, chosen, strict=True)
        task = replace(self.task, segments=[segment for segment, one in pairs if one])
        return self.at(task, self.names, self.values, starts[chosen])

    def _better(self, part: Self, chosen: BoolArray) -> tuple[Self, BoolArray]:
        """Return the better one of two fits of some segments, and for which it is the other one."""
        better = np.zeros_like(chosen)
        better[chosen] = part._sums(part.residual) < self._sums(self.residual)[chosen]

        def merged(these: FloatArray, others: FloatArray, which: BoolArray, by: BoolArray) -> Any:
            merged = these.copy()
            merged[which] = others[by]
            return merged

        rows, by = better[self.task.block], better[chosen][part.task.block]
        return replace(
            self,
            starts=merged(self.starts, part.starts, better, better[chosen]),
            outputs=merged(self.outputs, part.outputs, rows, by),
            by_names=merged(self.by_names, part.by_names, rows, by),
            by_start=merged(self.by_start, part.by_start, rows, by),
        ), better

    def _sums(self, column: FloatArray) -> FloatArray:
        """Return the sum of the squares of a column in each segment."""
        return np.bincount(self.task.block, column * column).astype(float)

    @cached_property
    def _bases(self) -> Sequence[tuple[FloatArray, FloatArray]]:
        """Basis of the derivatives by the start of each segment, and their inverse by it."""
        return [_decomposed(self.by_start[part]) for part in self.task.parts]


def best_starts(
    task: Trajectories, values: Mapping[str, float], starts: FloatArray | None = None
) -> Errors:
    """Return the errors of coordinates from the best starts near some, by default measured ones."""
    begun = Errors.at(task, (), values, task.starts if starts is None else starts)
    return begun.settled(ROUGH_TOLERANCE).settled()


def _decomposed(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return an orthogonal basis of the columns, and their pseudo-inverse by that basis."""
    norms = np.linalg.norm(columns, axis=0)
    norms[norms == 0.0] = 1.0
    left, sizes, right = np.linalg.svd(columns / norms, full_matrices=False)
    kept = sizes > _RANK * max(float(sizes[0]), 1e-300)
    return left[:, kept], (right[kept].T / sizes[kept]) / norms[:, None]
