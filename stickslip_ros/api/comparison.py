"""Comparison of control laws: which one holds the drive, and at what cost."""

import csv
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from typing_extensions import override

from stickslip_ros.api.design import gains, gains_text
from stickslip_ros.api.page import Summary
from stickslip_ros.api.results import Drawing, Parts, Table, TabularResult, attributes, column
from stickslip_ros.api.runs import limit_text
from stickslip_ros.api.scenarios import ScenarioLike, as_scenario
from stickslip_ros.api.studies import Values, axes_of
from stickslip_ros.arrays import FloatArray
from stickslip_ros.progress import Progress
from stickslip_ros.quantities import Quantity
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.scenarios.keywords import keyword_of
from stickslip_ros.show.parameter_tables import scenario_tables
from stickslip_ros.show.quantities import Units
from stickslip_ros.studies.case_outcome import FOLLOWING, OUTCOMES, is_positioning
from stickslip_ros.studies.comparison import (
    DISTURBANCES,
    Comparison,
    Outcomes,
    Rank,
    check_rank,
    compared,
    mean_of_seeds,
    ranked,
)
from stickslip_ros.studies.drive_loops import Tuned, with_law
from stickslip_ros.studies.runner import CountPoints, compute_columns
from stickslip_ros.studies.spread import spread_text
from stickslip_ros.tables import TextTable
from stickslip_ros.theory.linear_sampled_loop import settling_time


