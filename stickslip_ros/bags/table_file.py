"""Recordings of machines as tables: CSV files, and MAT files of MATLAB."""

import re
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray
from stickslip_ros.bags.expressions import Expression, listed
from stickslip_ros.bags.faults import Jumps, velocity_fault
from stickslip_ros.bags.mat_file import is_mat, vectors_of
from stickslip_ros.bags.reader import RunBlock
from stickslip_ros.bags.table_clock import even_times, stamps_of
from stickslip_ros.bags.text_table import ANY_FORM, NO_UNITS, TableFormat, TextTable, unit_factor
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.files import open_regular
from stickslip_ros.samples import LARGEST, ForceColumns, SampleColumns
from stickslip_ros.text import must_be_one_of

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
_NUMBER = re.compile(r"_?\d*$")
"""What the names of several columns of times differ by: Time_1 and Time_2."""


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
    columns = own_columns(table.path, table.columns) if columns is None else columns
    if belt_speed is not None:
        columns = {**columns, "belt_velocity": repr(float(belt_speed))}
    asked = _asked(table, columns, ("time", "position"))
    if not asked["time"].places:
        raise InvalidInputError(f"{table.path}: time = {columns['time']} must be a column")
    clocks = {name: _clocks(table, asked["time"].places, each) for name, each in asked.items()}
    cells = _cells(table, asked, asked["time"].places, *clocks.values())
    notes = [*table.notes(), *_lost_cells(table, cells, asked)]
    factors: dict[str, float] = {}
    for name, each in asked.items():
        factors[name], note = _factor(table, name, each)
        notes += note
    absolute = {
        places: _times(asked["time"], [cells[place] for place in places])
        for places in dict.fromkeys(clocks.values())
    }
    main = absolute[asked["time"].places]
    known = np.isfinite(main)
    rows = np.flatnonzero(known)
    if not len(rows):
        raise InvalidInputError(f"{table.path}: no time is a finite number")
    times = {
        places: np.asarray((each - main[rows[0]]) * factors["time"], float)
        for places, each in absolute.items()
    }
    clock = times[asked["time"].places]
    time = clock if known.all() else clock[rows]
    _check_order(table, time, rows)
    values: dict[str, FloatArray] = {}
    for name, each in asked.items():
        if name == "time":
            continue
        value = each.value([np.asarray(cells[place], float) for place in each.places])
        value = _measurable(value if factors[name] == 1.0 else value * factors[name])
        own = times[clocks[name]]
        if own is clock or np.array_equal(own, clock, equal_nan=True):
            if np.shape(value) != main.shape:
                value = np.full(main.shape, value)
            values[name] = value if known.all() else value[rows]
        else:
            values[name] = _at(time, own, value, hold=name in _FORCES)
            notes.append(f"{name} has times of its own, those of column #{clocks[name][0] + 1}")
    present = np.isfinite(values["position"])
    if not present.any():
        text = asked["position"].text
        raise InvalidInputError(f"{table.path}: no row has a time and a position, {text}")
    for name in values.keys() - {"position", "velocity"}:
        values[name], note = _merged(name, time, values[name], present)
        notes += note
    time, note = even_times(time)
    values["time"] = time
    notes += note
    notes += _without_faults(table, asked, values, rows, factors["position"])
    return Quantities(values, notes)


def speed_and_force(table: Table, columns: Mapping[str, str]) -> Quantities:
    """Return the quantities of a table of tests at constant speeds: pairs of velocity and force.

    `columns` has both, and errors are those of `quantities_of`.
    """
    asked = _asked(table, columns, ("velocity", "force"))
    cells = _cells(table, asked, asked["velocity"].places)
    notes = [*table.notes(), *_lost_cells(table, cells, asked)]
    values: dict[str, FloatArray] = {}
    for name, each in asked.items():
        factor, note = _factor(table, name, each)
        value = each.value([np.asarray(cells[place], float) for place in each.places])
        values[name] = _measurable(np.atleast_1d(value) * factor)
        notes += note
    return Quantities(values, notes)


