"""Drives as they are searched: friction by coordinates in newtons whose bounds are simple."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp, inf, sqrt
from typing import Any

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import rms
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.curves import (
    CoulombCurve,
    Curve,
    ExponentialCurve,
    SteppedCurve,
    StribeckCurve,
)
from stickslip_ros.identification.regression import Regression
from stickslip_ros.physics.model.constants import constants_of
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import (
    LAWS,
    CurveFollower,
    Directional,
    FrictionLaw,
    Table,
)

Values = Mapping[str, float]
"""Values of coordinates by name, SI units."""

_LEAST_SHARE = 1e-9
"""Smallest constant that must be above zero, as a share of the friction or of other forces."""
_SEARCH_FACTOR = 30.0
"""Factor by which the search may leave the mass and the stiffness that it starts from; viscous
friction up to which it goes, in static friction at the fastest speed."""
_LARGEST_STIFFNESS = 3000.0
"""Largest stiffness of the bristles, in stiffnesses of the spring."""
_SLOWEST_SHAPE, _FASTEST_SHAPE = 0.01, 10.0
"""Shapes of a curve that records may tell, in fastest speeds."""
DELAY = "force_delay"
"""Name of the constant that is not one of the drive: the time until a force acts, s."""
REVERSE = "reverse."
"""Start of the names of coordinates of backward slip where both directions have their own."""


class FrictionModel(ABC):
    """A friction law with the coordinates that are searched.

    The static coefficient has in its place its `rise` above the smaller one. Friction is in
    newtons: the normal force only scales it.
    """

    law: str
    """Name of the friction law."""
    curve: Curve
    """Its curve in steady slip, for the regression."""
    coordinates: Sequence[str]
    """Names of the coordinates."""
    smallest: str
    """Coordinate of the smallest friction."""
    memory: Sequence[str] = ()
    """Coordinates of the memory of the law."""
    by_differences: Sequence[str] = ()
    """Coordinates on which the motion depends other than by its equations."""

    @abstractmethod
    def start(self, fit: Regression, direction: int) -> dict[str, float]:
        """Return the coordinates that a regression gives in a direction of its rows."""

    def static_force(self, values: Values) -> float:
        """Return the static friction, N."""
        rise = values["rise"] if "rise" in self.coordinates else 0.0
        return values[self.smallest] + rise

    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        """Return the law of coordinates."""
        kind: Any = LAWS[self.law]
        own = {"static": self.static_force(values) / normal_force}
        for name in self.coordinates:
            if name != "rise":
                own[name] = values[name] / (1.0 if name.endswith("_speed") else normal_force)
        return kind(**own)

    def bounds(self, name: str, values: Values, fastest: float) -> tuple[float, float]:
        """Return the smallest and the largest value of a coordinate in the search from `values` on.

        The fastest speed is that relative to the belt in the records, m/s: what friction does at a
        hundredth of it or far above it, they do not tell.
        """
        if name == "viscous":
            rate = self.static_force(values) / fastest
            return -_SEARCH_FACTOR * rate, _SEARCH_FACTOR * rate
        if name == "bristle_stiffness":
            return values["stiffness"], _LARGEST_STIFFNESS * values["stiffness"]
        if name == "bristle_damping":
            return 0.0, _LARGEST_STIFFNESS * self.static_force(values) / fastest
        if name.endswith("_speed"):
            return _SLOWEST_SHAPE * fastest, _FASTEST_SHAPE * fastest
        if name == "rise":
            return 0.0, inf
        return _LEAST_SHARE * self.static_force(values), inf

    def like(self, values: Values) -> dict[str, float]:
        """Return coordinates like those of a LuGre model."""
        return dict(values)

    def to_search(self, values: Values, fastest: float) -> dict[str, float]:
        """Return coordinates of the search, in which fits are nearly linear, by the same names."""
        return dict(values)

    def from_search(self, found: Values, fastest: float) -> dict[str, float]:
        """Return the coordinates of `to_search`, which may be ones that the law refuses."""
        return dict(found)

    def free_bounds(self, name: str) -> tuple[float, float] | None:
        """Return bounds of a coordinate of the search if they are others than `bounds`."""
        return None

    def straightens(self, free: Sequence[str]) -> bool:
        """Return whether the search has other coordinates where these are free."""
        return False


class CoulombModel(FrictionModel):
    """Coulomb and viscous friction."""

    law = "coulomb"
    curve: Curve = CoulombCurve()
    coordinates: Sequence[str] = ("static", "viscous")
    smallest = "static"

    @override
    def start(self, fit: Regression, direction: int) -> dict[str, float]:
        static, viscous = fit.forces(direction).tolist()
        static = max(static, _least_force(fit))
        # A law without viscous friction has other equations, not a derivative by it.
        return {"static": static, "viscous": viscous or _LEAST_SHARE * static}


class StribeckModel(FrictionModel):
    """The cubic law of the paper, eq. 3."""

    law = "stribeck"
    curve: Curve = StribeckCurve()
    coordinates: Sequence[str] = ("minimum", "rise", "minimum_speed")
    smallest = "minimum"

    @override
    def start(self, fit: Regression, direction: int) -> dict[str, float]:
        static, drop = fit.forces(direction).tolist()
        smaller, rise = _split(static, drop, _least_force(fit))
        return {"minimum": smaller, "rise": rise, "minimum_speed": float(fit.shapes[direction])}


class ExponentialModel(FrictionModel):
    """The exponential law with viscous friction."""

    law = "exponential"
    curve: Curve = ExponentialCurve()
    coordinates: Sequence[str] = ("kinetic", "rise", "decay_speed", "viscous")
    smallest = "kinetic"

    @override
    def start(self, fit: Regression, direction: int) -> dict[str, float]:
        kinetic, drop, viscous = fit.forces(direction).tolist()
        smaller, rise = _split(kinetic + drop, drop, _least_force(fit))
        return {
            "kinetic": smaller,
            "rise": rise,
            "decay_speed": float(fit.shapes[direction]),
            "viscous": viscous or _LEAST_SHARE * smaller,
        }

    @override
    def straightens(self, free: Sequence[str]) -> bool:
        return {*ExponentialModel.coordinates} <= {*free}

    @override
    def to_search(self, values: Values, fastest: float) -> dict[str, float]:
        """Return the coordinates in which the fit of an exponential curve is nearly linear.

        Records that hardly tell the decay speed from viscous friction have a long curved valley of
        good fits. It is straight where friction is given by forces: `kinetic` is replaced by that
        at the fastest speed, m/s, `viscous` by that at rest, and `rise` by how far the force at a
        third of the fastest speed is below the straight line between them.
        """
        decay = values["decay_speed"]
        sag = values["rise"] * _sag(decay, fastest / 3.0, fastest)
        end = values["kinetic"] + values["rise"] * exp(-fastest / decay)
        end += values["viscous"] * fastest
        return {**values, "viscous": self.static_force(values), "kinetic": end, "rise": sag}

    @override
    def from_search(self, found: Values, fastest: float) -> dict[str, float]:
        decay = found["decay_speed"]
        rise = found["rise"] / _sag(decay, fastest / 3.0, fastest)
        kinetic = found["viscous"] - rise
        viscous = (found["kinetic"] - kinetic - rise * exp(-fastest / decay)) / fastest
        return {**found, "viscous": viscous, "kinetic": kinetic, "rise": rise}

    @override
    def free_bounds(self, name: str) -> tuple[float, float] | None:
        """Return the bounds of the forces at the fastest speed and at rest."""
        return {"kinetic": (-inf, inf), "viscous": (0.0, inf)}.get(name)


class BristleModel(ExponentialModel):
    """A law with a memory that follows an exponential curve, or a constant one as Dahl's does."""

    def __init__(self, law: str, memory: Sequence[str], by_differences: Sequence[str] = ()) -> None:
        self.law, self.memory, self.by_differences = law, memory, by_differences
        self.coordinates = (*ExponentialModel.coordinates, *memory)

    @override
    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        kind: Any = LAWS[self.law]
        own = {name: values[name] / normal_force for name in self.memory}
        return kind(EXPONENTIAL.friction(values, normal_force), **own)


