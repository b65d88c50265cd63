"""Samples of the motion and of forces, one by one and as columns; SI units."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import repeat
from typing import NamedTuple, Self

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray, Table
from stickslip_ros.errors import InvalidInputError

LARGEST = 1e100
"""Magnitude up to which positions (m) and speeds (m/s) are measured without overflow."""


class MotorSample(NamedTuple):
    """State of the motor behind the slide at one instant."""

    position: float
    """Displacement of the motor, m."""
    velocity: float
    """Velocity of the motor, m/s."""


RESTING_MOTOR = MotorSample(0.0, 0.0)
"""A motor at the reference."""


class Sample(NamedTuple):
    """State of slide and belt at one instant.

    Examples
    --------
    >>> from stickslip_ros.samples import Sample
    >>> sample = Sample(1_000_000, 1e-4, 0.0, 398.5, 4e-5, 0.04)
    >>> sample.belt_velocity
    0.04
    """

    stamp: int
    """Stamp, ns."""
    position: float
    """Displacement of the slide, m."""
    velocity: float
    """Velocity of the slide, m/s."""
    friction_force: float
    """Friction force on the slide, N, under the force held up to this sample; NaN if unknown."""
    belt_position: float
    """Displacement of the belt, m."""
    belt_velocity: float
    """Velocity of the belt, m/s."""
    motor: MotorSample | None = None
    """State of the motor; None if it is ideal."""

    def body(self, name: str) -> "Sample | MotorSample":
        """Return what has position and velocity of a body.

        Parameters
        ----------
        name : str
            "table", the slide, or "motor".

        Returns
        -------
        Sample or MotorSample
            The sample itself, or its motor.

        Raises
        ------
        InvalidInputError
            If there is no such motor.
        """
        if name == "table":
            return self
        if self.motor is None:
            raise InvalidInputError(
                f"feedback of the {name}: the samples have no motor, as with plant.motor.kind = "
                "ideal; feedback of the table needs none"
            )
        return self.motor


class Reference(NamedTuple):
    """Motion that a control law is to follow, at one instant; None for what is not given."""

    position: float | None = None
    """Displacement, m."""
    velocity: float | None = None
    """Velocity, m/s."""
    acceleration: float | None = None
    """Acceleration, m/s^2."""

    @property
    def filled(self) -> tuple[float, float, float]:
        """Position, velocity and acceleration, 0 for what is not given."""
        position, velocity, acceleration = self
        return (
            0.0 if position is None else position,
            0.0 if velocity is None else velocity,
            0.0 if acceleration is None else acceleration,
        )


NO_REFERENCE = Reference()
"""The reference where there is none."""


@dataclass(frozen=True, eq=False)
class SampleColumns(Table):
    """Consecutive samples: the fields of `Sample` as arrays of shape (samples,)."""

    stamp: IntArray
    """Stamps, ns."""
    position: FloatArray
    """Displacement of the slide, m."""
    velocity: FloatArray
    """Velocity of the slide, m/s."""
    friction_force: FloatArray
    """Friction force on the slide, N, under the force held up to each sample; NaN if unknown."""
    belt_position: FloatArray
    """Displacement of the belt, m."""
    belt_velocity: FloatArray
    """Velocity of the belt, m/s."""
    motor_position: FloatArray = field(default_factory=lambda: np.empty(0))
    """Displacement of the motor, m; NaN without one of finite mass."""
    motor_velocity: FloatArray = field(default_factory=lambda: np.empty(0))
    """Velocity of the motor, m/s; NaN without one of finite mass."""

    def __post_init__(self) -> None:
        for name in ("motor_position", "motor_velocity"):
            if len(getattr(self, name)) != len(self.stamp):
                object.__setattr__(self, name, np.full(len(self.stamp), np.nan))

    @property
    def has_motor(self) -> bool:
        """Whether a motor is among the samples."""
        return bool(np.isfinite(self.motor_position).any())

    @classmethod
    def from_samples(cls, samples: Sequence[Sample]) -> Self:
        """Return single samples as columns.

        Parameters
        ----------
        samples : sequence of Sample
            Consecutive samples.
        """
        stamp = np.array([sample.stamp for sample in samples], np.int64)
        none = np.nan, np.nan
        rows = [(*sample[1:6], *(sample.motor or none)) for sample in samples]
        others = np.array(rows).reshape(-1, 7)
        return cls(stamp, *others.T.copy())

    def samples(self) -> list[Sample]:
        """Return the samples one by one, with a motor where they have one."""
        slide = (column.tolist() for column in list(vars(self).values())[:6])
        motor = map(MotorSample, self.motor_position.tolist(), self.motor_velocity.tolist())
        return [*map(Sample, *slide, motor if self.has_motor else repeat(None))]

    @property
    def is_valid(self) -> BoolArray:
        """Boolean mask of the samples that are measured: finite, up to 1e100 m and m/s."""
        is_valid = np.ones(len(self), np.bool_)
        for column in (self.position, self.velocity, self.belt_velocity):
            is_valid &= (column >= -LARGEST) & (column <= LARGEST)
        return is_valid


@dataclass(frozen=True, eq=False)
class ReferenceColumns(Table):
    """Consecutive references of the slide, as arrays of shape (references,); NaN for no value."""

    stamp: IntArray
    """Stamps, ns."""
    position: FloatArray
    """Displacement, m."""
    velocity: FloatArray
    """Velocity, m/s."""


@dataclass(frozen=True, eq=False)
class ForceColumns(Table):
    """Consecutive control or disturbance forces, as arrays of shape (forces,)."""

    stamp: IntArray
    """Stamps, ns."""
    force: FloatArray
    """Force on the slide, N."""


NO_SAMPLES = SampleColumns(np.empty(0, np.int64), *[np.empty(0)] * 5)
"""No samples."""
NO_FORCES = ForceColumns(np.empty(0, np.int64), np.empty(0))
"""No forces."""
