"""The sensor between the motion and its samples."""

from collections.abc import Callable
from dataclasses import dataclass

Measure = Callable[[int, float, float], tuple[float, float]]
"""Returns the measured position (m) and velocity (m/s) for the number of a sample, and its true
position and velocity. It is called once for each sample, in order."""


@dataclass(frozen=True)
class Sensor:
    """What measures the slide; it is exact. The state of the belt is known.

    A sensor is a frozen dataclass of its constants, each described by `constant`. They become the
    parameters `sensor.*` of the plant.
    """

    def start(self, period: float) -> Measure | None:
        """Return what measures a segment of samples, or what follows a reset.

        Parameters
        ----------
        period : float
            Sample period, s.

        Returns
        -------
        callable or None
            See `Measure`; None for an exact sensor.
        """
        return None


EXACT_SENSOR = Sensor()
"""The sensor that measures exactly."""
