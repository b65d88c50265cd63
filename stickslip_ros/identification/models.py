"""What is identified: the constants of a drive with a friction law, and how they are searched."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, inf, sqrt
from typing import Any

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.curves import (
    CoulombCurve,
    Curve,
    ExponentialCurve,
    StribeckCurve,
)
from stickslip_ros.identification.regression import Regression
from stickslip_ros.physics.model.constants import constants_of
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import (
    LAWS,
    CurveFollower,
    Exponential,
    FrictionLaw,
    Table,
)

_TINY = 1e-9
"""Smallest constant that must be above zero, as a share of its start."""
_WIDE = 30.0
"""Factor by which the search may leave the mass and the stiffness that it starts from."""
_STIFFEST = 3000.0
"""Largest stiffness of the bristles, in stiffnesses of the spring."""
_EXPONENTIAL = ("kinetic", "rise", "decay_speed", "viscous")
"""Coordinates of an exponential curve."""
DELAY = "force_delay"
"""Name of the constant that is not one of the drive: the time until a force acts, s."""


@dataclass(frozen=True)
class Model:
    """A friction law with the constants that are searched for a drive on a spring.

    The search has coordinates of its own in which all bounds are simple: in place of the static
    coefficient its `rise` above the smaller one. Friction is in newtons: the normal force only
    scales it.
    """

    law: str
    """Name of the friction law."""
    curve: Curve
    """Its curve in steady slip, for the regression."""
    shape: str | None = None
    """Constant that is the shape of the curve."""
    smaller: str | None = None
    """Constant that is smaller than the static coefficient."""
    viscous: bool = False
    """Whether the law has a viscous constant."""
    memory: Sequence[str] = ()
    """Constants of the memory of the law."""

    @property
    def friction(self) -> Sequence[str]:
        """Coordinates of the friction."""
        own = ["static"] if self.smaller is None else [self.smaller, "rise"]
        if self.shape is not None:
            own.append(self.shape)
        if self.viscous:
            own.append("viscous")
        return [*own, *self.memory]

    def start(self, fit: Regression) -> dict[str, float]:
        """Return the coordinates that a regression gives."""
        forces = fit.forces(len(fit.rows.directions) - 1).tolist()
        values = dict(fit.constants)
        if self.smaller is None:
            static, rise = forces[0], 0.0
        elif isinstance(self.curve, StribeckCurve):
            static, rise = forces[0], forces[1]
        else:
            static, rise = forces[0] + forces[1], forces[1]
        least = 1e-3 * max(static, 1e-9)
        static = max(static, least)
        if self.smaller is None:
            values["static"] = static
        else:
            values["rise"] = min(max(rise, least), static - least)
            values[self.smaller] = static - values["rise"]
        if self.shape is not None:
            values[self.shape] = float(fit.shapes[-1])
        if self.viscous:
            # A law without viscous friction has other equations, not a derivative by it.
            values["viscous"] = forces[-1] or _TINY * static
        return values

    def static_force(self, values: Mapping[str, float]) -> float:
        """Return the static friction, N."""
        return values["static"] if self.smaller is None else values[self.smaller] + values["rise"]

    def bounds(self, name: str, values: Mapping[str, float], fastest: float) -> tuple[float, float]:
        """Return the smallest and the largest value of a coordinate in the search.

        Parameters
        ----------
        name : str
            Coordinate.
        values : mapping
            Coordinates at the start of the search.
        fastest : float
            Fastest speed relative to the belt in the records, m/s: what friction does at a
            hundredth of it or far above it, they do not tell.
        """
        rate = self.static_force(values) / fastest
        if name == "bias_force":
            return -inf, inf
        if name == "viscous":
            return -_WIDE * rate, _WIDE * rate
        if name in ("mass", "stiffness"):
            return values[name] / _WIDE, values[name] * _WIDE
        if name == DELAY:
            longest = sqrt(values["mass"] / values["stiffness"])
            return -longest, longest
        if name in ("rise", "damping", self.smaller):
            return 0.0, inf
        if name == self.shape:
            return 0.01 * fastest, 10.0 * fastest
        if name == "bristle_stiffness":
            return values["stiffness"], _STIFFEST * values["stiffness"]
        if name == "bristle_damping":
            return 0.0, _STIFFEST * rate
        return _TINY * abs(values[name]), inf

    def straightened(self, free: Sequence[str]) -> bool:
        """Return whether the search has other coordinates, see `to_search`."""
        return isinstance(self.curve, ExponentialCurve) and {*_EXPONENTIAL} <= {*free}

    def to_search(self, values: Mapping[str, float], fastest: float) -> dict[str, float]:
        """Return the coordinates in which the fit of an exponential curve is nearly linear.

        Records that hardly tell the decay speed from viscous friction have a long curved valley of
        good fits. It is straight where friction is given by forces: `kinetic` is replaced by that
        at the fastest speed, `viscous` by that at rest, and `rise` by how far the force at a third
        of the fastest speed is below the straight line between them.

        Parameters
        ----------
        values : mapping
            Coordinates.
        fastest : float
            Fastest speed relative to the belt, m/s.

        Returns
        -------
        dict
            Coordinates of the search by the names of those that they replace.
        """
        decay, middle = values["decay_speed"], fastest / 3.0
        rest = values["kinetic"] + values["rise"]
        sag = values["rise"] * _sag(decay, middle, fastest)
        end = values["kinetic"] + values["rise"] * exp(-fastest / decay)
        end += values["viscous"] * fastest
        return {**values, "viscous": rest, "kinetic": end, "rise": sag}

    def from_search(self, found: Mapping[str, float], fastest: float) -> dict[str, float]:
        """Return the coordinates of `to_search`, which may be ones that the law refuses."""
        decay, rest = found["decay_speed"], found["viscous"]
        rise = found["rise"] / _sag(decay, fastest / 3.0, fastest)
        kinetic = rest - rise
        viscous = (found["kinetic"] - kinetic - rise * exp(-fastest / decay)) / fastest
        return {**found, "viscous": viscous, "kinetic": kinetic, "rise": rise}

    def constants(self, values: Mapping[str, float], normal_force: float) -> dict[str, float]:
        """Return the parameters of the plant by flat name that coordinates stand for.

        Raises InvalidInputError for values that the law refuses.
        """
        found = {
            name: value
            for name, value in values.items()
            if name not in self.friction and name != DELAY
        }
        static = self.static_force(values)
        if self.smaller is not None:
            found[f"friction.{self.smaller}"] = values[self.smaller] / normal_force
        found["friction.static"] = static / normal_force
        if self.shape is not None:
            found[f"friction.{self.shape}"] = values[self.shape]
        if self.viscous:
            found["friction.viscous"] = values["viscous"] / normal_force
        for name in self.memory:
            found[f"friction.{name}"] = values[name] / normal_force
        return found

    def drive(
        self, values: Mapping[str, float], normal_force: float, belt_speed: float = 0.0
    ) -> Drive:
        """Return the drive of coordinates; raises InvalidInputError if there is none."""
        constants = self.constants(values, normal_force)
        own: dict[str, Any] = {
            name.removeprefix("friction."): value
            for name, value in constants.items()
            if name.startswith("friction.")
        }
        law: Any = LAWS[self.law]
        if not self.memory or not issubclass(law, CurveFollower):
            friction = law(**own)
        else:
            memory = {name: own.pop(name) for name in self.memory}
            friction = law(Exponential(**own), **memory)
        refusal = friction.refusal()
        if refusal is not None:
            raise InvalidInputError(refusal)
        return Drive(
            mass=constants["mass"],
            damping=constants["damping"],
            stiffness=constants["stiffness"],
            normal_force=normal_force,
            belt_speed=belt_speed,
            friction=friction,
            bias_force=constants["bias_force"],
        )


def numbers_of(law: FrictionLaw) -> dict[str, float]:
    """Return the constants of a law that are one number, those of the curve that it follows too."""
    if isinstance(law, Table):
        return {}
    own = {name: getattr(law, name) for name in constants_of(type(law))}
    if isinstance(law, CurveFollower):
        own |= numbers_of(law.curve)
    return {name: value for name, value in own.items() if isinstance(value, int | float)}


def _sag(decay: float, middle: float, fastest: float) -> float:
    """Return how far exp(-w/decay) is below its chord from rest to the fastest speed."""
    chord = 1.0 + (exp(-fastest / decay) - 1.0) * middle / fastest
    return chord - exp(-middle / decay)


COULOMB = Model("coulomb", CoulombCurve(), viscous=True)
STRIBECK = Model("stribeck", StribeckCurve(), shape="minimum_speed", smaller="minimum")
EXPONENTIAL = Model(
    "exponential", ExponentialCurve(), shape="decay_speed", smaller="kinetic", viscous=True
)
LUGRE = replace(EXPONENTIAL, law="lugre", memory=("bristle_stiffness", "bristle_damping"))
MEMORY_MODELS = (
    replace(COULOMB, law="dahl", viscous=False, memory=("bristle_stiffness",)),
    LUGRE,
    replace(LUGRE, law="elasto_plastic"),
    replace(LUGRE, law="maxwell_slip", memory=("bristle_stiffness",)),
)
"""Models with a memory; those after LuGre are searched from what LuGre gives."""
STATIC_MODELS = (COULOMB, STRIBECK, EXPONENTIAL)
"""Models without a memory, the simpler ones first."""
