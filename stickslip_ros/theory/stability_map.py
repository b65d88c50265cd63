"""Stability of the sampled loop over its gains, over rate and delay, and over the belt speed."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.control import ControlLaw, Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.sensor import EXACT_SENSOR, Sensor
from stickslip_ros.theory.critical_gains import critical_gains
from stickslip_ros.theory.gain_intervals import nearest_to_zero
from stickslip_ros.theory.linear import expand
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop

SEARCHED_FEEDS = (0.1, 10.0)
"""First and last belt speed at which a loop is looked at, as shares of that of its drive."""


@dataclass(frozen=True)
class StabilityMap:
    """Decay rates of a loop over cutoff frequency and linear gain, around given gains; SI units."""

    loop: LinearSampledLoop
    gains: Washout
    """Gains at the centre of the map."""
    corner_frequencies: FloatArray
    """rad/s, shape (m,)."""
    linear_gains: FloatArray
    """N s/m, shape (n,); their range includes zero."""
    decay_rates: FloatArray
    """1/s, shape (m, n); above zero where the loop is stable. Approximate for a long delay."""
    continuous: FloatArray
    """Critical linear gain without sampling and delay, shape (m,); NaN if there is none."""

    @classmethod
    def around(cls, loop: LinearSampledLoop, gains: Washout, points: int = 81) -> Self:
        """Return the map around `gains` (SI units) with this number of points along each axis.

        Its linear gains reach from zero past those gains and past the critical one.
        """
        corners = np.geomspace(0.1 * gains.corner_frequency, 10.0 * gains.corner_frequency, points)
        continuous = np.full(points, np.nan)
        for row, corner_frequency in enumerate(corners):
            critical = critical_gains(loop.drive, Washout(float(corner_frequency), 0.0, 0.0))
            if critical is not None:
                continuous[row] = critical.linear
        needed = loop.critical_linear_gain(gains.corner_frequency) or 0.0
        unit = loop.drive.force_scale / loop.drive.speed_scale
        ends = [2.0 * gain for gain in (gains.linear_gain, needed) if gain] or [-2.0 * unit]
        far = max(ends, key=abs)
        linear = np.linspace(min(*ends, -0.25 * far), max(*ends, -0.25 * far), points)
        decay_rates = loop.coarsened().decay_rates(corners, linear)
        return cls(loop, gains, corners, linear, decay_rates, continuous)


@dataclass(frozen=True)
class CriticalGainCurves:
    """Critical linear gain over rate and delay of a sampled loop; SI units."""

    rates: FloatArray
    """Hz, shape (m,)."""
    force_delays: FloatArray
    """s, shape (n,)."""
    linear_gains: FloatArray
    """See `LinearSampledLoop.critical_linear_gain`, N s/m; (m, n), NaN if there is none."""
    other_ends: FloatArray
    """Other ends of the stable intervals that these gains end, N s/m; (m, n)."""

    @classmethod
    def over(
        cls,
        drive: Drive,
        corner_frequency: float,
        rates: FloatArray,
        force_delays: FloatArray,
        sensor: Sensor = EXACT_SENSOR,
        answer_every: int = 1,
    ) -> Self:
        """Return the curves of a drive for this cutoff frequency (rad/s).

        The rates are those of the answers, to each sample of so many.
        """
        ends = np.full((2, len(rates), len(force_delays)), np.nan)
        for row, rate in enumerate(rates.tolist()):
            for column, force_delay in enumerate(force_delays.tolist()):
                sampling = rate * answer_every, force_delay, sensor, EXACT_SENSOR, answer_every
                loop = LinearSampledLoop.from_drive(drive, *sampling)
                intervals = loop.stable_linear_gains(corner_frequency) if loop else []
                if intervals:
                    interval = nearest_to_zero(intervals)
                    order = 1 if interval[0] == interval.critical else -1
                    ends[:, row, column] = interval[::order]
        return cls(rates, force_delays, *ends)


def stable_feeds(
    drive: Drive, law: ControlLaw | None, sampling: tuple[float, float, Sensor, Sensor, int]
) -> list[tuple[float, float]] | None:
    """Return the ranges of belt speeds, m/s, at which a small vibration decays by linear theory.

    Searched are those from `SEARCHED_FEEDS[0]` to `SEARCHED_FEEDS[1]` times the belt speed; a range
    that ends there may be wider. Without a `law` there is no control; `sampling` is what
    `LinearSampledLoop.from_drive` takes. None if the belt is at rest, or if linear theory does not
    cover the loop.
    """
    from scipy.optimize import bisect  # takes long to import

    def is_stable(speed: float) -> bool:
        moved = replace(drive, belt_speed=speed)
        if law is None:
            expansion = expand(moved)
            return expansion is not None and bool(expansion.stable)
        loop = LinearSampledLoop.from_drive(moved, *sampling)
        return loop is not None and loop.spectral_radius(law) < 1.0

    def sign(speed: float) -> float:
        return 1.0 if is_stable(speed) else -1.0

    if not drive.belt_speed:
        return None
    speeds = (drive.belt_speed * np.geomspace(*SEARCHED_FEEDS, 100)).tolist()
    try:
        known = [is_stable(speed) for speed in speeds]
    except InvalidInputError:
        return None
    ends = speeds[:1] * known[0]
    for (low, before), (high, after) in pairwise(zip(speeds, known, strict=True)):
        if before != after:
            ends.append(bisect(sign, low, high, rtol=1e-4))
    ends += speeds[-1:] * known[-1]
    return [*zip(ends[::2], ends[1::2], strict=True)]
