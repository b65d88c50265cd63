"""Disturbance forces on the slide that a scenario brings with it."""

from dataclasses import dataclass
from enum import StrEnum
from math import pi, sin


class DisturbanceKind(StrEnum):
    """Time course of a disturbance force."""

    NONE = "none"
    STEP = "step"
    IMPULSE = "impulse"
    SINE = "sine"


@dataclass(frozen=True)
class Disturbance:
    """A force that is held from sample to sample like the control force."""

    kind: DisturbanceKind = DisturbanceKind.NONE
    """A step lasts for `duration`, an impulse for one sample; a sine starts from zero."""
    amplitude: float = 0.0
    """N"""
    start: float = 0.0
    """Simulated time at which it begins, s."""
    duration: float = float("inf")
    """How long it lasts, s."""
    frequency: float = 1.0
    """Of the sine, Hz."""

    def force(self, time: float, period: float) -> float:
        """Return the force (N) of the sample at `time` (s), samples being `period` (s) apart."""
        since = time - self.start
        # Half a period of grace: the sample nearest to the start is the first that acts.
        since_nearest = since + period / 2.0
        duration = period if self.kind is DisturbanceKind.IMPULSE else self.duration
        if self.kind is DisturbanceKind.NONE or not 0.0 <= since_nearest < duration:
            return 0.0
        if self.kind is DisturbanceKind.SINE:
            return self.amplitude * sin(2.0 * pi * self.frequency * since)
        return self.amplitude
