"""Recordings of machines as tables: CSV files, and MAT files of MATLAB."""

import re
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import inf, nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray
from stickslip_ros.bags.expressions import Expression, listed
from stickslip_ros.bags.mat_file import is_mat, vectors_of
from stickslip_ros.bags.reader import RunBlock
from stickslip_ros.bags.text_table import ANY_FORM, NO_UNITS, TableFormat, TextTable, unit_factor
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.files import open_regular
from stickslip_ros.samples import LARGEST, ForceColumns, SampleColumns
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import must_be_one_of, quantity

TABLE_SUFFIXES = (".csv", ".mat", ".txt", ".dat", ".tsv", ".log", ".asc")
"""Ends of the names of files that are tables, whatever they hold."""

_BAG_SUFFIXES = (".mcap", ".db3")
_MCAP = b"\x89MCAP"

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

LONGEST = 9e9
"""Longest time, s, that stamps can express."""

_OWN_COLUMNS = {
    "time": ("time",),
    "position": ("measured_position", "position"),
    "velocity": ("measured_velocity", "velocity"),
    "force": ("control_force",),
    "belt_velocity": ("belt_velocity",),
    "friction_force": ("friction_force",),
}
"""Columns of the files that `stickslip simulate --out` writes; the first one that exists."""

_MOST_NUMBERS = 1 << 24
"""Numbers of a MAT file."""

_UNITS = {"time": "s", "position": "m", "reference": "m", "velocity": "m/s", "belt_velocity": "m/s"}
"""Units of quantities; the others are forces."""
_ROTARY = {"m": "rad", "m/s": "rad/s", "N": "N m"}
_FORCES = ("force", "disturbance", "friction_force")
"""Quantities that hold until the next value."""
_MERGED_SHARE, _BETWEEN_SHARE = 0.3, 0.05
"""Share of the rows with a position that lack another quantity, from which it was recorded between
them; fewest of its values, as a share of the positions."""
_STEM = re.compile(r"[^\W\d_]+")
"""What the names of columns of times have in common: Time_1 and Time_2."""
_EVEN_ROWS, _CLOCK_ROWS, _COARSE_SHARE, _COMMON_SHARE = 10, 100_000, 0.02, 0.02
"""Fewest and most rows in which times are seen to be rounded; least step of that, as a share of the
period; share of the steps of time from which one is usual."""


@dataclass(frozen=True)
class TableRecording:
    """A recording from a table, in SI units; it is read as a `Recording` is, in one block."""

    samples: SampleColumns
    """The motion; time zero is the stamp 0."""
    forces: ForceColumns
    """Control force at each sample; empty if the table has none."""
    velocity_estimated: bool
    """Whether the velocities are estimated from the positions."""
    notes: tuple[str, ...]
    """Sentences on what the table does not have."""
    dropped_known = False
    """A table does not tell which forces did not act."""

    @property
    def topics(self) -> dict[str, str]:
        """A table has none."""
        return {}

    @property
    def missing(self) -> list[str]:
        """A table that can be read is complete."""
        return []

    def blocks(self, least: int = 1) -> Iterator[RunBlock]:
        """Yield the samples, the forces and no dropped forces."""
        yield RunBlock(self.samples, self.forces, self.forces[:0])

    def metadata(self, name: str) -> dict[str, str] | None:
        """Return None: a table has no metadata."""
        return None


def is_table(path: Path) -> bool:
    """Return whether a path names a table rather than a bag: by its end or its first bytes."""
    if path.suffix.lower() in TABLE_SUFFIXES:
        return True
    if not path.is_file() or any(each in _BAG_SUFFIXES for each in path.suffixes):
        return False
    with _reading(path), open_regular(path) as stream:
        return not stream.read(len(_MCAP)).startswith(_MCAP)


def read_table(
    path: Path,
    columns: Mapping[str, str] | None = None,
    belt_speed: float | None = None,
    form: TableFormat = ANY_FORM,
) -> TableRecording:
    r"""Read a recording from a table: a text such as a CSV file, or a MAT file.

    `columns` has, for some of `QUANTITIES`, an `Expression` of columns and numbers in SI units. A
    column by itself is converted, if the table has its unit. By default the file is one of
    `stickslip simulate --out`. A `belt_speed` is in place of a column. A velocity that is not given
    is the difference of the positions beside each sample. A belt whose velocity is not given is at
    rest. `form` is what is known of the form of a text.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from stickslip_ros.bags.table_file import read_table
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "log.csv")
    ...     _ = path.write_text("t;x [mm]\n0;1\n0,001;3\n")
    ...     recording = read_table(path, {"time": "t", "position": "x"})
    >>> recording.samples.stamp.tolist(), recording.samples.position.tolist()
    ([0, 1000000], [0.001, 0.003])
    """
    return _recording(path, quantities_of(table_of(path, form), columns, belt_speed))


