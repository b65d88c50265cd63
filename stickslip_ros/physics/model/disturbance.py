"""Disturbance forces on the slide that a scenario brings with it."""

from dataclasses import dataclass
from enum import StrEnum
from math import isfinite, pi, sin


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

    def force(self, number: int, period: float) -> float:
        """Return the force (N) of sample `number`, samples being `period` (s) apart.

        The first sample that it acts on is the one nearest to the start.
        """
        if self.kind is DisturbanceKind.NONE:
            return 0.0
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
