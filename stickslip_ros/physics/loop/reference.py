"""References that control laws follow, as functions of time."""

from dataclasses import dataclass
from enum import StrEnum
from math import cos, isfinite, pi, sin

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
        edges = self.kind in (ReferenceKind.RAMP, ReferenceKind.TRAPEZOID)
        if edges and not (isfinite(self.duration) and self.duration > 0.0):
            return f"duration = {self.duration} s: must be above 0 and finite for a {self.kind}"
        if self.kind is ReferenceKind.TRAPEZOID and self.duration * self.frequency < 2.0:
            return (
                f"duration = {self.duration} s: must be at least 2/frequency = "
                f"{2.0 / self.frequency:g} s for a trapezoid"
            )
        return None

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
        kind, amplitude = self.kind, self.amplitude
        if kind in (ReferenceKind.NONE, ReferenceKind.TOPIC):
            return NO_REFERENCE
        since = time - self.start
        if since < 0.0:
            return Reference(0.0, 0.0, 0.0)
        if kind is ReferenceKind.RAMP:
            if since >= self.duration:
                return Reference(amplitude, 0.0, 0.0)
            speed = amplitude / self.duration
            return Reference(speed * since, speed, 0.0)
        if since >= self.duration:
            return Reference(0.0, 0.0, 0.0)
        if kind is ReferenceKind.SINE:
            omega = 2.0 * pi * self.frequency
            swing = amplitude * sin(omega * since)
            return Reference(swing, amplitude * omega * cos(omega * since), -swing * omega**2)
        if kind is ReferenceKind.TRAPEZOID:
            left, speed = self.duration - since, amplitude * self.frequency
            if since * self.frequency < 1.0:
                return Reference(speed * since, speed, 0.0)
            if left * self.frequency <= 1.0:
                return Reference(speed * left, -speed, 0.0)
        return Reference(amplitude, 0.0, 0.0)
