"""The trajectory of a simulated run: the motion and its forces at the samples."""

from array import array
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stickslip_ros.arrays import FloatArray, Table
from stickslip_ros.physics.motion.motion import Motion
from stickslip_ros.samples import Sample

_ROUNDING = 1e-6
"""Share of a period by which a sample may be missed for rounding."""


@dataclass(frozen=True, eq=False)
class Trajectory(Table):
    """The motion at the samples t = n/rate; arrays of shape (samples,), true values.

    `len(trajectory)` is the number of samples, `trajectory[rows]` has some of them.
    """

    time: FloatArray
    """Time since the start of the run, s."""
    position: FloatArray
    """Displacement of the slide, m."""
    velocity: FloatArray
    """Velocity of the slide, m/s."""
    friction_force: FloatArray
    """Friction force on the slide, N, under the force held up to the sample."""
    control_force: FloatArray
    """Answer of the controller to the sample, N; 0 without a controller."""
    belt_position: FloatArray
    """Displacement of the belt, m."""
    belt_velocity: FloatArray
    """Velocity of the belt, m/s."""


QUANTITIES = {
    "time": ("time", "s"),
    "position": ("displacement", "m"),
    "velocity": ("velocity", "m/s"),
    "friction_force": ("friction force", "N"),
    "control_force": ("control force", "N"),
    "belt_position": ("belt displacement", "m"),
    "belt_velocity": ("belt velocity", "m/s"),
}
"""Label and unit of each column of a trajectory."""


class TrajectoryRecorder:
    """Keeps the samples of a run as they come."""

    def __init__(self, rate: float) -> None:
        """Keep samples that are taken `rate` (Hz) times per second."""
        self._rate = rate
        self._values = array("d")
        self._now = 0.0

    def take(self, sample: Sample, control_force: float) -> None:
        """Keep the next sample, and the control force (N) that answers it."""
        _, position, velocity, friction_force, belt_position, belt_velocity = sample
        self._values.extend(
            (position, velocity, friction_force, control_force, belt_position, belt_velocity)
        )

    def sampling(self, motion: Motion, advance: Callable[[float], None]) -> Callable[[float], None]:
        """Return an `advance` (s) of a motion without sampled loop that stops to take samples."""

        def advance_and_take(duration: float) -> None:
            end = self._now + duration
            while self._now < end and not motion.unbounded:
                self.take_due(motion)
                stop = min(self._number / self._rate, end)
                advance(stop - self._now)
                self._now = stop

        return advance_and_take

    def take_due(self, motion: Motion) -> None:
        """Keep the sample that is due at the present instant of such a motion, if one is."""
        number = self._number
        if number - self._now * self._rate > _ROUNDING:
            return
        drive = motion.drive
        travel = drive.belt.integral(0.0, number / self._rate)
        sample = Sample(
            0,
            motion.position,
            motion.velocity,
            motion.friction_force,
            drive.belt_speed * number / self._rate + travel,
            motion.belt_speed,
        )
        self.take(sample, motion.applied_force)

    def trajectory(self) -> Trajectory:
        """Return the samples so far."""
        columns = np.array(self._values).reshape(-1, 6).T.copy()
        return Trajectory(np.arange(columns.shape[1]) / self._rate, *columns)

    @property
    def _number(self) -> int:
        """Number of the next sample."""
        return len(self._values) // 6
