"""Friction laws as they are identified: one adapter for each law."""

from collections.abc import Mapping, Sequence
from math import exp, inf, sqrt
from typing import Any

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.identified_law import (
    LEAST_RISE,
    REVERSE,
    IdentifiedLaw,
    Straightening,
    Values,
)
from stickslip_ros.model.friction import LAWS, Directional, FrictionLaw, Table

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
_BRISTLES = "bristle_stiffness", "bristle_damping"


class CoulombAdapter(IdentifiedLaw):
    """Coulomb and viscous friction: F = F_s + F_v w."""

    name = "coulomb"
    least = 0.0, 0.0
    coordinates: Sequence[str] = ("static", "viscous")
    smallest = "static"

    @override
    def bounds(self, name: str, values: Values, fastest: float) -> tuple[float, float]:
        low, high = super().bounds(name, values, fastest)
        # Friction that falls for ever would drive the slide: other laws fall, and end.
        return max(low, -values["damping"]) if name == "viscous" else low, high


class StictionAdapter(CoulombAdapter):
    """Coulomb friction with stiction, of which slip tells the kinetic friction only."""

    name = "stiction"
    coordinates: Sequence[str] = ("kinetic", "rise", "viscous")
    smallest = "kinetic"
    identifiable_in_slip = False

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


class DahlAdapter(IdentifiedLaw):
    """Dahl's law: Coulomb friction that bristles follow, without viscous friction."""

    name = "dahl"
    least = (0.0,)
    coordinates = "static", "bristle_stiffness"
    smallest = "static"

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        return np.ones((len(speed), 1))

    @override
    def starts(self, values: Values, fastest: float) -> Sequence[Values]:
        return _bristle_starts(values)


class StribeckAdapter(IdentifiedLaw):
    """The cubic law of the paper: F = F_m + D [1 - (3 r - r^3)/2] with r = w/v_m, eq. 3."""

    name = "stribeck"
    least = 0.0, 0.0
    shaped = True
    coordinates = "minimum", "rise", "minimum_speed"
    unscaled = ("minimum_speed",)
    smallest = "minimum"


def _forces(values: Values, fastest: float) -> dict[str, float]:
    """Return the forces that stand for an exponential law; see `ExponentialAdapter`."""
    rise, fast = values["rise"], values["kinetic"] + values["rise"] * _decay(values, fastest)
    return {
        "force_at_rest": values["kinetic"] + rise,
        "force_at_fastest": fast + values["viscous"] * fastest,
        "sag": rise * _sag(values, fastest),
    }


def _of_forces(values: Values, fastest: float) -> dict[str, float]:
    """Return the coordinates of `_forces`."""
    rise = values["sag"] / _sag(values, fastest)
    kinetic = values["force_at_rest"] - rise
    viscous = (values["force_at_fastest"] - kinetic - rise * _decay(values, fastest)) / fastest
    return {"kinetic": kinetic, "rise": rise, "viscous": viscous}


def _decay(values: Values, speed: float) -> float:
    """Return exp(-(w/v_s)^n) at a speed."""
    return exp(-((speed / values["decay_speed"]) ** values["exponent"]))


def _sag(values: Values, fastest: float) -> float:
    """Return how far it is below its chord from rest to the fastest speed, at a third of that."""
    return 1.0 + (_decay(values, fastest) - 1.0) / 3.0 - _decay(values, fastest / 3.0)


