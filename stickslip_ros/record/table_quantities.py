"""Quantities of a run in the columns of a table: expressions, units, times, faults."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isnan, nan
from typing import Any, NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray, windows
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.quantities import ROTARY
from stickslip_ros.record.expressions import Expression, listed
from stickslip_ros.record.faults import Jumps, lost_velocities, shift_note
from stickslip_ros.record.imperfections import play_note, ripple_note
from stickslip_ros.record.table_clock import (
    check_turns,
    clock_beside,
    clock_of,
    even_times,
    in_order,
    notes_of_another_clock,
    unit_of_steps,
)
from stickslip_ros.record.table_columns import ROW, Table, reading_file
from stickslip_ros.record.units import Unit, other_quantity, units_in
from stickslip_ros.samples import LARGEST
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import must_be_one_of, quantity

QUANTITIES = (
    "time",
    "position",
    "velocity",
    "force",
    "belt_velocity",
    "friction_force",
    "disturbance",
    "reference",
)
"""Quantities of a run that a table may have; time and position it must have."""

_DRIVES = re.compile(r"(?i)mot|enc|spind|screw|c?mdpos|cmd|soll|ref|set|target|consigne|vis\b")
"""Starts of words in the name of a column with the position of what drives the slide."""
_UNITS = {
    "time": "s",
    "position": "m",
    "reference": "m",
    "velocity": "m/s",
    "belt_velocity": "m/s",
}
"""Units of quantities; the others are forces."""
_MOTION, _FORCES = ("position", "velocity"), ("force", "disturbance", "friction_force")
"""Quantities of which rows without a number lack samples; those that hold until the next value."""
_MERGED_SHARE, _BETWEEN_SHARE = 0.3, 0.05
"""Share of the rows with a position that lack another quantity, from which it was recorded between
them; fewest of its values, as a share of the positions."""
_SMALLEST_TURN, _SAME_TURN = 256.0, 0.01
"""Least turn of a counter that wraps once; relative difference of a jump from it."""
_LARGE = 100.0
"""Range of positions without a unit, from which it is said that they are taken as m or rad."""


class Quantities(NamedTuple):
    """What a table has of a run."""

    values: dict[str, FloatArray]
    """Quantities, arrays of shape (rows,); the time is s from the first row."""
    notes: list[str]
    """Sentences on how the table was read, and on what it lacks."""


def quantities_of(
    table: Table,
    columns: Mapping[str, str] | None = None,
    belt_speed: float | None = None,
) -> Quantities:
    """Return the quantities that a table has.

    `columns` and `belt_speed` are those of `read_table`. Rows whose time is not finite are left
    out. Values that a measure would overflow with are NaN (above 1e100) or zero (below 1e-100).
    Columns with times of their own, and those of rows between the positions, are brought to the
    times of the positions: forces hold, other values are interpolated. Raises BagError if the file
    cannot be read, and InvalidInputError if it has not what is asked for, or no sample.
    """
    columns = table.own_columns if columns is None else columns
    if belt_speed is not None:
        columns = {**columns, "belt_velocity": repr(float(belt_speed))}
    needed = "velocity" if "position" not in columns and "velocity" in columns else "position"
    asked = _asked(table, columns, ("time", needed))
    clock = asked["time"].places
    if not clock:
        raise InvalidInputError(f"{table.path}: time = {columns['time']} must be a column")
    clocks = {name: clock_of(table, clock, expression) for name, expression in asked.items()}
    cells = _Cells.read(table, asked, clock, *clocks.values())
    notes = cells.notes
    times, rows = cells.times(clock, clocks.values())
    time = _picked(times[clock], rows)
    check_turns(table, time)
    part = rows if table.form.session else range(len(times[clock]))
    values: dict[str, FloatArray] = {}
    for name in [name for name in asked if name != "time"]:
        value, own_time = cells.value(name), times[clocks[name]]
        value = value if value.shape == own_time.shape else np.full(own_time.shape, value)
        if own_time is times[clock] or np.array_equal(own_time, times[clock], equal_nan=True):
            values[name] = _picked(value, rows)
        else:
            if own_time.shape == times[clock].shape:
                own_time, value = (_picked(column, part) for column in (own_time, value))
            values[name] = _at(time, own_time, value, hold=name in _FORCES)
            values[name][time > np.nanmax(own_time) + np.nanmedian(np.diff(own_time))] = nan
            notes += notes_of_another_clock(table, name, clocks[name], time, own_time)
    present = np.isfinite(values[needed])
    if not present.any():
        raise InvalidInputError(
            f"{table.path}: no row has a time and a {needed}, {asked[needed].text}; the columns "
            f"are {listed(table.columns)}"
        )
    for name in [name for name in values if name not in _MOTION and clocks[name] == clock]:
        values[name], note = _merged(name, time, values[name], present)
        notes += note
    values["time"], note = even_times(time)
    notes += note
    if needed == "velocity":
        at, velocity = values["time"][present], values["velocity"][present]
        moved = np.cumsum(np.append(0.0, (velocity[1:] + velocity[:-1]) / 2.0 * np.diff(at)))
        values["position"] = np.full(len(present), nan)
        values["position"][present] = moved
        notes.append("the position is not recorded: it is the integral of the velocity")
        return Quantities(values, notes)
    return Quantities(values, [*notes, *_faults(cells, values, rows)])


def speed_and_force(table: Table, columns: Mapping[str, str]) -> Quantities:
    """Return the quantities of a table of tests at constant speeds: pairs of velocity and force.

    `columns` has both, and errors are those of `quantities_of`.
    """
    asked = _asked(table, columns, ("velocity", "force"))
    cells = _Cells.read(table, asked, asked["velocity"].places)
    return Quantities({name: np.atleast_1d(cells.value(name)) for name in asked}, cells.notes)


@dataclass(frozen=True)
class _Cells:
    """The cells of the columns in expressions, and what converts the values of these."""

    table: Table
    asked: Mapping[str, Expression]
    columns: Mapping[int, Any]
    """By place."""
    factors: Mapping[str, float]
    """By quantity."""
    unknown_unit: bool
    """Whether times are those of a column without a unit."""
    notes: list[str]

    @classmethod
    def read(
        cls,
        table: Table,
        asked: Mapping[str, Expression],
        leading: Sequence[int],
        *others: Sequence[int],
    ) -> "_Cells":
        """Read the columns of expressions, and other ones.

        The length of the table is that of the leading ones; others of another length are refused.
        """
        places = [expression.places for expression in asked.values()]
        used = sorted({place for group in (*places, *others) for place in group} - {ROW})
        with reading_file(table.path):
            columns = dict(zip(used, table.read(used), strict=True))
        if ROW in leading:
            rows = max((len(column) for column in columns.values()), default=0)
            columns[ROW] = np.arange(rows, dtype=np.float64)
        rows = max((len(columns[place]) for place in leading), default=0)
        if not rows:
            raise BagError(f"{table.path}: the file cannot be read: it has no rows")
        for place, column in columns.items():
            lead = (clock_beside(table, leading, [place]) or leading)[0]
            if len(column) not in (1, len(columns[lead])):
                raise InvalidInputError(
                    f"{table.path}: {table.name(place)} has {len(column)} numbers and "
                    f"{table.name(lead)} {len(columns[lead])}: columns must have the same length"
                )
        notes = [*table.notes, *_lost_cells(table, columns, asked)]
        factors: dict[str, float] = {}
        units: dict[str, Unit] = {}
        unknown_unit = False
        for name, expression in asked.items():
            factors[name], column_units = _factor(table, name, expression)
            units |= column_units
            if name == "time" and expression.bare and not column_units:
                unknown_unit = expression.places[0] not in table.clocks
            if name == "position" and expression.bare and not column_units:
                notes += _large_note(table, columns[expression.places[0]], expression)
            if name == "time" and ROW in expression.places:
                by = "--period" if table.form.period else "a line above them"
                text = quantity(float(expression.text[4:]), "s")
                notes.append(f"the rows have no time: by {by} they are {text} apart")
        if "force" in asked and (newtons := table.form.per_ampere):
            text = quantity(newtons, "N m" if table.form.rotary else "N")
            notes.append(f"the force is {asked['force'].text}, a current, times {text} for 1 A")
        notes += _units_notes(table, units)
        return cls(table, asked, columns, factors, unknown_unit, notes)

    def value(self, name: str) -> FloatArray:
        """Return a quantity, or its only value, in SI units."""
        asked, factor = self.asked[name], self.factors[name]
        value = asked.value([np.asarray(self.columns[place], float) for place in asked.places])
        return _measurable(value if factor == 1.0 else value * factor)

    def rounding(self, name: str) -> float:
        """Return how much a quantity, linear in its columns, errs by the last digits of these."""
        asked = self.asked[name]
        rows = np.zeros((len(asked.places), 1 + len(asked.places)))  # no column, and each by itself
        for number, place in enumerate(asked.places):
            column = np.abs(self.columns[place])
            largest = np.max(column, where=np.isfinite(column), initial=0.0)
            rows[number, 1 + number] = np.spacing(largest)
        values = np.atleast_1d(asked.value([*rows])) * self.factors[name]
        with np.errstate(all="ignore"):
            return float(np.nan_to_num(np.sum(np.abs(values - values[0])), posinf=0.0))

    def unwrapped(self, name: str, row: int) -> str:
        """Return the expression that unwraps a column which jumps by a power of 2, or nothing.

        It must be of whole numbers.
        """
        asked, factor = self.asked[name], self.factors[name]
        if len(asked.places) != 1:
            return ""
        (place,), known = asked.places, self.table.columns
        near = np.asarray(self.columns[place], float)[max(0, row - 9) : row + 9]
        jump = np.max(np.abs(np.diff(near)), initial=1.0)
        turn = 2.0 ** np.rint(np.log2(jump))
        same = abs(turn - jump) <= _SAME_TURN * turn
        if turn < _SMALLEST_TURN or not same or np.any(near != np.rint(near)):
            return ""
        names = "|".join(re.escape(alias) for alias in known if known[alias] == place)
        text = f"unwrap({self.table.number(place)}, {turn:.0f})"
        if not asked.bare:
            column = rf"(?<![\w.])['\"]?(?:{names})(?!\w)['\"]?"
            text = re.sub(column, text, asked.text, count=1)
        return f"{name}={text}" + f"*{factor:.12g}" * (factor != 1.0)

    def times(
        self, clock: tuple[int, ...], others: Iterable[tuple[int, ...]]
    ) -> tuple[dict[tuple[int, ...], FloatArray], range | IntArray]:
        """Return times by columns, s from the first of the clock, and the rows that have one."""
        asked, factor = self.asked["time"], self.factors["time"]
        times = {
            places: _times(asked, [self.columns[place] for place in places])
            for places in dict.fromkeys((clock, *others))
        }
        known = np.isfinite(times[clock])
        rows = range(len(known)) if known.all() else np.flatnonzero(known)
        if not len(rows):
            raise InvalidInputError(f"{self.table.path}: no time is a finite number")
        rows = in_order(self.table, asked, factor, times[clock], rows)
        if rows[0] > rows[-1]:
            self.notes.append("the rows are read from the last one on: the newest is the first")
        if self.unknown_unit:
            step = float(np.median(np.diff(_picked(times[clock], rows)))) if len(rows) > 1 else 0.0
            column, first = self.table.number(clock[0]), float(times[clock][rows[0]])
            factor, note = unit_of_steps(step, first, self.table.period, column)
            self.notes.extend(note)
        if self.table.form.shift and len(times) == 1:
            raise InvalidInputError(
                f"{self.table.path}: shift is for columns with times of their own, and all have "
                f"those of {asked.text}"
            )
        first = times[clock][rows[0]]
        for places, stamps in times.items():
            since, own_factor = stamps - first if first else stamps, factor
            if places != clock:
                own_factor, units = _factor(self.table, "time", replace(asked, places=places))
                if not (units or clock_beside(self.table, clock, places)):
                    own_factor = factor
                if own_factor != factor:
                    since, own_factor = stamps * own_factor - first * factor, 1.0
            since = np.asarray(since if own_factor == 1.0 else since * own_factor, float)
            times[places] = since if places == clock else since + self.table.form.shift
        return times, rows


def _asked(
    table: Table, columns: Mapping[str, str], needed: Sequence[str]
) -> dict[str, Expression]:
    """Return the expression of each quantity; refuse what is no quantity, or not enough."""
    for name in columns:
        if name not in QUANTITIES:
            raise InvalidInputError(f"column {name} is invalid: {must_be_one_of(name, QUANTITIES)}")
    if table.form.force_constant and "force" not in columns:
        raise InvalidInputError(
            f"{table.path}: force_constant is for a current, and no column is given for force"
        )
    period = table.form.period or (table.period or (None,))[0]
    if table.form.period is not None and "time" in columns:
        raise InvalidInputError(f"{table.path}: period is for a table without times")
    lacking = [name for name in needed if name not in columns and (name != "time" or not period)]
    if lacking:
        pairs = "; pairs of velocity and force are read by identify --map" * (
            {"velocity", "force"} == {*columns}
        )
        ways = "; --period gives the time from row to row" * ("time" in lacking and not pairs)
        raise InvalidInputError(
            f"{table.path}: no column is given for {' and '.join(lacking)}{pairs}{ways}"
        )
    asked = {
        name: Expression.read(table.path, text, table.columns) for name, text in columns.items()
    }
    if "time" in needed and "time" not in columns:
        asked["time"] = Expression.read(table.path, f"row*{period!r}", {"row": ROW})
    return asked


def _times(clock: Expression, cells: Sequence[Any]) -> Any:
    """Return the times of an expression with all their digits."""
    counts = len(cells) > 1 or cells[0].dtype.kind == "i"
    exact = np.longdouble if counts else float  # a float has no digits for ns since 1970
    return clock.value([np.asarray(column, exact) for column in cells])


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


def _factor(table: Table, kind: str, asked: Expression) -> tuple[float, dict[str, Unit]]:
    """Return what converts columns without a number to SI units, and the units by column.

    Raises InvalidInputError if they have a unit of another quantity, several, or several readings.
    """
    places = [place for place in asked.places if place not in table.clocks] if asked.bare else []
    by_column, target = dict[str, Unit](), _UNITS.get(kind, "N")
    per_ampere = table.form.per_ampere if kind == "force" else None
    meant, way = kind, ""
    if per_ampere is not None:
        target, meant, way = "A", "a current", "; without --force-constant it counts as a force"
    elif kind == "force":
        way = "; --force-constant 0.35Nm/A with --pitch 10mm, or 50N/A, converts a current"
    for place in places:
        name = table.name(place).removeprefix("column ")
        which = f"{table.path}: {kind}, {table.name(place)},"
        column = table.number(place) if len(asked.places) == 1 else f"({asked.text})"
        other = other_quantity(table.names[place])
        if other == meant:
            other = None
        if other and kind in ((*_MOTION, *_FORCES) if other == "an acceleration" else _FORCES):
            text = "*1 takes it if it is one" if kind in _MOTION else f"*NUMBER converts it{way}"
            if kind in _MOTION and other == "an acceleration":
                text += (
                    f"; velocity=cumsum({column})*NUMBER without a position integrates it, with "
                    "the time from row to row, s, times the number of m/s^2 in one of it"
                )
            raise InvalidInputError(
                f"{which} is {other} by its name, which tells no {kind}: {kind}={column}{text}"
            )
        cells = table.names[place], table.units[place]
        readings = units_in(*cells, target)
        if per_ampere is not None and not readings:
            readings = [unit._replace(factor=nan) for unit in units_in(*cells, "N")]
        if len(readings) > 1:
            texts = [f"{unit.text or target} ({unit.factor:g} {unit.target})" for unit in readings]
            ways = [f"{kind}={column}*{unit.factor:.12g}" for unit in readings]
            raise InvalidInputError(
                f"{which} may be in {' or '.join(texts)}: {' or '.join(ways)} says which"
            )
        if kind == "time" and len(asked.places) > len(places):
            by_column["the clock"] = Unit("s", 1.0, "s")
        for unit in readings:
            si = ROTARY.get(target, target) if table.form.rotary else unit.target
            if isnan(unit.factor) or unit.target != si:
                raise InvalidInputError(
                    f"{which} is in {unit.text}, which is no unit of {meant}"
                    f"{' of a rotary axis' * (unit.target != si)}: {kind}={column}*NUMBER "
                    f"converts it, with the number of {si} in one of it{way}"
                )
            by_column[name] = unit
    units = {unit.factor for unit in by_column.values()}
    if len(units) > 1 or (by_column and len(by_column) < len(places) and units != {1.0}):
        texts = [f"{name} in {unit.text}" for name, unit in by_column.items()]
        raise InvalidInputError(
            f"{table.path}: {kind} = {asked.text} is of different units, {', '.join(texts)}: a "
            f"number for each converts it to {target}, as in #1*0.001-#2"
        )
    return next(iter(units), 1.0) * (per_ampere or 1.0), by_column


def _units_notes(table: Table, by_column: Mapping[str, Unit]) -> Iterator[str]:
    """Yield sentences on the units by column."""
    if by_column:
        units = [f"{name}: {unit.text}" for name, unit in by_column.items()]
        yield f"units: {'; '.join(dict.fromkeys(units))}"
    angles = [unit.text for unit in by_column.values() if unit.target in ROTARY.values()]
    if angles and not table.form.rotary:
        yield f"{angles[0]} is of a rotary axis: what is in m is in rad, as --rotary shows"


def _large_note(table: Table, column: Any, asked: Expression) -> Iterator[str]:
    """Yield a sentence on a position without a unit, if it may be in another one than m."""
    unit = "rad" if table.form.rotary else "m"
    low, high = (float(extreme(column)) for extreme in (np.fmin.reduce, np.fmax.reduce))
    if high - low >= _LARGE and (column.dtype.kind == "i" or unit == "m"):
        yield (
            f"the position, {asked.text}, has no unit and counts in {unit}, from {low:.6g} to "
            f"{high:.6g}: in another one, *NUMBER converts it"
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


def _picked(values: FloatArray, rows: range | IntArray) -> FloatArray:
    """Return rows of values; a range stands for all."""
    return values if isinstance(rows, range) else values[rows]


def _faults(cells: _Cells, values: dict[str, FloatArray], rows: range | IntArray) -> Iterator[str]:
    """Leave out what no motion makes; yield sentences on this, and on what the values show."""
    yield from _without_lost_positions(cells, values, rows)
    if "velocity" in values:
        yield from _without_lost_velocities(cells.table, values, rows)
    units = ("rad", "N m") if cells.table.form.rotary else ("m", "N")
    if "reference" in values:
        yield from play_note(values["reference"], values["position"], units[0], "the reference")
    else:
        for name, column in _driving_columns(cells):
            driving = _picked(column, rows)
            if driving.shape == values["position"].shape:
                yield from play_note(driving, values["position"], units[0], name)
    if "force" in values:
        yield from ripple_note(values["time"], values["position"], values["force"], units)


def _driving_columns(cells: _Cells) -> Iterator[tuple[str, FloatArray]]:
    """Yield the first column that nobody asked for, and that is named like what drives the slide.

    It is complete, in the unit of the position.
    """
    table, position = cells.table, cells.asked["position"]
    if not position.bare or len(position.places) != 1:
        return

    def factors(place: int) -> list[float]:
        return [unit.factor for unit in units_in(table.names[place], table.units[place], "m")]

    unit = factors(position.places[0])
    for place, name in enumerate(table.names):
        words = re.findall(r"[^\W\d_]+", name)
        is_unused = place not in cells.columns and place in table.columns.values()
        if is_unused and any(map(_DRIVES.match, words)) and factors(place) == unit:
            (column,) = table.read([place])
            if np.isfinite(column).all():
                yield table.name(place), np.asarray(column, float) * cells.factors["position"]
            return


def _without_lost_positions(
    cells: _Cells, values: dict[str, FloatArray], rows: range | IntArray
) -> Iterator[str]:
    """Leave out positions that no motion makes; yield sentences on them.

    Raises InvalidInputError if the positions are those of a counter that wraps.
    """
    table, factor = cells.table, cells.factors["position"]
    position, time = values["position"], values["time"]
    present = np.isfinite(position)
    present_rows: range | IntArray = range(len(position))
    if not present.all():
        present_rows = np.flatnonzero(present)
    jumps = Jumps(_picked(position, present_rows), cells.rounding("position"))

    def line(row: Any) -> str:
        return table.line(int(rows[present_rows[row]]))

    wrap = jumps.wrap()
    if wrap is not None:
        turn = f"{wrap.turn / factor:.10g}"
        text = f"unwrap({cells.asked['position'].text}, {turn})"
        raise InvalidInputError(
            f"{table.path}: the position jumps {len(wrap.rows)} times by {turn}, the "
            f"first time at {line(wrap.rows[0])}, as of a counter that wraps: position="
            f"{text}{'' if factor == 1.0 else f'*{factor:g}'}"
        )
    lost = jumps.dropouts()
    if len(lost):
        values["position"] = position = position.copy()
        position[lost if isinstance(present_rows, range) else present_rows[lost]] = nan
        yield (
            "the position jumps away and back, as no motion does, in "
            f"{len(lost)} rows, the first is {line(lost[0])}: they are left out"
        )
    for row, size in jumps.shifts():
        way = cells.unwrapped("position", int(rows[present_rows[row]]))
        if way:
            raise InvalidInputError(
                f"{table.path}: the position jumps as a counter that wraps, at {line(row)}: {way}"
            )
        place = f"at {line(row)}, {time[present_rows[row]]:.6g} s after the first row"
        yield shift_note(size, place, "rad" if table.form.rotary else "m")


def _without_lost_velocities(
    table: Table, values: dict[str, FloatArray], rows: range | IntArray
) -> Iterator[str]:
    """Leave out velocities that contradict the others or the positions; yield sentences on them."""
    position, velocity = values["position"], values["velocity"]
    both = np.flatnonzero(np.isfinite(position) & np.isfinite(velocity))
    fault, spikes = lost_velocities(values["time"][both], position[both], velocity[both])
    if fault is not None:
        values["velocity"] = np.full(len(velocity), nan)
        yield f"the velocity {fault}: it is left out"
    elif spikes.any():
        lost = both[spikes]
        values["velocity"] = velocity = velocity.copy()
        velocity[lost] = nan
        yield (
            "the velocity jumps away and back, as the positions do not, in "
            f"{len(lost)} rows, the first is {table.line(int(rows[lost[0]]))}: they are left out"
        )


def _at(at: FloatArray, time: FloatArray, values: FloatArray, *, hold: bool) -> FloatArray:
    """Return values that are known at some times at others: held, or interpolated."""
    known = np.isfinite(time) & np.isfinite(values)
    if not known.any():
        return np.full(len(at), nan)
    time, values = time[known], values[known]
    if not hold:
        return np.interp(at, time, values, left=nan, right=nan)
    last = np.searchsorted(time, at + 0.5 / NANOSECONDS, "right") - 1
    return np.where(last >= 0, values[last], nan)


def _merged(
    name: str, time: FloatArray, values: FloatArray, present: BoolArray
) -> tuple[FloatArray, list[str]]:
    """Return a quantity at the rows with a position also where most of these lack it."""
    known = np.isfinite(values)
    lacking = 1.0 - np.mean(known[present])
    few = np.count_nonzero(known) < _BETWEEN_SHARE * np.count_nonzero(present)
    if lacking <= _MERGED_SHARE or few:
        return values, []
    hold = name in _FORCES
    note = f"{lacking:.0%} of the rows with a position have no {name}: it is "
    note += "held" if hold else "interpolated"
    return np.where(known, values, _at(time, time, values, hold=hold)), [note]
