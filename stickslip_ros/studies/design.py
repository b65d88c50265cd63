"""The task of a design, and its result: gains of a control law, or why there are none."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import copysign
from typing import Any, Self

import numpy as np

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import LARGEST, SMALLEST
from stickslip_ros.model.control import ControlLaw, Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.scenarios.files import Scenario, parameter_file
from stickslip_ros.studies.options import OWN_SPEED_RANGE


@dataclass(frozen=True)
class Task:
    """The task of a design; SI units. Create it with `Task.from_scenario`."""

    scenario: Scenario
    """Drive, loop and control law; the gains of the law are not used."""
    belt_speeds: tuple[float, float]
    """Lowest and highest belt speed, m/s, above zero."""
    force_limit: float
    """Largest allowed force, N: that of the controller, or the limit of a weaker actuator."""

    @classmethod
    def from_scenario(
        cls, scenario: Scenario, belt_speeds: tuple[float, float] | None = None
    ) -> Self:
        """Return the task of a scenario.

        Parameters
        ----------
        scenario : Scenario
            Source of drive, loop, control law and force limit.
        belt_speeds : tuple[float, float], optional
            Lowest and highest belt speed, m/s; by default 10 % below and above the scenario's.

        Raises
        ------
        InvalidInputError
            If the speeds are not a range above zero, if they are omitted and the scenario's belt
            is at rest, or if the scenario has no controller.
        """
        plant, law = scenario.plant, scenario.control_law
        if law is None:
            raise InvalidInputError(
                "plant.expects_control = False: without control there are no gains"
            )
        if isinstance(law, Washout) and plant.motor.kind == "mass":
            raise InvalidInputError(
                f"plant.motor.kind = mass is refused: a design of the {law.name} law needs an "
                "ideal motor"
            )
        if belt_speeds is None:
            speed = abs(plant.belt_speed)
            if speed == 0.0:
                raise InvalidInputError(
                    "plant.belt_speed = 0: gains are for a moving belt, so speeds must be given"
                )
            belt_speeds = (speed * (1.0 - OWN_SPEED_RANGE), speed * (1.0 + OWN_SPEED_RANGE))
        low, high = belt_speeds
        if not SMALLEST <= low <= high <= LARGEST:
            ordered = SMALLEST <= high < low <= LARGEST
            must = "the lower must be first" if ordered else f"must be above 0, at most {LARGEST:g}"
            raise InvalidInputError(f"belt speeds {low:g} m/s to {high:g} m/s: {must}")
        return cls(scenario, (low, high), min(law.force_limit, plant.actuator.limit))

    @cached_property
    def drive(self) -> Drive:
        """The drive at the scenario's belt speed."""
        return self.scenario.plant.as_drive()

    @property
    def speeds(self) -> list[float]:
        """Five belt speeds across the range, m/s, or the only one."""
        low, high = self.belt_speeds
        return np.linspace(low, high, 5 if low < high else 1).tolist()

    @property
    def drives(self) -> list[Drive]:
        """The drive at these speeds; the opposite direction is symmetric."""
        return [replace(self.drive, belt_speed=speed) for speed in self.speeds]

    def with_law(self, law: ControlLaw) -> Scenario:
        """Return the scenario with other constants of its law.

        Parameters
        ----------
        law : ControlLaw
            The law with the constants.

        Returns
        -------
        Scenario
            The changed copy. Its belt speed is that of the scenario, or the nearest one within the
            range.
        """
        (low, high), belt_speed = self.belt_speeds, self.scenario.plant.belt_speed
        values = {name: getattr(law, name) for name in law.constants()}
        proposed: dict[str, Any] = {
            f"{self.scenario.controller.node}.{name}": value
            for name, value in values.items()
            if isinstance(value, float)
        }
        proposed["plant.belt_speed"] = copysign(min(max(abs(belt_speed), low), high), belt_speed)
        return self.scenario.overridden([], proposed)


@dataclass(frozen=True)
class Design:
    """The proposed controller of a task, or the reason why there is none."""

    task: Task
    """The task."""
    controller: ControlLaw | None = None
    """The proposed controller; None if no gains meet the task."""
    remark: str | None = None
    """Why there is no proposal, or a caution about it."""
    checks: Sequence[Any] = ()
    """Simulations of the proposal, in order of belt speed."""

    @cached_property
    def scenario(self) -> Scenario | None:
        """The task's scenario with the proposal, see `Task.with_law`; None without one."""
        return None if self.controller is None else self.task.with_law(self.controller)

    @property
    def parameter_file(self) -> str | None:
        """Text of a parameter file with the complete `scenario`; None without a proposal."""
        if self.scenario is None:
            return None
        nodes = self.scenario.as_dict()
        del nodes["analyzer"]["bag"]
        return parameter_file(nodes)


def joined(*remarks: str | None) -> str | None:
    """Return the remarks that there are as one text; None without any."""
    return "; ".join(filter(None, remarks)) or None
