"""The search for gains that damp fastest within a force limit, by the linear sampled loop."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import ceil, floor, inf, isinf, log10
from typing import Annotated, Self

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.constants import LARGEST, SMALLEST
from stickslip_ros.physics.model.control import Washout
from stickslip_ros.physics.model.dimensionless_drive import SPEED
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.functions import zero_between
from stickslip_ros.physics.model.sensor import EXACT_SENSOR, Sensor
from stickslip_ros.physics.theory.linear_sampled_loop import LinearSampledLoop, why_no_linear_loop
from stickslip_ros.quantities import Quantity
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.controller_trial import Vibration
from stickslip_ros.studies.options import OWN_SPEED_RANGE
from stickslip_ros.studies.stability import hopf_distance, hopf_ratio, number_text

CUBIC_SHARES = (0.0, 0.125, 0.25, 0.5)
"""Cubic gains to try, as shares of the friction law's own cubic coefficient.

With a share of 1 the loop would diverge from high speeds. A positive cubic gain reduces the force
where the vibration is large, so that the force limit allows more linear gain.
"""

RESERVE = 0.95
"""Share of the allowed force and gain that the first proposal uses."""


@dataclass(frozen=True)
class Task:
    """The task of a design; SI units. Create it with `Task.from_scenario`."""

    drive: Drive
    """The drive; `belt_speeds` replaces its belt speed."""
    rate: float
    """Samples per second, Hz."""
    force_delay: float
    """Delay from a sample to the start of its force, s."""
    force_limit: float
    """Largest allowed force, N: that of the controller, or the limit of a weaker actuator."""
    belt_speeds: tuple[float, float]
    """Lowest and highest belt speed, m/s, above zero; the opposite direction is symmetric."""
    sensor: Sensor = EXACT_SENSOR
    """Sensor that measures the samples."""
    scenario: Scenario | None = field(default=None, compare=False, repr=False)
    """The scenario that the task comes from, if any."""

    @classmethod
    def from_scenario(
        cls, scenario: Scenario, belt_speeds: tuple[float, float] | None = None
    ) -> Self:
        """Return the task of a scenario.

        Parameters
        ----------
        scenario : Scenario
            Source of drive, rate, delay and force limit.
        belt_speeds : tuple[float, float], optional
            Lowest and highest belt speed, m/s; by default 10 % below and above the scenario's.

        Returns
        -------
        Task
            The task.

        Raises
        ------
        InvalidInputError
            If the speeds are not a range above zero, if they are omitted and the scenario's belt
            is at rest, or if a design does not cover the scenario's control law.
        """
        plant, law = scenario.plant, scenario.control_law
        if law is None:
            raise InvalidInputError(
                "plant.expects_control = False: without control there are no gains"
            )
        if not isinstance(law, Washout):
            raise InvalidInputError(
                f"control law = {law.name} is invalid: must be {Washout.name}, "
                "whose gains a design proposes"
            )
        if plant.motor.kind == "mass":
            raise InvalidInputError(
                "plant.motor.kind = mass is refused: a design needs an ideal motor"
            )
        if belt_speeds is None:
            own = abs(plant.belt_speed)
            if own == 0.0:
                raise InvalidInputError(
                    "plant.belt_speed = 0: gains are for a moving belt, so speeds must be given"
                )
            belt_speeds = (own * (1.0 - OWN_SPEED_RANGE), own * (1.0 + OWN_SPEED_RANGE))
        low, high = belt_speeds
        if not SMALLEST <= low <= high <= LARGEST:
            raise InvalidInputError(
                f"belt speeds {low:g} to {high:g} m/s: must be from {SMALLEST:g} to {LARGEST:g}, "
                "the lower first"
            )
        return cls(
            plant.as_drive(),
            plant.rate,
            plant.force_delay,
            min(law.force_limit, plant.actuator.limit),
            (low, high),
            plant.sensor,
            scenario,
        )

    @property
    def is_rough(self) -> bool:
        """Whether noise or rounding keep the loop from resting."""
        rounded = self.sensor.position_resolution or self.drive.actuator.resolution
        return bool(rounded or self.sensor.position_noise or self.sensor.velocity_noise)

    def drives(self) -> list[Drive]:
        """Return the drive at five speeds across the range, or at the only one."""
        low, high = self.belt_speeds
        speeds = np.linspace(low, high, 5 if low < high else 1)
        return [replace(self.drive, belt_speed=speed) for speed in speeds.tolist()]


class Candidates:
    """Gains by theory: from the linear loops of the speed range, and the vibrations there."""

    def __init__(self, task: Task, vibrations: Sequence[Vibration]) -> None:
        self.task, self.vibrations = task, vibrations
        loops = (
            LinearSampledLoop.from_drive(each.drive, task.rate, task.force_delay, task.sensor)
            for each in vibrations
        )
        self.loops = [loop for loop in loops if loop is not None]
        # The loops differ in the slope of the friction only: the two extreme ones decide.
        slopes = [float(loop.jacobian[SPEED, SPEED]) for loop in self.loops]
        ends = sorted({int(np.argmin(slopes)), int(np.argmax(slopes))})
        self._extremes = [self.loops[index].coarsened() for index in ends]
        # Twice the gain that settles without overshoot: a larger one does not damp faster.
        unit = task.drive.normal_force / task.drive.speed_scale
        self._largest_gain = (4.0 + 2.0 * max(map(abs, slopes))) * unit
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

    def slowest(self, gains: Washout) -> LinearSampledLoop:
        """Return the loop in which a small deviation decays most slowly."""
        return min(self.loops, key=lambda loop: loop.decay_rate(gains))

    def best(self, strength: float, cubic_shares: Sequence[float]) -> Washout | None:
        """Return the gains that damp fastest, with the share `strength` of what is allowed.

        They have three digits, and are zero if nothing vibrates. None if no gains are stable.
        """
        if not self._vibrates:
            none = Washout(rounded(self.task.drive.angular_frequency), 0.0, 0.0)
            if self.slowest(none).decay_rate(none) > 0.0:
                return none
        best, fastest = None, 0.0
        for share in cubic_shares:
            cubic = share * self._cubic_coefficient
            if share > 0.0 and (cubic == 0.0 or isinf(self.task.force_limit)):
                break
            gains = self._fastest(strength, cubic)
            decay_rate = self.slowest(gains).decay_rate(gains)
            if decay_rate > fastest * 1.05:  # less is not worth a larger cubic gain
                best, fastest = gains, decay_rate
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
        sets = [[loop.stable_linear_gains(d) for loop in self._extremes] for d in frequencies]
        if not any(
            max(one.low, other.low) < min(one.high, other.high)
            for each in sets
            for one in each[0]
            for other in each[-1]
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

    def _fastest(self, strength: float, cubic: float) -> Washout:
        """Return the fastest gains: from five grids, each refined around the best point so far."""
        # A positive cubic gain softens the control with a negative linear gain only.
        limits = np.array(
            [np.log(self._corner_frequencies(2)), [-1.0, 0.0 if cubic > 0.0 else 1.0]]
        )
        window, counts = limits, (25, 41)
        best = Washout(0.0, 0.0, 0.0)
        for _ in range(5):
            logarithms, shares = (
                np.linspace(low, high, count)
                for (low, high), count in zip(window, counts, strict=True)
            )
            corners = np.exp(logarithms)
            largest = [self._largest(corner, strength, cubic) for corner in corners.tolist()]
            gains = np.outer(largest, shares)
            rates = np.min([loop.decay_rates(corners, gains) for loop in self._extremes], axis=0)
            row, column = np.unravel_index(int(np.argmax(rates)), rates.shape)
            best = Washout(*map(rounded, (corners[row], gains[row, column], cubic)))
            centre = np.array([[logarithms[row]], [shares[column]]])
            reach = 0.3 / 2.0 * (window[:, 1:] - window[:, :1])
            window = np.clip(centre + reach * [-1.0, 1.0], limits[:, :1], limits[:, 1:])
            counts = (9, 9)
        return best

    def _corner_frequencies(self, count: int) -> FloatArray:
        """Return cutoff frequencies (rad/s), up to the rate: a faster filter passes nothing."""
        omega = self.task.drive.angular_frequency
        low, high = 0.02 * omega, 20.0 * omega
        return np.geomspace(low, max(min(high, self.task.rate), 2.0 * low), count)

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
    return coefficient * drive.normal_force / drive.speed_scale**3 if coefficient > 1e-6 else 0.0


def rounded(value: float, digits: int = 3, *, up: bool = False) -> float:
    """Return a value rounded to `digits` significant digits, `up` or to the nearest."""
    if value == 0.0:
        return 0.0
    if up:
        unit = 10.0 ** (floor(log10(value)) + 1 - digits)
        value = ceil(value / unit) * unit
    return float(f"{value:.{digits}g}")


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


def little_margin(task: Task, found: Margins) -> str | None:
    """Return a remark on loops with a small margin; None if all margins are large enough."""
    little = [
        f"{factor:.3g} times the linear gain is unstable"
        for factor in (found.gain_down, found.gain_up)
        if factor is not None and 1.0 / 1.1 < factor < 1.1
    ]
    if found.delay is not None and found.delay < 0.02 * task.drive.natural_period:
        delay = number_text(task.drive, found.delay, "s")
        little.append(f"an additional delay of {delay} makes it unstable")
    return f"the margin is very small: {', '.join(little)}" if little else None
