"""Sweeps: the settled motion of a scenario over the values of one or two parameters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.measures.cycle_measures import Measures
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.progress import Progress
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.plan import Axis, Continuation, Grid
from stickslip_ros.studies.settling import (
    ControlledDrive,
    MotionState,
    Settled,
    SettlingOptions,
    settle,
)
from stickslip_ros.studies.study import Study

DIAGRAM_OPTIONS = SettlingOptions(transient=300.0, cycles=6)
"""Default settling of a bifurcation diagram."""


def sweep_study(
    scenario: Scenario,
    axes: Sequence[Axis],
    *,
    continuation: Continuation | None = None,
    course: SettlingOptions | None = None,
    continuous: bool = False,
) -> Study:
    """Return the study of a scenario over the values of one or two parameters.

    Compute it with `compute_columns` or `run`. For a sweep without control, set
    `plant.expects_control` to false in the scenario.

    Parameters
    ----------
    scenario : Scenario
        The scenario; it supplies all other parameters.
    axes : Sequence[Axis]
        One or two axes; the study has every combination of their values.
    continuation : Continuation, optional
        Direction along the last axis in which each point starts from the end of its neighbour. By
        default every point starts in the scenario's initial state.
    course : SettlingOptions, optional
        How long each motion is simulated; by default a transient of 200 natural periods, then 4
        cycles.
    continuous : bool
        Whether the control acts without sampling (eq. 19).

    Returns
    -------
    Study
        The study, ready to be computed.

    Raises
    ------
    InvalidInputError
        If there are not one or two axes, an axis is of a controller that the scenario does not
        have, or no point is valid.

    Examples
    --------
    >>> from stickslip_ros.scenarios.files import load_scenario
    >>> from stickslip_ros.studies.plan import Axis
    >>> study = sweep_study(load_scenario("paper"), [Axis("plant.belt_speed", 0.1, 0.5, 5)])
    >>> study.plan.size
    5
    """
    if not 1 <= len(axes) <= 2:
        raise InvalidInputError(f"{len(axes)} parameters: a sweep is over one or two")
    without = [axis for axis in axes if not axis.parameter.startswith("plant.")]
    if without and not scenario.plant.expects_control:
        raise InvalidInputError(f"{without[0]}: without control there is no controller")
    study = Study(
        scenario, Grid(tuple(axes), continuation), course or SettlingOptions(), continuous
    )
    study.check()
    return study


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
    drives: Sequence[Drive],
    progress: Progress = lambda _: None,
    course: SettlingOptions = DIAGRAM_OPTIONS,
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
