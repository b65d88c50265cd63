"""The times of a table: which columns they are, whether they are rounded, and their stamps."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray, windows
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.record.expressions import Expression
from stickslip_ros.record.table_columns import ROW, SECOND, Table, reading_file
from stickslip_ros.record.table_units import Cells, conversion
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import quantity

Clock = tuple[int, ...]
"""Places of the columns that tell times."""
Rows = range | IntArray
"""Rows of a table; a range stands for all."""
LONGEST = 9e9
"""Longest time, s, that stamps can express."""
_LATEST, _DAYS, _INSTANT = 1e11, (2e4, 1e6), 1e-5
"""Latest date, s since 1970; days since 1900 or 0, of which spreadsheets count dates, and steps of
them of less than a second."""
_FEWEST, _MOST = 10, 100_000
"""Fewest rows of a part that is evenly spaced; rows in which a rounding is looked for."""
_COARSE_SHARE, _COMMON_SHARE, _MULTIPLE = 0.02, 0.02, 1e-3
"""Least step of a rounding, as a share of the period; share of the steps of time from which one is
usual: others are gaps and lost rows; distance of a multiple, in steps of the rounding."""
_TURNS = [
    float(f"{turn}e{power}")
    for turn in (86_400, 3_600, *(2**bits for bits in (8, 16, 24, 31, 32)))
    for power in (-9, -6, -3, 0, 3, 6, 9)
]
"""Turns of clocks and counters, in any units."""
_MOST_SESSIONS, _TURNING_SHARE, _SAME_STEP = 20, 0.3, 0.01
"""Most sessions of a table; share of rows with the time of the row before, from which several rows
have the same; relative difference of the same steps."""
_NUMBER = re.compile(r"_?\d*$")
"""What the names of several columns of times differ by: Time_1 and Time_2."""
_UNSEEN = 0.005
"""Share of the times at which a quantity of another clock may be unknown without a word."""


def finite_rows(values: FloatArray) -> Rows:
    """Return the rows with a number."""
    known = np.isfinite(values)
    return range(len(known)) if known.all() else np.flatnonzero(known)


def picked(values: FloatArray, rows: Rows) -> FloatArray:
    """Return rows of values."""
    return values if isinstance(rows, range) else values[rows]


def columns_of(
    table: Table, asked: Mapping[str, Expression], leading: Clock, *others: Clock
) -> dict[int, Any]:
    """Return the columns of expressions, and other ones, by place.

    The length of the table is that of the leading ones; others of another length are refused.
    """
    places = [*others, *(expression.places for expression in asked.values())]
    used = sorted({place for group in places for place in group} - {ROW})
    with reading_file(table.path):
        columns = dict(zip(used, table.read(used), strict=True))
    if ROW in leading:
        rows = max((len(column) for column in columns.values()), default=0)
        columns[ROW] = np.arange(rows, dtype=np.float64)
    if not max((len(columns[place]) for place in leading), default=0):
        raise BagError(f"{table.path}: the file cannot be read: it has no rows")
    for place, column in columns.items():
        lead = (clock_beside(table, leading, [place]) or leading)[0]
        if len(column) not in (1, len(columns[lead])):
            raise InvalidInputError(
                f"{table.path}: {table.name(place)} has {len(column)} numbers and "
                f"{table.name(lead)} {len(columns[lead])}: columns must have the same length"
            )
    return columns


def times_of(
    cells: Cells, clock: Clock, others: Iterable[Clock]
) -> tuple[dict[Clock, FloatArray], Rows]:
    """Return times by columns, s from the first of the clock, and the rows that have one."""
    table, asked, (factor, units) = cells.table, cells.asked["time"], cells.conversions["time"]
    times: dict[Clock, Any] = {}
    for places in dict.fromkeys((clock, *others)):
        columns = [cells.columns[place] for place in places]
        counts = len(columns) > 1 or columns[0].dtype.kind == "i"
        exact = np.longdouble if counts else float  # a float has no digits for ns since 1970
        times[places] = asked.value([np.asarray(column, exact) for column in columns])
    rows = finite_rows(times[clock])
    if not len(rows):
        raise InvalidInputError(f"{table.path}: no time is a finite number")
    rows = in_order(table, asked, factor, times[clock], rows)
    if rows[0] > rows[-1]:
        cells.notes.append("the rows are read from the last one on: the newest is the first")
    if asked.bare and not units and asked.places[0] not in table.clocks:
        step = float(np.median(np.diff(picked(times[clock], rows)))) if len(rows) > 1 else 0.0
        column, first = table.number(clock[0]), float(times[clock][rows[0]])
        factor, notes = unit_of_steps(step, first, table.period, column)
        cells.notes.extend(notes)
    if table.form.shift and len(times) == 1:
        raise InvalidInputError(
            f"{table.path}: shift is for columns with times of their own, and all have "
            f"those of {asked.text}"
        )
    first = times[clock][rows[0]]
    for places, stamps in times.items():
        since = stamps - first if first else stamps
        since = since if factor == 1.0 else since * factor
        if places != clock:
            other, units = conversion(table, "time", replace(asked, places=places))
            if other != factor and (units or clock_beside(table, clock, places)):
                since = stamps * other - first * factor
        since = np.asarray(since, float)
        times[places] = since if places == clock else since + table.form.shift
    return times, rows


def in_order(table: Table, clock: Expression, factor: float, time: FloatArray, rows: Rows) -> Rows:
    """Return the rows of the session that was chosen, or all.

    `time` is in the unit of the table, s times `factor`. Raises InvalidInputError with a way where
    it goes back.
    """
    time = picked(time, rows)
    back = np.flatnonzero(time[1:] < time[:-1]) + 1
    bounds, session = [0, *back.tolist(), len(time)], table.form.session
    if session is not None:
        if session >= len(bounds):
            raise InvalidInputError(
                f"session = {session} is invalid: {table.path} has {len(bounds) - 1}"
            )
        return np.asarray(rows)[bounds[session - 1] : bounds[session]]
    if not len(back):
        return rows
    if len(back) == len(time) - 1 > 1:  # the newest first
        return np.asarray(rows)[::-1]
    before, after = float(time[back[0] - 1]), float(time[back[0]])
    step = before - float(time[max(0, back[0] - 2)])
    turns = (turn for turn in _TURNS if abs(before + step - after - turn) < 1.5 * step)
    turn = next(filter(lambda turn: turn > 10.0 * step, turns), None)
    what = f"goes back {len(back)} times, the first time at {table.line(int(rows[back[0]]))}"
    if turn:
        column = table.number(clock.places[0]) if clock.bare else clock.text
        way = "" if factor == 1.0 else f"*{factor:.12g}"
        what += f", as a counter that wraps: time=unwrap({column}, {turn:.12g}){way}"
    elif len(back) <= _MOST_SESSIONS:
        sizes = " and ".join(map(str, np.diff(bounds)))
        what += (
            f", where a session of its own starts: --session 1 takes the first of {sizes} rows; "
            "of several joints, --where COLUMN=VALUE takes the rows of one"
        )
    else:
        what += ": rows must be in the order of time"
        if table.period:
            what += f"; without one they are {table.period[0]:g} s apart, by a line above them"
    raise InvalidInputError(f"{table.path}: the time {what}")


def check_turns(table: Table, time: FloatArray) -> None:
    """Refuse rows of several joints that have the same times."""
    same = np.count_nonzero(time[1:] == time[:-1])
    if same < _TURNING_SHARE * len(time) or table.form.where or not (turns := table.turns):
        return
    place, turn = turns
    name = table.name(place).removeprefix("column ")
    raise InvalidInputError(
        f"{table.path}: each time is that of several rows, in which {name} is "
        f"{' and '.join(turn[:_MOST_SESSIONS])}: --where '{name}={turn[0]}' takes one"
    )


def unit_of_steps(
    step: float, first: float, period: tuple[float, float] | None, column: str
) -> tuple[float, list[str]]:
    """Return the unit of times without one, s, by their usual step and the first, and sentences.

    `period` is that of the rows in s and in a unit of the table, if that is told.
    """
    lasting, in_unit = period or (nan, nan)
    if period and step == 1.0:  # row numbers
        in_unit = 1.0
    if in_unit != lasting and abs(step - in_unit) < _SAME_STEP * in_unit:
        text = quantity(lasting, "s")
        return lasting / in_unit, [
            f"the time is converted: steps of {in_unit:g} are {text} by a line above"
        ]
    if step < _INSTANT and _DAYS[0] < first < _DAYS[1]:
        raise InvalidInputError(
            f"the time starts at {first:.6g} and has steps of {step:.2g}, as days have: "
            f"time={column}*86400 converts it, and time={column}*1 takes it as s"
        )
    if step < 1.0:
        return 1.0, []
    if first > _LATEST:
        raise InvalidInputError(
            f"the time starts at {first:.6g}, which is no date in s: time={column}*NUMBER converts "
            "it, with 0.001 from ms, 1e-06 from µs, 1e-07 from 100 ns, 1e-09 from ns"
        )
    unit, factor = ("ms", "0.001") if step < 100.0 else ("µs", "1e-06")
    return 1.0, [
        f"the time has no unit and counts in s, {quantity(step, 's')} from row to row: in {unit} "
        f"it is time={column}*{factor}"
    ]


def even_times(time: FloatArray) -> tuple[FloatArray, list[str]]:
    """Return even times, s, for times that are even up to a rounding, and sentences on them.

    Between gaps of more than two steps of the rounding, they must be on a line to within a step.
    """
    if len(time) < _FEWEST or time[-1] > LONGEST:
        return time, []
    rounding, notes = _rounding(np.diff(time[:_MOST])), list[str]()
    if rounding:
        steps = np.diff(time)
        gaps = np.flatnonzero(steps > np.median(steps) + 2.5 * rounding) + 1
        parts = [_even(part, rounding) for part in np.split(time, gaps)]
        even = np.concatenate([time[:0], *(part for part in parts if part is not None)])
        if len(even) == len(time):
            period = quantity(float(np.median(np.diff(even))), "s")
            return even - even[0], [
                f"the times are rounded to {quantity(rounding, 's')}: the rows are taken as evenly "
                f"spaced, {period} apart"
            ]
        multiples, digits = steps / rounding, np.log10(rounding)
        whole = np.abs(multiples - np.rint(multiples)) < _MULTIPLE
        if np.mean(whole) > 1.0 - _COMMON_SHARE and abs(digits - round(digits)) < _MULTIPLE:
            share = rounding / float(np.median(steps))
            notes = [
                f"the times are multiples of {quantity(rounding, 's')}: if they are rounded, "
                f"velocities err by {share:.0%}"
            ]
    if stand := int(np.count_nonzero(time[1:] == time[:-1])):
        way = ": --period in place of it tells rows apart" * (stand > _TURNING_SHARE * len(time))
        notes.append(f"{stand} of {len(time)} rows have the time of the row before{way}")
    return time, notes


def stamps_of(path: Path, time: FloatArray) -> IntArray:
    """Return times, s, as stamps, ns, from the first one; InvalidInputError if they are too far."""
    if max(time.max(), -time.min()) > LONGEST:
        raise InvalidInputError(f"{path}: the times differ by more than {LONGEST:g} s")
    stamp = np.empty(len(time), np.int64)
    for part in windows(len(time)):
        stamp[part] = np.rint(time[part] * NANOSECONDS)
    return stamp


def _rounding(steps: FloatArray) -> float:
    """Return the least difference of usual steps, s; 0 if it is a small share of them."""
    sizes, counts = np.unique(np.rint(steps * NANOSECONDS), return_counts=True)
    sizes = sizes[counts >= _COMMON_SHARE * counts.sum()] / NANOSECONDS
    step = float(np.diff(sizes).min(initial=np.inf))
    return step if _COARSE_SHARE * float(np.median(steps)) <= step < np.inf else 0.0


def _even(time: FloatArray, rounding: float) -> FloatArray | None:
    """Return the times of a part on a line, those of a short one as they are; None without one."""
    if len(time) < _FEWEST:
        return time
    rows = np.arange(len(time), dtype=np.float64)
    period = float(np.polyfit(rows, time - time[0], 1)[0])
    short = (float(f"{period:.{digits}g}") for digits in range(1, 10))
    near = 0.05 * rounding / len(time)
    line = rows * next((candidate for candidate in short if abs(candidate - period) < near), period)
    apart = time - line
    if np.ptp(apart) > 1.05 * rounding:
        return None
    return line + float(apart.min() + apart.max()) / 2.0


def clock_of(table: Table, clock: Clock, asked: Expression) -> Clock:
    """Return the columns of the times of an expression.

    They are those of the time or, if this is one column, the last one before a column that is named
    like it, such as Time_2 after Time_1.
    """
    if beside := clock_beside(table, clock, asked.places):
        return beside
    stems, first = [_NUMBER.sub("", name) for name in table.names], clock[0]
    if len(clock) > 1 or first == ROW or not stems[first]:
        return clock
    alike = [place for place, stem in enumerate(stems) if stem == stems[first]]
    clocks = {
        max((column for column in alike if column < place and place not in alike), default=first)
        for place in asked.places
    }
    return tuple(clocks) if len(clocks) == 1 and alike[0] == first else clock


def clock_beside(table: Table, clock: Clock, places: Sequence[int]) -> Clock:
    """Return the times of columns of a second table, which are named like those of the clock."""
    first = table.second_from
    later = [first is not None and place >= first for place in places]
    if not any(later):
        return ()
    if not all(later):
        names = " and ".join(map(table.name, places))
        raise InvalidInputError(f"{table.path}: {names} have clocks of their own")
    times: list[int] = []
    for place in () if ROW in clock else clock:
        known = [name for name, column in table.columns.items() if column == place]
        named = [name for name in known if not name.startswith("#")] or known
        alike = [SECOND + name for name in named if SECOND + name in table.columns]
        if not alike:
            raise InvalidInputError(
                f"{table.path}: the second table has no {table.name(place)}, that of the times"
            )
        times.append(table.columns[alike[-1]])
    return tuple(times)


def notes_of_another_clock(
    table: Table, name: str, clock: Clock, time: FloatArray, own_time: FloatArray
) -> Iterator[str]:
    """Yield a sentence on a quantity with times of its own, s; refuse times apart from the others.

    `clock` are the columns of its times, `time` those of the other quantities, `own_time` its own.
    """
    start, end = float(np.nanmin(own_time)), float(np.nanmax(own_time))
    text = f"{name} has times of its own, those of {table.name(clock[0])}"
    if not (start <= time[-1] and end >= time[0]):
        shift = float(f"{table.form.shift + time[0] - start:.6g}")
        raise InvalidInputError(
            f"{table.path}: {text}, from {start:.6g} s to {end:.6g} s after the first of the "
            f"others, which end at {time[-1]:.6g} s: --shift {shift:g} lets both start together"
        )
    outside = float(np.mean((time < start) | (time > end)))
    yield text + f", and is not known at {outside:.0%} of the others" * (outside >= _UNSEEN)
