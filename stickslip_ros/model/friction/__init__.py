"""The friction laws, each with an entry in `LAWS`."""

from stickslip_ros.model.friction.base import (
    FrictionLaw,
    FrictionMemory,
    FrictionObserver,
    SteadyFriction,
)
from stickslip_ros.model.friction.coulomb import Coulomb
from stickslip_ros.model.friction.dahl import Dahl
from stickslip_ros.model.friction.directional import Directional
from stickslip_ros.model.friction.elasto_plastic import ElastoPlastic
from stickslip_ros.model.friction.exponential import Exponential
from stickslip_ros.model.friction.linear import Linear
from stickslip_ros.model.friction.lugre import CurveFollower, LuGre, SteadyPart
from stickslip_ros.model.friction.maxwell_slip import MaxwellSlip
from stickslip_ros.model.friction.stiction import Stiction
from stickslip_ros.model.friction.stribeck import Stribeck
from stickslip_ros.model.friction.table import Table

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
    )
}
"""Every friction law by the name it has in parameters.

`stickslip_ros.scenarios.parameters` adds those of other packages, found by their entry points.
"""

WITHDRAWN = {
    "rate_state": "the last versions that had this law are those of 0.2.0 before its release"
}
"""Laws, with a memory, of bags and scenarios of earlier versions: what to say of each."""

__all__ = [
    "LAWS",
    "WITHDRAWN",
    "Coulomb",
    "CurveFollower",
    "Dahl",
    "Directional",
    "ElastoPlastic",
    "Exponential",
    "FrictionLaw",
    "FrictionMemory",
    "FrictionObserver",
    "Linear",
    "LuGre",
    "MaxwellSlip",
    "SteadyFriction",
    "SteadyPart",
    "Stiction",
    "Stribeck",
    "Table",
]
