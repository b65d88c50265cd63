"""Friction laws as they are identified: one adapter for each law."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from math import exp, inf, log, sqrt
from typing import Any

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.model.constants import constants_of
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import (
    LAWS,
    CurveFollower,
    Directional,
    FrictionLaw,
    RateState,
    Table,
)

Values = Mapping[str, float]
"""Values of coordinates by name, SI units."""

_LEAST_SHARE = 1e-9
"""Smallest constant that must be above zero, as a share of the friction or of other forces."""
_LEAST_RISE = 1e-3
"""Smallest force from which a search starts, as a share of the static friction."""
_SEARCH_FACTOR = 30.0
"""Factor by which the search may leave the mass and the stiffness that it starts from; viscous
friction up to which it goes, in static friction at the fastest speed."""
_LARGEST_STIFFNESS = 3000.0
"""Largest stiffness of the bristles, in stiffnesses of the spring."""
_SLOWEST_SHAPE, _FASTEST_SHAPE = 0.01, 10.0
"""Shapes of a curve that records may tell, in fastest speeds."""
_LEAST_FRICTION = 0.01
"""Least friction of bristles at a speed, as a share of the largest."""
_RISE_SHARE = 0.3
"""Rise of static friction from which the search starts, as a share of the kinetic one: bristles
may hide it."""
_RISE_SHARES, _LARGEST_RISE = (0.05, 0.3, 1.0), 3.0
"""Rises of static friction from which a law with stiction is searched, in kinetic ones, and the
largest one, in static ones at the start."""
_EXPONENTS = 1.0, 5.0
"""Exponents of a decay that are searched."""
_STIFFNESS_RATIOS = (10.0, 100.0)
"""Stiffnesses of bristles from which the search starts, in stiffnesses of the spring."""
_DAMPING_RATIO = 0.03
"""Damping of the bristles from which the search starts, as a share of the critical one."""
_DIRECT_EFFECT, _LEAST_DIRECT_EFFECT = 0.03, 0.01
"""Direct effect from which the search starts, as a share of the friction at the fastest speed; the
least one, as a share of the friction at the reference speed."""
_SLIP_DISTANCES, _LEAST_SLIP_DISTANCE = (0.03, 0.1), 1e-3
"""Slip distances from which the search starts, and the least one, in amplitudes of the free
vibration whose speed is the fastest one."""
_REFERENCE_SPEED = float(RateState().reference_speed)
DELAY = "force_delay"
"""Name of the constant that is not one of the drive: the time until a force acts, s."""
LAG = "actuator.time_constant"
"""Name of the time constant of the lag of the force, s."""
REVERSE = "reverse."
"""Start of the names of coordinates of backward slip where both directions have their own."""


class IdentifiedLaw(ABC):
    """A friction law as identification knows it.

    A regression of forces takes friction in steady slip as a sum of `terms` with unknown forces;
    it may have one shape, a speed, in which it is not linear. A search of trajectories has
    `coordinates` with simple bounds. They are in newtons: the normal force only scales friction.
    The static coefficient has in its place its `rise` above the smaller one.
    """

    name: str
    """Name of the friction law."""
    least: Sequence[float]
    """Smallest value of each unknown force: 0 or minus infinity."""
    shaped: bool = False
    """Whether there is a shape."""
    least_shape: float = 0.25
    """Smallest shape that records tell, in their slowest speeds."""
    deflection: float = 0.0
    """Path over which friction follows a change of direction or speed, m; 0: immediately."""
    coordinates: Sequence[str]
    """Names of the coordinates: those of the constants, and `rise` for `static`."""
    unscaled: Sequence[str] = ()
    """Coordinates that do not scale with the normal force, such as speeds."""
    smallest: str
    """Coordinate of the smallest friction."""
    memory: Sequence[str] = ()
    """Coordinates of the memory of the law."""
    of_slip: bool = True
    """Whether friction in slip tells all constants."""
    optional: Sequence[str] = ()
    """Coordinates that are fitted only if the records ask for them."""
    by_differences: Sequence[str] = ()
    """Coordinates on which the motion depends other than by its equations."""
    straightened: Mapping[str, tuple[float, float] | None] = {}
    """Coordinates that, where all of them are free, the search replaces by others of the same
    names, in which fits are nearly linear; with their bounds, if these are not `bounds`."""

    @abstractmethod
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        """Return the terms, rows of shape (rows, terms); `speed` is |v_r| and `shape` in m/s."""

    @abstractmethod
    def coordinates_of(self, forces: Sequence[float], shape: float) -> dict[str, float]:
        """Return the coordinates of unknown forces, N, and of a shape, m/s."""

    def joined(self, directions: Sequence[Values]) -> dict[str, float]:
        """Return the coordinates of one direction, or of forward and backward slip."""
        first, *others = directions
        return {**first, **{REVERSE + name: each[name] for each in others for name in each}}

    def start(self, values: Values, smallest: float) -> dict[str, float]:
        """Return coordinates from which a search can start: inside of their bounds.

        `smallest` is the smallest static friction, N.
        """
        found = dict(values)
        if "rise" in found:
            least = _LEAST_RISE * max(self.static_force(found), smallest)
            static = max(self.static_force(found), least)
            found["rise"] = min(max(found["rise"], least), static - least)
            found[self.smallest] = static - found["rise"]
        else:
            found[self.smallest] = max(found[self.smallest], smallest)
        if "viscous" in found:
            # A law without viscous friction has other equations, not a derivative by it.
            found["viscous"] = found["viscous"] or _LEAST_SHARE * found[self.smallest]
        return found

    def starts(self, values: Values, fastest: float) -> Sequence[Values]:
        """Return the coordinates from which searches of trajectories start.

        `values` are those of a regression, with the mass and the stiffness; the fastest speed is
        that of `bounds`.
        """
        return [values]

    def static_force(self, values: Values) -> float:
        """Return the static friction, N."""
        rise = values["rise"] if "rise" in self.coordinates else 0.0
        return values[self.smallest] + rise

    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        """Return the law of coordinates."""
        kind: Any = LAWS[self.name]
        own = {"static": self.static_force(values) / normal_force}
        for name in self.coordinates:
            if name != "rise":
                own[name] = values[name] / (1.0 if name in self.unscaled else normal_force)
        return kind(**own)

    def drive(self, values: Values, normal_force: float, belt_speed: float = 0.0) -> Drive:
        """Return the drive of coordinates."""
        return Drive(
            mass=values["mass"],
            damping=values["damping"],
            stiffness=values["stiffness"],
            normal_force=normal_force,
            belt_speed=belt_speed,
            friction=self.friction(values, normal_force),
            bias_force=values["bias_force"],
        )

    def constants(self, values: Values, normal_force: float) -> dict[str, float]:
        """Return the parameters of the plant by flat name that coordinates stand for.

        A table has none. Of a law that is followed a few deflections are tried: its constants
        have no error, and are left out.
        """
        own = {*self.coordinates, DELAY}
        found = {name: value for name, value in values.items() if name not in own}
        if self.deflection > 0.0:
            return found
        for group, law in by_group(self.friction(values, normal_force)).items():
            found |= {group + name: value for name, value in numbers_of(law).items()}
        return found

    @property
    def fixable(self) -> Sequence[str]:
        """The coordinates that can be given: they are constants of the law."""
        return [name for name in self.coordinates if name in constants_of(LAWS[self.name])]

    def bounds(self, name: str, values: Values, fastest: float) -> tuple[float, float]:
        """Return the smallest and the largest value of a coordinate in the search from `values` on.

        The fastest speed is that relative to the belt in the records, m/s: what friction does at a
        hundredth of it or far above it, they do not tell.
        """
        static = self.static_force(values)
        if name in ("mass", "stiffness"):
            return values[name] / _SEARCH_FACTOR, values[name] * _SEARCH_FACTOR
        if name in (DELAY, LAG):
            longest = sqrt(values["mass"] / values["stiffness"])
            return -longest if name == DELAY else 0.0, longest
        if name == "bias_force":
            return -inf, inf
        if name == "viscous":
            return -_SEARCH_FACTOR * static / fastest, _SEARCH_FACTOR * static / fastest
        if name == "bristle_stiffness":
            return values["stiffness"], _LARGEST_STIFFNESS * values["stiffness"]
        if name == "bristle_damping":
            return 0.0, _LARGEST_STIFFNESS * static / fastest
        if name.endswith("_speed"):
            return _SLOWEST_SHAPE * fastest, _FASTEST_SHAPE * fastest
        return 0.0 if name in ("rise", "damping") else _LEAST_SHARE * static, inf

    def size(self, name: str, values: Values, fastest: float) -> float:
        """Return a typical size of a coordinate of the law, from which differences are made."""
        static = self.static_force(values)
        if name.endswith("_speed"):
            return fastest
        if name in ("viscous", "bristle_damping"):
            return static / fastest
        if name in self.unscaled:
            return abs(values[name])
        return values["stiffness"] if name == "bristle_stiffness" else static

    def to_search(self, values: Values, fastest: float) -> dict[str, float]:
        """Return the coordinates with those in place that `straightened` names."""
        return dict(values)

    def from_search(self, found: Values, fastest: float) -> dict[str, float]:
        """Return the coordinates of `to_search`, which may be ones that the law refuses."""
        return dict(found)


class CoulombAdapter(IdentifiedLaw):
    """Coulomb and viscous friction: F = F_s + F_v w."""

    name = "coulomb"
    least = 0.0, 0.0
    coordinates: Sequence[str] = ("static", "viscous")
    smallest = "static"

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        return np.column_stack([np.ones_like(speed), speed])

    @override
    def coordinates_of(self, forces: Sequence[float], shape: float) -> dict[str, float]:
        return dict(zip(self.coordinates, forces, strict=False))


class StictionAdapter(CoulombAdapter):
    """Coulomb friction with stiction, of which slip tells the kinetic friction only."""

    name = "stiction"
    coordinates: Sequence[str] = ("kinetic", "rise", "viscous")
    smallest = "kinetic"
    of_slip = False

    @override
    def coordinates_of(self, forces: Sequence[float], shape: float) -> dict[str, float]:
        kinetic, viscous = forces
        return {"kinetic": kinetic, "rise": 0.0, "viscous": viscous}

    @override
    def starts(self, values: Values, fastest: float) -> Sequence[Values]:
        return [{**values, "rise": share * values["kinetic"]} for share in _RISE_SHARES]

    @override
    def bounds(self, name: str, values: Values, fastest: float) -> tuple[float, float]:
        if name == "rise":  # a slide that never breaks loose tells nothing
            return 0.0, _LARGEST_RISE * self.static_force(values)
        return super().bounds(name, values, fastest)


class DahlAdapter(CoulombAdapter):
    """Dahl's law: Coulomb friction that bristles follow, without viscous friction."""

    name = "dahl"
    least = (0.0,)
    coordinates: Sequence[str] = ("static", "bristle_stiffness")
    memory: Sequence[str] = ("bristle_stiffness",)

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        return np.ones((len(speed), 1))

    @override
    def starts(self, values: Values, fastest: float) -> Sequence[Values]:
        return _bristle_starts(values)


