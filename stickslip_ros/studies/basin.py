"""Basins of attraction: which motion a start leads to, and what share of starts each one gets."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from typing import Self

from stickslip_ros.deprecated_names import Renamed
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.options import BASIN_COURSE, SettlingCourse
from stickslip_ros.studies.plan import Axis, Plan
from stickslip_ros.studies.settling import CYCLES
from stickslip_ros.studies.study import Point, Study

POSITION, VELOCITY = "plant.initial.position", "plant.initial.velocity"
"""What a start is made of; the washout filter is at rest."""


@dataclass(frozen=True)
class Attractor:
    """A motion that starts lead to; SI units."""

    regime: Regime | None
    """None: it is not known, for the motion failed or completed no cycle."""
    steady: bool
    """Whether the motions have settled; those that have not may be on their way to another."""
    amplitude: float | None
    """m; None unless they are cycles that have settled."""
    midpoint: float | None
    """m; likewise."""
    count: int = 0
    """Starts that lead to it."""
    share: float = 0.0
    """Basin stability: what share of the starts that is."""
    standard_error: float = 0.0
    """Of the share of a random sample of n, sqrt(S (1 - S) / n); a grid's is smaller, as a rule."""

    of = Renamed("from_point")

    @classmethod
    def from_point(cls, point: Point) -> Self:
        """Return the attractor that a motion has come to, for all that is known."""
        measures, steady = point.measures, point.steady
        if steady and measures.regime in CYCLES:
            return cls(measures.regime, steady, measures.amplitude, measures.midpoint)
        return cls(measures.regime, steady, None, None)

    def is_like(self, other: "Attractor") -> bool:
        """Return whether two are the same but for rounding and the last of the transient.

        Cycles are if regime, amplitude and midpoint are, the latter within two percent.
        """
        if (self.regime, self.steady) != (other.regime, other.steady):
            return False
        allowed = 0.02 * (self.amplitude or 0.0)
        pairs = (self.amplitude, other.amplitude), (self.midpoint, other.midpoint)
        return all(abs((one or 0.0) - (two or 0.0)) <= allowed for one, two in pairs)


@dataclass(frozen=True)
class Basins:
    """Which attractor each start of a study leads to."""

    attractors: tuple[Attractor, ...]
    """The one with most starts first."""
    order: tuple[int, ...]
    """Place in `attractors` of each attractor in the order in which they were found."""
    found: tuple[Attractor, ...]
    """The attractors in that order."""

    of = Renamed("from_points")

    @classmethod
    def from_points(cls, points: Iterable[Point]) -> Self:
        """Return what the points of a study, taken one at a time, have come to."""
        found: list[Attractor] = []
        counts: list[int] = []
        for point in points:
            attractor = Attractor.from_point(point)
            place = _place(attractor, found)
            if place == len(found):
                found.append(attractor)
                counts.append(0)
            counts[place] += 1
        ranked = sorted(range(len(found)), key=lambda place: -counts[place])
        attractors: list[Attractor] = []
        for place in ranked:
            share = counts[place] / sum(counts)
            error = sqrt(share * (1.0 - share) / sum(counts))
            one = replace(found[place], count=counts[place], share=share, standard_error=error)
            attractors.append(one)
        order = tuple(ranked.index(place) for place in range(len(found)))
        return cls(tuple(attractors), order, tuple(found))

    def place(self, point: Point) -> int:
        """Return the place in `attractors` of that which a point has come to."""
        return self.order[_place(Attractor.from_point(point), self.found)]


def basin_study(
    scenario: Scenario,
    plan: Plan,
    *,
    course: SettlingCourse | None = None,
    continuous: bool = False,
) -> Study:
    """Return the study of the starts in `plan`, a grid or a sample over `POSITION` and `VELOCITY`.

    What they lead to is told by `Basins`. Raises InvalidInputError for another plan.
    """
    if set(plan.parameters) != {POSITION, VELOCITY} or plan.carried:
        raise InvalidInputError(
            f"a basin is over {POSITION} and {VELOCITY}, not {', '.join(plan.parameters)}"
        )
    study = Study(scenario, plan, course or BASIN_COURSE, continuous)
    study.check()
    return study


def default_axes(scenario: Scenario, count: int) -> tuple[Axis, Axis]:
    """Return so many positions and velocities each, twice as far as a vibration goes, about.

    That has the amplitude at which the slide is as fast as the belt, or that to which static
    friction bends the spring, whichever is more.
    """
    drive = scenario.plant.as_drive()
    bent = drive.friction.static * drive.length_scale
    reach = 2.0 * max(abs(drive.belt_speed) / drive.angular_frequency, bent)
    middle, speed = drive.equilibrium_position, reach * drive.angular_frequency
    return (
        Axis(POSITION, middle - reach, middle + reach, count),
        Axis(VELOCITY, -speed, speed, count),
    )


def _place(attractor: Attractor, found: Sequence[Attractor]) -> int:
    """Return the first of those found that is like it, or, without, how many there are."""
    places = (place for place, other in enumerate(found) if other.is_like(attractor))
    return next(places, len(found))
