"""The task of a design: a drive, its loop, a force limit and a range of belt speeds."""

from dataclasses import dataclass, field, replace
from math import inf
from typing import Self

import numpy as np

from stickslip_ros.deprecated_names import Renamed
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.control import Washout
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.sensor import EXACT_SENSOR, Sensor
from stickslip_ros.physics.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.options import OWN_SPEED_RANGE

DesignedLaw = Washout
"""The control law whose gains a design proposes."""


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

    of = Renamed("from_scenario")

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
        if not isinstance(law, DesignedLaw):
            raise InvalidInputError(
                f"control law = {law.name} is refused: must be {DesignedLaw.name}, "
                "whose gains a design proposes"
            )
        if belt_speeds is None:
            own = abs(plant.belt_speed)
            if own == 0.0:
                raise InvalidInputError(
                    "plant.belt_speed = 0: gains are for a moving belt, so speeds must be given"
                )
            belt_speeds = (own * (1.0 - OWN_SPEED_RANGE), own * (1.0 + OWN_SPEED_RANGE))
        low, high = belt_speeds
        if not 0.0 < low <= high < inf:
            raise InvalidInputError(
                f"belt speeds {low:g} to {high:g} m/s: must be finite, above zero, the lower first"
            )
        return cls(
            plant.as_drive(),
            plant.rate,
            plant.force_delay,
            min(law.force_limit, plant.as_actuator().limit),
            (low, high),
            plant.as_sensor(),
            scenario,
        )

    @property
    def rough(self) -> bool:
        """Whether noise or rounding keep the loop from resting."""
        rounded = self.sensor.position_resolution or self.drive.actuator.resolution
        return bool(rounded or self.sensor.position_noise or self.sensor.velocity_noise)

    def linear_loop(self, drive: Drive) -> LinearSampledLoop | None:
        """Return the linear loop of a drive in this task.

        Parameters
        ----------
        drive : Drive
            Drive in SI units.

        Returns
        -------
        LinearSampledLoop or None
            Loop; see `LinearSampledLoop.from_drive`.
        """
        return LinearSampledLoop.from_drive(drive, self.rate, self.force_delay, self.sensor)

    def drives(self) -> list[Drive]:
        """Return the drive at five speeds across the range, or at the only one."""
        low, high = self.belt_speeds
        speeds = np.linspace(low, high, 5 if low < high else 1)
        return [replace(self.drive, belt_speed=speed) for speed in speeds.tolist()]

    def shown(self, value: float, unit: str) -> str:
        """Return a value as text for a remark.

        Parameters
        ----------
        value : float
            The value, in SI units.
        unit : str
            Its unit.

        Returns
        -------
        str
            The value with its unit; without it if the drive is dimensionless.
        """
        return f"{value:.4g}" if self.drive.is_dimensionless else f"{value:.4g} {unit}"
