"""The trajectory of a simulated run as a CSV file."""

import csv
from typing import TextIO

from stickslip_ros.physics.loop.trajectory import QUANTITIES, SampleRecorder


class TrajectoryFile(SampleRecorder):
    """Writes the samples of a run to a CSV file as they come.

    The first line has the names of `QUANTITIES`. The numbers are in SI units, with all digits.
    """

    def __init__(self, stream: TextIO, rate: float, every: int = 1) -> None:
        """Write one in `every` samples; they are taken `rate` (Hz) times per second."""
        super().__init__(rate, every)
        self._write = csv.writer(stream, lineterminator="\n").writerow
        self._write(QUANTITIES)

    def keep(self, row: tuple[float, ...]) -> None:
        """Write the values of one sample."""
        self._write(map(float, row))