@dataclass(frozen=True)
class Table:
    """A table of a file: what its columns are, and how they are read."""

    path: Path
    columns: Mapping[str, int]
    """Places of the columns by name; a column has several names, such as `x` and `#2`."""
    names: Sequence[str]
    """Name of each column; empty if it has none."""
    units: Sequence[str]
    """Units that the table has for its columns; empty where it has none."""
    read: Callable[[Sequence[int]], list[Any]]
    """Read columns by their places, as arrays of shape (rows,), or of a constant (1,)."""
    line: Callable[[int], str]
    """Name the place of a row in the file."""
    notes: Callable[[], Sequence[str]]
    """Return sentences on how the file was read."""

    def has(self, text: str) -> bool:
        """Return whether the table has all columns of an expression."""
        try:
            Expression.read(self.path, text, self.columns)
        except InvalidInputError:
            return False
        return True


def table_of(path: Path, form: TableFormat = ANY_FORM) -> Table:
    """Return the table in a text or MAT file; raises BagError."""
    with _reading(path):
        with open_regular(path) as stream:
            if is_mat(path, stream):
                found = vectors_of(stream, _MOST_NUMBERS)
                if not found:
                    raise ValueError("it has no column")
                vectors = [*found.values()]
                return Table(
                    path,
                    {name: place for place, name in enumerate(found)},
                    [*found],
                    [""] * len(found),
                    lambda wanted: [vectors[place] for place in wanted],
                    lambda row: f"row {row + 1}",
                    lambda: (),
                )
        text = TextTable(path, form)
        return Table(
            path,
            text.columns,
            text.names,
            text.units,
            text.read,
            text.line,
            lambda: text.notes,
        )


@contextmanager
def _reading(path: Path) -> Generator[None]:
    """Turn what a file raises that cannot be read into BagError."""
    try:
        yield
    except (OSError, ValueError, OverflowError, MemoryError) as error:
        if isinstance(error, InvalidInputError):
            raise
        reason = getattr(error, "strerror", None) or str(error).strip() or type(error).__name__
        raise BagError(f"{path}: the file cannot be read: {reason}") from None


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
    path = table.path
    if columns is None:
        columns = own_columns(path, table.columns)
    if belt_speed is not None:
        columns = {**columns, "belt_velocity": repr(float(belt_speed))}
    for name in columns:
        if name not in QUANTITIES:
            raise InvalidInputError(f"column {name} is invalid: {must_be_one_of(name, QUANTITIES)}")
    lacking = [name for name in ("time", "position") if name not in columns]
    if lacking:
        raise InvalidInputError(f"{path}: no column is given for {' and '.join(lacking)}")
    asked = {name: Expression.read(path, text, table.columns) for name, text in columns.items()}
    clock = asked["time"]
    if not clock.places:
        raise InvalidInputError(f"{path}: time = {columns['time']} must be a column")
    main = clock.places[0]
    own_clocks = {} if clock.places[1:] else _own_clocks(table, main)
    used = dict.fromkeys(place for each in asked.values() for place in each.places)
    with _reading(path):
        places = sorted({*used, *(own_clocks.get(place, main) for place in used)})
        raw = dict(zip(places, table.read(places), strict=True))
    rows = max(len(raw[place]) for place in clock.places)
    if not rows:
        raise BagError(f"{path}: the file cannot be read: it has no rows")
    for place in used:
        if len(raw[place]) not in (1, rows):
            raise InvalidInputError(
                f"{path}: {_name(table, place)} has {len(raw[place])} numbers and the time "
                f"{columns['time']} {rows}: columns must have the same length"
            )
    notes = [*table.notes(), *_remarks(table, raw, [*used])]
    factors: dict[str, float] = {}
    for name, each in asked.items():
        if each.bare:
            factors[name], note = _factor(table, name, each.places[0])
            notes += note
    counts = len(clock.places) > 1 or raw[main].dtype.kind == "i"
    exact = np.longdouble if counts else float  # a float has no digits for ns since 1970
    stamped = clock.value([np.asarray(raw[place], exact) for place in clock.places])
    known = np.isfinite(stamped)
    if not known.any():
        raise InvalidInputError(f"{path}: no time is a finite number")
    stamped = stamped if known.all() else stamped[known]
    time = np.asarray((stamped - stamped[0]) * factors.get("time", 1.0), float)
    if len(back := np.flatnonzero(np.diff(time) < 0.0)):
        line = table.line(int(np.flatnonzero(known)[back[0] + 1]))
        raise InvalidInputError(
            f"{path}: the time goes back {len(back)} times, the first time at {line}: rows must be "
            "in the order of time; a counter that wraps is time=unwrap(column, turn)"
        )
    values: dict[str, FloatArray] = {}
    for name, each in asked.items():
        if name == "time":
            continue
        cells: list[FloatArray] = []
        for place in each.places:
            own = own_clocks.get(place, main)
            column = np.asarray(raw[place], float)
            if own != main and not np.array_equal(raw[own], raw[main], equal_nan=True):
                column = _at(raw[main], raw[own], column, hold=name in _FORCES)
                notes.append(f"{name} has times of its own, those of column #{own + 1}")
            cells.append(column if len(column) == rows else column[0])
        value = np.broadcast_to(each.value(cells), known.shape)
        value = value if known.all() else value[known]
        if factors.get(name, 1.0) != 1.0:
            value = value * factors[name]
        size = np.abs(value)
        small = (size < 1.0 / LARGEST) & (size > 0.0)
        if small.any() or not np.all(size <= LARGEST):
            value = np.where(size <= LARGEST, np.where(small, 0.0, value), nan)
        values[name] = value
    present = np.isfinite(values["position"])
    if not present.any():
        raise InvalidInputError(f"{path}: no row has a time and a position, {columns['position']}")
    for name, value in values.items():
        if name not in ("position", "velocity"):
            values[name] = _between(name, time, value, present, notes)
    even, note = _unrounded(time)
    return Quantities({"time": even, **values}, [*notes, *note])


