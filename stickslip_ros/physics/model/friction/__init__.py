"""The friction laws: one file each, and one entry each in `LAWS`."""

from stickslip_ros.physics.model.friction.base import FrictionLaw
from stickslip_ros.physics.model.friction.coulomb import Coulomb
from stickslip_ros.physics.model.friction.directional import Directional
from stickslip_ros.physics.model.friction.exponential import Exponential
from stickslip_ros.physics.model.friction.linear import Linear
from stickslip_ros.physics.model.friction.stribeck import Stribeck
from stickslip_ros.physics.model.friction.table import Table

LAWS: dict[str, type[FrictionLaw]] = {
    law.name: law for law in (Stribeck, Coulomb, Linear, Exponential, Table)
}
"""Every friction law by the name it has in parameters.

`stickslip_ros.scenarios.parameters` adds those of other packages, found by their entry points.
"""

__all__ = [
    "LAWS",
    "Coulomb",
    "Directional",
    "Exponential",
    "FrictionLaw",
    "Linear",
    "Stribeck",
    "Table",
]
