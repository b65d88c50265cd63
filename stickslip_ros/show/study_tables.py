"""The tables of studies: sweeps, basins of attraction, and what theory says."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby, islice
from math import log10
from typing import Any, cast

from stickslip_ros.measures.cycle_measures import Regime, Trend
from stickslip_ros.quantities import Quantity
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.show.measure_table import measure_table
from stickslip_ros.show.quantities import THEORY, Units
from stickslip_ros.studies.basin import Attractor, Basins
from stickslip_ros.studies.columns import Columns, Point
from stickslip_ros.studies.plan import Grid
from stickslip_ros.studies.stability import Notes, Section
from stickslip_ros.studies.study import Study
from stickslip_ros.tables import TextTable

_MOST_RANGES = 60
"""Rows of the table of a sweep; where there are more, only their regimes are counted."""

_GAIN_MARGINS = "gain_down", "gain_up"
"""Ratios of the linear gain at the limit of stability and the proposed one."""

_Quantities = Mapping[str, Quantity]


def _direction_and_regime(point: Point, plan: Grid) -> str:
    """Return what the points of a row of the table on the screen have in common."""
    regime = Regime.label(point.regime)
    if point.regime in (None, Regime.UNBOUNDED):
        regime = point.reason or regime
    elif not point.steady:
        regime += ", not steady" + (f": {Trend.DRIFTING}" if point.reason else "")
    return f"{plan.direction(point.number) or ''} {regime}".lstrip()


def sweep_table(study: Study, columns: Columns) -> TextTable:
    """Return in which ranges of the parameter there is which regime; of a map, how often."""
    plan = study.plan
    assert isinstance(plan, Grid)
    title = f"{study.scenario.name}, {plan.size} points"
    if len(plan.axes) == 1:
        rows = list(islice(_ranges(columns, plan, units_of(study)), _MOST_RANGES + 1))
        if len(rows) <= _MOST_RANGES:
            headings = ["regime", plan.parameters[0], "points", "amplitude", "stick fraction"]
            return TextTable(title, headings, rows)
    counts = Counter(_direction_and_regime(point, plan) for point in columns.points())
    return TextTable(title, ["regime", "points"], [[name, str(n)] for name, n in counts.items()])


def units_of(study: Study) -> Units:
    """Return the units in which the points of a study are shown."""
    return Units.for_drive(study.scenario.plant.as_drive(), study.plan.parameters)


def _ranges(columns: Columns, plan: Grid, units: Units) -> Iterator[list[str]]:
    largest = max((amplitude or 0.0 for amplitude in columns.cells("amplitude")), default=0.0)
    for kind, group in groupby(columns.points(), lambda point: _direction_and_regime(point, plan)):
        measured = [(point.amplitude, point.stick_fraction, point.number) for point in group]
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


def basin_table(study: Study, basins: Basins) -> TextTable:
    """Return the attractors of a study, that with most starts first."""
    units = Units.for_drive(study.scenario.plant.as_drive())
    rows = [
        [
            attractor_name(attractor),
            units.text(attractor.amplitude, "m"),
            units.text(attractor.midpoint, "m"),
            str(attractor.count),
            f"{attractor.share:.4f}",
            f"{attractor.standard_error:.4f}",
        ]
        for attractor in basins.attractors
    ]
    headings = ["motion", "amplitude", "midpoint", "starts", "share", "standard error"]
    return TextTable(f"{study.scenario.name}, {study.plan.size} starts", headings, rows)


def attractor_name(attractor: Attractor) -> str:
    """Return what an attractor is called: its regime, and whether it is steady."""
    name = Regime.label(attractor.regime)
    return name if attractor.steady or attractor.regime is None else f"{name}, not steady"


def side_by_side(
    title: str, shown: _Quantities, rows: Sequence[Mapping[str, Any]], units: Units
) -> TextTable:
    """Return a table with a column for each of `shown`, all its values with one prefix."""
    columns = [
        units.texts([row[name] for row in rows], unit) for name, (_, unit, _) in shown.items()
    ]
    headings = [quantity.label for quantity in shown.values()]
    return TextTable(title, headings, list(zip(*columns, strict=True)))


def one_below_another(
    title: str, shown: _Quantities, values: Mapping[str, Any], units: Units
) -> TextTable:
    """Return a table with a row for each of `shown`; margins of gain also in dB."""
    rows = [[label, units.text(values[name], unit)] for name, (label, unit, _) in shown.items()]
    for row, name in zip(rows, shown, strict=True):
        if name in _GAIN_MARGINS and values[name] is not None:
            row[1] += f" ({20.0 * log10(values[name]):.1f} dB)"
    return TextTable(title, ["", ""], rows)


def stability_tables(scenario: Scenario, parts: Section, notes: Notes) -> Iterator[TextTable | str]:
    """Yield the tables of what `stability` has found, and its notes."""
    units = Units.for_drive(scenario.plant.as_drive())
    rows: list[list[str]] = []
    for section, quantities in THEORY.items():
        values = parts[section]
        known: list[list[str]] = []
        for name, (label, unit, _) in quantities.items():
            value = values[name]
            if name == "decay_rate" and value is not None and value < 0.0:
                label, value = "growth rate", -value
            shown = _shown(name, value, unit, units)
            if name == "speed_ranges" and value and value[0][0] == values["searched_speeds"][0]:
                low, _, rest = shown.partition(" to ")
                shown = f"up to {rest} (searched from {low})"
            known += [[f"  {label}", shown]] * (shown.strip("-, ") != "")
        rows += [[section.replace("_", " "), ""], *known] if known else []
    yield TextTable(f"{scenario.name}, by theory", ["", ""], rows)
    for loop in ("open_loop", "closed_loop"):
        cycles: list[Section] = parts[loop]["limit_cycles"]
        if cycles:
            columns = {
                f"{number}, {'stable' if cycle['stable'] else 'unstable'}": {
                    **cycle, "multipliers": _complex(cycle["multipliers"], ""),
                }
                for number, cycle in enumerate(cycles, 1)
            }  # fmt: skip
            title = f"limit cycles, {loop.replace('_', ' ')}"
            yield measure_table(title, columns, dict.fromkeys(columns, units))
    for reason in dict.fromkeys(notes.values()):
        places = [place for place, why in notes.items() if why == reason]
        yield f"{'; '.join(places).replace('_', ' ').replace('.', ', ')}: {reason}"


def _shown(name: str, value: Any, unit: str, units: Units) -> str:
    if name == "eigenvalues" and value is not None:
        return _complex(value, units.of_unit(unit))
    if "lyapunov" in name:
        coefficients = cast(list[float | None], value if isinstance(value, list) else [value])
        return ", ".join(
            units.text(coefficient, unit) + _starts(coefficient) for coefficient in coefficients
        )
    if not isinstance(value, list):
        return units.texts([value], unit, digits=8 if name == "spectral_radius" else 4)[0]
    items = cast(list[Any], value)
    if name in ("stable_linear_gains", "speed_ranges"):
        return "; ".join(" to ".join(units.texts(ends, unit)) for ends in items) or "-"
    return ", ".join(units.texts(items, unit)) or "-"


def _starts(coefficient: float | None) -> str:
    """Return what a first Lyapunov coefficient means: whether the vibration has hysteresis."""
    if not coefficient:
        return ""
    start = "with a jump" if coefficient > 0.0 else "gently"
    return f" ({'no ' * (coefficient < 0.0)}hysteresis: the vibration starts {start})"


def _complex(values: Iterable[complex], unit: str) -> str:
    """Return the text of complex numbers, of a conjugate pair once."""
    texts = [
        f"{value.real:.4g} ± {value.imag:.4g}j" if value.imag else f"{value.real:.4g}"
        for value in values
        if value.imag >= 0.0
    ]
    return f"{', '.join(texts)} {unit}".rstrip()
