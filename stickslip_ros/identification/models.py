"""What is identified: the constants of a drive with a friction law."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, sqrt

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.friction_models import FrictionModel
from stickslip_ros.identification.regression import Regression
from stickslip_ros.physics.model.constants import constants_of
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import CurveFollower, Directional, FrictionLaw, Table

_WIDE = 30.0
"""Factor by which the search may leave the mass and the stiffness that it starts from."""
DELAY = "force_delay"
"""Name of the constant that is not one of the drive: the time until a force acts, s."""


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
        """Return the smallest and the largest value of a coordinate in the search.

        Parameters
        ----------
        name : str
            Coordinate.
        values : mapping
            Coordinates at the start of the search.
        fastest : float
            Fastest speed relative to the belt in the records, m/s.
        """
        if name in ("mass", "stiffness"):
            return values[name] / _WIDE, values[name] * _WIDE
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