class StribeckAdapter(IdentifiedLaw):
    """The cubic law of the paper: F = F_s - D (3 r - r^3)/2 with r = w/v_m, eq. 3."""

    name = "stribeck"
    least = 0.0, 0.0
    shaped = True
    coordinates: Sequence[str] = ("minimum", "rise", "minimum_speed")
    unscaled: Sequence[str] = ("minimum_speed",)
    smallest = "minimum"

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        ratio = speed / shape
        return np.column_stack([np.ones_like(speed), -0.5 * (3.0 * ratio - ratio**3)])

    @override
    def coordinates_of(self, forces: Sequence[float], shape: float) -> dict[str, float]:
        static, drop = forces
        rise = min(drop, static)
        return {"minimum": static - rise, "rise": rise, "minimum_speed": shape}


class ExponentialAdapter(IdentifiedLaw):
    """F = F_k + D exp(-(w/v_s)^n) + F_v w; the viscous force may be negative.

    A regression has the exponent n = 1. Records that hardly tell the decay speed from viscous
    friction have a long curved valley of good fits. It is straight where friction is given by
    forces: in the search `kinetic` is replaced by that at the fastest speed, m/s, `viscous` by that
    at rest, and `rise` by how far the force at a third of the fastest speed is below the straight
    line between them.
    """

    name = "exponential"
    least = 0.0, 0.0, -np.inf
    shaped = True
    coordinates: Sequence[str] = ("kinetic", "rise", "decay_speed", "viscous", "exponent")
    unscaled: Sequence[str] = ("decay_speed", "exponent")
    optional = ("exponent",)
    # An exponent that is a whole number makes other equations.
    by_differences: Sequence[str] = ("exponent",)
    smallest = "kinetic"
    straightened: Mapping[str, tuple[float, float] | None] = {
        "kinetic": (-inf, inf),
        "rise": None,
        "decay_speed": None,
        "viscous": (0.0, inf),
    }

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        return np.column_stack([np.ones_like(speed), np.exp(-speed / shape), speed])

    @override
    def coordinates_of(self, forces: Sequence[float], shape: float) -> dict[str, float]:
        kinetic, drop, viscous = forces
        return {
            "kinetic": kinetic,
            "rise": drop,
            "decay_speed": shape,
            "viscous": viscous,
            "exponent": 1.0,
        }

    @override
    def starts(self, values: Values, fastest: float) -> Sequence[Values]:
        return [values, {**values, "exponent": 2.0}]

    @override
    def bounds(self, name: str, values: Values, fastest: float) -> tuple[float, float]:
        return _EXPONENTS if name == "exponent" else super().bounds(name, values, fastest)

    @override
    def to_search(self, values: Values, fastest: float) -> dict[str, float]:
        sag = values["rise"] * _sag(values, fastest)
        end = values["kinetic"] + values["rise"] * _decay(values, fastest)
        end += values["viscous"] * fastest
        return {**values, "viscous": self.static_force(values), "kinetic": end, "rise": sag}

    @override
    def from_search(self, found: Values, fastest: float) -> dict[str, float]:
        rise = found["rise"] / _sag(found, fastest)
        kinetic = found["viscous"] - rise
        viscous = (found["kinetic"] - kinetic - rise * _decay(found, fastest)) / fastest
        return {**found, "viscous": viscous, "kinetic": kinetic, "rise": rise}


