"""Where theory has the transitions in the paper's bifurcation diagrams."""

from collections.abc import Callable
from itertools import pairwise

from stickslip_ros.physics.drive import Drive
from stickslip_ros.physics.measures import Regime
from stickslip_ros.physics.theory.linear import expand, hurwitz_determinants
from stickslip_ros.physics.theory.roots import zero_between
from stickslip_ros.physics.theory.sticking import sticking_onset
from stickslip_ros.studies.paper.figures import BifurcationFigure, bifurcation_drive


def marks(figure: BifurcationFigure) -> dict[str, float]:
    """Return the values of the parameter at the transitions that the diagram shows, by name."""
    margins: dict[str, Callable[[Drive], float]] = {
        "Hopf point": _hopf_margin,
        "onset of sticking": _sticking_margin,
    }
    sticking = [measures.regime is Regime.STICK_SLIP for measures in figure.diagram.measures]
    stable = [_hopf_margin(drive) > 0.0 for drive in figure.diagram.drives]
    found: dict[str, float] = {}
    for (name, margin), changed in zip(margins.items(), (stable, sticking), strict=True):
        ends = zip(pairwise(figure.values.tolist()), pairwise(changed), strict=True)
        for (low, high), (before, after) in ends:

            def at(value: float, margin: Callable[[Drive], float] = margin) -> float:
                return margin(bifurcation_drive(figure.number, value))

            if before != after and at(low) * at(high) < 0.0:
                found[name] = zero_between(at, low, high)
    return found


def _hopf_margin(drive: Drive) -> float:
    """Return what is above zero where the equilibrium is stable; zero on a belt at rest."""
    expansion = expand(drive)
    return 0.0 if expansion is None else float(hurwitz_determinants(expansion.jacobian)[-1])


def _sticking_margin(drive: Drive) -> float:
    """Return by how much (m/s) the belt is faster than at the onset of sticking."""
    onset = sticking_onset(drive).exact
    return abs(drive.belt_speed) - (onset or 0.0)
