"""The friction laws, each with an entry in `LAWS`."""

from stickslip_ros.physics.model.friction.base import (
    FrictionCreep,
    FrictionLaw,
    FrictionMemory,
    SteadyFriction,
)
from stickslip_ros.physics.model.friction.dahl import Dahl
from stickslip_ros.physics.model.friction.directional import Directional
from stickslip_ros.physics.model.friction.elasto_plastic import ElastoPlastic
from stickslip_ros.physics.model.friction.exponential import Exponential
from stickslip_ros.physics.model.friction.lugre import CurveFollower, LuGre, SteadyPart
from stickslip_ros.physics.model.friction.maxwell_slip import MaxwellSlip
from stickslip_ros.physics.model.friction.observer import FrictionObserver
from stickslip_ros.physics.model.friction.polynomials import Coulomb, Linear, Stribeck
from stickslip_ros.physics.model.friction.rate_state import RateState
from stickslip_ros.physics.model.friction.stiction import Stiction
from stickslip_ros.physics.model.friction.table import Table

LAWS: dict[str, type[FrictionLaw]] = {
    law.name: law
    for law in (
        Stribeck,
        Coulomb,
        Linear,
        Exponential,
        Stiction,
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
    "FrictionCreep",
    "FrictionLaw",
    "FrictionMemory",
    "FrictionObserver",
    "Linear",
    "LuGre",
    "MaxwellSlip",
    "RateState",
    "SteadyFriction",
    "SteadyPart",
    "Stiction",
    "Stribeck",
    "Table",
]