class TableAdapter(IdentifiedLaw):
    """Friction without a law, a sum of straight lines between knots: forces at given speeds."""

    name = "table"
    smallest = "force_0"

    def __init__(self, speeds: FloatArray, knots: FloatArray | None = None) -> None:
        """Take the speeds of the points and of the knots, m/s, from 0; by default the same."""
        self.speeds, self.knots = speeds, speeds if knots is None else knots
        self.least = (0.0, *[-np.inf] * (len(self.knots) - 1))
        self.coordinates = [f"force_{number}" for number in range(len(speeds))]
        # The polynomials of the pieces are made from them.
        self.by_differences = self.coordinates

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        low, high = self.knots[:-1], self.knots[1:]
        shares = np.clip((speed[:, None] - low) / (high - low), 0.0, 1.0)
        return np.column_stack([np.ones_like(speed), shares])

    @override
    def coordinates_of(self, forces: Sequence[float], shape: float) -> dict[str, float]:
        found = self.terms(self.speeds, shape) @ np.array(forces)
        return dict(zip(self.coordinates, found.tolist(), strict=True))

    @override
    def start(self, values: Values, smallest: float) -> dict[str, float]:
        least = _LEAST_RISE * max(map(abs, values.values()))
        return {name: max(value, least) for name, value in values.items()}

    @override
    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        sizes = [max(values[name], 0.0) / normal_force for name in self.coordinates]
        return Table(tuple(zip(self.speeds.tolist(), sizes, strict=True)))


