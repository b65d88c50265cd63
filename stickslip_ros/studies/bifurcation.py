"""Bifurcation diagrams: what a drive's motion from rest settles on, for one drive after another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stickslip_ros.physics.drive import Drive
from stickslip_ros.physics.knots import FloatArray
from stickslip_ros.physics.measures import Measures
from stickslip_ros.physics.simulation import Progress
from stickslip_ros.studies.settled import Case, Settled, Settler, State

TRANSIENT_PERIODS, MEASURED_PERIODS = 300.0, 6.0
"""Natural periods from rest that are passed over, and that are looked at then."""


@dataclass(frozen=True)
class BifurcationDiagram:
    """The settled motions of a sequence of drives, one row each."""

    drives: tuple[Drive, ...]
    """The drive of each row."""
    measures: tuple[Measures, ...]
    """The measures of each row."""
    row: npt.NDArray[np.intp]
    """Row that each turning point belongs to, ascending. A motion that runs away has none."""
    position: FloatArray
    """Displacement of each turning point, m: the Poincare section X' = 0."""


def bifurcation_diagram(
    drives: Sequence[Drive],
    progress: Progress = lambda _: None,
    *,
    transient_periods: float = TRANSIENT_PERIODS,
    measured_periods: float = MEASURED_PERIODS,
) -> BifurcationDiagram:
    """Return what each drive settles on from rest at X = 0.

    The periods are natural ones of the respective drive.
    """
    settler = Settler()
    settled: list[Settled] = []
    for drive in drives:
        period = drive.natural_period
        times = transient_periods * period, measured_periods * period
        settled.append(settler.settle(Case(drive), State(0.0, 0.0), *times))
        progress(len(settled) / len(drives))
    counts = [len(motion.turning_points) for motion in settled]
    return BifurcationDiagram(
        drives=tuple(drives),
        measures=tuple(motion.measures for motion in settled),
        row=np.repeat(np.arange(len(settled)), counts),
        position=np.concatenate([np.empty(0), *(motion.turning_points for motion in settled)]),
    )
