"""The time of a motion, and that of the signals that belt and load follow."""

from collections.abc import Sequence

from stickslip_ros.arrays import FloatArray


class MotionClock:
    """Time since the start of a motion, s."""

    def __init__(self) -> None:
        self.time = 0.0
        """Time since the start, s."""
        self.frequency = 1.0
        """Dimensionless time of a second: the angular frequency of the drive."""
        self._origin = self._lost = 0.0

    @property
    def signal_time(self) -> float:
        """Time of the signals of belt and load, s."""
        return self.time - self._origin

    def signal_times(self, times: FloatArray) -> Sequence[float]:
        """Return times of the motion (s), as of breakpoints, as those of the signals."""
        return (times - self._origin).tolist()

    @property
    def scaled(self) -> float:
        """Time of the signals, dimensionless: sums of scaled durations would drift."""
        return (self.time - self._origin) * self.frequency

    def restart_signals(self) -> None:
        """Start the signals now."""
        self._origin, self._lost = self.time, 0.0

    def pass_exactly(self, duration: float) -> float:
        """Add a duration, s, and what the sum has lost by rounding; return the scaled time."""
        before, duration = self.time, duration - self._lost
        self.time = before + duration
        self._lost = (self.time - before) - duration
        return (self.time - self._origin) * self.frequency
