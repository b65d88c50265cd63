"""Disturbance forces on the slide that a scenario defines."""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, pi, sin

from stickslip_ros.physics.model.courses import CourseKind, PiecewiseCourse, Ramp, Table, Trapezoid

DisturbanceKind = CourseKind
"""Shape of a disturbance force over time."""

NO_TABLE = Table()
"""The points of the other kinds."""


@dataclass(frozen=True)
class Disturbance:
    """Disturbance force on the slide; like the control force it is held between samples.

    Examples
    --------
    A step of 50 N for 0.2 s, sampled every 0.1 s, starts at sample 5:

    >>> from stickslip_ros.physics.model.disturbance import Disturbance, DisturbanceKind
    >>> step = Disturbance(DisturbanceKind.STEP, amplitude=50.0, start=0.5, duration=0.2)
    >>> [step.force(number, 0.1) for number in range(4, 8)]
    [0.0, 50.0, 50.0, 0.0]
    """

    kind: DisturbanceKind = DisturbanceKind.NONE
    """A step lasts for `duration`, an impulse for one sample; a sine starts at zero. A ramp rises
    during `duration` and then stays. A trapezoid rises over 1/`frequency`, holds, and falls over
    1/`frequency` to zero at `start` + `duration`. A table has its values at its times."""
    amplitude: float = 0.0
    """Amplitude, N."""
    start: float = 0.0
    """Simulated time at which the force starts, s."""
    duration: float = float("inf")
    """Duration of a step or a sine, s; of a ramp, the time of its rise."""
    frequency: float = 1.0
    """Frequency of the sine, and one over the time of a rise of the trapezoid, Hz."""
    table: Table = NO_TABLE
    """Points of a table, N."""

    def refusal(self) -> str | None:
        """Return why the constants do not make a disturbance, or None."""
        return None if self._course is None else self._course.refusal()

    def force(self, number: int, period: float) -> float:
        """Return the disturbance force at a sample.

        A step, an impulse or a sine starts at the sample nearest to `start`.

        Parameters
        ----------
        number : int
            Number of the sample, from 0.
        period : float
            Sample period, s.

        Returns
        -------
        float
            Force, N; 0 before the start and after the end.
        """
        if self.kind is DisturbanceKind.NONE:
            return 0.0
        if self._course is not None:
            return self._course.at(number * period)
        first = round(self.start / period)
        samples = self.duration / period
        if self.kind is DisturbanceKind.IMPULSE:
            samples = 1.0
        elif isfinite(samples):
            samples = round(samples)
        if not first <= number < first + samples:
            return 0.0
        if self.kind is DisturbanceKind.SINE:
            return self.amplitude * sin(2.0 * pi * self.frequency * (number * period - self.start))
        return self.amplitude

    @cached_property
    def _course(self) -> PiecewiseCourse | None:
        """The course without jumps of which the forces are samples; None for the other kinds."""
        match self.kind:
            case DisturbanceKind.RAMP:
                return Ramp(self.amplitude, self.start, self.duration)
            case DisturbanceKind.TRAPEZOID:
                return Trapezoid(self.amplitude, self.start, self.duration, self.frequency)
            case DisturbanceKind.TABLE:
                return self.table
            case _:
                return None