class DahlModel(CoulombModel):
    """Dahl's law: Coulomb friction that bristles follow, without viscous friction."""

    law = "dahl"
    coordinates: Sequence[str] = ("static", "bristle_stiffness")
    memory: Sequence[str] = ("bristle_stiffness",)

    @override
    def start(self, fit: Regression, direction: int) -> dict[str, float]:
        return {"static": super().start(fit, direction)["static"]}

    @override
    def like(self, values: Values) -> dict[str, float]:
        """Return the static friction that is the kinetic one of LuGre."""
        return {**values, "static": values["kinetic"]}


class TableModel(FrictionModel):
    """Friction without a law: forces at given speeds."""

    law = "table"
    smallest = "force_0"

    def __init__(self, speeds: Sequence[float]) -> None:
        """Take the speeds of the points, m/s, from 0."""
        self.speeds = tuple(speeds)
        self.curve = SteppedCurve(self.speeds)
        self.coordinates = [f"force_{number}" for number in range(len(speeds))]
        # The polynomials of the pieces are made from them.
        self.by_differences = self.coordinates

    @override
    def start(self, fit: Regression, direction: int) -> dict[str, float]:
        forces = np.cumsum(fit.forces(direction))
        forces = np.maximum(forces, 1e-3 * float(np.abs(forces).max()))
        return dict(zip(self.coordinates, forces.tolist(), strict=True))

    @override
    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        sizes = [values[name] / normal_force for name in self.coordinates]
        return Table(tuple(zip(self.speeds, sizes, strict=True)))


