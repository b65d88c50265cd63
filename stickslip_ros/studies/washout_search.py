"""The gains of the washout law: those that damp fastest within a force limit, and their margins."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise
from math import exp, inf, isinf, log10
from typing import Annotated, Self

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.functions import zero_between
from stickslip_ros.quantities import Quantity
from stickslip_ros.studies.controller_trial import Vibration
from stickslip_ros.studies.design import Task
from stickslip_ros.studies.gain_search import Loops, fastest, rounded
from stickslip_ros.studies.stability import hopf_distance, hopf_ratio, number_text
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop, why_no_linear_loop

CUBIC_SHARES = (0.0, 0.125, 0.25, 0.5)
"""Cubic gains to try, as shares of the friction law's own cubic coefficient.

With a share of 1 the loop would diverge from high speeds. A positive cubic gain reduces the force
where the vibration is large, so that the force limit allows more linear gain.
"""

_UNITS = np.array([0.25, 0.2])
"""Logarithm of the cutoff frequency, and share of the largest gain, that one step covers first."""

_PARTS = -1.0, -0.4, 0.0, 0.4, 1.0
_WAYS = [(x, y) for x in _PARTS for y in _PARTS]
"""Steps of the search: the fastest decay is often on a ridge, askew to the gains."""

RESERVE = 0.95
"""Share of the allowed force and gain that the first proposal uses."""


class Candidates:
    """Gains by theory: from the linear loops of the speed range, and the vibrations there."""

    def __init__(self, task: Task, vibrations: Sequence[Vibration]) -> None:
        self.task, self.vibrations = task, vibrations
        plant = task.scenario.plant
        loops = (
            LinearSampledLoop.from_drive(member.drive, plant.rate, plant.force_delay, plant.sensor)
            for member in vibrations
        )
        self.loops = Loops([loop for loop in loops if loop is not None])
        # Twice the gain that settles without overshoot: a larger one does not damp faster.
        unit = task.drive.force_scale / task.drive.speed_scale
        self._largest_gain = (4.0 + 2.0 * self.loops.steepest) * unit
        self._cubic_coefficient = _cubic_coefficient(task.drive)
        self._peaks: dict[float, float] = {}
        """Largest filtered speed of all vibrations, m/s, by cutoff frequency."""

    def limited(self, force_limit: float) -> Self:
        """Return the candidates for another force limit, N."""
        other = copy(self)
        other.task = replace(self.task, force_limit=force_limit)
        return other

    def free_peak_force(self) -> float:
        """Return the peak force, N, of the fastest gains without limit; 0 if none are stable."""
        gains = self.limited(inf).best(RESERVE, CUBIC_SHARES)
        if gains is None:
            return 0.0
        return max(vibration.peak_force(gains) for vibration in self.vibrations)

    def best(self, strength: float, cubic_shares: Sequence[float]) -> Washout | None:
        """Return the gains that damp fastest, with the share `strength` of what is allowed.

        They have three digits, and are zero if nothing vibrates. None if no gains are stable.
        """
        if not self._vibrates:
            none = Washout(rounded(self.task.drive.angular_frequency), 0.0, 0.0)
            if self.loops.slowest(none).decay_rate(none) > 0.0:
                return none
        best, highest = None, 0.0
        for share in cubic_shares:
            cubic = share * self._cubic_coefficient
            if share > 0.0 and (cubic == 0.0 or isinf(self.task.force_limit)):
                break
            gains = self._fastest(strength, cubic)
            decay_rate = 0.0 if gains is None else self.loops.slowest(gains).decay_rate(gains)
            if decay_rate > highest * 1.05:  # less is not worth a larger cubic gain
                best, highest = gains, decay_rate
        return best

    def why_zero(self) -> str:
        """Return the reason for zero gains."""
        if self._vibrates:
            return "no gains within the force limit damp faster than none"
        distances = {
            abs(log10(ratio)): hopf_distance(vibration.drive)
            for vibration in self.vibrations
            if (ratio := hopf_ratio(vibration.drive)) is not None
        }
        said = "nothing vibrates without control at these belt speeds: the gains are zero"
        if not distances:
            return said
        nearest = min(distances)
        little = ", with a very small margin" if nearest < log10(1.05) else ""
        return f"{said}; {distances[nearest]}{little}"

    def why_none(self) -> str:
        """Return why no gains are stable at all speeds within the force limit."""
        frequencies = self._corner_frequencies(17).tolist()
        sets = [[loop.stable_linear_gains(d) for loop in self.loops.deciding] for d in frequencies]
        if not any(
            max(one.low, other.low) < min(one.high, other.high)
            for gains in sets
            for one in gains[0]
            for other in gains[-1]
        ):
            return (
                "no linear gain makes the equilibrium stable at all these belt speeds, at this "
                "rate and delay"
            )
        limit = number_text(self.task.drive, self.task.force_limit, "N")
        return (
            f"the force limit of {limit} is too small for gains that make the equilibrium stable "
            "at all these belt speeds and suppress the vibration"
        )

    @property
    def _vibrates(self) -> bool:
        return any(vibration.vibrates for vibration in self.vibrations)

    def _fastest(self, strength: float, cubic: float) -> Washout | None:
        """Return the fastest gains with this cubic gain; None if none are stable."""
        corners = np.log(self._corner_frequencies(25)).tolist()
        # A positive cubic gain softens the control with a negative linear gain only.
        most = 0.0 if cubic > 0.0 else 1.0
        shares = np.linspace(-1.0, most, 21)

        def gains(point: FloatArray) -> Washout:
            logarithm, share = (point * _UNITS).tolist()
            corner = rounded(exp(min(max(logarithm, corners[0]), corners[-1])))
            share = min(max(share, -1.0), most)
            linear = share * self._largest(corner, strength, cubic)
            return Washout(corner, rounded(linear), rounded(cubic))

        starts = np.stack(np.meshgrid(corners, shares), axis=-1).reshape(-1, 2) / _UNITS
        return fastest(self.loops, starts, gains, ways=_WAYS, kept=3)

    def _corner_frequencies(self, count: int) -> FloatArray:
        """Return cutoff frequencies (rad/s), up to the rate: a faster filter passes nothing."""
        omega = self.task.drive.angular_frequency
        low, high = 0.02 * omega, 20.0 * omega
        return np.geomspace(low, max(min(high, self.task.scenario.plant.rate), 2.0 * low), count)

    def _largest(self, corner_frequency: float, strength: float, cubic: float) -> float:
        """Return the largest allowed magnitude of the linear gain.

        With a softening cubic gain the force k v - k2 v^3 may be largest below the peak speed.
        """
        if corner_frequency not in self._peaks:
            self._peaks[corner_frequency] = max(
                vibration.peak_speed(corner_frequency) for vibration in self.vibrations
            )
        peak, limit = self._peaks[corner_frequency], strength * self.task.force_limit
        gain = limit / peak + cubic * peak**2 if peak > 0.0 else inf
        if gain < 3.0 * cubic * peak**2:
            gain = (6.75 * cubic * limit**2) ** (1.0 / 3.0)
        return min(gain, strength * self._largest_gain)


def _cubic_coefficient(drive: Drive) -> float:
    """Return the coefficient of the falling cubic friction at high speed, N s^3/m^3, or zero."""
    law, high = drive.dimensionless.friction, 1e6
    coefficient = -float(law.coefficient(high, 1.0)) / high**3
    return coefficient * drive.force_scale / drive.speed_scale**3 if coefficient > 1e-6 else 0.0


@dataclass(frozen=True)
class Margins:
    """Smallest gain and delay margins of a set of stable loops."""

    gain_down: Annotated[float | None, Quantity("lower gain margin")]
    """Largest factor below one of the linear gain at which a loop is unstable; None: no such."""
    gain_up: Annotated[float | None, Quantity("upper gain margin")]
    """Smallest factor above one of the linear gain at which a loop is unstable; None: no such."""
    delay: Annotated[float | None, Quantity("delay margin", "s")]
    """Delay margin: smallest additional delay of the force at which a loop is unstable, s; None: no
    such within half a natural period, or within the range of the theory."""


def margins(loops: Sequence[LinearSampledLoop], gains: Washout) -> Margins:
    """Return the margins of loops that are stable with these gains (SI units)."""
    factors = [
        end / gains.linear_gain
        for loop in loops
        for interval in loop.stable_linear_gains(gains.corner_frequency)
        if interval.low < gains.linear_gain < interval.high
        for end in interval
    ]
    delays = [delay for loop in loops if (delay := _delay_margin(loop, gains)) is not None]
    return Margins(
        gain_down=max((factor for factor in factors if 0.0 < factor < 1.0), default=None),
        gain_up=min((factor for factor in factors if factor > 1.0), default=None),
        delay=min(delays, default=None),
    )


def _delay_margin(loop: LinearSampledLoop, gains: Washout) -> float | None:
    def decay_rate(further: float) -> float:
        return replace(loop, force_delay=loop.force_delay + further).decay_rate(gains)

    further = np.linspace(0.0, loop.drive.natural_period / 2.0, 33).tolist()
    for shorter, longer in pairwise(further):
        if why_no_linear_loop(loop.drive, loop.rate, loop.force_delay + longer) is not None:
            return None
        if decay_rate(longer) < 0.0:
            return zero_between(decay_rate, shorter, longer)
    return None


def little_margin(task: Task, margins: Margins) -> str | None:
    """Return a remark on loops with a small margin; None if all margins are large enough."""
    little = [
        f"{factor:.3g} times the linear gain is unstable"
        for factor in (margins.gain_down, margins.gain_up)
        if factor is not None and 1.0 / 1.1 < factor < 1.1
    ]
    if margins.delay is not None and margins.delay < 0.02 * task.drive.natural_period:
        delay = number_text(task.drive, margins.delay, "s")
        little.append(f"an additional delay of {delay} makes it unstable")
    return f"the margin is very small: {', '.join(little)}" if little else None
