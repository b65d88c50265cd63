"""The friction laws: one file each, and one entry each in `LAWS`."""

from stickslip_ros.physics.model.friction.base import FrictionLaw
from stickslip_ros.physics.model.friction.coulomb import Coulomb
from stickslip_ros.physics.model.friction.curve_follower import CurveFollower
from stickslip_ros.physics.model.friction.dahl import Dahl
from stickslip_ros.physics.model.friction.directional import Directional
from stickslip_ros.physics.model.friction.elasto_plastic import ElastoPlastic
from stickslip_ros.physics.model.friction.exponential import Exponential
from stickslip_ros.physics.model.friction.linear import Linear
from stickslip_ros.physics.model.friction.lugre import LuGre
from stickslip_ros.physics.model.friction.maxwell_slip import MaxwellSlip
from stickslip_ros.physics.model.friction.observer import FrictionObserver
from stickslip_ros.physics.model.friction.rate_state import RateState
from stickslip_ros.physics.model.friction.stribeck import Stribeck
from stickslip_ros.physics.model.friction.table import Table

LAWS: dict[str, type[FrictionLaw]] = {
    law.name: law
    for law in (
        Stribeck,
        Coulomb,
        Linear,
        Exponential,
        Table,
        Dahl,
        LuGre,
        ElastoPlastic,
        MaxwellSlip,
        RateState,
    )
}
"""Every friction law by the name it has in parameters.

`stickslip_ros.scenarios.parameters` adds those of other packages, found by their entry points.
"""

__all__ = [
    "LAWS",
    "Coulomb",
    "CurveFollower",
    "Dahl",
    "Directional",
    "ElastoPlastic",
    "Exponential",
    "FrictionLaw",
    "FrictionObserver",
    "Linear",
    "LuGre",
    "MaxwellSlip",
    "RateState",
    "Stribeck",
    "Table",
]