class DirectionalModel(FrictionModel):
    """A law without a memory that has constants of its own in each direction of slip."""

    def __init__(self, own: FrictionModel) -> None:
        """Take the model of each direction."""
        self.own, self.law, self.curve = own, own.law, own.curve
        self.coordinates = _in_both(own.coordinates)
        self.by_differences = _in_both(own.by_differences)

    @override
    def start(self, fit: Regression, direction: int) -> dict[str, float]:
        """Return the coordinates of both directions."""
        both = [self.own.start(fit, each) for each in (0, 1)]
        return {**both[0], **{REVERSE + name: value for name, value in both[1].items()}}

    @override
    def static_force(self, values: Values) -> float:
        """Return the larger static friction, N."""
        return max(self.own.static_force(each) for each in _by_direction(values))

    @override
    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        return Directional(
            *(self.own.friction(each, normal_force) for each in _by_direction(values))
        )

    @override
    def bounds(self, name: str, values: Values, fastest: float) -> tuple[float, float]:
        forward, reverse = _by_direction(values)
        of = reverse if name.startswith(REVERSE) else forward
        return self.own.bounds(name.removeprefix(REVERSE), of, fastest)


def _in_both(names: Sequence[str]) -> Sequence[str]:
    return [*names, *(REVERSE + name for name in names)]


def _by_direction(values: Values) -> tuple[dict[str, float], dict[str, float]]:
    """Return the coordinates of forward and of backward slip by the same names."""
    reverse = {
        name.removeprefix(REVERSE): value
        for name, value in values.items()
        if name.startswith(REVERSE)
    }
    return dict(values), {**values, **reverse}


def _least_force(fit: Regression) -> float:
    """Return the smallest friction from which a search starts, N, by the other forces."""
    columns = fit.rows.columns
    others = sum(abs(value) * rms(columns[name]) for name, value in fit.constants.items())
    return _LEAST_SHARE * others if others > 0.0 else _LEAST_SHARE


def _split(static: float, drop: float, smallest: float) -> tuple[float, float]:
    """Return the smaller friction and the rise above it to rest, both above zero."""
    least = 1e-3 * max(static, smallest)
    static = max(static, least)
    rise = min(max(drop, least), static - least)
    return static - rise, rise


