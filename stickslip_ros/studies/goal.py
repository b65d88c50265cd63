"""The goal of a design: the limits that gains are to keep, and the belt speeds at which."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, inf, log, log10
from typing import NamedTuple

import numpy as np

from stickslip_ros.model.drive import Drive, number_text
from stickslip_ros.model.drive_layout import SPEED
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.case_outcome import Disturbance
from stickslip_ros.theory.linear import jacobians

_GAIN_MARGIN = 10.0**0.1
"""Least gain margin, a factor: 2 dB."""
_DELAY_MARGIN = 2.0
"""Least delay margin, in periods of the controller."""
_NOISE_SHARE = 0.05
"""Largest rms force by noise, as a share of the limit, or of the static friction if it is less."""
_SLOWEST = 0.05
"""Least decay rate, per natural period or per `_WITHOUT_PERIOD`."""
_WITHOUT_PERIOD = 0.2
"""Period, s, of a drive without a spring."""


def speeds_across(drive: Drive, low: float, high: float) -> list[float]:
    """Return belt speeds, m/s, that stand for a range: five, and where the loops are extreme.

    Their sign is that of the drive's belt speed. Between them the slope of the friction is least
    or largest.
    """
    speeds = np.linspace(low, high, 5 if low < high else 1)
    if low < high and drive.has_spring:
        every = np.geomspace(low, high, 65)
        slopes = jacobians(drive, None, every / drive.speed_scale)[:, SPEED, SPEED]
        for row in (int(slopes.argmin()), int(slopes.argmax())):
            speeds = np.append(speeds, every[row]) if 0 < row < 64 else speeds
    return [copysign(speed, drive.belt_speed) for speed in np.unique(speeds).tolist()]


@dataclass(frozen=True)
class Goal:
    """What gains are to achieve; SI units."""

    feeds: tuple[float, ...]
    """Belt speeds, m/s."""
    force_limit: float
    """Largest force, N: of the law, or of a weaker actuator."""
    step: float
    """Step of a disturbance force, N, under which the force stays within the limit."""
    impulse: float
    """The same of an impulse, one period of the controller long, N."""
    delay_margin: float
    """Least delay margin, s."""
    noise_force: float
    """Largest rms force by noise and rounding, N."""
    decay_rate: float
    """Least decay rate, 1/s."""
    gain_margin: float = _GAIN_MARGIN
    """Least factor between the force of the law and an unstable one."""

    @classmethod
    def from_scenario(
        cls,
        scenario: Scenario,
        belt_speeds: tuple[float, float],
        disturbances: Sequence[Disturbance],
        force_limit: float,
    ) -> "Goal":
        """Return the goal for a scenario: a delay margin of two periods of the controller.

        Parameters
        ----------
        scenario : Scenario
            Drive and loop.
        belt_speeds : tuple of float
            Lowest and highest belt speed, m/s.
        disturbances : sequence of Disturbance
            What acts on the drive. A sine counts as a step of its amplitude.
        force_limit : float
            Largest force of the law, N.
        """
        plant = scenario.plant
        drive, limit = plant.as_drive(), min(force_limit, plant.actuator.limit)
        step, impulse = (
            max((d.amplitude for d in disturbances if d.kind in kinds), default=0.0)
            for kinds in (("step", "sine"), ("impulse",))
        )
        impulse /= plant.answer_every  # as strong over a period of the controller
        friction = max(drive.friction.limits) * drive.normal_force
        return cls(
            feeds=tuple(speeds_across(drive, *belt_speeds)),
            force_limit=limit,
            step=step,
            impulse=impulse,
            delay_margin=_DELAY_MARGIN / plant.control_rate,
            noise_force=_NOISE_SHARE * min(limit, friction),
            decay_rate=_SLOWEST / (drive.natural_period if drive.has_spring else _WITHOUT_PERIOD),
        )


class Limit(NamedTuple):
    """A quantity of gains with its limit."""

    name: str
    """Name, for a sentence."""
    value: float
    """Value that the gains have, SI units."""
    limit: float
    """Largest or least value."""
    unit: str
    """Unit."""
    least: bool = False
    """Whether it is the least value."""

    @property
    def excess(self) -> float:
        """Logarithm of the factor to the limit, above zero beyond it."""
        above, below = (self.limit, self.value) if self.least else (self.value, self.limit)
        ratio = above / max(below, 1e-300)
        return log(ratio) if ratio > 0.0 else -inf

    def sentence(self, drive: Drive) -> str:
        """Return a clause with both values."""
        values = [self.value, self.limit]
        if self.unit == "dB":
            shown = [f"{20.0 * log10(value):.2g} dB" for value in values]
        else:
            shown = [number_text(drive, value, self.unit) for value in values]
        bound = "least" if self.least else "most"
        return f"{self.name} is {shown[0]}, and must be at {bound} {shown[1]}"
