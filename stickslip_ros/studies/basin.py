"""Basins of attraction: the motion that each start leads to, and the share of starts of each."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from typing import Self

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.options import BASIN_OPTIONS, SettlingOptions
from stickslip_ros.studies.plan import Axis, Plan
from stickslip_ros.studies.settling import CYCLES
from stickslip_ros.studies.study import Point, Study

POSITION, VELOCITY = "plant.initial.position", "plant.initial.velocity"
"""Parameters that define a start; the control law starts in its initial state."""


@dataclass(frozen=True)
class Attractor:
    """A motion that starts lead to; SI units."""

    regime: Regime | None
    """Regime of the motion; None: unknown, because the motion failed or completed no cycle."""
    steady: bool
    """Whether the motions have settled; those that have not may still reach another attractor."""
    amplitude: float | None
    """Amplitude of the displacement, m; None unless the motions are settled cycles."""
    midpoint: float | None
    """Midpoint of the displacement, m; None unless the motions are settled cycles."""
    count: int = 0
    """Number of starts that lead to it."""
    share: float = 0.0
    """Basin stability: the share of the starts that lead to it, 0 to 1."""
    standard_error: float = 0.0
    """Of the share S of n random starts, sqrt(S (1 - S) / n); usually smaller on a grid."""

    @classmethod
    def from_point(cls, point: Point) -> Self:
        """Return the attractor that a motion has reached, as far as known.

        Parameters
        ----------
        point : Point
            A computed point of a study.

        Returns
        -------
        Attractor
            The attractor; its count and share are 0.
        """
        measures, steady = point.measures, point.steady
        if steady and measures.regime in CYCLES:
            return cls(measures.regime, steady, measures.amplitude, measures.midpoint)
        return cls(measures.regime, steady, None, None)

    def is_like(self, other: "Attractor") -> bool:
        """Return whether two attractors are the same, up to rounding and a remaining transient.

        Parameters
        ----------
        other : Attractor
            The attractor to compare with.

        Returns
        -------
        bool
            Whether `regime` and `steady` are equal, and amplitude and midpoint differ by 2 % of
            the amplitude at most.
        """
        if (self.regime, self.steady) != (other.regime, other.steady):
            return False
        allowed = 0.02 * (self.amplitude or 0.0)
        pairs = (self.amplitude, other.amplitude), (self.midpoint, other.midpoint)
        return all(abs((one or 0.0) - (two or 0.0)) <= allowed for one, two in pairs)


@dataclass(frozen=True)
class Basins:
    """The attractors of a basin study, and the one that each start leads to."""

    attractors: tuple[Attractor, ...]
    """The attractors; the one with the most starts comes first."""
    order: tuple[int, ...]
    """Index in `attractors` of each attractor in `found`."""
    found: tuple[Attractor, ...]
    """The attractors in the order in which they were found."""

    @classmethod
    def from_points(cls, points: Iterable[Point]) -> Self:
        """Return the attractors that the points of a study have reached.

        Parameters
        ----------
        points : Iterable[Point]
            The points, as from `Journal.points`. They are read once, one at a time.

        Returns
        -------
        Basins
            The attractors with their shares of the points.
        """
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
        """Return which of the attractors a point has reached.

        Parameters
        ----------
        point : Point
            One of the points that the basins were made from.

        Returns
        -------
        int
            Index in `attractors`.
        """
        return self.order[_place(Attractor.from_point(point), self.found)]


def basin_study(
    scenario: Scenario,
    plan: Plan,
    *,
    course: SettlingOptions | None = None,
    continuous: bool = False,
) -> Study:
    """Return the study of the starts in a plan.

    Compute it with `run` or `compute_columns`; `Basins` groups the results by attractor.

    Parameters
    ----------
    scenario : Scenario
        The scenario; all parameters but the initial state apply.
    plan : Grid or RandomSample
        The starts, over `plant.initial.position` (m) and `plant.initial.velocity` (m/s).
    course : SettlingOptions, optional
        How long each motion is followed; by default transients of 50 natural periods, at most 80
        of them.
    continuous : bool
        Whether the control acts without sampling (eq. 19).

    Returns
    -------
    Study
        The study, ready to be computed.

    Raises
    ------
    InvalidInputError
        If the plan is over other parameters or has a continuation, or no start is valid.

    Examples
    --------
    >>> from stickslip_ros.scenarios.files import load_scenario
    >>> from stickslip_ros.studies.journal import Journal
    >>> from stickslip_ros.studies.plan import Grid
    >>> from stickslip_ros.studies.runner import run
    >>> scenario = load_scenario("paper", ["plant.expects_control=false"])
    >>> study = basin_study(scenario, Grid(default_axes(scenario, 2)))
    >>> with Journal(study) as journal:
    ...     run(journal)
    ...     basins = Basins.from_points(journal.points())
    >>> [(str(each.regime), each.share) for each in basins.attractors]
    [('stick_slip', 1.0)]
    """
    if set(plan.parameters) != {POSITION, VELOCITY} or plan.continuation:
        raise InvalidInputError(
            f"a basin is over {POSITION} and {VELOCITY}, not {', '.join(plan.parameters)}"
        )
    study = Study(scenario, plan, course or BASIN_OPTIONS, continuous)
    study.check()
    return study


def default_axes(scenario: Scenario, count: int) -> tuple[Axis, Axis]:
    """Return axes of positions and velocities about twice as wide as a vibration.

    The vibration is estimated by the larger of two amplitudes: the one at which the slide is as
    fast as the belt, and the spring's deflection under static friction.

    Parameters
    ----------
    scenario : Scenario
        The scenario whose drive sets the range.
    count : int
        Number of values of each axis, at least 2.

    Returns
    -------
    tuple[Axis, Axis]
        Axes of `plant.initial.position` (m), centred on the equilibrium, and
        `plant.initial.velocity` (m/s), centred on zero.

    Raises
    ------
    InvalidInputError
        If the drive has no spring.

    Examples
    --------
    >>> from stickslip_ros.scenarios.files import load_scenario
    >>> [axis.count for axis in default_axes(load_scenario("paper"), 5)]
    [5, 5]
    """
    drive = scenario.plant.as_drive()
    if not drive.has_spring:
        raise InvalidInputError(
            "plant.stiffness = 0 N/m: without a spring no range of starts follows from the drive, "
            "so both position and velocity must be given"
        )
    bent = max(drive.friction.limits) * drive.length_scale
    reach = 2.0 * max(abs(drive.belt_speed) / drive.angular_frequency, bent)
    middle, speed = drive.equilibrium_position, reach * drive.angular_frequency
    return (
        Axis(POSITION, middle - reach, middle + reach, count),
        Axis(VELOCITY, -speed, speed, count),
    )


def _place(attractor: Attractor, found: Sequence[Attractor]) -> int:
    """Return the index of the first attractor found that is like it, or else their number."""
    places = (place for place, other in enumerate(found) if other.is_like(attractor))
    return next(places, len(found))