def _asked(
    table: Table, columns: Mapping[str, str], needed: Sequence[str]
) -> dict[str, Expression]:
    """Return the expression of each quantity; refuse what is no quantity, or not enough."""
    for name in columns:
        if name not in QUANTITIES:
            raise InvalidInputError(f"column {name} is invalid: {must_be_one_of(name, QUANTITIES)}")
    lacking = [name for name in needed if name not in columns]
    if lacking:
        pairs = "; pairs of velocity and force are read by identify --map" * (
            {"velocity", "force"} == {*columns}
        )
        raise InvalidInputError(
            f"{table.path}: no column is given for {' and '.join(lacking)}{pairs}"
        )
    return {
        name: Expression.read(table.path, text, table.columns) for name, text in columns.items()
    }


def _cells(
    table: Table, asked: Mapping[str, Expression], leading: Sequence[int], *others: Sequence[int]
) -> dict[int, Any]:
    """Return the columns of expressions, and other ones, by place.

    The length of the table is that of the leading ones; others of another length are refused.
    """
    places = [each.places for each in asked.values()]
    used = sorted({place for each in (*places, *others) for place in each})
    with _reading(table.path):
        cells = dict(zip(used, table.read(used), strict=True))
    rows = max((len(cells[place]) for place in leading), default=0)
    if not rows:
        raise BagError(f"{table.path}: the file cannot be read: it has no rows")
    for place, column in cells.items():
        if len(column) not in (1, rows):
            raise InvalidInputError(
                f"{table.path}: {_name(table, place)} has {len(column)} numbers and "
                f"{_name(table, leading[0])} {rows}: columns must have the same length"
            )
    return cells


def _name(table: Table, place: int) -> str:
    names = (name for name, each in table.columns.items() if each == place and name[:1] != "#")
    return f"column {next(names, f'#{place + 1}')}"


def _clocks(table: Table, clock: tuple[int, ...], asked: Expression) -> tuple[int, ...]:
    """Return the columns of the times of an expression.

    They are those of the time or, if this is one column, the last one before a column that is named
    like it, such as Time_2 after Time_1.
    """
    stems, first = [_NUMBER.sub("", name) for name in table.names], clock[0]
    if len(clock) > 1 or not stems[first]:
        return clock
    alike = [place for place, stem in enumerate(stems) if stem == stems[first]]
    own = {
        max((each for each in alike if each < place and place not in alike), default=first)
        for place in asked.places
    }
    return tuple(own) if len(own) == 1 and alike[0] == first else clock


def _times(clock: Expression, cells: Sequence[Any]) -> Any:
    """Return the times that a table has, in its unit."""
    counts = len(cells) > 1 or cells[0].dtype.kind == "i"
    exact = np.longdouble if counts else float  # a float has no digits for ns since 1970
    return clock.value([np.asarray(each, exact) for each in cells])


def _check_order(table: Table, time: FloatArray, rows: IntArray) -> None:
    """Refuse times that go back."""
    back = np.flatnonzero(np.diff(time) < 0.0)
    if len(back):
        raise InvalidInputError(
            f"{table.path}: the time goes back {len(back)} times, the first time at "
            f"{table.line(int(rows[back[0] + 1]))}: rows must be in the order of time; a counter "
            "that wraps is time=unwrap(column, turn)"
        )


def _lost_cells(
    table: Table, cells: Mapping[int, Any], asked: Mapping[str, Expression]
) -> Iterator[str]:
    """Yield sentences on cells that are left out."""
    for place in dict.fromkeys(place for each in asked.values() for place in each.places):
        column = cells[place]
        if column.min() >= -LARGEST and column.max() <= LARGEST:
            continue
        bad = np.flatnonzero(~(np.abs(column) <= LARGEST))
        value = column[bad[0]]
        yield (
            f"{_name(table, place)} has no number in {len(bad)} of {len(column)} rows"
            f"{f', or one as large as {value:.3g}' if np.isfinite(value) else ''}; the first "
            f"is {table.line(int(bad[0]))}"
        )


def _factor(table: Table, kind: str, asked: Expression) -> tuple[float, list[str]]:
    """Return what converts a column by itself to SI units, and sentences that say so."""
    if not asked.bare or table.units[asked.places[0]].lower() in NO_UNITS:
        return 1.0, []
    given, unit = table.units[asked.places[0]], _UNITS.get(kind, "N")
    name = f"{kind}, {_name(table, asked.places[0])},"
    factor = unit_factor(given, unit)
    if factor is not None:
        return factor, [] if factor == 1.0 else [f"{name} is in {given}, and converted to {unit}"]
    rotary = _ROTARY.get(unit, unit)
    factor = unit_factor(given, rotary)
    if factor is not None:
        return factor, [
            f"{name} is in {given}: what is in {unit} is in {rotary}, as --rotary shows"
        ]
    return 1.0, [f"{name} is in {given}, which is no unit of {kind}: it is taken as {unit}"]


