"""How well a controller holds: settling and hunting."""

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.noise import rises


def settling_time(distance: FloatArray, allowed: float, start: float, rate: float) -> float | None:
    """Return the time from `start` on, s, until a distance stays at most `allowed`.

    `distance` is that from the rest, shape (samples,), at `rate` samples per second. None if its
    last value is larger.
    """
    beyond = np.flatnonzero(distance > allowed)
    if len(beyond) and beyond[-1] == len(distance) - 1:
        return None
    last = (int(beyond[-1]) + 1) / rate if len(beyond) else 0.0
    return max(last - start, 0.0)


def hunting(error: FloatArray, least: float, rate: float) -> tuple[float, float | None]:
    """Return amplitude (m) and mean period (s) of a vibration about the reference.

    `error` is the displacement from the reference, m, shape (samples,), at `rate` samples per
    second. A swing counts where it passes a third of the amplitude on either side of the middle.
    The amplitude, half the range, is 0 and the period None if it is not above `least` (m), or if
    there are not two whole periods.
    """
    amplitude = float(np.ptp(error)) / 2.0
    middle = error - (error.max() + error.min()) / 2.0
    rows = rises(middle, amplitude / 3.0)
    if amplitude <= least or len(rows) < 3:
        return 0.0, None
    return amplitude, float(rows[-1] - rows[0]) / (len(rows) - 1) / rate