class SaturatingAdapter(TableAdapter):
    """F = F_0 + R (1 - exp(-w/v_s)) + F_v w: friction that rises ever less, as of ball screws."""

    shaped = True
    least_shape = 1.0  # a rise far below the slowest speed is one with the force at rest

    def __init__(self, speeds: FloatArray) -> None:
        """Take the speeds of the points of its table, m/s, from 0."""
        super().__init__(speeds)
        self.least = 0.0, 0.0, 0.0

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        return np.column_stack([np.ones_like(speed), 1.0 - np.exp(-speed / shape), speed])


class _DerivedAdapter(IdentifiedLaw):
    """A law that is made from another one, whose friction in steady slip it has."""

    def __init__(self, own: IdentifiedLaw) -> None:
        """Take the adapter of the other law."""
        self.own, self.name, self.deflection = own, own.name, own.deflection
        self.least, self.shaped, self.least_shape = own.least, own.shaped, own.least_shape

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        return self.own.terms(speed, shape)

    @override
    def coordinates_of(self, forces: Sequence[float], shape: float) -> dict[str, float]:
        return self.own.coordinates_of(forces, shape)


class BristledTableAdapter(_DerivedAdapter):
    """A table that friction follows over a path, as bristles do: F' = |v_r| (F_table - F) / d.

    It is the LuGre law without damping of the bristles, of one deflection d at all speeds.
    """

    def __init__(self, table: TableAdapter, deflection: float) -> None:
        """Take the table in steady slip, and the deflection, m."""
        super().__init__(table)
        self.name, self.deflection, self.smallest = "lugre", deflection, table.smallest
        self.memory = "bristle_stiffness", "bristle_damping"
        self.coordinates = (*table.coordinates, *self.memory)

    @override
    def joined(self, directions: Sequence[Values]) -> dict[str, float]:
        # A law has one contact: the mean friction of both directions is that of its stiffness.
        mean = float(np.mean([max(0.0, *each.values()) for each in directions]))
        own = {"bristle_stiffness": mean / self.deflection, "bristle_damping": 0.0}
        # Bristles need friction to deflect.
        least = _LEAST_FRICTION * mean
        return super().joined(
            [{name: max(each[name], least) for name in each} | own for each in directions]
        )

    @override
    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        return _bristled(self, self.own, values, normal_force)


