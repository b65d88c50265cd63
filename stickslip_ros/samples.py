"""Samples of the motion and control forces, one at a time and as columns; SI units."""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray


class Sample(NamedTuple):
    """State of slide and belt at one instant."""

    stamp: int
    """ns"""
    position: float
    """Displacement of the slide, m."""
    velocity: float
    """Velocity of the slide, m/s."""
    friction_force: float
    """Friction force on the slide, N, under the force held up to then; NaN where not known."""
    belt_position: float
    """Displacement of the belt, m."""
    belt_velocity: float
    """Velocity of the belt, m/s."""


@dataclass(frozen=True, eq=False)
class SampleColumns:
    """Samples that follow each other: the fields of `Sample` as arrays of shape (samples,)."""

    stamp: IntArray
    position: FloatArray
    velocity: FloatArray
    friction_force: FloatArray
    belt_position: FloatArray
    belt_velocity: FloatArray

    def __len__(self) -> int:
        return len(self.stamp)

    def __getitem__(self, rows: slice | BoolArray | IntArray) -> Self:
        return type(self)(*(column[rows] for column in vars(self).values()))

    def followed_by(self, others: Self) -> Self:
        """Return these samples and those behind them as one."""
        pairs = zip(vars(self).values(), vars(others).values(), strict=True)
        return type(self)(*(np.concatenate(pair) for pair in pairs))


@dataclass(frozen=True, eq=False)
class ForceColumns:
    """Control or disturbance forces that follow each other: arrays of shape (forces,)."""

    stamp: IntArray
    """ns"""
    force: FloatArray
    """N"""

    def __len__(self) -> int:
        return len(self.stamp)

    def __getitem__(self, rows: slice | BoolArray | IntArray) -> Self:
        return type(self)(self.stamp[rows], self.force[rows])
