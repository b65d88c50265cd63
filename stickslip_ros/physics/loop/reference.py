"""References that control laws follow, as functions of time."""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

from stickslip_ros.physics.model.courses import PiecewiseCourse, Ramp, Sine, Step, Trapezoid
from stickslip_ros.samples import NO_REFERENCE, Reference


class ReferenceKind(StrEnum):
    """Source of a reference."""

    NONE = "none"
    TOPIC = "topic"
    """Given from outside; as a function of time there is none."""
    STEP = "step"
    RAMP = "ramp"
    SINE = "sine"
    TRAPEZOID = "trapezoid"


@dataclass(frozen=True)
class ReferenceCourse:
    """Reference displacement over the time since the first sample, with its derivatives.

    A step has `amplitude` while it lasts; a ramp rises during `duration` and then stays; a sine
    starts at zero; a trapezoid rises over 1/`frequency`, holds, and falls over 1/`frequency` to
    zero at `start` + `duration`. Before the start and after the end the reference rests at zero.

    Examples
    --------
    >>> from stickslip_ros.physics.loop.reference import ReferenceCourse, ReferenceKind
    >>> ramp = ReferenceCourse(ReferenceKind.RAMP, amplitude=0.1, duration=2.0)
    >>> ramp(1.0)
    Reference(position=0.05, velocity=0.05, acceleration=0.0)
    """

    kind: ReferenceKind = ReferenceKind.NONE
    """Shape over time."""
    amplitude: float = 0.0
    """Largest displacement, m."""
    start: float = 0.0
    """Time at which the course starts, s."""
    duration: float = float("inf")
    """Duration, s; of a ramp, the time of its rise."""
    frequency: float = 1.0
    """Frequency of the sine, and one over the time of a rise of the trapezoid, Hz."""

    def refusal(self) -> str | None:
        """Return why the constants do not make a course, or None."""
        return None if self._course is None else self._course.refusal()

    def __call__(self, time: float) -> Reference:
        """Return the reference at a time.

        Parameters
        ----------
        time : float
            Time since the first sample, s.

        Returns
        -------
        Reference
            Displacement, velocity and acceleration; at a corner, those after it. A jump has no
            velocity.
        """
        course = self._course
        if course is None:
            return NO_REFERENCE
        return Reference(course.at(time), *course.rates(time))

    @cached_property
    def _course(self) -> PiecewiseCourse | None:
        amplitude, start, duration = self.amplitude, self.start, self.duration
        match self.kind:
            case ReferenceKind.STEP:
                return Step(amplitude, start, duration)
            case ReferenceKind.RAMP:
                return Ramp(amplitude, start, duration)
            case ReferenceKind.SINE:
                return Sine(amplitude, start, duration, self.frequency)
            case ReferenceKind.TRAPEZOID:
                return Trapezoid(amplitude, start, duration, self.frequency)
            case ReferenceKind.NONE | ReferenceKind.TOPIC:
                return None
