"""Disturbance forces on the slide that a scenario defines."""

from dataclasses import dataclass
from enum import StrEnum
from math import isfinite, pi, sin


class DisturbanceKind(StrEnum):
    """Shape of a disturbance force over time."""

    NONE = "none"
    STEP = "step"
    IMPULSE = "impulse"
    SINE = "sine"


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
    """A step lasts for `duration`, an impulse for one sample; a sine starts at zero."""
    amplitude: float = 0.0
    """Amplitude, N."""
    start: float = 0.0
    """Simulated time at which the force starts, s."""
    duration: float = float("inf")
    """Duration of a step or a sine, s."""
    frequency: float = 1.0
    """Frequency of the sine, Hz."""

    def force(self, number: int, period: float) -> float:
        """Return the disturbance force at a sample.

        The force starts at the sample nearest to `start`.

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