class ExponentialAdapter(IdentifiedLaw):
    """F = F_k + D exp(-(w/v_s)^n) + F_v w; the viscous force may be negative.

    A regression has one exponent n. Records that hardly tell the decay speed from viscous friction
    have a long curved valley of good fits. It is straight where friction is given by forces: in the
    search `kinetic` is replaced by that at the fastest speed, `viscous` by that at rest, and `rise`
    by the sag, how far the force at a third of the fastest speed is below the straight line between
    them.
    """

    name = "exponential"
    least = 0.0, 0.0, -np.inf
    shaped = True
    coordinates = "kinetic", "rise", "decay_speed", "viscous", "exponent"
    unscaled = "decay_speed", "exponent"
    optional = ("exponent",)
    # An exponent that is a whole number makes other equations.
    by_differences = ("exponent",)
    smallest = "kinetic"
    straightening = Straightening(
        {"kinetic": "force_at_fastest", "rise": "sag", "viscous": "force_at_rest"},
        {"force_at_fastest": (-inf, inf), "force_at_rest": (0.0, inf)},
        _forces,
        _of_forces,
        with_free=("decay_speed",),
    )

    def __init__(self, exponent: float = 1.0) -> None:
        """Take the exponent of a regression."""
        self._exponent = exponent

    @override
    def coordinates_of(self, forces: Sequence[float], shape: float) -> dict[str, float]:
        return {**super().coordinates_of(forces, shape), "exponent": self._exponent}

    @override
    def starts(self, values: Values, fastest: float) -> Sequence[Values]:
        return [values, {**values, "exponent": 2.0}]

    @override
    def bounds(self, name: str, values: Values, fastest: float) -> tuple[float, float]:
        return _EXPONENTS if name == "exponent" else super().bounds(name, values, fastest)


class TableAdapter(IdentifiedLaw):
    """Friction without a law, a sum of straight lines between knots: forces at given speeds."""

    name = "table"
    smallest = "force_0"

    def __init__(self, speeds: FloatArray, knots: FloatArray | None = None) -> None:
        """Take the speeds of the points and of the knots, m/s, from 0; by default the same."""
        self.speeds = self._points = speeds
        self.knots = speeds if knots is None else knots
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
        curve = self.terms(self._points, shape) @ np.array(forces)
        return dict(zip(self.coordinates, curve.tolist(), strict=True))

    @override
    def start(self, values: Values, smallest: float) -> dict[str, float]:
        least = LEAST_RISE * max(map(abs, values.values()))
        return {name: max(value, least) for name, value in values.items()}

    @override
    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        forces = zip(self._points.tolist(), self.coordinates, strict=True)
        return Table(tuple((w, max(values[name], 0.0) / normal_force) for w, name in forces))


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


class FollowingAdapter(IdentifiedLaw):
    """A law with bristles, or elements, whose friction follows that of another law: its curve."""

    def __init__(
        self,
        curve: IdentifiedLaw,
        name: str = "lugre",
        bristles: Sequence[str] = _BRISTLES,
        by_differences: Sequence[str] = (),
    ) -> None:
        """Take the curve, its name, the coordinates of its memory, and what takes differences."""
        self._curve, self.name = curve, name
        self.coordinates = [*curve.coordinates, *bristles]
        self.by_differences = [*curve.by_differences, *by_differences]
        self.unscaled, self.smallest, self.optional = curve.unscaled, curve.smallest, curve.optional
        self.straightening = curve.straightening
        self.least, self.shaped, self.least_shape = curve.least, curve.shaped, curve.least_shape
        self.speeds, self.identifiable_in_slip = curve.speeds, curve.identifiable_in_slip

    @override
    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        return self._curve.terms(speed, shape)

    @override
    def coordinates_of(self, forces: Sequence[float], shape: float) -> dict[str, float]:
        return self._curve.coordinates_of(forces, shape)

    @override
    def starts(self, values: Values, fastest: float) -> Sequence[Values]:
        rise = max(values["rise"], _RISE_SHARE * values["kinetic"])
        return _bristle_starts({**values, "rise": rise})

    @override
    def bounds(self, name: str, values: Values, fastest: float) -> tuple[float, float]:
        return self._curve.bounds(name, values, fastest)

    @override
    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        kind: Any = LAWS[self.name]
        memory = {name: values[name] / normal_force for name in self.memory}
        return kind(self._curve.friction(values, normal_force), **memory)