def _name(table: Table, place: int) -> str:
    names = (name for name, each in table.columns.items() if each == place and name[:1] != "#")
    return f"column {next(names, f'#{place + 1}')}"


def _own_clocks(table: Table, clock: int) -> dict[int, int]:
    """Return the times of each column by their places, if several are named like those of `clock`.

    They are the last ones before the column.
    """
    stems = [(_STEM.match(name) or [""])[0].lower() for name in table.names]
    alike = [place for place, stem in enumerate(stems) if stem and stem == stems[clock]]
    if len(alike) < 2 or clock != alike[0]:
        return {}
    return {
        place: max(each for each in alike if each < place)
        for place in range(clock + 1, len(stems))
        if place not in alike
    }


def _remarks(table: Table, raw: Mapping[int, FloatArray], places: Sequence[int]) -> Iterator[str]:
    """Yield sentences on cells that are left out."""
    for place in places:
        if raw[place].min() >= -LARGEST and raw[place].max() <= LARGEST:
            continue
        bad = np.flatnonzero(~(np.abs(raw[place]) <= LARGEST))
        value = raw[place][bad[0]]
        yield (
            f"{_name(table, place)} has no number in {len(bad)} of {len(raw[place])} rows"
            f"{f', or one as large as {value:.3g}' if np.isfinite(value) else ''}; the first "
            f"is {table.line(int(bad[0]))}"
        )


def _factor(table: Table, kind: str, place: int) -> tuple[float, list[str]]:
    """Return what converts a column to SI units, and sentences that say so."""
    given, unit = table.units[place], _UNITS.get(kind, "N")
    name = f"{kind}, {_name(table, place)},"
    if given.lower() in NO_UNITS:
        return 1.0, []
    factor = unit_factor(given, unit)
    if factor is not None:
        return factor, [] if factor == 1.0 else [f"{name} is in {given}, and converted to {unit}"]
    rotary = _ROTARY.get(unit, unit)
    factor = unit_factor(given, rotary)
    if factor is not None:
        return factor, [f"{name} is in {given}: what is in {unit} is in {rotary}"]
    return 1.0, [f"{name} is in {given}, which is no unit of {kind}: it is taken as {unit}"]


def _at(at: FloatArray, time: FloatArray, values: FloatArray, *, hold: bool) -> FloatArray:
    """Return values that are known at some times at others: held, or interpolated."""
    known = np.isfinite(time) & np.isfinite(values)
    if not known.any():
        return np.full(len(at), nan)
    time, values = time[known], values[known]
    if not hold:
        return np.interp(at, time, values, left=nan, right=nan)
    last = np.searchsorted(time, at, "right") - 1
    return np.where(last >= 0, values[last], nan)


def _between(
    name: str, time: FloatArray, values: FloatArray, present: BoolArray, notes: list[str]
) -> FloatArray:
    """Return a quantity at the rows with a position, if most of them lack it."""
    known = np.isfinite(values)
    lacking = 1.0 - np.mean(known[present])
    if lacking <= _MERGED_SHARE or np.count_nonzero(known) < _BETWEEN_SHARE * np.count_nonzero(
        present
    ):
        return values
    how = "held" if name in _FORCES else "interpolated"
    notes.append(f"{lacking:.0%} of the rows with a position have no {name}: it is {how}")
    return np.where(known, values, _at(time, time, values, hold=name in _FORCES))