def _measurable(values: FloatArray) -> FloatArray:
    """Return values with NaN for those above 1e100, and zero for those below 1e-100."""
    size = np.abs(values)
    small = (size < 1.0 / LARGEST) & (size > 0.0)
    if small.any() or not np.all(size <= LARGEST):
        return np.where(size <= LARGEST, np.where(small, 0.0, values), nan)
    return values


def _without_faults(
    table: Table,
    asked: Mapping[str, Expression],
    values: dict[str, FloatArray],
    rows: IntArray,
    factor: float,
) -> Iterator[str]:
    """Leave out positions that no motion makes, and velocities that contradict the others."""

    def line(found: IntArray) -> str:
        return table.line(int(rows[found[0]]))

    position = values["position"]
    present = np.flatnonzero(np.isfinite(position))
    jumps = Jumps(position if len(present) == len(position) else position[present])
    wrap = jumps.wrap()
    if wrap is not None:
        turn = f"{wrap.turn / factor:.10g}"
        text = f"unwrap({asked['position'].text}, {turn})"
        raise InvalidInputError(
            f"{table.path}: the position jumps {len(wrap.rows)} times by {turn}, the "
            f"first time at {line(present[wrap.rows])}, as of a counter that wraps: position="
            f"{text}{'' if factor == 1.0 else f'*{factor:g}'}"
        )
    lost = jumps.dropouts()
    if lost.any():
        values["position"] = position = position.copy()
        position[present[lost]] = nan
        yield (
            f"the position jumps away and back, as no motion does, in {np.count_nonzero(lost)} "
            f"rows, the first is {line(present[lost])}: they are left out"
        )
    if "velocity" not in values:
        return
    time, velocity = values["time"], values["velocity"]
    both = np.flatnonzero(np.isfinite(position) & np.isfinite(velocity))
    time, position, own = time[both], position[both], velocity[both]
    spikes = Jumps(own).dropouts()
    if spikes.any():
        between = np.interp(time, time[~spikes], own[~spikes])
        by_position = differences(time, position)
        spikes &= np.abs(own - by_position) > np.abs(between - by_position)
    fault = velocity_fault(time[~spikes], position[~spikes], own[~spikes])
    if fault is not None:
        values["velocity"] = np.full(len(rows), nan)
        yield f"the velocity {fault}: it is left out"
    elif spikes.any():
        values["velocity"] = velocity = velocity.copy()
        velocity[both[spikes]] = nan
        yield (
            "the velocity jumps away and back, as the positions do not, in "
            f"{np.count_nonzero(spikes)} rows, the first is {line(both[spikes])}: they are left out"
        )


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
    if lacking.any():
        by_position = np.full(len(time), nan)
        by_position[present] = differences(time[present], position[present])
        velocity = np.where(lacking, by_position, velocity)
    samples = SampleColumns(
        stamp,
        position,
        velocity,
        values.get("friction_force", unknown),
        unknown,
        values.get("belt_velocity", rest),
    )
    if not samples.is_valid.any():
        empty = [name for name, value in values.items() if not np.isfinite(value[present]).any()]
        raise InvalidInputError(
            f"{path}: no row gives a sample: no position has a number of {' and '.join(empty)} "
            "beside it"
        )
    forces = ForceColumns(stamp[:0], rest[:0])
    if "force" in values:
        forces = ForceColumns(stamp, values["force"])
    estimated = 2 * np.count_nonzero(lacking) > np.count_nonzero(present)
    return TableRecording(samples, forces, bool(estimated), tuple(notes))


def differences(time: FloatArray, position: FloatArray) -> FloatArray:
    """Return the velocity at each time, by the positions on both sides; NaN where time stands."""
    if len(time) < 2:
        return np.zeros(len(time))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        moved, lasted = (
            np.concatenate([each[1:2] - each[:1], each[2:] - each[:-2], each[-1:] - each[-2:-1]])
            for each in (position, time)
        )
        return moved / lasted


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