@dataclass(frozen=True, eq=False, repr=False)
class ComparedLaws(TabularResult):
    """Outcomes of control laws on one drive; it prints as a ranked table."""

    study: Comparison
    """The scenario and its cases."""
    outcomes: Outcomes
    """Outcome of each case."""
    tuned: Mapping[str, Tuned]
    """Gains that were found, by law; the others were given."""
    rank_by: str | None = None
    """Mean by which the laws are ranked, the smallest first; None: by the rule of `ranks`."""

    @property
    def scenario(self) -> Scenario:
        """The scenario of the drive."""
        return self.study.scenario

    @property
    def scenarios(self) -> dict[str, Scenario]:
        """The scenario of the drive with each law and its gains, by name of the law."""
        laws = self.study.plan.laws
        return {law: with_law(self.scenario, law, constants) for law, constants in laws.items()}

    @cached_property
    def ranks(self) -> tuple[Rank, ...]:
        """The laws, the best first: by cases held, then error, then force beyond the mean.

        By `rank_by` instead, those first of which no case failed.
        """
        return ranked(self.study, self.outcomes, self.rank_by)

    @property
    def verdict(self) -> str:
        """The best law, and all whose intervals of the cases held overlap its."""
        least, first = self.ranks[0].held_interval[0], self.ranks[0]
        if self.rank_by is not None:
            label, unit, _ = OUTCOMES[self.rank_by]
            value = self._units.with_error(*first.means[self.rank_by], unit)
            unknown = [rank.law for rank in self.ranks if np.isnan(rank.means[self.rank_by][0])]
            if len(unknown) == len(self.ranks):
                return f"the {label} is not known of any law"
            others = f"; it is not known of {', '.join(unknown)}" * bool(unknown)
            return f"{first.law} has the least {label}: {value}{others}"
        alike = [rank for rank in self.ranks if rank.held_interval[1] >= least]
        texts = dict.fromkeys(rank.held_text for rank in alike)
        groups = {text: [r.law for r in alike if r.held_text == text] for text in texts}
        laws = "; ".join(
            f"{', '.join(names)} hold{'s' * (len(names) == 1)} {text}"
            for text, names in groups.items()
        )
        return f"{laws} of the cases{': not told apart' if len(alike) > 1 else ''}"

    def held_at_points(self, law: str) -> FloatArray:
        """Return the share of the cases that a law holds, at each point of the parameters.

        Parameters
        ----------
        law : str
            Name of the law.

        Returns
        -------
        ndarray
            Shares, 0 to 1, shape (points,).
        """
        held = self.outcomes.of_law(self.study.plan, law, "held")
        return np.nan_to_num(held).mean(axis=(1, 2))

    def at_points(self, law: str, name: str) -> tuple[FloatArray, FloatArray]:
        """Return the mean of an outcome at each point of the parameters, and its standard error.

        Parameters
        ----------
        law : str
            Name of the law.
        name : str
            Name of a column of `OUTCOMES`.

        Returns
        -------
        tuple of ndarray
            Means and standard errors over the seeds, shape (points,); NaN where there is none.
        """
        values = self.outcomes.of_law(self.study.plan, law, name)[:, np.newaxis]
        mean, error = np.transpose([mean_of_seeds(point) for point in values])
        return mean, error

    @override
    def _drawing(self) -> Drawing:
        from stickslip_ros.show.comparison_figure import comparison_figure

        error, *_ = self.ranks[0].means
        names = [error, "peak_force"]
        if self.rank_by not in (None, *names):
            names.append(self.rank_by)
        values = {
            rank.law: {name: self.at_points(rank.law, name) for name in (*names, "held")}
            for rank in self.ranks
        }
        return partial(comparison_figure, self.study, values, names)

    @property
    def _columns(self) -> dict[str, Any]:
        """Columns of all cases by name, those of the plan first."""
        plan = self.study.plan
        cases = [plan.case(number) for number in range(plan.size)]
        laws, texts = [*plan.laws], [str(disturbance) for disturbance in plan.disturbances]
        columns: dict[str, Any] = {"law": [laws[case.law] for case in cases]}
        if plan.grid is not None:
            values = [plan.grid.values(case.point) for case in cases]
            columns |= dict(zip(plan.parameters, zip(*values, strict=True), strict=True))
        columns["disturbance"] = [texts[case.disturbance] for case in cases]
        columns["seed"] = [case.seed for case in cases]
        for name in OUTCOMES:
            columns[name] = [getattr(row, name) for row in self.outcomes.rows]
        return columns

    def write_csv(self, stream: TextIO) -> None:
        """Write a row for each case.

        Parameters
        ----------
        stream : TextIO
            Where it is written.
        """
        columns = self._columns
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))

    @override
    def _table(self) -> Table:
        quantities: dict[str, Quantity] = {"law": Quantity("control law")}
        columns: dict[str, Any] = {}
        for name, values in self._columns.items():
            quantity = OUTCOMES.get(name)
            if name in self.study.plan.parameters:
                name, quantity = keyword_of(name), Quantity(keyword_of(name))
            columns[name] = column(values, text=name == "reason")
            quantities[name] = quantity or Quantity(name)
        drive = self.scenario.plant.as_drive()
        dimensions = {"case": range(self.study.plan.size)}
        source = attributes(self.scenario)
        return Table(columns, quantities, Units.for_drive(drive), dimensions, source)

    @override
    def _entries(self) -> dict[str, Any]:
        plan = self.study.plan
        ranked = [
            {
                "law": rank.law,
                "held": rank.held,
                "held_error": rank.held_error,
                "held_interval": [*rank.held_interval],
                **{name: mean for name, (mean, _) in rank.means.items()},
                **{f"{name}_error": error for name, (_, error) in rank.means.items()},
                "delay_margin": getattr(self.tuned.get(rank.law), "delay_margin", None),
                "at_limit": rank.at_limit,
                "failures": rank.failures,
                "constants": dict(plan.laws[rank.law]),
                "gains": gains(self.scenarios[rank.law].controller.control_law),
                "remark": getattr(self.tuned.get(rank.law), "remark", None),
            }
            for rank in self.ranks
        ]
        return {
            **self.scenario.provenance(),
            "task": self._task,
            "duration": plan.duration,
            "tolerance": plan.tolerance,
            "spread": plan.spread,
            "rank_by": self.rank_by,
            "ranks": ranked,
            "cases": self._columns,
        }

    @property
    def _units(self) -> Units:
        return Units.for_drive(self.scenario.plant.as_drive(), self.study.plan.parameters)

    @property
    def _task(self) -> str:
        return "positioning" if is_positioning(self.scenario) else "regulation"

    @override
    def parts(self) -> Parts:
        plan, units, means = self.study.plan, self._units, self.ranks[0].means
        known = {n for n in means for rank in self.ranks if np.isfinite(rank.means[n][0])}
        left_out = {*FOLLOWING} - known
        if "reversal_height" in known:  # the reference does not come to rest
            left_out |= {"settling_time", "hunting_amplitude"}
        names = [n for n in means if n not in left_out]
        laws, points, disturbances, seeds = plan.shape
        rows: list[list[str]] = []
        for rank in self.ranks:
            tuned = self.tuned.get(rank.law)
            margin = "given" if tuned is None else units.text(tuned.delay_margin, "s")
            texts = [units.with_error(*rank.means[name], OUTCOMES[name].unit) for name in names]
            rows.append([rank.law, rank.held_text, *texts, margin, f"{rank.at_limit:.1%}"])
        where = "of the belt speed" if self._task == "regulation" else "of the reference's motion"
        yield self.verdict
        title = (
            f"{self.scenario.name}, {self._task}: points {points}, disturbances {disturbances}, "
            f"seeds {seeds}, constants {spread_text(plan.spread)}; held within "
            f"{plan.tolerance:.2g} {where}"
        )
        labels = [OUTCOMES[name].label for name in names]
        headings = ["law", "held", *labels, "delay margin", "at the limit"]
        yield TextTable(title, headings, rows)
        yield f"disturbances: {', '.join(map(str, plan.disturbances))}"
        for law, tuned in self.tuned.items():
            remark = f"; {tuned.remark}" if tuned.remark else ""
            settles = settling_time(tuned.decay_rate)
            if remark and settles is not None and settles > plan.duration:
                remark += f"; these settle in {units.text(settles, 's')}, longer than a case lasts"
            yield f"{law}: {gains_text(tuned.law, units)}{remark}"
        for rank in self.ranks:
            if rank.failures:
                failed = f"{rank.failures} of {plan.size // laws} cases failed"
                yield f"{rank.law}: {failed}: {'; '.join(rank.reasons[:3])}"

    @override
    def _summary(self) -> Summary:
        plan, controller = self.study.plan, self.scenario.controller
        given = controller.law in plan.laws and controller.law not in self.tuned
        unused = [*plan.parameters, *[controller.node] * (not given)]
        parameters = scenario_tables(self.scenario, unused=unused)
        title = "Comparison of control laws"
        return Summary(title, self.scenario.name, self.verdict, parameters, self._facts())

    def _facts(self) -> dict[str, str]:
        """Return what a page says first: what the best law holds, its gains and its force."""
        plan, best, grid = self.study.plan, self.ranks[0], self.study.plan.grid
        plant, law = self.scenario.plant, self.scenarios[best.law].controller.control_law
        units = self._units
        facts, texts = {"best law": best.law}, [units.text(plant.belt_speed, "m/s")]
        if grid is not None:
            rows = [zip(grid.values(point), grid.axes, strict=True) for point in range(grid.size)]
            texts = [", ".join(units.text(value, axis.unit) for value, axis in row) for row in rows]
        held = [texts[point] for point in np.flatnonzero(self.held_at_points(best.law) == 1.0)]
        name = "points" if {*plan.parameters} - {"plant.belt_speed"} else "feeds"
        shown = f"{held[0]} to {held[-1]}" if 2 < len(held) == len(texts) else ", ".join(held)
        count = f"in every case; {len(held)} of {len(texts)}"
        facts[f"{name} that hold"] = f"{shown or 'none'} ({count})"
        peak = units.with_error(*best.means["peak_force"], OUTCOMES["peak_force"].unit)
        allowed = limit_text(law, plant, units)
        return facts | {"gains": gains_text(law, units), "mean peak force": peak + allowed}


