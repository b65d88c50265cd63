"""Bifurcation diagrams: the settled motions from rest of a sequence of drives."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.cycle_measures import Measures
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.progress import Progress
from stickslip_ros.studies.settling import (
    ControlledDrive,
    MotionState,
    Settled,
    SettlingCourse,
    settle,
)

COURSE = SettlingCourse(transient=300.0, cycles=6)
"""Default settling of a bifurcation diagram."""


@dataclass(frozen=True)
class BifurcationDiagram:
    """The settled motions of a sequence of drives, one row each."""

    drives: tuple[Drive, ...]
    """The drive of each row."""
    measures: tuple[Measures, ...]
    """The measures of each row."""
    row: npt.NDArray[np.intp]
    """Row that each turning point belongs to, ascending. A motion that diverges has none."""
    position: FloatArray
    """Displacement of each turning point, m: the Poincare section X' = 0."""


def bifurcation_diagram(
    drives: Sequence[Drive], progress: Progress = lambda _: None, course: SettlingCourse = COURSE
) -> BifurcationDiagram:
    """Return the motion that each drive settles on from rest at X = 0."""
    settled: list[Settled] = []
    for drive in drives:
        settled.append(settle(ControlledDrive(drive), MotionState(0.0, 0.0), course))
        progress(len(settled) / len(drives))
    counts = [len(motion.turning_points) for motion in settled]
    return BifurcationDiagram(
        drives=tuple(drives),
        measures=tuple(motion.measures for motion in settled),
        row=np.repeat(np.arange(len(settled)), counts),
        position=np.concatenate([np.empty(0), *(motion.turning_points for motion in settled)]),
    )