def _unrounded(time: FloatArray) -> tuple[FloatArray, list[str]]:
    """Return even times for times that are even up to a rounding, and a sentence that says so.

    Between gaps of more than two steps of the rounding, they must be on a line to within a step.
    """
    steps = np.diff(time)
    if len(time) < _EVEN_ROWS or time[-1] > LONGEST or np.ptp(steps) < 0.5 / NANOSECONDS:
        return time, []
    sizes, counts = np.unique(np.rint(steps[:_CLOCK_ROWS] * NANOSECONDS), return_counts=True)
    sizes = sizes[counts >= _COMMON_SHARE * counts.sum()]  # others are gaps and lost rows
    step = float(np.diff(sizes).min(initial=inf)) / NANOSECONDS
    usual = float(np.median(steps))
    usual = float(np.mean(steps[steps <= usual + 1.5 * step]))
    stand = int(np.count_nonzero(steps == 0.0))
    if _COARSE_SHARE * usual <= step < inf:
        found, period = time.copy(), usual
        for rows in np.split(np.arange(len(time)), np.flatnonzero(steps > usual + 2.0 * step) + 1):
            if len(rows) < _EVEN_ROWS:
                continue
            own = time[rows]
            number = np.arange(len(rows)) - (len(rows) - 1) / 2.0
            period = float(number @ (own - own.mean()) / (number @ number))
            short = (float(f"{period:.{digits}g}") for digits in range(1, 12))
            period = next((p for p in short if abs(p - period) * len(rows) < 0.05 * step), period)
            apart = own - period * np.arange(len(rows))
            if np.ptp(apart) > 1.05 * step:
                break
            found[rows] = float(apart.min() + apart.max()) / 2.0 + period * np.arange(len(rows))
        else:
            return found - found[0], [
                f"the times are rounded to {quantity(step, 's')}: the rows are taken as evenly "
                f"spaced, {quantity(period, 's')} apart"
            ]
    if stand:
        return time, [f"{stand} of {len(time)} rows have the time of the row before"]
    return time, []


def stamps_of(path: Path, time: FloatArray) -> IntArray:
    """Return times, s, as stamps, ns, from the first one; InvalidInputError if they are too far."""
    if np.abs(time).max() > LONGEST:
        raise InvalidInputError(f"{path}: the times differ by more than {LONGEST:g} s")
    return np.rint(time * NANOSECONDS).astype(np.int64)


def _recording(path: Path, found: Quantities) -> TableRecording:
    values, notes = found.values, [*found.notes]
    time, position = values["time"], values["position"]
    stamp = stamps_of(path, time)
    present = np.isfinite(position)
    unknown, rest = np.full(len(time), nan), np.zeros(len(time))
    velocity = values.get("velocity", unknown)
    lacking = present & ~np.isfinite(velocity)
    if "velocity" not in values:
        notes.append("the velocity is not recorded: it is the difference of the positions")
    elif lacking.any():
        notes.append(
            f"{np.count_nonzero(lacking)} rows have a position and no velocity: it is the "
            "difference of the positions"
        )
    if "belt_velocity" not in values:
        notes.append("the belt velocity is not recorded: the belt counts as at rest")
    differences = unknown.copy()
    differences[present] = _differences(time[present], position[present])
    samples = SampleColumns(
        stamp,
        position,
        np.where(lacking, differences, velocity),
        values.get("friction_force", unknown),
        unknown,
        values.get("belt_velocity", rest),
    )
    forces = ForceColumns(stamp[:0], rest[:0])
    if "force" in values:
        forces = ForceColumns(stamp, values["force"])
    estimated = 2 * np.count_nonzero(lacking) > np.count_nonzero(present)
    return TableRecording(samples, forces, bool(estimated), tuple(notes))


def _differences(time: FloatArray, position: FloatArray) -> FloatArray:
    """Return the velocity at each time, by the positions on both sides; NaN where time stands."""
    if len(time) < 2:
        return np.zeros(len(time))
    after = np.minimum(np.arange(len(time)) + 1, len(time) - 1)
    before = np.maximum(np.arange(len(time)) - 1, 0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return (position[after] - position[before]) / (time[after] - time[before])


def own_columns(path: Path, known: Mapping[str, int]) -> dict[str, str]:
    """Return the columns by quantity of a table that `stickslip simulate --out` has written.

    Raises InvalidInputError for another one.
    """
    own = {
        quantity: next((name for name in names if name in known), "")
        for quantity, names in _OWN_COLUMNS.items()
    }
    if not own["time"] or not own["position"]:
        raise InvalidInputError(
            f"{path} has the columns {listed(known)}, and not those of "
            "`stickslip simulate --out`: say what they are, as in --columns "
            "time=t,position=x,force=u*2.5"
        )
    return {quantity: name for quantity, name in own.items() if name}
