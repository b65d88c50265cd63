"""What an axis is labelled with: SI units with a suitable prefix, or none for the unit drive."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from stickslip_ros.physics.drive import Drive
from stickslip_ros.prefixes import prefix_for


@dataclass(frozen=True)
class Units:
    """Whether quantities are in SI units or dimensionless, and how that is written."""

    dimensionless: bool = False

    @classmethod
    def of(cls, drive: Drive | None) -> Self:
        """Return those of a drive: with mass, stiffness and normal force 1 it is dimensionless."""
        unit = drive is not None and drive.mass == drive.stiffness == drive.normal_force == 1.0
        return cls(dimensionless=unit)

    def label(self, name: str, unit: str) -> str:
        """Return the label of an axis, as "velocity (mm/s)"; of a number its name alone."""
        if not unit:
            return name
        return f"{name} ({'dimensionless' if self.dimensionless else unit})"

    def axis(self, name: str, unit: str, *values: npt.ArrayLike) -> tuple[float, str]:
        """Return what to divide values (SI) by that an axis shows, and its label.

        Times have no prefix beyond the second, and numbers none at all.
        """
        largest = _largest(*values)
        if self.dimensionless or not unit or (unit == "s" and largest >= 1.0):
            return 1.0, self.label(name, unit)
        scale, prefix = prefix_for(largest)
        return scale, self.label(name, prefix + unit)

    def text(self, value: float, unit: str) -> str:
        """Return a value (SI) as text with its unit."""
        if self.dimensionless or not unit:
            return f"{value:.4g}"
        scale, prefix = prefix_for(value)
        return f"{value / scale:.4g} {prefix}{unit}"


def _largest(*values: npt.ArrayLike) -> float:
    arrays = [np.asarray(value, dtype=float) for value in values]
    return max((float(np.nanmax(np.abs(array), initial=0.0)) for array in arrays), default=0.0)
