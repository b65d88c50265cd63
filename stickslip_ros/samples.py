"""Samples of the motion and control forces, one at a time and as columns; SI units."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray, Table
from stickslip_ros.deprecated_names import Renamed

LARGEST = 1e100
"""Magnitude up to which positions (m) and speeds (m/s) are believed, and nothing overflows."""


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
class SampleColumns(Table):
    """Samples that follow each other: the fields of `Sample` as arrays of shape (samples,)."""

    effort = Renamed("friction_force")

    stamp: IntArray
    position: FloatArray
    velocity: FloatArray
    friction_force: FloatArray
    belt_position: FloatArray
    belt_velocity: FloatArray

    @property
    def believed(self) -> BoolArray:
        """Which of them are measured: those that are finite, up to 1e100 m and m/s."""
        believed = np.abs(self.position) <= LARGEST
        for column in (self.velocity, self.belt_velocity):
            believed &= np.abs(column) <= LARGEST
        return believed


@dataclass(frozen=True, eq=False)
class ForceColumns(Table):
    """Control or disturbance forces that follow each other: arrays of shape (forces,)."""

    stamp: IntArray
    """ns"""
    force: FloatArray
    """N"""
