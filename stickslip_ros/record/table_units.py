"""Columns of a table in SI units: what converts them, and which units are refused.

A unit is that of the column by its header or, without one, that of a line above the table.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from math import isnan, nan
from typing import Any, NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray, windows
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.quantities import ROTARY
from stickslip_ros.record.expressions import Expression
from stickslip_ros.record.header_units import Unit, are_units, other_quantity, units_in
from stickslip_ros.record.table_columns import ROW, Table
from stickslip_ros.samples import LARGEST
from stickslip_ros.text import quantity, shown

QUANTITIES = {
    "time": "s",
    "position": "m",
    "velocity": "m/s",
    "force": "N",
    "belt_velocity": "m/s",
    "friction_force": "N",
    "disturbance": "N",
    "reference": "m",
}
"""Units of the quantities that a table may have; time and position it must have."""
_SI = {*QUANTITIES.values()}
MOTION, FORCES = ("position", "velocity"), ("force", "disturbance", "friction_force")
"""Quantities of which rows without a number lack samples; those that hold until the next value."""
_WORD = re.compile(r"[^\W\d_][^\s\d,;:=()\[\]{}<>|、]*")
_WORDS = re.compile(r"(?i)(?:in|min|h|d|yd|dyn|mil|turns?|rot|foot|yard|day|grad)\W*")
"""Units that may be other words."""
_IN = r"(?<!\w)(?:in|en|em|v|w|в)\s"
_TOLD = re.compile(rf"(?i)(?:{_IN}|[\[(:=/])\s*$")
"""What is before a unit that may be another word."""
_LABEL = re.compile(r"(?i)unit|einheit|unidad|jednot|единиц|单位|単位")
"""What is in the line of a unit of one letter."""
_NUMBER_BEFORE = re.compile(r"(?i)\d[\d.,]*(?:e[-+]?\d+)?\s*[\[(]?$")
_NUMBER_BEHIND = re.compile(r"[\s\])}>:;,=\"]*[-+]?\d")


class _Mention(NamedTuple):
    """A unit in a line above a table."""

    unit: Unit
    line: str
    is_fact: bool
    """Whether a number has it, or it is of another quantity: it tells no column."""


class _Meaning(NamedTuple):
    """What a column in an expression without a number is."""

    kind: str
    """Quantity of the run."""
    target: str
    """SI unit of linear motion."""
    meant: str
    way: str = ""
    """What else than a number helps if it is something else."""


_BY_CURRENT = "; --force-constant 0.35Nm/A with --pitch 10mm, or 50N/A, converts a current"
_FORCE = _Meaning("force", "N", "force", _BY_CURRENT)
_CURRENT = _Meaning("force", "A", "a current", "; without --force-constant it counts as a force")


class Conversion(NamedTuple):
    """What converts an expression without a number to SI units."""

    factor: float
    units: dict[str, Unit]
    """By column; empty without any."""


class Cells:
    """The cells of the columns in expressions, and what converts the values of these."""

    def __init__(
        self, table: Table, asked: Mapping[str, Expression], columns: Mapping[int, Any]
    ) -> None:
        """Take expressions by quantity, and columns by place; see `conversion` for errors."""
        self.table, self.asked, self.columns = table, asked, columns
        self.conversions, refused = dict[str, Conversion](), list[str]()
        for name, text in asked.items():
            try:
                self.conversions[name] = conversion(table, name, text)
            except InvalidInputError as error:
                refused.append(str(error).removeprefix(f"{table.path}: "))
        if refused:
            raise InvalidInputError(f"{table.path}: {'; '.join(refused)}")
        self.notes = [*table.notes, *_lost_cells(table, columns, asked), *self._units_notes()]
        """Sentences on how the table was read."""

    def value(self, name: str) -> FloatArray:
        """Return a quantity, or its only value, in SI units."""
        asked, factor = self.asked[name], self.conversions[name].factor
        value = asked.value([np.asarray(self.columns[place], float) for place in asked.places])
        return _measurable(value if factor == 1.0 else value * factor)

    def _units_notes(self) -> Iterator[str]:
        """Yield sentences on units that the table has, and on those that it lacks."""
        asked, form = self.asked, self.table.form
        if "time" in asked and ROW in asked["time"].places:
            by = "--period" if form.period else "a line above them"
            text = quantity(float(asked["time"].text[4:]), "s")
            yield f"the rows have no time: by {by} they are {text} apart"
        if "force" in asked and (newtons := form.per_ampere):
            text = quantity(newtons, "N m" if form.rotary else "N")
            yield f"the force is {asked['force'].text}, a current, times {text} for 1 A"
        by_column = {k: v for one in self.conversions.values() for k, v in one.units.items()}
        units = [f"{name}: {unit.text}" for name, unit in by_column.items()]
        for name, expression in asked.items():
            timed = name == "time" and (self.table.clocks or self.table.period)
            known = timed or self.conversions[name].units or self.table.is_own
            if expression.bare and not known:
                unit = "A" if name == "force" and form.per_ampere else QUANTITIES[name]
                beside = next(_mentions(self.table.remarks, unit), None)
                unit = ROTARY.get(unit, unit) if form.rotary else unit
                line = f", below the line {shown(beside.line)}" if beside else ""
                units.append(f"{expression.text}: no known unit, taken as {unit}{line}")
        if units:
            yield f"units: {'; '.join(dict.fromkeys(units))}"
        angles = [unit.text for unit in by_column.values() if unit.target in ROTARY.values()]
        if angles and not form.rotary:
            yield f"{angles[0]} is of a rotary axis: what is in m is in rad, as --rotary shows"


def conversion(table: Table, kind: str, asked: Expression) -> Conversion:
    """Return what converts columns without a number to SI units.

    Raises InvalidInputError if they have a unit of another quantity, several, or several readings.
    """
    places = [place for place in asked.places if place not in table.clocks] if asked.bare else []
    per_ampere = table.form.per_ampere if kind == "force" else None
    meaning = _Meaning(kind, QUANTITIES[kind], kind)
    if kind == "force":
        meaning = _FORCE if per_ampere is None else _CURRENT
    units = dict[str, Unit]()
    if kind == "time" and 0 < len(places) < len(asked.places):
        units["the clock"] = Unit("s", 1.0, "s")
    for place in places:
        start = f"{table.path}: {kind}, {table.name(place)},"
        column = table.number(place) if len(asked.places) == 1 else f"({asked.text})"
        _check_name(table, place, start, column, meaning)
        if unit := _unit(table, place, start, column, meaning):
            units[table.name(place).removeprefix("column ")] = unit
    factors = {unit.factor for unit in units.values()}
    if len(factors) > 1 or (units and len(units) < len(places) and factors != {1.0}):
        texts = [f"{name} in {unit.text}" for name, unit in units.items()]
        raise InvalidInputError(
            f"{table.path}: {kind} = {asked.text} is of different units, {', '.join(texts)}: a "
            f"number for each converts it to {meaning.target}, as in #1*0.001-#2"
        )
    return Conversion(next(iter(factors), 1.0) * (per_ampere or 1.0), units)


def _check_name(table: Table, place: int, start: str, column: str, meaning: _Meaning) -> None:
    """Refuse a column that is another quantity by its name."""
    kind, other = meaning.kind, other_quantity(table.names[place])
    refused = (*MOTION, *FORCES) if other == "an acceleration" else FORCES
    if other in (None, meaning.meant) or kind not in refused:
        return
    text = f"*NUMBER converts it{meaning.way}"
    if kind in MOTION:
        text = (
            f"*1 takes it if it is one; velocity=cumsum({column})*NUMBER without a position "
            "integrates it, with the time from row to row, s, times the number of m/s^2 in one "
            "of it"
        )
    raise InvalidInputError(
        f"{start} is {other} by its name, which tells no {kind}: {kind}={column}{text}"
    )


def _unit(table: Table, place: int, start: str, column: str, meaning: _Meaning) -> Unit | None:
    """Return the unit of a column, None without one; refuse one of another quantity."""
    kind, target, meant, way = meaning
    cells = table.names[place], table.units[place]
    readings = units_in(*cells, target)
    if not readings and (told := _unit_told(table.remarks, table.names[place])):
        by_line = units_in(cells[0], told, target)
        readings = [
            unit if isnan(unit.factor) else unit._replace(text=f"{unit.text} by a line above")
            for unit in by_line
        ]
    said = [] if readings else [m for m in _mentions(table.remarks, target) if not m.is_fact]
    if said:
        readings = [*{m.unit.factor: m.unit for m in said}.values(), Unit("", 1.0, target)]
        start += f" by the line {shown(said[0].line)} above,"
    if target == "A" and not readings:
        readings = [unit._replace(factor=nan) for unit in units_in(*cells, "N")]
    if len(readings) > 1:
        texts = [f"{unit.text or target} ({unit.factor:g} {unit.target})" for unit in readings]
        ways = [f"{kind}={column}*{unit.factor:.12g}" for unit in readings]
        raise InvalidInputError(
            f"{start} may be in {' or '.join(texts)}: {' or '.join(ways)} says which"
        )
    unit = next(iter(readings), None)
    if unit is not None:
        si = ROTARY.get(target, target) if table.form.rotary else unit.target
        if isnan(unit.factor) or unit.target != si:
            raise InvalidInputError(
                f"{start} is in {unit.text}, which is no unit of {meant}"
                f"{' of a rotary axis' * (unit.target != si)}: {kind}={column}*NUMBER "
                f"converts it, with the number of {si} in one of it{way}"
            )
    return unit


def _lost_cells(
    table: Table, cells: Mapping[int, Any], asked: Mapping[str, Expression]
) -> Iterator[str]:
    """Yield a sentence on each column with cells that are no numbers, or too large ones."""
    for place in dict.fromkeys(place for formula in asked.values() for place in formula.places):
        column = cells[place]
        if column.min() >= -LARGEST and column.max() <= LARGEST:
            continue
        bad = np.flatnonzero(~(np.abs(column) <= LARGEST))
        value = column[bad[0]]
        yield (
            f"{table.name(place)} has no number in {len(bad)} of {len(column)} rows"
            f"{f', or one as large as {value:.3g}' if np.isfinite(value) else ''}; the first "
            f"is {table.line(int(bad[0]))}"
        )


def _measurable(values: FloatArray) -> FloatArray:
    """Return values with NaN for those above 1e100, and zero for those below 1e-100."""
    column = np.atleast_1d(values)
    for part in windows(len(column)):
        size = np.abs(column[part])
        small = (size < 1.0 / LARGEST) & (size > 0.0)
        if small.any() or not np.all(size <= LARGEST):
            size = np.abs(column)
            small = (size < 1.0 / LARGEST) & (size > 0.0)
            return np.where(size <= LARGEST, np.where(small, 0.0, column), nan)
    return column


def _unit_told(lines: Sequence[str], name: str) -> str:
    """Return the unit that is behind the name of a column in lines above, or nothing."""
    column = re.compile(
        rf"(?i)(?<!\w){re.escape(name)}(?!\w)(?:\s*[:=-].*[\s(\[]|\W*(?:{_IN})?)([^\W\d]\S*?)[\W_]*$"
    )
    parts = (part for line in lines for part in re.split(r"[,;|\t、]", line) if name)
    units = {match[1] for match in map(column.search, parts) if match and are_units([match[1]])}
    return units.pop() if len(units) == 1 else ""


def _mentions(lines: Sequence[str], target: str) -> Iterator[_Mention]:
    """Yield the units of a quantity, with the SI unit `target`, in lines above, but for this."""
    for line in lines:
        label = _LABEL.search(line)
        for match in _WORD.finditer(line):
            before, word, behind = line[: match.start()], match[0], line[match.end() :]
            word = word if are_units([word]) else word.partition("/")[2]  # as in x/mm
            certain = not _WORDS.fullmatch(word) and (len(word) > 1 or label)
            if not are_units([word]) or not (certain or _TOLD.search(before)):
                continue
            number = _NUMBER_BEFORE.search(before) or _NUMBER_BEHIND.match(behind)
            for unit in units_in("", word, target):
                if unit.factor > 0.0 and unit.factor != 1.0:
                    yield _Mention(unit, line, number is not None)
                elif label and all(isnan(u.factor) for si in _SI for u in units_in("", word, si)):
                    yield _Mention(unit, line, True)
