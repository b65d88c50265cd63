"""Simulated runs: trajectory and measures of a scenario."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from stickslip_ros.api.results import Parts, Quantity, Table, TabularResult, provenance
from stickslip_ros.api.scenarios import ScenarioLike, as_scenario
from stickslip_ros.physics.loop.trajectory import (
    MEASURED,
    QUANTITIES,
    Trajectory,
    TrajectoryRecorder,
)
from stickslip_ros.physics.measures.cycle_measures import Measures
from stickslip_ros.plots.measure_table import simulation_tables
from stickslip_ros.plots.run_history import RunHistory
from stickslip_ros.plots.units import Units
from stickslip_ros.progress import Progress
from stickslip_ros.quantities import number_of
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies import simulate as simulation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip_ros.plots.style import FigureStyle

_COLUMNS = {name: Quantity(*labelled) for name, labelled in {**QUANTITIES, **MEASURED}.items()}


@dataclass(frozen=True, eq=False, repr=False)
class Run(TabularResult):
    """A simulated run; it prints as a table of its measures."""

    scenario: Scenario
    """The scenario that was simulated."""
    duration: float
    """Simulated time, s."""
    continuous: bool
    """Whether the controller acted without sampling."""
    measures: Measures
    """Amplitude, regime and the other measures of the last cycles, as `stickslip simulate` prints
    them; with a sensor, of what it tells."""
    truth: Measures | None
    """With a sensor, the measures of the motion itself; else None."""
    trajectory: Trajectory
    """The motion at the samples t = n/rate, as numpy arrays."""
    _history: RunHistory
    """The data of the figure."""

    def _figure(self, style: "FigureStyle") -> "Figure":
        from stickslip_ros.plots.run_figure import DrawnRun, run_figure

        drawn = DrawnRun.simulated(self.scenario, self._history, self.truth or self.measures)
        return run_figure(drawn, style=style)

    def _table(self) -> Table:
        columns = vars(self.trajectory)
        time = {"time": self.trajectory.time}
        return Table(columns, _COLUMNS, self._units, time, provenance(self.scenario), "time")

    @property
    def _units(self) -> Units:
        return Units.for_drive(self.scenario.plant.as_drive())

    def _parts(self) -> Parts:
        return simulation_tables(self.scenario, self.duration, self.measures, self.truth)


def simulate(
    scenario: ScenarioLike,
    duration: float | str | None = None,
    *,
    continuous: bool = False,
    progress: Progress = lambda _: None,
) -> Run:
    """Simulate a scenario without ROS, and measure its motion.

    Parameters
    ----------
    scenario : Scenario, str or Path
        The scenario, its name or its path.
    duration : float or str, optional
        Simulated time, s. By default this is the scenario's own duration, or 200 natural periods.
        It is needed for a drive without a spring and without a duration.
    continuous : bool
        Let the controller act without sampling, as in the paper's eq. 19. By default its force is
        held from sample to sample, as between the nodes.
    progress : callable, optional
        Receives the share that is done, 0 to 1.

    Returns
    -------
    Run
        Trajectory and measures.

    Raises
    ------
    InvalidInputError
        If the scenario or the duration is not allowed, or if continuous control does not support
        the scenario.

    Examples
    --------
    >>> import stickslip_ros as ss
    >>> run = ss.simulate("paper", duration=100)
    >>> len(run.trajectory), run.measures.regime.value
    (10001, 'pure_slip')
    """
    chosen = as_scenario(scenario)
    given = simulation.default_duration(chosen) if duration is None else duration
    length = number_of("duration", given, "s")
    measured = simulation.sensor_meter(chosen)
    history = RunHistory()
    recorder = TrajectoryRecorder(chosen.plant.rate, measured=measured is not None)
    true = simulation.simulate(
        chosen,
        length,
        continuous=continuous,
        progress=progress,
        observer=history,
        recorder=recorder,
        measured=measured,
    )
    measures, truth = (true, None) if measured is None else (measured.measures(), true)
    return Run(chosen, length, continuous, measures, truth, recorder.trajectory(), history)