class BristleAdapter(ExponentialAdapter):
    """A law with a memory that follows an exponential curve."""

    def __init__(
        self, name: str, memory: Sequence[str], by_differences: Sequence[str] = ()
    ) -> None:
        self.name, self.memory = name, memory
        self.by_differences = (*ExponentialAdapter.by_differences, *by_differences)
        self.coordinates = (*ExponentialAdapter.coordinates, *memory)

    @override
    def starts(self, values: Values, fastest: float) -> Sequence[Values]:
        rise = max(values["rise"], _RISE_SHARE * values["kinetic"])
        return _bristle_starts({**values, "rise": rise})

    @override
    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        return _bristled(self, EXPONENTIAL, values, normal_force)


class RateStateAdapter(IdentifiedLaw):
    """F = F_k + (A - B) ln(w/v_0) in steady slip, of which A is immediate.

    The reference speed v_0 is that by default: another one only changes F_k. Far from v_0, F_k
    hardly differs from the slope A - B: in the search `kinetic` is replaced by friction in steady
    slip at the fastest speed.
    """

    name = "rate_state"
    least = 0.0, -inf
    coordinates: Sequence[str] = (
        "kinetic", "direct_effect", "evolution_effect", "slip_distance",
    )  # fmt: skip
    unscaled: Sequence[str] = ("slip_distance",)
    smallest = "kinetic"
    memory: Sequence[str] = coordinates[1:]
    straightened: Mapping[str, tuple[float, float] | None] = {"kinetic": (0.0, inf)}

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        decades = np.log(np.maximum(speed / _REFERENCE_SPEED, 1.0))
        return np.column_stack([np.ones_like(speed), decades])

    @override
    def coordinates_of(self, forces: Sequence[float], shape: float) -> dict[str, float]:
        kinetic, slope = forces
        return {
            "kinetic": kinetic,
            "direct_effect": max(slope, 0.0),
            "evolution_effect": max(-slope, 0.0),
        }

    @override
    def starts(self, values: Values, fastest: float) -> Sequence[Values]:
        amplitude = fastest * sqrt(values["mass"] / values["stiffness"])
        slope = values["direct_effect"] - values["evolution_effect"]
        direct = max(_DIRECT_EFFECT * self.to_search(values, fastest)["kinetic"], abs(slope))
        effects = {"direct_effect": direct, "evolution_effect": direct - slope}
        return [
            {**values, **effects, "slip_distance": share * amplitude} for share in _SLIP_DISTANCES
        ]

    @override
    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        return RateState(
            **{
                name: values[name] / (1.0 if name in self.unscaled else normal_force)
                for name in self.coordinates
            }
        )

    @override
    def bounds(self, name: str, values: Values, fastest: float) -> tuple[float, float]:
        if name == "slip_distance":
            amplitude = fastest * sqrt(values["mass"] / values["stiffness"])
            return _LEAST_SLIP_DISTANCE * amplitude, amplitude
        if name == "direct_effect":
            return _LEAST_DIRECT_EFFECT * values["kinetic"], inf
        if name == "evolution_effect":
            return 0.0, inf
        return super().bounds(name, values, fastest)

    @override
    def to_search(self, values: Values, fastest: float) -> dict[str, float]:
        return {**values, "kinetic": values["kinetic"] + self._rise(values, fastest)}

    @override
    def from_search(self, found: Values, fastest: float) -> dict[str, float]:
        return {**found, "kinetic": found["kinetic"] - self._rise(found, fastest)}

    def _rise(self, values: Values, fastest: float) -> float:
        """Return how far friction in steady slip rises to the fastest speed, N."""
        slope = values["direct_effect"] - values["evolution_effect"]
        return slope * log(fastest / _REFERENCE_SPEED)


