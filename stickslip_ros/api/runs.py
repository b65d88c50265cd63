"""Simulated runs: trajectory and measures of a scenario."""

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property, partial
from math import inf
from typing import Any

import numpy as np
from typing_extensions import override

from stickslip_ros.api.page import Summary
from stickslip_ros.api.results import Drawing, Parts, Table, TabularResult, attributes
from stickslip_ros.api.scenarios import ScenarioLike, as_scenario
from stickslip_ros.measures.cycle_measures import Measures
from stickslip_ros.measures.following import Following, followed
from stickslip_ros.measures.run_meter import RunAnalysis
from stickslip_ros.measures.sample_meter import NOT_JUDGED
from stickslip_ros.model.control import ControlLaw
from stickslip_ros.motion.trajectory import SampleRecorder, Trajectory, TrajectoryRecorder
from stickslip_ros.progress import Progress
from stickslip_ros.quantities import number_of
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.show.measure_table import measure_table, measures_text, why_no_cycle
from stickslip_ros.show.parameter_tables import scenario_tables
from stickslip_ros.show.quantities import Units
from stickslip_ros.show.run_history import DrawnRun, RunHistory
from stickslip_ros.studies import simulate as simulation


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
    notes: Sequence[str]
    """Sentences that say why the measures may be wrong."""
    following: Following | None
    """How the slide follows its reference, of the same positions as `measures`; None without
    one."""
    true_following: Following | None
    """The same of the motion itself, with a sensor."""
    _recorder: SampleRecorder | None
    """What has taken the samples."""
    _history: RunHistory
    """The data of the figure."""

    @cached_property
    def trajectory(self) -> Trajectory:
        """The motion at the samples t = n/rate, as numpy arrays."""
        assert isinstance(self._recorder, TrajectoryRecorder)
        return self._recorder.trajectory()

    @override
    def _drawing(self) -> Drawing:
        from stickslip_ros.show.run_figure import run_figure
        from stickslip_ros.show.style import title_of

        title, plant = title_of("Simulated run", self.scenario), self.scenario.plant
        parts = self._history, self.truth or self.measures, plant.as_drive(), (), title
        drawn = DrawnRun(self.scenario.name, *parts, disturbed=plant.disturbance.kind != "none")
        return partial(run_figure, drawn)

    def _table(self) -> Table:
        columns, recorder = vars(self.trajectory), self._recorder
        time = {"time": self.trajectory.time}
        assert recorder is not None
        quantities, source = recorder.quantities, attributes(self.scenario)
        if self.following is not None:
            columns = {**columns, "reference": recorder.pursuit[1]}
        return Table(columns, quantities, self._units, time, source, "time")

    @property
    def _units(self) -> Units:
        return Units.for_drive(self.scenario.plant.as_drive())

    @override
    def _entries(self) -> dict[str, Any]:
        measured, true = self._following
        truth = None if self.truth is None else {**self.truth.as_dict(), **true}
        values = {**self.measures.as_dict(), **measured, "truth": truth, "duration": self.duration}
        values["notes"] = [*self.notes]
        return {**values, **self.scenario.provenance()}

    @property
    def _following(self) -> list[dict[str, Any]]:
        both = self.following, self.true_following
        return [{} if following is None else asdict(following) for following in both]

    @override
    def _summary(self) -> Summary:
        plant, law = self.scenario.plant, self.scenario.control_law
        _, force = self._history.control.columns()
        forces = (float(np.abs(force).max()), float(force[-1])) if len(force) else (None, None)
        disturbed = plant.disturbance.kind != "none"
        facts = loop_facts(plant, law, *forces, sampled=not self.continuous, disturbed=disturbed)
        verdict = sentence(measures_text(self.measures, self._units))
        parameters = scenario_tables(self.scenario, unused=())
        return Summary("Simulated run", self.scenario.name, verdict, parameters, facts)

    @override
    def parts(self) -> Parts:
        columns, units = {"": self.measures}, self._units
        if self.truth is not None:
            columns = {"measured": self.measures, "true": self.truth}
        runs = zip(columns.items(), self._following, strict=False)
        values = {name: {**run.as_dict(), **follows} for (name, run), follows in runs}
        title = f"{self.scenario.name}, {self.duration:g} {units.of_unit('s')}".rstrip()
        yield measure_table(title, values, dict.fromkeys(values, units))
        regime, drive = (self.truth or self.measures).regime, self.scenario.plant.as_drive()
        reason = why_no_cycle(regime, self.duration, drive)
        yield from [*filter(None, [reason]), *self.notes]


