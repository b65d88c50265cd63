"""Quantities of a run in the columns of a table, all at the times of its positions."""

from collections.abc import Mapping, Sequence
from math import nan
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.record.expressions import Expression, listed
from stickslip_ros.record.table_clock import (
    Clock,
    Rows,
    check_turns,
    clock_of,
    columns_of,
    even_times,
    notes_of_another_clock,
    picked,
    times_of,
)
from stickslip_ros.record.table_columns import ROW, Table
from stickslip_ros.record.table_faults import Values, without_faults
from stickslip_ros.record.table_units import FORCES, MOTION, QUANTITIES, Cells
from stickslip_ros.record.updates import updated
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import must_be_one_of

_MERGED_SHARE, _BETWEEN_SHARE = 0.3, 0.05
"""Share of the rows with a position that lack another quantity, from which it was recorded between
them; fewest of its values, as a share of the positions."""


class Quantities(NamedTuple):
    """What a table has of a run."""

    values: Values
    """The time is s from the first row."""
    notes: list[str]
    """Sentences on how the table was read, and on what it lacks."""


def quantities_of(
    table: Table, columns: Mapping[str, str] | None = None, belt_speed: float | None = None
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
    _check_column(table, "time", asked["time"])
    clock = asked["time"].places
    clocks = {name: clock_of(table, clock, expression) for name, expression in asked.items()}
    cells = Cells(table, asked, columns_of(table, asked, clock, *clocks.values()))
    times, rows = times_of(cells, clock, clocks.values())
    time = picked(times[clock], rows)
    check_turns(table, time)
    values = _at_clock(cells, times, clocks, rows)
    present = np.isfinite(values[needed])
    if not present.any():
        raise InvalidInputError(
            f"{table.path}: no row has a time and a {needed}, {asked[needed].text}; the columns "
            f"are {listed(table.columns)}"
        )
    for name in [name for name in values if name not in MOTION and clocks[name] == clock]:
        values[name], notes = _merged(name, time, values[name], present)
        cells.notes.extend(notes)
    values["time"], notes = even_times(time)
    cells.notes.extend(notes)
    if needed == "position":
        places = asked[needed].places if clocks[needed] == clock else ()
        every = [np.asarray(cells.columns[place], float) for place in places]
        columns_at = [picked(column, rows) for column in every if len(column) > 1]
        period, own = updated(values["time"], columns_at)
        if period > 1:
            values["position"] = np.where(own, values["position"], nan)
            cells.notes.append(
                f"the position is updated only every {period:.3g} rows: those between repeat it or "
                "lie on lines, and are left out"
            )
        return Quantities(values, [*cells.notes, *without_faults(cells, values, rows)])
    at, velocity = values["time"][present], values["velocity"][present]
    moved = np.cumsum(np.append(0.0, (velocity[1:] + velocity[:-1]) / 2.0 * np.diff(at)))
    values["position"] = np.full(len(present), nan)
    values["position"][present] = moved
    cells.notes.append("the position is not recorded: it is the integral of the velocity")
    return Quantities(values, cells.notes)


def speed_and_force(table: Table, columns: Mapping[str, str]) -> Quantities:
    """Return the quantities of a table of tests at constant speeds: pairs of velocity and force.

    `columns` has both, and errors are those of `quantities_of`.
    """
    asked = _asked(table, columns, ("velocity", "force"))
    for name, expression in asked.items():
        _check_column(table, name, expression)
    cells = Cells(table, asked, columns_of(table, asked, asked["velocity"].places))
    return Quantities({name: np.atleast_1d(cells.value(name)) for name in asked}, cells.notes)


def _check_column(table: Table, name: str, asked: Expression) -> None:
    """Refuse a number in place of a column."""
    if not asked.places:
        raise InvalidInputError(f"{table.path}: {name} = {asked.text} must be a column")


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


def _at_clock(
    cells: Cells, times: Mapping[Clock, FloatArray], clocks: Mapping[str, Clock], rows: Rows
) -> Values:
    """Return all quantities but the time at the `rows` of the table.

    `times` are s by columns, and `clocks` the columns of the times of each quantity.
    """
    table, clock_time = cells.table, times[cells.asked["time"].places]
    time = picked(clock_time, rows)
    part = rows if table.form.session else range(len(clock_time))
    values = Values()
    for name in [name for name in cells.asked if name != "time"]:
        value, own_time = cells.value(name), times[clocks[name]]
        value = value if value.shape == own_time.shape else np.full(own_time.shape, value)
        if own_time is clock_time or np.array_equal(own_time, clock_time, equal_nan=True):
            values[name] = picked(value, rows)
            continue
        if own_time.shape == clock_time.shape:
            own_time, value = (picked(column, part) for column in (own_time, value))
        values[name] = _at(time, own_time, value, hold=name in FORCES)
        values[name][time > np.nanmax(own_time) + np.nanmedian(np.diff(own_time))] = nan
        cells.notes.extend(notes_of_another_clock(table, name, clocks[name], time, own_time))
    return values


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
    hold = name in FORCES
    note = f"{lacking:.0%} of the rows with a position have no {name}: it is "
    note += "held" if hold else "interpolated"
    return np.where(known, values, _at(time, time, values, hold=hold)), [note]
