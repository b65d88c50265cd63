"""What gains are to achieve, and what the linear loops say of those that were found."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import copysign, inf, log, log10
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from stickslip_ros.model.control import ControlLaw
from stickslip_ros.model.drive import Drive, number_text
from stickslip_ros.model.drive_layout import SPEED
from stickslip_ros.quantities import Quantity, quantities_of
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.case_outcome import Disturbance
from stickslip_ros.theory.linear import jacobians
from stickslip_ros.theory.loop_response import LoopResponse


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
    gain_margin: float = 10.0**0.1
    """Least factor, 2 dB, between the force of the law and an unstable one."""

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
        limit = min(force_limit, scenario.plant.actuator.limit)
        feeds = speeds_across(scenario.plant.as_drive(), *belt_speeds)
        step, impulse = (
            max((d.amplitude for d in disturbances if d.kind in kinds), default=0.0)
            for kinds in (("step", "sine"), ("impulse",))
        )
        plant = scenario.plant
        impulse /= plant.answer_every  # as strong over a period of the controller
        return cls(tuple(feeds), limit, step, impulse, 2.0 / plant.control_rate)


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


@dataclass(frozen=True)
class Tuned:
    """The gains that were found for a law, and what the linear loops say of them."""

    law: ControlLaw
    """The law with its gains: the nearest ones if a limit is missed."""
    goal: Goal
    """The goal."""
    decay_rate: Annotated[float, Quantity("smallest decay rate", "1/s")]
    """Smallest decay rate at the feeds, 1/s."""
    delay_margin: Annotated[float | None, Quantity("delay margin", "s")] = None
    """Smallest delay margin, s; None if no delay turns the loop unstable."""
    phase_margin: Annotated[float | None, Quantity("phase margin", "rad")] = None
    """Smallest phase margin, rad; None without any."""
    gain_down: Annotated[float | None, Quantity("lower gain margin")] = None
    """Largest factor below one of the force at which a loop is unstable; None without any."""
    gain_up: Annotated[float | None, Quantity("upper gain margin")] = None
    """Smallest factor above one of the force at which a loop is unstable; None without any."""
    sensitivity_peak: Annotated[float | None, Quantity("peak of the sensitivity")] = None
    """Largest magnitude of the sensitivity."""
    peak_force: Annotated[float | None, Quantity("peak force, predicted", "N")] = None
    """Largest force, N, by disturbance, mean friction and noise, and of the washout law by the
    vibration that it catches."""
    mean_force: Annotated[float | None, Quantity("mean friction that the law carries", "N")] = None
    """Largest part of it that is constant, N."""
    noise_force: Annotated[float | None, Quantity("rms force by noise", "N")] = None
    """Largest rms force by noise and rounding of the encoder, N."""
    missed: tuple[Limit, ...] = ()
    """Limits that the gains miss."""
    remark: str | None = None
    """Which limits are missed, and by how much, or a caution; or None."""
    responses: tuple[LoopResponse, ...] = field(default=(), repr=False)
    """The linear loops at the feeds; empty of unstable ones."""

    @property
    def poles(self) -> dict[float, npt.NDArray[np.complex128]]:
        """Poles of the linear loop per sample, by belt speed, m/s."""
        poles: dict[float, npt.NDArray[np.complex128]] = {}
        for response in self.responses:
            loop = response.plant.loop
            matrix = loop.transition_matrix(response.feedback)
            poles[loop.drive.belt_speed] = np.linalg.eigvals(matrix).astype(np.complex128)
        return poles


LINEAR = quantities_of(Tuned)
"""What the linear loops say, by name."""
