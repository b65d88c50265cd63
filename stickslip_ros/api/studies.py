"""Studies: sweeps over parameters, and basins of attraction."""

from abc import abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np
from typing_extensions import override

from stickslip_ros.api.page import Summary
from stickslip_ros.api.results import Drawing, Parts, Table, TabularResult, attributes
from stickslip_ros.api.scenarios import ScenarioLike, as_scenario
from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.quantities import Quantity, number_of
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.scenarios.keywords import described, keyword_of, parameter_of
from stickslip_ros.show.parameter_tables import scenario_tables
from stickslip_ros.show.quantities import FURTHER
from stickslip_ros.show.study_tables import attractor_name, basin_table, sweep_table, units_of
from stickslip_ros.studies import transitions as theory
from stickslip_ros.studies.basin import (
    POSITION,
    VELOCITY,
    Attractor,
    Basins,
    basin_study,
    default_axes,
)
from stickslip_ros.studies.columns import COLUMNS, Columns, json_entries, write_csv
from stickslip_ros.studies.options import BASIN_COUNT, BASIN_OPTIONS
from stickslip_ros.studies.plan import Axis, Continuation, Grid, ListedAxis, RandomSample
from stickslip_ros.studies.runner import CountPoints, compute_columns
from stickslip_ros.studies.settling import SettlingOptions
from stickslip_ros.studies.study import Study, sweep_study
from stickslip_ros.text import shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Values = tuple[float | str, float | str, int] | tuple[float | str, float | str, int, str]
"""First and last value, how many, and optionally "log"."""


@dataclass(frozen=True, eq=False, repr=False)
class Points(TabularResult):
    """The points of a study as columns."""

    study: Study
    """The scenario, its points, and how long each motion was simulated."""
    columns: Columns
    """The result of each point, as numpy arrays."""

    @property
    def scenario(self) -> Scenario:
        """The scenario that was varied."""
        return self.study.scenario

    @property
    @abstractmethod
    def further(self) -> Mapping[str, Any]:
        """Further columns of a table: an array of a value for each point, by name."""

    @abstractmethod
    def _results(self) -> dict[str, Any]:
        """Return what belongs to all points together, for JSON."""

    def write_csv(self, stream: TextIO) -> None:
        """Write a row for each point.

        Parameters
        ----------
        stream : TextIO
            Where it is written.
        """
        write_csv(stream, self.columns, self.further)

    @override
    def _entries(self) -> dict[str, Any]:
        studied = self.study.as_dict()
        studied.pop("scenario")
        columns = json_entries(self.columns, self.further)
        return {**self.scenario.provenance(), **self._results(), **studied, **columns}

    def _table(self) -> Table:
        columns, plan = self.columns, self.study.plan
        names = [keyword_of(parameter) for parameter in plan.parameters]
        cells: dict[str, Any] = dict(zip(names, columns.values.values(), strict=True))
        quantities = dict(zip(names, map(_of_parameter, plan.parameters), strict=True))
        dimensions: dict[str, Any] = {"point": range(plan.size)}
        if isinstance(plan, Grid):
            values = (axis.values() for axis in plan.axes)
            dimensions = dict(zip(names, values, strict=True))
            if plan.continuation:
                dimensions = {"direction": [*map(str, plan.directions)], **dimensions}
        cells |= {**self.further, **{name: getattr(columns, name) for name in COLUMNS}}
        cells["regime"] = np.array([kind and str(kind) for kind in columns.regime], dtype=object)
        quantities |= {name: FURTHER[name] for name in self.further} | COLUMNS
        units = units_of(self.study)
        return Table(cells, quantities, units, dimensions, attributes(self.scenario))


