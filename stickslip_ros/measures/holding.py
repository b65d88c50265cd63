"""How well a controller holds: settling and hunting."""

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.noise import rises


def settling_time(distance: FloatArray, allowed: float, start: float, rate: float) -> float | None:
    """Return the time from `start` on until a distance stays at most what is allowed.

    Parameters
    ----------
    distance : ndarray
        Distance from the rest, shape (samples,).
    allowed : float
        Largest distance of what has settled.
    start : float
        Time from which on it may settle, s.
    rate : float
        Samples per second, Hz.

    Returns
    -------
    float or None
        Time, s; None if the last distance is too large.
    """
    beyond = np.flatnonzero(distance > allowed)
    if len(beyond) and beyond[-1] == len(distance) - 1:
        return None
    last = (int(beyond[-1]) + 1) / rate if len(beyond) else 0.0
    return max(last - start, 0.0)


def hunting(error: FloatArray, least: float, rate: float) -> tuple[float, float | None]:
    """Return amplitude and period of a vibration about the reference.

    A swing counts where it passes a third of the amplitude on either side of the middle.

    Parameters
    ----------
    error : ndarray
        Displacement from the reference, m, shape (samples,).
    least : float
        Least amplitude, m, that is hunting.
    rate : float
        Samples per second, Hz.

    Returns
    -------
    amplitude : float
        Half the range, m; 0 if it is less, or if there are not two whole periods.
    period : float or None
        Mean period, s; None without hunting.
    """
    amplitude = float(np.ptp(error)) / 2.0
    middle = error - (error.max() + error.min()) / 2.0
    rows = rises(middle, amplitude / 3.0)
    if amplitude <= least or len(rows) < 3:
        return 0.0, None
    return amplitude, float(rows[-1] - rows[0]) / (len(rows) - 1) / rate
