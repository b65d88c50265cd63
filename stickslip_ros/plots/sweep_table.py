"""The table of a sweep: in which ranges there is which regime."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from itertools import groupby, islice

from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.plots.units import Units
from stickslip_ros.studies.plan import Grid
from stickslip_ros.studies.study import Point, Study
from stickslip_ros.tables import TextTable

_MOST_RANGES = 60
"""Rows of the table; where there are more, only their regimes are counted."""


def _direction_and_regime(point: Point, plan: Grid) -> str:
    """Return what the points of a row of the table on the screen have in common."""
    regime = point.reason or Regime.label(point.measures.regime)
    if point.reason is None and not point.steady:
        regime += ", not steady"
    return f"{plan.direction(point.number) or ''} {regime}".lstrip()


def sweep_table(study: Study, points: Callable[[], Iterable[Point]]) -> TextTable:
    """Return in which ranges of the parameter there is which regime; of a map, how often.

    `points` yields the points of the study in their order, each time that it is called.
    """
    plan = study.plan
    assert isinstance(plan, Grid)
    title = f"{study.scenario.name}, {plan.size} points"
    if len(plan.axes) == 1:
        rows = list(islice(_ranges(points, plan, units_of(study)), _MOST_RANGES + 1))
        if len(rows) <= _MOST_RANGES:
            headings = ["regime", plan.parameters[0], "points", "amplitude", "stick fraction"]
            return TextTable(title, headings, rows)
    counts = Counter(_direction_and_regime(point, plan) for point in points())
    return TextTable(title, ["regime", "points"], [[each, str(n)] for each, n in counts.items()])


def units_of(study: Study) -> Units:
    """Return the units in which the points of a study are shown."""
    return Units.for_drive(study.scenario.plant.as_drive(), study.plan.parameters)


def _ranges(points: Callable[[], Iterable[Point]], plan: Grid, units: Units) -> Iterator[list[str]]:
    largest = max((point.measures.amplitude or 0.0 for point in points()), default=0.0)
    for kind, group in groupby(points(), lambda point: _direction_and_regime(point, plan)):
        measured = [
            (point.measures.amplitude, point.measures.stick_fraction, point.number)
            for point in group
        ]
        amplitudes, stick_fractions, numbers = zip(*measured, strict=True)
        yield [
            kind,
            _range([plan.values(number)[0] for number in numbers], plan.axes[0].unit, units),
            str(len(numbers)),
            _range(amplitudes, "m", units, largest),
            _range(stick_fractions, "", units),
        ]


def _range(values: Iterable[float | None], unit: str, units: Units, largest: float = 0.0) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return "-"
    low, high = units.texts([min(known), max(known)], unit, largest=largest)
    return low if low == high else f"{low.split()[0]} to {high}"