class Sweep(Points):
    """Settled motions over one or two parameters; it prints as a table of regimes."""

    @cached_property
    def transitions(self) -> Mapping[str, list[float]]:
        """Values at the Hopf bifurcation and the stick-slip onset, by theory; SI units.

        A sweep over two parameters has none here: its figure shows them as curves.
        """
        axis, *others = self._axes
        return {} if others else theory.transitions(self.study, axis)

    @property
    def _axes(self) -> tuple[Axis, ...]:
        plan = self.study.plan
        assert isinstance(plan, Grid)
        return plan.axes

    def plot(self, colour: str = "regime", *, style: str = "screen") -> "Figure":
        """Return the figure that `stickslip sweep --plot` draws.

        Parameters
        ----------
        colour : str
            What colours the cells of a map (over two parameters): "regime", or a measure of
            `columns` that is a number, such as "amplitude". The diagram of one parameter takes
            "regime" only.
        style : {"screen", "paper", "paper-double"}
            What the figure is for: a screen, or one column or two of a journal.

        Returns
        -------
        matplotlib.figure.Figure
            The bifurcation diagram over one parameter, or the map over two.

        Raises
        ------
        InvalidInputError
            If `colour` is unknown, or given for a sweep over one parameter, or `style` is unknown.
        """
        return self._drawn(style, colour=colour)

    @property
    @override
    def further(self) -> Mapping[str, Any]:
        """The direction in which each point is carried on, if any."""
        plan = self.study.plan
        assert isinstance(plan, Grid)
        if not plan.continuation:
            return {}
        ways = np.array([*map(str, plan.directions)], dtype=object)
        return {"direction": np.repeat(ways, plan.size // len(ways))}

    def _results(self) -> dict[str, Any]:
        speeds = self.transitions.items()
        return {"transitions": {name.lower().replace(" ", "_"): values for name, values in speeds}}

    @override
    def _drawing(self, colour: str = "regime") -> Drawing:
        from stickslip_ros.show.study_figure import sweep_figure

        return partial(sweep_figure, self.columns, self.study, colour)

    @override
    def _summary(self) -> Summary:
        counts = Counter(map(Regime.label, self.columns.regime))
        verdict = ", ".join(f"{regime} at {count}" for regime, count in counts.items())
        return Summary(
            f"Sweep over {' and '.join(self.study.plan.parameters)}",
            self.scenario.name,
            f"{verdict} of {self.study.plan.size} points",
            scenario_tables(self.scenario, unused=self.study.plan.parameters),
        )

    @override
    def parts(self) -> Parts:
        yield sweep_table(self.study, self.columns)
        units = units_of(self.study)
        for name, values in self.transitions.items():
            label = theory.transition_label(name, self._axes[0].parameter)
            yield f"{label}: {', '.join(units.texts(values, self._axes[0].unit))}"


class Basin(Points):
    """The motion that each start leads to; it prints as a table of these motions."""

    @cached_property
    def basins(self) -> Basins:
        """The motions, with the number and the share of the starts that lead to each."""
        return Basins.from_columns(self.columns)

    @property
    def attractors(self) -> tuple[Attractor, ...]:
        """The motions that the starts lead to, the one with most starts first."""
        return self.basins.attractors

    @property
    @override
    def further(self) -> Mapping[str, Any]:
        """The place in the attractors of each start."""
        return {"attractor": self.basins.places}

    def _results(self) -> dict[str, Any]:
        return {"attractors": [asdict(attractor) for attractor in self.attractors]}

    @override
    def _drawing(self) -> Drawing:
        from stickslip_ros.show.study_figure import basin_figure

        return partial(basin_figure, self.columns, self.basins, self.study)

    @override
    def _summary(self) -> Summary:
        shares = [f"{attractor_name(motion)} {motion.share:.1%}" for motion in self.attractors]
        parameters = scenario_tables(self.scenario, unused=self.study.plan.parameters)
        title = "Basins of attraction"
        return Summary(title, self.scenario.name, ", ".join(shares), parameters)

    @override
    def parts(self) -> Parts:
        yield basin_table(self.study, self.basins)


def sweep(
    scenario: ScenarioLike,
    /,
    *axes: str,
    carry: str | None = None,
    continuous: bool = False,
    transient: float | None = None,
    cycles: int | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    journal: Path | None = None,
    progress: CountPoints = lambda _: None,
    **parameters: Values | list[Any] | FloatArray,
) -> Sweep:
    """Measure the settled motion of a scenario over the values of one or two parameters.

    Parameters
    ----------
    scenario : Scenario, str or Path
        The scenario, its name or its path.
    *axes : str
        Texts NODE.PARAMETER=A:B:COUNT or NODE.PARAMETER=A:B:COUNT:log, as after `--over` on the
        command line.
    carry : {"up", "down", "both"}, optional
        Begin each point where its neighbour along the last parameter ended, which shows
        hysteresis. By default every point begins in the scenario's initial state.
    continuous : bool
        Let the controller act without sampling, which takes a fraction of the time.
    transient : float, optional
        Natural periods before the measurement at each point (200).
    cycles : int, optional
        Whole cycles to measure (4).
    workers : int
        Processes that share the points. With more than one a script needs
        `if __name__ == "__main__":`.
    executor : concurrent.futures.Executor, optional
        Computes the points instead, on a cluster for example.
    journal : Path, optional
        File from which a sweep that was interrupted continues.
    progress : callable, optional
        Receives the number of points that are done.
    **parameters : tuple, list or ndarray
        `(first, last, count)` or `(first, last, count, "log")` by keyword as for `scenario`, SI
        units or texts with a unit, ends included; or a list or an array that rises or falls.

    Returns
    -------
    Sweep
        The points as columns, with the figure and the tables made from them.

    Raises
    ------
    InvalidInputError
        If an argument is not allowed.
    RunError
        If worker processes keep dying.

    Examples
    --------
    >>> import stickslip_ros as ss
    >>> diagram = ss.sweep(ss.scenario("paper", expects_control=False), belt_speed=(0.40, 0.48, 9))
    >>> [regime.value for regime in diagram.columns.regime[[0, -1]]]
    ['stick_slip', 'pure_slip']
    """
    if carry is not None and carry not in list(Continuation):
        raise InvalidInputError(f"carry = {shown(carry)} is invalid: must be up, down or both")
    chosen = as_scenario(scenario)
    study = sweep_study(
        chosen,
        axes_of(chosen, axes, parameters),
        continuation=None if carry is None else Continuation(carry),
        settling=_settling(SettlingOptions(), transient, cycles),
        continuous=continuous,
    )
    columns = compute_columns(
        study, workers=workers, executor=executor, path=journal, progress=progress
    )
    return Sweep(study, columns)


def basin(
    scenario: ScenarioLike,
    /,
    *,
    position: Values | tuple[float | str, float | str] | None = None,
    velocity: Values | tuple[float | str, float | str] | None = None,
    sample: int | None = None,
    seed: int = 0,
    continuous: bool = False,
    transient: float | None = None,
    cycles: int | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    journal: Path | None = None,
    progress: CountPoints = lambda _: None,
) -> Basin:
    """Find the motion that each start leads to, and the share of the starts of each motion.

    Parameters
    ----------
    scenario : Scenario, str or Path
        The scenario, its name or its path.
    position, velocity : tuple, optional
        `(first, last, count)` of the starts, m and m/s; of a sample `(first, last)` is enough. By
        default 40 each, about twice as far to either side as a vibration goes.
    sample : int, optional
        Number of random starts, uniformly distributed between the ends of position and velocity,
        instead of the grid.
    seed : int
        Which sample it is, 0 or more.
    continuous, transient, cycles, workers, executor, journal, progress
        As for `sweep`. The transient is 50 natural periods and is repeated until the motion is
        steady.

    Returns
    -------
    Basin
        The starts as columns, and the motions that they lead to.

    Raises
    ------
    InvalidInputError
        If an argument is not allowed.
    RunError
        If worker processes keep dying.

    Examples
    --------
    >>> import stickslip_ros as ss
    >>> drive = ss.scenario("paper", expects_control=False, belt_speed=0.46)
    >>> [attractor.share for attractor in ss.basin(drive, sample=20, seed=1).attractors]
    [1.0]
    """
    chosen = as_scenario(scenario)
    axes: list[Axis] = []
    starts: list[tuple[str, str, Any]] = [
        ("position", POSITION, position),
        ("velocity", VELOCITY, velocity),
    ]
    for place, (name, parameter, given) in enumerate(starts):
        if given is None:
            axes.append(default_axes(chosen, BASIN_COUNT)[place])
            continue
        ends = sample is not None and isinstance(given, tuple) and len(given) == 2
        axes.append(axis_of(name, parameter, (*given, 2) if ends else given))
    plan = Grid(tuple(axes)) if sample is None else RandomSample(tuple(axes), sample, seed)
    settling = _settling(BASIN_OPTIONS, transient, cycles)
    study = basin_study(chosen, plan, settling=settling, continuous=continuous)
    columns = compute_columns(
        study, workers=workers, executor=executor, path=journal, progress=progress
    )
    return Basin(study, columns)


def axes_of(scenario: Scenario, texts: Sequence[str], given: Mapping[str, Any]) -> list[Axis]:
    """Return the axes that are given as texts and by keyword."""
    parameters = {keyword: parameter_of(keyword, scenario.nodes) for keyword in given}
    named = (axis_of(name, parameters[name], given[name], listed=True) for name in given)
    return [*map(Axis.parse, texts), *named]


def axis_of(name: str, parameter: str, given: Any, *, listed: bool = False) -> Axis:
    """Return the axis of values that are given by keyword; of a list too, if that is allowed."""
    try:
        if listed and isinstance(given, list | np.ndarray):
            values = tuple(number_of(parameter, v, described(parameter).unit) for v in given)
            return ListedAxis(parameter, values[0], values[-1], len(values), listed=values)
        first, last, count, *spacing = given
        if isinstance(given, str) or spacing not in ([], ["log"]):
            raise ValueError
        return Axis(parameter, first, last, index(count), bool(spacing))
    except (IndexError, TypeError, ValueError):
        others = "(first, last, count, 'log')" + (", or a list or an array" if listed else "")
        raise InvalidInputError(
            f"{name} = {shown(given)} is invalid: must be (first, last, count) or {others}"
        ) from None


def _settling(
    settling: SettlingOptions, transient: float | None, cycles: int | None
) -> SettlingOptions:
    given = {"transient": transient, "cycles": cycles}
    return replace(settling, **{name: n for name, n in given.items() if n is not None})


def _of_parameter(parameter: str) -> Quantity:
    known = described(parameter)
    return Quantity(known.meaning.rstrip("."), known.unit or "")
