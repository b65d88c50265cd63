"""Faults and imperfections of a run that a table shows: they are left out, or refused, or told."""

import re
from collections.abc import Iterator
from math import nan
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.record.faults import Jumps, lost_velocities, shift_note
from stickslip_ros.record.header_units import units_in
from stickslip_ros.record.imperfections import play_note, ripple_note
from stickslip_ros.record.table_clock import Rows, finite_rows, picked
from stickslip_ros.record.table_units import Cells

Values = dict[str, FloatArray]
"""Quantities by name, arrays of shape (rows,)."""
_DRIVES = re.compile(r"(?i)mot|enc|spind|screw|c?mdpos|cmd|soll|ref|set|target|consigne|vis\b")
"""Starts of words in the name of a column with the position of what drives the slide."""
_SMALLEST_TURN, _SAME_TURN = 256.0, 0.01
"""Least turn of a counter that wraps once; relative difference of a jump from it."""


def without_faults(cells: Cells, values: Values, rows: Rows) -> Iterator[str]:
    """Leave out what no motion makes; yield sentences on this, and on what the values show.

    `values` are quantities at the `rows` of the table. Raises InvalidInputError if the positions
    are those of a counter that wraps.
    """
    yield from _without_lost_positions(cells, values, rows)
    if "velocity" in values:
        position, velocity = values["position"], values["velocity"]
        both = np.flatnonzero(np.isfinite(position) & np.isfinite(velocity))
        fault, spikes = lost_velocities(values["time"][both], position[both], velocity[both])
        if fault is not None:
            values["velocity"] = np.full(len(velocity), nan)
            yield f"the velocity {fault}: it is left out"
        elif spikes.any():
            first = cells.table.line(int(rows[both[spikes][0]]))
            yield _left_out(values, "velocity", both[spikes], first, "the positions do not")
    units = ("rad", "N m") if cells.table.form.rotary else ("m", "N")
    if "reference" in values:
        yield from play_note(values["reference"], values["position"], units[0], "the reference")
    else:
        for name, column in _driving_columns(cells):
            driving = picked(column, rows)
            if driving.shape == values["position"].shape:
                yield from play_note(driving, values["position"], units[0], name)
    if "force" in values:
        yield from ripple_note(values["time"], values["position"], values["force"], units)


def _driving_columns(cells: Cells) -> Iterator[tuple[str, FloatArray]]:
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
                yield (
                    table.name(place),
                    np.asarray(column, float) * cells.conversions["position"].factor,
                )
            return


def _without_lost_positions(cells: Cells, values: Values, rows: Rows) -> Iterator[str]:
    """Leave out positions that no motion makes; yield sentences on them."""
    table, factor = cells.table, cells.conversions["position"].factor
    present = finite_rows(values["position"])
    jumps = Jumps(picked(values["position"], present), _rounding(cells))

    def line(row: Any) -> str:
        return table.line(int(rows[present[row]]))

    turns = {
        row: turn
        for row, size in jumps.shifts()
        if (turn := _turn_of_counter(cells, int(rows[present[row]]), size))
    }
    wrap = jumps.wrap() or (max(turns.values(), default=0.0), [*turns])
    if wrap[0]:
        size, after = wrap
        turn, often = f"{size / factor:.10g}", "once" if len(after) == 1 else f"{len(after)} times"
        text = f"unwrap({cells.asked['position'].text}, {turn})"
        raise InvalidInputError(
            f"{table.path}: the position jumps {often} by {turn}, the "
            f"first time at {line(after[0])}, as of a counter that wraps: position="
            f"{text}{'' if factor == 1.0 else f'*{factor:.12g}'}"
        )
    if len(lost := jumps.dropouts()):
        first, lost = line(lost[0]), lost if isinstance(present, range) else present[lost]
        yield _left_out(values, "position", lost, first, "no motion does")
    for row, size in jumps.shifts():
        place = f"at {line(row)}, {values['time'][present[row]]:.6g} s after the first row"
        yield shift_note(size, place, "rad" if table.form.rotary else "m")


def _left_out(values: Values, name: str, lost: IntArray, first: str, why: str) -> str:
    """Leave out what a quantity jumps to, and back from; return the sentence on this."""
    values[name] = values[name].copy()
    values[name][lost] = nan
    return (
        f"the {name} jumps away and back, as {why}, in {len(lost)} rows, the first is {first}: "
        "they are left out"
    )


def _rounding(cells: Cells) -> float:
    """Return how much the position, linear in its columns, errs by the last digits of these."""
    asked = cells.asked["position"]
    rows = np.zeros((len(asked.places), 1 + len(asked.places)))  # no column, and each by itself
    for number, place in enumerate(asked.places):
        column = np.abs(cells.columns[place])
        largest = np.max(column, where=np.isfinite(column), initial=0.0)
        rows[number, 1 + number] = np.spacing(largest)
    values = np.atleast_1d(asked.value([*rows])) * cells.conversions["position"].factor
    with np.errstate(all="ignore"):
        return float(np.nan_to_num(np.sum(np.abs(values - values[0])), posinf=0.0))


def _turn_of_counter(cells: Cells, row: int, size: float) -> float:
    """Return the turn of a counter that jumps by a power of 2 at a row; 0 if it does not.

    Its column must be of whole numbers; `size` is that of the jump, in the unit of the position.
    """
    if len(places := cells.asked["position"].places) != 1:
        return 0.0
    near = np.asarray(cells.columns[places[0]], float)[max(0, row - 9) : row + 9]
    jump = float(np.max(np.abs(np.diff(near)), initial=1.0))
    turn = 2.0 ** np.rint(np.log2(jump))
    whole = turn >= _SMALLEST_TURN and np.all(near == np.rint(near))
    return abs(size) * turn / jump if whole and abs(turn - jump) <= _SAME_TURN * turn else 0.0
