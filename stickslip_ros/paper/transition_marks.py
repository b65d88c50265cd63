"""Where theory has the transitions in the paper's bifurcation diagrams."""

from collections.abc import Callable

from stickslip_ros.paper.figures import BifurcationFigure, bifurcation_drive
from stickslip_ros.physics.theory.sticking import Release
from stickslip_ros.studies.settled import ControlledDrive
from stickslip_ros.studies.transitions import (
    HOPF_POINT,
    STICKING_LIMIT,
    hopf_margin,
    sign_changes,
    stick_margin,
)


def transition_marks(figure: BifurcationFigure) -> dict[str, float]:
    """Return the values of the parameter at the transitions that the diagram shows, by name."""
    release = Release()
    margins: dict[str, Callable[[ControlledDrive], float]] = {
        HOPF_POINT: hopf_margin,
        STICKING_LIMIT: lambda case: stick_margin(case, release),
    }
    found: dict[str, float] = {}
    for name, margin in margins.items():

        def at(value: float, margin: Callable[[ControlledDrive], float] = margin) -> float:
            return margin(ControlledDrive(bifurcation_drive(figure.number, value)))

        if values := list(sign_changes(at, figure.values.tolist())):
            found[name] = values[-1]
    return found
