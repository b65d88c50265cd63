"""The trajectory of a simulated run as a CSV file."""

import csv
from typing import TextIO

from stickslip_ros.physics.loop.trajectory import SampleRecorder


class TrajectoryFile(SampleRecorder):
    """Writes the samples of a run to a CSV file as they come.

    The first line has the names of its `quantities`. The numbers are in SI units, with all digits.
    """

    def __init__(
        self, stream: TextIO, rate: float, every: int = 1, *, measured: bool = False
    ) -> None:
        """Write samples as `SampleRecorder` keeps them."""
        super().__init__(rate, every, measured=measured)
        self._write = csv.writer(stream, lineterminator="\n").writerow
        self._write(self.quantities)

    def keep(self, row: tuple[float, ...]) -> None:
        """Write the values of one sample."""
        self._write(map(float, row))
