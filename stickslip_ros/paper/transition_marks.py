"""What theory adds to the paper's bifurcation diagrams: transitions and unstable equilibria."""

from collections.abc import Callable

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.paper.figures import BifurcationFigure, bifurcation_drive
from stickslip_ros.studies.settling import ControlledDrive
from stickslip_ros.studies.transitions import (
    HOPF_POINT,
    STICKING_LIMIT,
    hopf_margin,
    sign_changes,
    stick_margin,
)


def transition_marks(figure: BifurcationFigure) -> dict[str, float]:
    """Return the values of the parameter at the transitions that the diagram shows, by name."""

    def case(value: float) -> ControlledDrive:
        return ControlledDrive(bifurcation_drive(figure.number, value))

    margins: dict[str, Callable[[float], float]] = {
        HOPF_POINT: lambda value: hopf_margin(case(value)),
        STICKING_LIMIT: lambda value: stick_margin(case(value)),
    }
    found: dict[str, float] = {}
    for name, margin in margins.items():
        if values := list(sign_changes(margin, figure.values.tolist())):
            found[name] = values[-1]
    return found


def unstable_equilibria(figure: BifurcationFigure) -> FloatArray:
    """Return the displacement of the unstable equilibrium for each drive, NaN if it is stable."""
    return np.array(
        [
            drive.equilibrium_position if hopf_margin(ControlledDrive(drive)) < 0.0 else np.nan
            for drive in figure.diagram.drives
        ]
    )