class FollowedTable(FollowingAdapter):
    """Friction that follows a table over a path, as bristles do: F' = |v_r| (F_table - F) / d.

    It is the LuGre law without damping of the bristles, of one deflection d at all speeds.
    """

    def __init__(self, table: TableAdapter, deflection: float) -> None:
        """Take the table, and the deflection, m."""
        super().__init__(table)
        self.deflection = deflection

    @override
    def joined(self, directions: Sequence[Values]) -> dict[str, float]:
        # A law has one contact: the mean friction of both directions is that of its stiffness.
        mean = float(np.mean([max(0.0, *way.values()) for way in directions]))
        bristles = dict(zip(_BRISTLES, (mean / self.deflection, 0.0), strict=True))
        # Bristles need friction to deflect.
        least = _LEAST_FRICTION * mean
        return super().joined(
            [
                {name: max(force, least) for name, force in way.items()} | bristles
                for way in directions
            ]
        )


class DirectionalAdapter(IdentifiedLaw):
    """A law that has constants of its own in each direction of slip."""

    def __init__(self, law: IdentifiedLaw) -> None:
        """Take the adapter of each direction."""
        self._law, self.name = law, law.name
        self.coordinates, self.optional, self.by_differences, self.unscaled = (
            [*names, *(REVERSE + name for name in names)]
            for names in (law.coordinates, law.optional, law.by_differences, law.unscaled)
        )

    @property
    @override
    def one_way(self) -> IdentifiedLaw:
        return self._law

    @override
    def static_force(self, values: Values) -> float:
        """Return the larger static friction, N."""
        return max(map(self._law.static_force, _by_direction(values)))

    @override
    def friction(self, values: Values, normal_force: float) -> FrictionLaw:
        both = _by_direction(values)
        return Directional(*(self._law.friction(way, normal_force) for way in both))

    @override
    def bounds(self, name: str, values: Values, fastest: float) -> tuple[float, float]:
        way = _by_direction(values)[name.startswith(REVERSE)]
        return self._law.bounds(name.removeprefix(REVERSE), way, fastest)

    @override
    def size(self, name: str, values: Values, fastest: float) -> float:
        # Both directions are of a size.
        larger = max(_by_direction(values), key=self._law.static_force)
        return self._law.size(name.removeprefix(REVERSE), larger, fastest)


def _bristle_starts(values: Values) -> Sequence[Values]:
    """Return coordinates with bristles of some stiffnesses."""
    stiffnesses = [ratio * values["stiffness"] for ratio in _STIFFNESS_RATIOS]
    dampings = [_DAMPING_RATIO * sqrt(stiff * values["mass"]) for stiff in stiffnesses]
    bristles = zip(stiffnesses, dampings, strict=True)
    return [{**values, **dict(zip(_BRISTLES, pair, strict=True))} for pair in bristles]


def _by_direction(values: Values) -> tuple[Values, Values]:
    """Return the coordinates of forward and of backward slip by the same names."""
    reverse = {
        name.removeprefix(REVERSE): value
        for name, value in values.items()
        if name.startswith(REVERSE)
    }
    return values, {**values, **reverse}


EXPONENTIAL, GAUSSIAN = ExponentialAdapter(), ExponentialAdapter(2.0)
LUGRE = FollowingAdapter(EXPONENTIAL)
DAHL = DahlAdapter()
COMPETING: Sequence[IdentifiedLaw] = (
    CoulombAdapter(),
    StictionAdapter(),
    StribeckAdapter(),
    EXPONENTIAL,
    LUGRE,
    DAHL,
    # The elastic limit is made from the smallest friction.
    FollowingAdapter(EXPONENTIAL, "elasto_plastic", by_differences=["kinetic"]),
    FollowingAdapter(EXPONENTIAL, "maxwell_slip", ["bristle_stiffness"]),
)
"""Laws that compete, the simpler ones first. Those after LuGre are searched from what it gives."""
KNOWN_LAWS: Mapping[str, IdentifiedLaw] = {law.name: law for law in COMPETING}
"""All laws with constants by their name."""