def compare(
    scenario: ScenarioLike,
    controllers: str | Sequence[str],
    /,
    *axes: str,
    disturbances: str | Sequence[str] = DISTURBANCES,
    given: str | Sequence[str] = (),
    seeds: int = 1,
    spread: float | str = 0.0,
    duration: float = 6.0,
    tolerance: float | None = None,
    rank_by: str | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    journal: Path | None = None,
    progress: CountPoints = lambda _: None,
    tuning_progress: Progress = lambda _: None,
    **parameters: Values | list[Any] | FloatArray,
) -> ComparedLaws:
    """Compare control laws on one drive: which holds it, how well, and with what force.

    The gains of each law are tuned by one rule, or given. Each law meets the same disturbances, the
    same noise and the same drives.

    Parameters
    ----------
    scenario : Scenario, str or Path
        The scenario, its name or its path. With a moving belt the task is regulation: hold the
        slide still. With the belt at rest it is positioning at the scenario's reference.
    controllers : str or sequence of str
        Names of control laws, as a list or a text separated by commas.
    *axes : str
        Texts NODE.PARAMETER=A:B:COUNT, as in `sweep`.
    disturbances : str or sequence of str
        `none`, `step`, `impulse` and `sine`, also with an amplitude, as in `sine=300N@8Hz`.
    given : str or sequence of str
        Laws whose constants are those of the scenario, without tuning.
    seeds : int
        Number of seeds of the noise of the sensor and of the constants of the drive.
    spread : float or str
        Largest deviation of the constants of the drive, as a share, or `"fit"`: as the fit that
        wrote the scenario leaves them open.
    duration : float
        Duration of a case, s.
    tolerance : float, optional
        What a law that holds may leave: share of the belt speed (0.05), or of the reference's
        motion (0.001).
    rank_by : str, optional
        Column of means by which the laws are ranked, the smallest first, such as `peak_force` or,
        of positioning, `reversal_height`. By default they are ranked by the cases held, then the
        error, then the force beyond the mean.
    workers, executor, journal, progress
        As for `sweep`.
    tuning_progress : callable
        Receives the share of the laws whose gains are found, 0 to 1.
    **parameters
        As for `sweep`, such as `belt_speed=(0.002, 0.03, 4)`.

    Returns
    -------
    ComparedLaws
        The outcomes of all cases, and the ranked table.

    Raises
    ------
    InvalidInputError
        If an argument is not allowed, or a law has no gains that make all loops stable.
    RunError
        If worker processes keep dying.

    Examples
    --------
    >>> import stickslip_ros as ss
    >>> drive = ss.scenario("feed_drive", controller="velocity_feedback", velocity_gain=-3000.0)
    >>> laws = "velocity_feedback,washout"
    >>> ranking = ss.compare(drive, laws, disturbances="step", given=laws, duration=1.0)
    >>> [(rank.law, rank.held) for rank in ranking.ranks]
    [('velocity_feedback', 1.0), ('washout', 1.0)]
    """
    chosen = as_scenario(scenario)
    check_rank(rank_by, chosen)
    study, tuned = compared(
        chosen,
        controllers,
        axes_of(chosen, axes, parameters),
        disturbances=disturbances,
        given=given,
        seeds=seeds,
        spread=spread,
        duration=duration,
        tolerance=tolerance,
        progress=tuning_progress,
    )
    outcomes = compute_columns(
        study,
        workers=workers,
        executor=executor,
        path=journal,
        progress=progress,
        columns=Outcomes(study.plan.size),
    )
    return ComparedLaws(study, outcomes, tuned, rank_by)
