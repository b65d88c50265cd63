"""Slip by slip: drops of a position that sticks and slips, for cycles that are not alike."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, nan
from typing import Annotated, Any, NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.measures.drift import fit_line
from stickslip_ros.quantities import Quantity

_MEDIAN = 5
"""Number of samples of the median that suppresses impulses."""
_STICKING_RATIO = 2.5
"""Time from a slip to the next, in slip times, from which a motion sticks; in a sine it is two."""
_LEAST_SAMPLES = 8
"""Number of samples for the fit of a stick."""
_MOST_SLIPS = 100_000
"""Number of slips in a report: the last ones."""
_QUANTILES = {"q05": 0.05, "q25": 0.25, "median": 0.5, "q75": 0.75, "q95": 0.95}


class Slip(NamedTuple):
    """One stick and the slip that ends it."""

    time: float
    """Start of the slip, a tenth of the drop, s."""
    stick_time: Annotated[float, Quantity("time of sticking", "s")]
    """Duration of the stick before, s; NaN where it is not recorded as a whole."""
    drop: Annotated[float, Quantity("drop", "m")]
    """Displacement by which the slide goes back, m."""
    slip_time: Annotated[float, Quantity("time of slipping", "s")]
    """Duration of the slip, s."""
    stick_velocity: Annotated[float, Quantity("velocity while sticking", "m/s")]
    """Velocity during the first half of the stick, m/s, by a straight line."""
    stick_velocity_error: float
    """Its standard error, m/s."""


@dataclass(frozen=True)
class SlipThreshold:
    """Least size of a slip of a slide that sticks and slips.

    Parameters
    ----------
    drop : float
        Displacement, m, by which the slide goes back by more.
    within : float
        Time, s, in which it does.

    Raises
    ------
    InvalidInputError
        If one of them is not above 0 and finite.

    Examples
    --------
    A slip of more than 0.1 mm within 50 ms:

    >>> from stickslip_ros.measures.slips import SlipThreshold
    >>> SlipThreshold(1e-4, within=0.05)
    SlipThreshold(drop=0.0001, within=0.05)
    """

    drop: float
    within: float = 0.1

    def __post_init__(self) -> None:
        for name, value, unit in (("drop", self.drop, "m"), ("within", self.within, "s")):
            if not 0.0 < value < float("inf"):
                raise InvalidInputError(f"{name} = {value} is invalid: must be above 0 ({unit})")


def slips_in(time: FloatArray, position: FloatArray, threshold: SlipThreshold) -> list[Slip]:
    """Return the slips of a slide on a belt that moves forward, from positions (m) at times (s).

    A slip is a drop beyond the threshold, of medians over five samples. It ends at the lowest
    position before a rise by half of it, or before as many samples without a lower one as it may
    take. Its duration is that from a tenth to nine tenths of the drop, the transition duration of
    IEEE Std 181. When the first stick began is not known.
    """
    from scipy.ndimage import maximum_filter1d, median_filter  # takes long to import

    slips: list[Slip] = []
    if len(time) <= 2 * _MEDIAN:
        return slips
    drop, step = threshold.drop, float(time[_MEDIAN * 2] - time[0]) / (_MEDIAN * 2)
    span = max(round(min(threshold.within / step, len(time))), 1) if step > 0.0 else 1
    # The last medians are not known yet.
    smooth: FloatArray = median_filter(position, _MEDIAN, mode="nearest")[: -(_MEDIAN // 2)]
    highest = maximum_filter1d(smooth, span + 1, origin=span // 2, mode="nearest")
    low = np.flatnonzero(smooth < highest - drop)
    landing: int | None = None
    while True:
        # Soon after a landing only what is higher since then counts.
        begin = landing or 0
        since = smooth[begin : begin + span]
        near = np.flatnonzero(since < np.maximum.accumulate(since) - drop)
        later = low[np.searchsorted(low, begin + span) :][:1]
        if not len(near) and not len(later):
            return slips
        start = begin + int(near[0]) if len(near) else int(later[0])
        bottom = _landing(smooth, start, drop, span)
        if bottom is None:
            return slips
        top = max(start - span, begin)
        top += int(np.argmax(smooth[top : start + 1]))
        slips.append(_slip(time, smooth, top, bottom, landing))
        landing = bottom


def _landing(smooth: FloatArray, start: int, drop: float, span: int) -> int | None:
    """Return the row at which the slip from a row on ends; None if it is not recorded."""
    count = 2 * span
    while True:
        fall = smooth[start : start + count]
        lowest, rows = np.minimum.accumulate(fall), np.arange(len(fall))
        last = np.maximum.accumulate(np.where(fall <= lowest, rows, 0))
        first = np.maximum.accumulate(np.where(np.diff(lowest, prepend=np.inf) < 0.0, rows, 0))
        rests = last - first > span  # a slide on a guide at rest does not move at all
        over = rests | (fall > lowest + drop / 2.0) | (rows - last > span)
        if over.any():
            end = int(np.argmax(over))
            return start + int(first[end] if rests[end] else last[end])
        if start + count >= len(smooth):
            return None
        count *= 2


def _slip(time: FloatArray, smooth: FloatArray, top: int, bottom: int, landing: int | None) -> Slip:
    """Return the slip between two rows, with the stick since the landing if it is long enough."""
    tenth = (smooth[top] - smooth[bottom]) / 10.0
    rows = smooth[top : bottom + 1]
    start = top + int(np.flatnonzero(rows >= smooth[top] - tenth)[-1])
    end = top + int(np.flatnonzero(rows <= smooth[bottom] + tenth)[0])
    stick_time = slope = error = nan
    if landing is not None and start - landing >= _LEAST_SAMPLES:
        stick_time = float(time[start] - time[landing])
        # Before a slip the contact creeps.
        half = slice(landing, (landing + start) // 2 + 1)
        slope, error = fit_line(time[half] - float(time[half].mean()), smooth[half])
    return Slip(
        time=float(time[start]),
        stick_time=stick_time,
        drop=float(smooth[top] - smooth[bottom]),
        slip_time=float(time[end] - time[start]),
        stick_velocity=slope,
        stick_velocity_error=error,
    )


def slip_report(slips: list[Slip], threshold: SlipThreshold, belt_speed: float) -> dict[str, Any]:
    """Return `count`, threshold, `regime`, distributions and each slip, for JSON; SI units.

    The belt speed is for the share of the sticks' velocity; 0 if it is not known.
    """
    count, slips = len(slips), slips[-_MOST_SLIPS:]
    columns = {name: [slip[k] for slip in slips] for k, name in enumerate(Slip._fields)}
    report: dict[str, Any] = {
        "count": count,
        "least_drop": threshold.drop,
        "within": threshold.within,
        "regime": regime_of(slips),
        "belt_speed": belt_speed,
    }
    for name in ("stick_time", "drop", "slip_time", "stick_velocity"):
        report[name] = _distribution(np.array(columns[name]))
    by_slip = {
        name: [value if isfinite(value) else None for value in values]
        for name, values in columns.items()
    }
    return {**report, "each": by_slip}


def regime_of(slips: Sequence[Slip]) -> Regime | None:
    """Return whether a motion with these slips sticks; None where no stick is seen as a whole.

    It sticks if the median time from the end of a slip to the next is 2.5 times that of a slip.
    """
    sticks = [slip.stick_time for slip in slips if isfinite(slip.stick_time)]
    if not sticks:
        return None
    slip_time = float(np.median([slip.slip_time for slip in slips]))
    longer = float(np.median(sticks)) > _STICKING_RATIO * slip_time
    return Regime.STICK_SLIP if longer else Regime.PURE_SLIP


def _distribution(values: FloatArray) -> dict[str, float] | None:
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return None
    quantiles = np.quantile(values, [*_QUANTILES.values()]).tolist()
    spread = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
    return {
        "mean": float(np.mean(values)),
        "standard_error": spread / len(values) ** 0.5,
        "standard_deviation": spread,
        **dict(zip(_QUANTILES, quantiles, strict=True)),
    }
