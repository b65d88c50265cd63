"""The trajectory of a simulated run: the motion and its forces at the samples."""

from abc import ABC, abstractmethod
from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from stickslip_ros.arrays import FloatArray, Table
from stickslip_ros.quantities import Quantity, quantities_of
from stickslip_ros.samples import Reference, Sample

if TYPE_CHECKING:
    from stickslip_ros.motion.motion import Motion, RecordedMotion

_ROUNDING = 1e-6
"""Share of a period by which a sample may be missed for rounding."""


@dataclass(frozen=True, eq=False)
class Trajectory(Table):
    """The motion at the samples t = n/rate; arrays of shape (samples,), true values.

    `len(trajectory)` is the number of samples, `trajectory[rows]` has some of them.
    """

    time: Annotated[FloatArray, Quantity("time", "s")]
    """Time since the start of the run, s."""
    position: Annotated[FloatArray, Quantity("displacement", "m")]
    """Displacement of the slide, m."""
    velocity: Annotated[FloatArray, Quantity("velocity", "m/s")]
    """Velocity of the slide, m/s."""
    friction_force: Annotated[FloatArray, Quantity("friction force", "N")]
    """Friction force on the slide, N, under the force held up to the sample."""
    control_force: Annotated[FloatArray, Quantity("control force", "N")]
    """Answer of the controller to the sample, N; 0 without a controller."""
    belt_position: Annotated[FloatArray, Quantity("belt displacement", "m")]
    """Displacement of the belt, m."""
    belt_velocity: Annotated[FloatArray, Quantity("belt velocity", "m/s")]
    """Velocity of the belt, m/s."""


@dataclass(frozen=True, eq=False)
class MeasuredTrajectory(Trajectory):
    """A trajectory with what a sensor tells of it."""

    measured_position: Annotated[FloatArray, Quantity("measured displacement", "m")]
    """Measured displacement of the slide, m."""
    measured_velocity: Annotated[FloatArray, Quantity("measured velocity", "m/s")]
    """Measured velocity of the slide, m/s."""


@dataclass(frozen=True, eq=False)
class MotorTrajectory(Trajectory):
    """A trajectory of a drive with a motor of finite mass."""

    motor_position: Annotated[FloatArray, Quantity("motor displacement", "m")]
    """Displacement of the motor, m."""
    motor_velocity: Annotated[FloatArray, Quantity("motor velocity", "m/s")]
    """Velocity of the motor, m/s."""


@dataclass(frozen=True, eq=False)
class MeasuredMotorTrajectory(MotorTrajectory, MeasuredTrajectory):
    """The same with what the sensors of slide and motor tell of it."""

    measured_motor_position: Annotated[FloatArray, Quantity("measured motor displacement", "m")]
    """Measured displacement of the motor, m."""
    measured_motor_velocity: Annotated[FloatArray, Quantity("measured motor velocity", "m/s")]
    """Measured velocity of the motor, m/s."""


_KINDS = {
    (False, False): Trajectory,
    (True, False): MeasuredTrajectory,
    (False, True): MotorTrajectory,
    (True, True): MeasuredMotorTrajectory,
}
"""Trajectories by whether they have what sensors tell, and a motor."""


class SampleRecorder(ABC):
    """Receives the samples of a run as they come, and keeps each one or every nth."""

    def __init__(
        self,
        rate: float,
        every: int = 1,
        *,
        measured: bool = False,
        motor: bool = False,
        reference: Callable[[float], Reference] | None = None,
    ) -> None:
        """Keep one in `every` samples; they are taken `rate` (Hz) times per second.

        With `measured` also what a sensor tells, with `motor` also the motion of the motor, and the
        position of a `reference` over the time (s).
        """
        self._rate, self._every, self._measured = rate, every, measured
        self._with_motor, self._reference = motor, reference
        self._pursuit = array("d")
        """Reference, position and measured position of all samples."""
        self._number = 0
        """Number of the next sample."""
        self._now = 0.0

    @abstractmethod
    def keep(self, row: tuple[float, ...]) -> None:
        """Keep the values of one sample, in the order of `quantities`."""

    @property
    def quantities(self) -> Mapping[str, Quantity]:
        """Label and unit of each column: those of a trajectory, and of the reference."""
        columns = quantities_of(self._kind)
        if self._reference is not None:
            columns["reference"] = Quantity("reference", "m")
        return columns

    @property
    def pursuit(self) -> FloatArray:
        """Time (s), reference, position and measured position (m), shape (4, samples).

        There are no samples without a reference.
        """
        columns = np.array(self._pursuit).reshape(-1, 3).T
        return np.array([np.arange(columns.shape[1]) / self._rate, *columns])

    @property
    def _kind(self) -> type[Trajectory]:
        return _KINDS[self._measured, self._with_motor]

    def take(self, sample: Sample, control_force: float, measured: Sample | None = None) -> None:
        """Receive the next sample, and the control force (N) that answers it.

        `measured` is the sample as a sensor tells it.
        """
        number, seen = self._number, measured or sample
        aim = 0.0
        if self._reference is not None:
            aim = self._reference(number / self._rate).position or 0.0
            self._pursuit.extend((aim, sample.position, seen.position))
        if number % self._every == 0:
            _, position, velocity, friction_force, belt, belt_speed, motor = sample
            row = number / self._rate, position, velocity, friction_force, control_force, belt
            row += belt_speed, *(seen[1:3] if self._measured else ())
            if self._with_motor:
                assert motor is not None
                row += *motor, *((seen.motor or motor) if self._measured else ())
            self.keep(row if self._reference is None else (*row, aim))
        self._number = number + 1

    def sampling(
        self, motion: "RecordedMotion", advance: Callable[[float], None]
    ) -> Callable[[float], None]:
        """Return an `advance` (s) of a motion without sampled loop that stops to take samples."""

        def advance_and_take(duration: float) -> None:
            end = self._now + duration
            while self._now < end and not motion.unbounded:
                self.take_due(motion)
                stop = min(self._number / self._rate, end)
                advance(stop - self._now)
                self._now = stop
                if stop < end:
                    motion.divide()

        return advance_and_take

    def take_due(self, motion: "Motion") -> None:
        """Keep the sample that is due at the present instant of such a motion, if one is."""
        number = self._number
        if number - self._now * self._rate > _ROUNDING:
            return
        drive, (x, velocity, friction, belt_speed, motor) = motion.drive, motion.reading()
        travel = drive.belt.integral(0.0, number / self._rate)
        travel += drive.belt_speed * number / self._rate
        sample = Sample(0, x, velocity, friction, travel, belt_speed, motor)
        self.take(sample, motion.applied_force)


class TrajectoryRecorder(SampleRecorder):
    """Keeps the samples of a run in memory."""

    def __init__(self, rate: float, every: int = 1, **options: Any) -> None:
        """Keep samples as `SampleRecorder` does."""
        super().__init__(rate, every, **options)
        self._values = array("d")

    def keep(self, row: tuple[float, ...]) -> None:
        """Keep the values of one sample."""
        self._values.extend(row)

    def trajectory(self) -> Trajectory:
        """Return the samples so far."""
        columns = np.array(self._values).reshape(-1, len(self.quantities)).T.copy()
        return self._kind(*columns[: len(quantities_of(self._kind))])
