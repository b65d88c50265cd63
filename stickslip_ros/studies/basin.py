"""Basins of attraction: the motion that each start leads to, and the share of starts of each."""

from dataclasses import dataclass
from math import sqrt
from typing import Self

import numpy as np
import numpy.typing as npt

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.columns import Columns
from stickslip_ros.studies.options import BASIN_OPTIONS, SettlingOptions
from stickslip_ros.studies.plan import Axis, Plan
from stickslip_ros.studies.settling import CYCLES
from stickslip_ros.studies.study import Study

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


@dataclass(frozen=True)
class Basins:
    """The attractors of a basin study, and the one that each start leads to."""

    attractors: tuple[Attractor, ...]
    """The attractors; the one with the most starts comes first."""
    places: npt.NDArray[np.intp]
    """Index in `attractors` of the attractor that each start leads to, shape (n,)."""

    @classmethod
    def from_columns(cls, columns: Columns) -> Self:
        """Return the attractors that the points of a study have reached.

        Motions are the same, up to rounding and a remaining transient, if `regime` and `steady`
        are equal, and amplitude and midpoint differ by 2 % of the amplitude at most from those of
        the first one; these count for settled cycles only.

        Parameters
        ----------
        columns : Columns
            The results of the study.

        Returns
        -------
        Basins
            The attractors with their shares of the points.
        """
        regime, steady = columns.regime, columns.steady
        cycle = steady & np.isin(regime, CYCLES)
        amplitude, midpoint = (
            np.where(cycle, measure, 0.0) for measure in (columns.amplitude, columns.midpoint)
        )
        places = np.full(len(regime), -1)
        attractors: list[Attractor] = []
        while len(left := np.flatnonzero(places < 0)):
            first = int(left[0])
            allowed = 0.02 * amplitude[first]
            alike = (regime[left] == regime[first]) & (steady[left] == steady[first])
            for column in (amplitude, midpoint):
                alike &= np.abs(column[left] - column[first]) <= allowed
            alike[0] = True  # also where an amplitude is not finite
            places[left[alike]] = len(attractors)
            share = (count := int(alike.sum())) / len(regime)
            attractor = Attractor(
                regime=regime.item(first),
                steady=bool(steady[first]),
                amplitude=float(amplitude[first]) if cycle[first] else None,
                midpoint=float(midpoint[first]) if cycle[first] else None,
                count=count,
                share=share,
                standard_error=sqrt(share * (1.0 - share) / len(regime)),
            )
            attractors.append(attractor)
        order = sorted(range(len(attractors)), key=lambda place: -attractors[place].count)
        ranked = tuple(attractors[place] for place in order)
        return cls(ranked, np.argsort(order)[places] if order else places)


def basin_study(
    scenario: Scenario,
    plan: Plan,
    *,
    settling: SettlingOptions | None = None,
    continuous: bool = False,
) -> Study:
    """Return the study of the starts in a plan.

    Compute it with `compute_columns`; `Basins` groups the results by attractor.

    Parameters
    ----------
    scenario : Scenario
        The scenario; all parameters but the initial state apply.
    plan : Grid or RandomSample
        The starts, over `plant.initial.position` (m) and `plant.initial.velocity` (m/s).
    settling : SettlingOptions, optional
        How long each motion is followed; by default transients of 50 natural periods, at most 80
        of them.
    continuous : bool
        Whether the control acts without sampling (eq. 19).

    Raises
    ------
    InvalidInputError
        If the plan is over other parameters or has a continuation, or no start is valid.
    """
    if set(plan.parameters) != {POSITION, VELOCITY} or plan.continuation:
        raise InvalidInputError(
            f"a basin is over {POSITION} and {VELOCITY}, not {', '.join(plan.parameters)}"
        )
    study = Study(scenario, plan, settling or BASIN_OPTIONS, continuous)
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
    """
    drive = scenario.plant.as_drive()
    if not drive.has_spring:
        raise InvalidInputError(
            "plant.stiffness = 0 N/m: without a spring no range of starts follows from the drive, "
            "so both position and velocity must be given"
        )
    bent = max(drive.friction.limits) * (drive.normal_force / drive.stiffness)
    reach = 2.0 * max(abs(drive.belt_speed) / drive.angular_frequency, bent)
    middle, speed = drive.equilibrium_position, reach * drive.angular_frequency
    return (
        Axis(POSITION, middle - reach, middle + reach, count),
        Axis(VELOCITY, -speed, speed, count),
    )
