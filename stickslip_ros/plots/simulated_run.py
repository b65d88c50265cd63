"""Figure of a simulated run."""

from matplotlib.figure import Figure

from stickslip_ros.physics.measures.cycle_measures import Measures
from stickslip_ros.physics.model.disturbance import DisturbanceKind
from stickslip_ros.plots.run_figure import run_figure
from stickslip_ros.plots.run_history import RunHistory
from stickslip_ros.plots.style import SCREEN, FigureStyle
from stickslip_ros.plots.titles import title_of
from stickslip_ros.scenarios.files import Scenario


def simulated_run_figure(
    scenario: Scenario, history: RunHistory, measures: Measures, *, style: FigureStyle = SCREEN
) -> Figure:
    """Return the figure of a simulated run of a scenario."""
    disturbed = scenario.plant.disturbance.kind is not DisturbanceKind.NONE
    title = title_of("Simulated run", scenario)
    force = "control force and disturbance" if disturbed else "control force"
    drive = scenario.plant.as_drive()
    return run_figure(history, measures, drive, title=title, force=force, style=style)