def _sag(decay: float, middle: float, fastest: float) -> float:
    """Return how far exp(-w/decay) is below its chord from rest to the fastest speed."""
    chord = 1.0 + (exp(-fastest / decay) - 1.0) * middle / fastest
    return chord - exp(-middle / decay)


COULOMB, STRIBECK, EXPONENTIAL = CoulombModel(), StribeckModel(), ExponentialModel()
STATIC_MODELS: Sequence[FrictionModel] = (COULOMB, STRIBECK, EXPONENTIAL)
"""Models of laws without a memory, the simpler ones first."""
LUGRE = BristleModel("lugre", ("bristle_stiffness", "bristle_damping"))
DAHL = DahlModel()
MEMORY_MODELS: Sequence[FrictionModel] = (
    LUGRE,
    DAHL,
    # Its elastic limit is made from the smallest friction.
    BristleModel("elasto_plastic", LUGRE.memory, ("kinetic",)),
    BristleModel("maxwell_slip", ("bristle_stiffness",)),
)
"""Models with a memory. Those after LuGre are searched from what LuGre gives."""


@dataclass(frozen=True)
class Model:
    """A drive on a spring, with the coordinates that are searched."""

    friction: FrictionModel
    """Its friction law."""

    def start(self, fit: Regression) -> dict[str, float]:
        """Return the coordinates that a regression gives."""
        last = len(fit.rows.directions) - 1
        return {**fit.constants, **self.friction.start(fit, last)}

    def by_differences(self, names: Sequence[str]) -> Sequence[str]:
        """Return those of these coordinates by which a motion has no derivatives of its own."""
        return [name for name in names if name in (DELAY, *self.friction.by_differences)]

    def bounds(self, name: str, values: Mapping[str, float], fastest: float) -> tuple[float, float]:
        """Return the bounds of a coordinate in the search; see `FrictionModel.bounds`."""
        if name in ("mass", "stiffness"):
            return values[name] / _SEARCH_FACTOR, values[name] * _SEARCH_FACTOR
        if name == DELAY:
            longest = sqrt(values["mass"] / values["stiffness"])
            return -longest, longest
        if name in ("damping", "bias_force"):
            return (0.0 if name == "damping" else -inf), inf
        return self.friction.bounds(name, values, fastest)

    def constants(self, values: Mapping[str, float], normal_force: float) -> dict[str, float]:
        """Return the parameters of the plant by flat name that coordinates stand for.

        A table has none.
        """
        own = {*self.friction.coordinates, DELAY}
        found = {name: value for name, value in values.items() if name not in own}
        law = self.friction.friction(values, normal_force)
        groups = {"friction.": law}
        if isinstance(law, Directional):
            groups = {"friction.": law.forward, "friction.reverse.": law.reverse}
        for group, each in groups.items():
            found |= {group + name: value for name, value in numbers_of(each).items()}
        return found

    def drive(
        self, values: Mapping[str, float], normal_force: float, belt_speed: float = 0.0
    ) -> Drive:
        """Return the drive of coordinates; raises InvalidInputError if there is none."""
        friction = self.friction.friction(values, normal_force)
        refusal = friction.refusal()
        if refusal is not None:
            raise InvalidInputError(refusal)
        return Drive(
            mass=values["mass"],
            damping=values["damping"],
            stiffness=values["stiffness"],
            normal_force=normal_force,
            belt_speed=belt_speed,
            friction=friction,
            bias_force=values["bias_force"],
        )


def numbers_of(law: FrictionLaw) -> dict[str, float]:
    """Return the constants of a law that are one number, those of the curve that it follows too."""
    if isinstance(law, Table):
        return {}
    own = {name: getattr(law, name) for name in constants_of(type(law))}
    if isinstance(law, CurveFollower):
        own |= numbers_of(law.curve)
    return {name: value for name, value in own.items() if isinstance(value, int | float)}
