"""Bifurcation diagrams: what a drive's motion from rest settles on, for one drive after another."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stickslip_ros.physics.drive import Drive
from stickslip_ros.physics.knots import FloatArray
from stickslip_ros.physics.measures import CycleMeter, Measures, Regime
from stickslip_ros.physics.motion import Motion
from stickslip_ros.physics.simulation import Progress

TRANSIENT_PERIODS, MEASURED_PERIODS = 300.0, 6.0
"""Natural periods from rest that are passed over, and that are looked at then."""


class SettledMotion(NamedTuple):
    """What is left of a motion from rest after a transient."""

    turning_points: FloatArray
    """Displacements at which the velocity is zero, m; in equilibrium the one place of rest."""
    measures: Measures


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
    settled: list[SettledMotion] = []
    for motion in settled_motions(drives, transient_periods, measured_periods):
        settled.append(motion)
        progress(len(settled) / len(drives))
    counts = [len(motion.turning_points) for motion in settled]
    return BifurcationDiagram(
        drives=tuple(drives),
        measures=tuple(motion.measures for motion in settled),
        row=np.repeat(np.arange(len(settled)), counts),
        position=np.concatenate([np.empty(0), *(motion.turning_points for motion in settled)]),
    )


def settled_motions(
    drives: Iterable[Drive],
    transient_periods: float = TRANSIENT_PERIODS,
    measured_periods: float = MEASURED_PERIODS,
) -> Iterator[SettledMotion]:
    """Yield what each drive settles on from rest at X = 0, one after the other.

    Integrators are compiled anew only where the friction law becomes another one.
    """
    motions: tuple[Motion, Motion] | None = None
    for drive in drives:
        if motions is None:
            # Marking the knots costs more than the motion itself: the transient goes without.
            motions = Motion(drive, 0.0, 0.0), Motion(drive, 0.0, 0.0, record=True)
        transient, recorder = motions
        transient.drive = recorder.drive = drive
        transient.restart(0.0, 0.0)
        transient.advance(transient_periods * drive.natural_period)
        meter = CycleMeter(window=int(measured_periods) + 1)
        turning_points = np.empty(0)
        if not transient.unbounded:
            recorder.take_knots()
            recorder.restart(transient.position, transient.velocity)
            recorder.advance(measured_periods * drive.natural_period)
            knots = recorder.take_knots()
            meter.feed(knots, drive.belt_speed)
            turning_points = knots.position[knots.velocity == 0.0]
        if transient.unbounded or recorder.unbounded:
            meter.report_run_away()
        measures = meter.measures()
        if measures.regime is Regime.UNBOUNDED:
            turning_points = np.empty(0)
        elif measures.regime is Regime.EQUILIBRIUM:
            turning_points = np.array([measures.midpoint])
        yield SettledMotion(turning_points, measures)