def sentence(measures: str) -> str:
    """Return `measures_text` as a sentence."""
    text = measures.replace("at the end:", "at the end the motion is", 1)
    return f"{text[:1].upper()}{text[1:]}."


def loop_facts(
    plant: PlantParameters,
    law: ControlLaw | None,
    peak: float | None,
    last: float | None,
    *,
    sampled: bool = True,
    disturbed: bool = False,
) -> dict[str, str]:
    """Return what a page says first of a loop: feeds, gains, and forces `peak` and `last`, N.

    The forces of a loop that is `disturbed` are with the disturbance.
    """
    # These take long.
    from stickslip_ros.api.design import gains_text
    from stickslip_ros.theory.stability_map import SEARCHED_FEEDS, stable_feeds

    units = Units.for_drive(plant.as_drive())
    varied = f", with a signal ({plant.belt.kind})" * (plant.belt.kind != "none")
    facts = {"belt speed": units.text(plant.belt_speed, "m/s") + varied}
    ranges = None
    if sampled or law is None:
        ranges = stable_feeds(plant.as_drive(), law, plant.linear_sampling)
    if ranges is not None:
        ends = tuple(share * plant.belt_speed for share in SEARCHED_FEEDS)
        *shown, searched = (
            " to ".join(units.texts(interval, "m/s", 3)) for interval in (*ranges, ends)
        )
        stable = "; ".join(shown) or "none"
        facts["feeds that hold"] = f"{stable} (by linear theory, searched from {searched})"
    facts["control"] = "none" if law is None else f"{law.name}: {gains_text(law, units)}"
    if law is not None and peak is not None:
        most, end = units.texts([peak, last], "N")
        name, limit = "control force", limit_text(law, plant, units)
        if disturbed:
            name, limit = f"{name} and disturbance", ""
        facts[name] = f"at most {most}, {end} at the end{limit}"
    return facts


def limit_text(law: ControlLaw, plant: PlantParameters, units: Units) -> str:
    """Return the limit of a control force, for behind that force; nothing without one."""
    limit = min(law.force_limit, plant.actuator.limit)
    return f"; limit {units.text(limit, 'N')}" if limit < inf else ""


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
    recorder = TrajectoryRecorder(chosen.plant.rate, **simulation.recorded_columns(chosen))
    return measured_run(chosen, length, continuous=continuous, recorder=recorder, progress=progress)


def measured_run(
    scenario: Scenario,
    duration: float,
    *,
    continuous: bool,
    recorder: SampleRecorder | None,
    drawn: bool = True,
    progress: Progress,
) -> Run:
    """Simulate and measure a run (s); a `recorder` takes its samples.

    A run that is not to be `drawn` is simulated faster.
    """
    measured = simulation.sensor_meter(scenario)
    history, columns = RunHistory(), simulation.recorded_columns(scenario)
    pursuer = recorder
    if recorder is None and columns["reference"] is not None:
        pursuer = TrajectoryRecorder(scenario.plant.rate, sys.maxsize, **columns)
    true = simulation.simulate(
        scenario,
        duration,
        continuous=continuous,
        progress=progress,
        observer=history if drawn else None,
        recorder=pursuer,
        measured=measured,
    )
    unit = Units.for_drive(scenario.plant.as_drive()).of_unit("m")
    seen = itself = None
    if pursuer is not None:
        time, reference, *motions = pursuer.pursuit
        itself, seen = (followed(time, reference, motion, unit) for motion in motions)
    history.take_analysis(RunAnalysis(None, None, seen))
    true_measures, notes = None, [NOT_JUDGED] if scenario.reading.varies else []
    if measured is not None:
        true_measures, (true, notes, _) = true, measured.measured(unit)
    notes = [*notes, *(seen.notes if seen else ())]
    following = [None if analysis is None else analysis.values for analysis in (seen, itself)]
    return Run(
        scenario,
        duration,
        continuous,
        true,
        true_measures,
        notes,
        following[0],
        None if true_measures is None else following[1],
        recorder,
        history,
    )