class DirectionalAdapter(_DerivedAdapter):
    """A law that has constants of its own in each direction of slip."""

    def __init__(self, own: IdentifiedLaw) -> None:
        """Take the adapter of each direction."""
        super().__init__(own)
        self.coordinates, self.optional, self.by_differences, self.unscaled = (
            [*names, *(REVERSE + name for name in names)]
            for names in (own.coordinates, own.optional, own.by_differences, own.unscaled)
        )

    @override
    def static_force(self, values: Values) -> float:
        """Return the larger static friction, N."""
        return max(self.own.static_force(each) for each in _by_direction(values))

    @override
    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        both = _by_direction(values)
        return Directional(*(self.own.friction(each, normal_force) for each in both))

    @override
    def bounds(self, name: str, values: Values, fastest: float) -> tuple[float, float]:
        own = _by_direction(values)[name.startswith(REVERSE)]
        return self.own.bounds(name.removeprefix(REVERSE), own, fastest)

    @override
    def size(self, name: str, values: Values, fastest: float) -> float:
        # Both directions are of a size.
        larger = max(_by_direction(values), key=self.own.static_force)
        return self.own.size(name.removeprefix(REVERSE), larger, fastest)


def by_group(law: FrictionLaw) -> Mapping[str, FrictionLaw]:
    """Return a law by its group of parameters, or two that differ between the directions."""
    if isinstance(law, Directional):
        return {"friction.": law.forward, "friction.reverse.": law.reverse}
    return {"friction.": law}


def numbers_of(law: FrictionLaw) -> dict[str, float]:
    """Return the constants of a law that are one number, those of the curve that it follows too."""
    if isinstance(law, Table):
        return {}
    own = {name: getattr(law, name) for name in constants_of(type(law))}
    if isinstance(law, CurveFollower):
        own |= numbers_of(law.curve)
    return {name: value for name, value in own.items() if isinstance(value, int | float)}


def _bristled(
    law: IdentifiedLaw, curve: IdentifiedLaw, values: Values, normal_force: float
) -> FrictionLaw:
    kind: Any = LAWS[law.name]
    own = {name: values[name] / normal_force for name in law.memory}
    return kind(curve.friction(values, normal_force), **own)


def _bristle_starts(values: Values) -> Sequence[Values]:
    """Return coordinates with bristles of some stiffnesses."""
    stiffnesses = [ratio * values["stiffness"] for ratio in _STIFFNESS_RATIOS]
    return [
        {**values, "bristle_stiffness": stiffness}
        | {"bristle_damping": _DAMPING_RATIO * sqrt(stiffness * values["mass"])}
        for stiffness in stiffnesses
    ]


def _by_direction(values: Values) -> tuple[Values, Values]:
    """Return the coordinates of forward and of backward slip by the same names."""
    reverse = {
        name.removeprefix(REVERSE): value
        for name, value in values.items()
        if name.startswith(REVERSE)
    }
    return values, {**values, **reverse}


def _decay(values: Values, speed: float) -> float:
    """Return exp(-(w/v_s)^n) at a speed."""
    return exp(-((speed / values["decay_speed"]) ** values["exponent"]))


def _sag(values: Values, fastest: float) -> float:
    """Return how far it is below its chord from rest to the fastest speed, at a third of that."""
    return 1.0 + (_decay(values, fastest) - 1.0) / 3.0 - _decay(values, fastest / 3.0)


EXPONENTIAL = ExponentialAdapter()
STATIC_LAWS: Sequence[IdentifiedLaw] = (
    CoulombAdapter(),
    StictionAdapter(),
    StribeckAdapter(),
    EXPONENTIAL,
)
"""Laws without a memory that compete, the simpler ones first."""
LUGRE = BristleAdapter("lugre", ("bristle_stiffness", "bristle_damping"))
DAHL = DahlAdapter()
MEMORY_LAWS: Sequence[IdentifiedLaw] = (
    LUGRE,
    DAHL,
    # Its elastic limit is made from the smallest friction.
    BristleAdapter("elasto_plastic", LUGRE.memory, ("kinetic",)),
    BristleAdapter("maxwell_slip", ("bristle_stiffness",)),
)
"""Laws with a memory that compete. Those after LuGre are searched from what LuGre gives."""
COMPETING = (*STATIC_LAWS, *MEMORY_LAWS)
KNOWN_LAWS: Mapping[str, IdentifiedLaw] = {
    each.name: each for each in (*COMPETING, RateStateAdapter())
}
"""All laws with constants by their name."""
