"""Figure of the stability of a scenario: a map of the gains, or a bifurcation diagram."""

from matplotlib.figure import Figure

from stickslip_ros.plots.branches_figure import branches_figure
from stickslip_ros.plots.stability_map import stability_figure
from stickslip_ros.plots.style import SCREEN, FigureStyle
from stickslip_ros.plots.titles import title_of
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.stability import bifurcation_branches, stability_map


def scenario_stability_figure(scenario: Scenario, *, style: FigureStyle = SCREEN) -> Figure:
    """Return the map of a scenario with control, the bifurcation diagram of one without.

    Call it only if `why_no_figure` returns None.
    """
    if scenario.control_law is None:
        title = title_of("Bifurcation diagram", scenario, ["plant.belt_speed"])
        return branches_figure(bifurcation_branches(scenario), title=title, style=style)
    title = title_of("Stability of the sampled loop", scenario)
    return stability_figure(*stability_map(scenario), title=title, style=style)
