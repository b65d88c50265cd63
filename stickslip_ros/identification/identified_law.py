"""What identification must know of a friction law."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, sqrt
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.constants import constants_of
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import LAWS, CurveFollower, Directional, FrictionLaw, Table

Values = Mapping[str, float]
"""Values of coordinates by name, SI units."""

_LEAST_SHARE = 1e-9
"""Smallest constant that must be above zero, as a share of the friction or of other forces."""
LEAST_RISE = 1e-3
"""Smallest force from which a search starts, as a share of the static friction."""
DELAY = "force_delay"
"""Name of the constant that is not one of the drive: the time until a force acts, s."""
LAG = "actuator.time_constant"
"""Name of the time constant of the lag of the force, s."""
REVERSE = "reverse."
"""Start of the names of coordinates of backward slip where both directions have their own."""


@dataclass(frozen=True)
class Coordinate:
    """What a search knows of a coordinate by its name."""

    unit: str = ""
    """Unit, from which its typical size follows; empty: that is its own value."""
    low: float = _LEAST_SHARE
    """Smallest value in a search, in sizes of where it begins."""
    high: float = inf
    """Largest value, likewise."""
    of_memory: bool = False
    """Whether it is a constant of the memory of a law."""


_COORDINATES = {
    **dict.fromkeys(("mass", "stiffness"), Coordinate("", 1.0 / 30.0, 30.0)),
    DELAY: Coordinate("s", -1.0, 1.0),
    LAG: Coordinate("s", 0.0, 1.0),
    "bias_force": Coordinate("N", -inf),
    "rise": Coordinate("N", 0.0),
    "damping": Coordinate("N s/m", 0.0),
    "viscous": Coordinate("N s/m", -30.0, 30.0),
    "bristle_stiffness": Coordinate("N/m", 1.0, 3000.0, of_memory=True),
    "bristle_damping": Coordinate("N s/m", 0.0, 3000.0, of_memory=True),
}
"""Coordinates by name; others are speeds, forces, or have no scale."""


@dataclass(frozen=True)
class Straightening:
    """Numbers in which fits are nearly linear, which a search has in place of coordinates.

    They replace these where all of them, and those of `with_free`, are free. Both functions take
    the fastest speed, too.
    """

    names: Mapping[str, str]
    """Name of the number in place of each coordinate."""
    bounds: Mapping[str, tuple[float, float]]
    """Bounds of the numbers; the others have those of the coordinate that they replace."""
    to_search: Callable[[Values, float], dict[str, float]]
    """Returns the numbers of coordinates."""
    from_search: Callable[[Values, float], dict[str, float]]
    """Returns the coordinates of numbers; they may be ones that the law refuses."""
    with_free: Sequence[str] = ()
    """Further coordinates that must be free: what the numbers are depends on them."""


AS_THEY_ARE = Straightening({}, {}, lambda _, __: {}, lambda _, __: {})
"""Has no coordinate replaced."""


class IdentifiedLaw:
    """A friction law as identification knows it.

    A regression of forces takes friction in steady slip as a sum of `terms` with unknown forces;
    it may have one shape, a speed, in which it is not linear. A search of trajectories has
    `coordinates` with simple bounds. They are in newtons: the normal force only scales friction.
    The static coefficient has in its place its `rise` above the smaller one.
    """

    name: str
    """Name of the friction law."""
    coordinates: Sequence[str]
    """Names of the coordinates: those of the constants, and `rise` for `static`."""
    unscaled: Sequence[str] = ()
    """Coordinates that do not scale with the normal force, such as speeds."""
    smallest: str
    """Coordinate of the smallest friction."""

    # Of the regression:
    least: Sequence[float]
    """Smallest value of each unknown force: 0 or minus infinity."""
    shaped: bool = False
    """Whether there is a shape."""
    least_shape: float = 0.25
    """Smallest shape that records tell, in their slowest speeds."""
    speeds: FloatArray | None = None
    """Speeds of the points that stand for a curve, m/s; None: those recorded."""
    deflection: float = 0.0
    """Path over which friction follows a change of direction or speed, m; 0: immediately."""
    identifiable_in_slip: bool = True
    """Whether friction in slip tells all constants."""

    # Of the search:
    optional: Sequence[str] = ()
    """Coordinates that are fitted only if the records ask for them."""
    by_differences: Sequence[str] = ()
    """Coordinates on which the motion depends other than by its equations."""
    straightening: Straightening = AS_THEY_ARE
    """Numbers for the search, if it is slow in its coordinates."""

    @property
    def memory(self) -> Sequence[str]:
        """Coordinates of the memory of the law."""
        return [name for name in self.coordinates if self._coordinate(name).of_memory]

    def terms(self, speed: FloatArray, shape: float) -> FloatArray:
        """Return the terms, rows of shape (rows, terms); `speed` is |v_r| and `shape` in m/s.

        By default a term is the friction of the law with one of the unknown forces alone, 1 N.
        """
        units = np.eye(len(self.least)).tolist()
        laws = [self.friction(self.coordinates_of(unit, shape), 1.0) for unit in units]
        return np.column_stack([-law.coefficient(speed, 1.0) for law in laws])

    def coordinates_of(self, forces: Sequence[float], shape: float) -> dict[str, float]:
        """Return the coordinates of unknown forces, N, and of a shape, m/s.

        By default the forces are the coordinates that scale with the normal force, and what does
        not is the shape.
        """
        scaled = [name for name in self.coordinates if name not in self.unscaled]
        values = dict(zip(scaled, forces, strict=False))  # a memory is none of friction in slip
        return values | dict.fromkeys(self.unscaled, shape)

    @property
    def one_way(self) -> "IdentifiedLaw":
        """The law of each direction of slip."""
        return self

    def joined(self, directions: Sequence[Values]) -> dict[str, float]:
        """Return the coordinates of one direction, or of forward and backward slip."""
        forward, *reverse = directions
        others = {REVERSE + name: value for way in reverse for name, value in way.items()}
        return {**forward, **others}

    def start(self, values: Values, smallest: float) -> dict[str, float]:
        """Return coordinates from which a search can start: inside of their bounds.

        `smallest` is the smallest static friction, N.
        """
        start = dict(values)
        if "rise" in start:
            least = LEAST_RISE * max(self.static_force(start), smallest)
            static = max(self.static_force(start), least)
            start["rise"] = min(max(start["rise"], least), static - least)
            start[self.smallest] = static - start["rise"]
        else:
            start[self.smallest] = max(start[self.smallest], smallest)
        if "viscous" in start:
            # A law without viscous friction has other equations, not a derivative by it.
            start["viscous"] = start["viscous"] or _LEAST_SHARE * start[self.smallest]
        return start

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
        has_static = "static" in constants_of(kind)
        constants = {"static": self.static_force(values) / normal_force} if has_static else {}
        for name in self.coordinates:
            if name != "rise":
                constants[name] = values[name] / (1.0 if name in self.unscaled else normal_force)
        return kind(**constants)

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
        others = {*self.coordinates, DELAY}
        constants = {name: value for name, value in values.items() if name not in others}
        if self.one_way.deflection > 0.0:
            return constants
        for group, law in by_group(self.friction(values, normal_force)).items():
            constants |= {group + name: value for name, value in numbers_of(law).items()}
        return constants

    @property
    def fixable(self) -> Sequence[str]:
        """The coordinates that can be given: they are constants of the law."""
        return [name for name in self.coordinates if name in constants_of(LAWS[self.name])]

    def bounds(self, name: str, values: Values, fastest: float) -> tuple[float, float]:
        """Return the smallest and the largest value of a coordinate in the search from `values` on.

        The fastest speed is that relative to the belt in the records, m/s.
        """
        coordinate, size = self._coordinate(name), self.size(name, values, fastest)
        return coordinate.low * size, coordinate.high * size

    def size(self, name: str, values: Values, fastest: float) -> float:
        """Return a typical size of a coordinate, above 0, from which differences are made."""
        match self._coordinate(name).unit:
            case "N":
                return self.static_force(values)
            case "N s/m":
                return self.static_force(values) / fastest
            case "N/m":
                return values["stiffness"]
            case "m/s":
                return fastest
            case "s":
                return sqrt(values["mass"] / values["stiffness"])
            case _:
                return max(abs(values[name]), np.finfo(float).tiny)

    def _coordinate(self, name: str) -> Coordinate:
        if name.endswith("_speed"):
            # What a curve does far below or above the recorded speeds is not identifiable.
            return Coordinate("m/s", 0.01, 10.0)
        return _COORDINATES.get(name) or Coordinate("" if name in self.unscaled else "N")


def label_of(law: IdentifiedLaw) -> str:
    """Return the name of a law, and whether it is by direction."""
    return law.name if law.one_way is law else f"{law.name} by direction"


def by_group(law: FrictionLaw) -> Mapping[str, FrictionLaw]:
    """Return a law by its group of parameters, or two that differ between the directions."""
    if isinstance(law, Directional):
        return {"friction.": law.forward, "friction.reverse.": law.reverse}
    return {"friction.": law}


def numbers_of(law: FrictionLaw) -> dict[str, float]:
    """Return the constants of a law that are one number, those of the curve that it follows too."""
    if isinstance(law, Table):
        return {}
    constants = {name: getattr(law, name) for name in constants_of(type(law))}
    if isinstance(law, CurveFollower):
        constants |= numbers_of(law.curve)
    return {name: value for name, value in constants.items() if isinstance(value, int | float)}
