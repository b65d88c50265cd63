"""What gains are wanted for: a drive, its loop, a force limit and a range of belt speeds."""

from dataclasses import dataclass, field, replace
from math import inf
from typing import Self

import numpy as np

from stickslip_ros.deprecated_names import Renamed
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.options import OWN_SPEED_RANGE


@dataclass(frozen=True)
class Task:
    """What gains are wanted for; SI units."""

    drive: Drive
    rate: float
    """Samples per second, Hz."""
    force_delay: float
    """From a sample to the start of its force, s."""
    force_limit: float
    """Largest force there may be, N."""
    belt_speeds: tuple[float, float]
    """Lowest and highest, m/s, above zero; the other direction mirrors them."""
    scenario: Scenario | None = field(default=None, compare=False, repr=False)
    """What sets the task, if a scenario does."""

    of = Renamed("from_scenario")

    @classmethod
    def from_scenario(
        cls, scenario: Scenario, belt_speeds: tuple[float, float] | None = None
    ) -> Self:
        """Return the task that a scenario sets, by default within 10 % of its own belt speed.

        Raises InvalidInputError for speeds that are no range above zero.
        """
        plant = scenario.plant
        if belt_speeds is None:
            own = abs(plant.belt_speed)
            if own == 0.0:
                raise InvalidInputError(
                    "plant.belt_speed = 0: gains are for a moving belt, so its speeds must be given"
                )
            belt_speeds = (own * (1.0 - OWN_SPEED_RANGE), own * (1.0 + OWN_SPEED_RANGE))
        low, high = belt_speeds
        if not 0.0 < low <= high < inf:
            raise InvalidInputError(
                f"belt speeds {low:g} to {high:g} m/s: must be finite, above zero, the lower first"
            )
        limit = scenario.washout_controller.force_limit
        return cls(plant.as_drive(), plant.rate, plant.force_delay, limit, (low, high), scenario)

    def drives(self) -> list[Drive]:
        """Return the drive at speeds throughout the range."""
        low, high = self.belt_speeds
        speeds = np.linspace(low, high, 5 if low < high else 1)
        return [replace(self.drive, belt_speed=speed) for speed in speeds.tolist()]

    def shown(self, value: float, unit: str) -> str:
        """Return a value as remarks show it, without a unit where the drive is dimensionless."""
        return f"{value:.4g}" if self.drive.is_dimensionless else f"{value:.4g} {unit}"
