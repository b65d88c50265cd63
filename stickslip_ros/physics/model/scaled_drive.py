"""A drive in the units of another one, so that derivatives by its mass and stiffness exist."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

from typing_extensions import override

from stickslip_ros.physics.model.constants import scaled
from stickslip_ros.physics.model.control import ContinuousControl
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.drive_system import DriveSystem


@dataclass(frozen=True)
class ScaledDrive(Drive):
    """Drive whose units are those of another drive: its mass and stiffness need not be 1 in them.

    Durations, lengths and speeds then do not depend on its constants.
    """

    unit: Drive = field(kw_only=True)
    """The drive that gives the units; with a spring."""

    @cached_property
    @override
    def angular_frequency(self) -> float:
        return self.unit.angular_frequency

    @cached_property
    @override
    def length_scale(self) -> float:
        return self.unit.length_scale

    @cached_property
    @override
    def speed_scale(self) -> float:
        return self.unit.speed_scale

    @cached_property
    @override
    def dimensionless(self) -> Self:
        scales = self.unit.scales
        return replace(
            self,
            mass=self.mass / self.unit.mass,
            damping=self.damping * scales.speed / scales.force,
            stiffness=self.stiffness / self.unit.stiffness,
            normal_force=self.normal_force / scales.force,
            belt_speed=self.belt_speed / scales.speed,
            friction=self.friction.scaled(scales.speed, scales.length),
            belt=self.belt.scaled(scales, "m/s"),
            load=self.load.scaled(scales, "N"),
            actuator=scaled(self.actuator, scales),
            bias_force=self.bias_force / scales.force,
        )


def in_units_of(unit: Drive, drive: Drive) -> ScaledDrive:
    """Return a drive in the units of another one, of the same normal force."""
    own = {name: getattr(drive, name) for name in Drive.__dataclass_fields__}
    return ScaledDrive(**own, unit=unit)


class FreeDriveSystem(DriveSystem):
    """Drive in units of another one: mass, stiffness and bias are constants like the others."""

    def __init__(self, drive: ScaledDrive, control: ContinuousControl | None = None) -> None:
        super().__init__(drive, control)
        own = self.drive
        self.constants = {
            **self.constants,
            "mass": own.mass,
            "stiffness": own.stiffness,
            "bias_force": own.bias_force,
        }
        of_law = (name for name in self.constants if name.startswith("friction."))
        self.free_constants = ("mass", "damping", "stiffness", "bias_force", *of_law)

    @cached_property
    def _symbolic(self) -> Any:
        found, constants = super()._symbolic, self.symbols.constants
        return found._replace(
            drive=replace(
                found.drive,
                mass=constants["mass"],
                stiffness=constants["stiffness"],
                bias_force=constants["bias_force"],
            )
        )
