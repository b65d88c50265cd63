"""Figure of a simulated run."""

from matplotlib.figure import Figure

from stickslip_ros.physics.measures.cycle_measures import Measures
from stickslip_ros.physics.model.disturbance import DisturbanceKind
from stickslip_ros.plots.run_figure import run_figure
from stickslip_ros.plots.run_history import RunHistory
from stickslip_ros.scenarios.files import Scenario


def simulated_run_figure(scenario: Scenario, history: RunHistory, measures: Measures) -> Figure:
    """Return the figure of a simulated run of a scenario."""
    disturbed = scenario.plant.disturbance.kind is not DisturbanceKind.NONE
    title = " ".join([scenario.name, *scenario.overrides])
    force = "control force and disturbance" if disturbed else "control force"
    return run_figure(history, measures, scenario.plant.as_drive(), title=title, force=force)
