"""Reads what recordings, bags or tables, have for identification."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.identification.even_clock import evenly_spaced
from stickslip_ros.identification.record import FEWEST, Record, lagged
from stickslip_ros.model.actuator import Actuator
from stickslip_ros.record.bag_layout import ANY_LAYOUT, BagLayout
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.report import values_of
from stickslip_ros.record.table_clock import stamps_of
from stickslip_ros.record.table_columns import ANY_FORM, Table, TableFormat
from stickslip_ros.record.table_file import is_table, table_of
from stickslip_ros.record.table_quantities import quantities_of
from stickslip_ros.samples import ForceColumns
from stickslip_ros.stamps import NANOSECONDS

_OPTIONAL = ("velocity", "disturbance", "reference")
"""Quantities that a table may lack if another one of the same machine has them."""
_MAY_LACK_VALUES = ("velocity", "reference")
"""Quantities without which samples are used."""
_Contents = tuple[IntArray, dict[str, FloatArray], float | None, Sequence[str]]
"""Stamps, ns, columns of a `Record`, the delay of the force, s, if it is known, and notes."""


def read_all(
    paths: Sequence[Path],
    columns: Mapping[str, str] | None = None,
    *,
    form: TableFormat = ANY_FORM,
    **options: Any,
) -> dict[Path, list[Record]]:
    """Return what several recordings of one machine have for identification, by path.

    What identification can do without, such as a disturbance, may be a column of some tables only:
    it is left out where a table lacks it. Options and errors are those of `read_records`.
    """
    tables = {path: table_of(path, form) for path in paths if is_table(path)}
    by_path: dict[Path, list[Record]] = {}
    for path in dict.fromkeys(paths):
        given, table = columns, tables.get(path)
        if columns is not None and table is not None:
            given = {
                quantity: text
                for quantity, text in columns.items()
                if table.has(text)
                or quantity not in _OPTIONAL
                or not any(other.has(text) for other in tables.values())
            }
        by_path[path] = read_records(path, given, table=table, **options)
    return by_path


def read_records(
    path: Path,
    columns: Mapping[str, str] | None = None,
    *,
    start: float = 0.0,
    end: float = inf,
    namespace: str | None = None,
    belt_speed: float | None = None,
    form: TableFormat = ANY_FORM,
    layout: BagLayout = ANY_LAYOUT,
    table: Table | None = None,
) -> list[Record]:
    """Return what a bag, or a CSV or MAT file, has for identification.

    The part that is used is from `start` to `end`, s from the first sample. Each part without a
    longer gap is a record. `columns` and `form` are those for `read_table`, `table` is what was
    opened already. `namespace` is that of the drive, if a bag holds several. `belt_speed`, m/s,
    is in place of the column of a table, and of a bag whose joint states have no belt; `layout`
    says where a bag of another machine has motion and force.
    Raises BagError if the recording cannot be read, and InvalidInputError if it lacks what
    identification needs.
    """
    if table is None and is_table(path):
        table = table_of(path, form)
    stamp, quantities, delay, notes = (
        _of_bag(path, namespace, belt_speed, layout)
        if table is None
        else _of_table(table, columns, belt_speed)
    )
    since = (stamp - stamp[0]) / NANOSECONDS
    part = (since >= start) & (since < end)
    if not part.any():
        part_of = f"from {start:g} s" + (f" to {end:g} s" if isfinite(end) else " on")
        raise InvalidInputError(f"{path} holds no samples {part_of}: it lasts {since.max():.4g} s")
    part_values = {name: values[part] for name, values in quantities.items()}
    records = evenly_spaced(str(path), stamp[part], part_values)
    return [replace(record, notes=tuple(notes), delay=delay) for record in records]


def _of_table(
    table: Table, columns: Mapping[str, str] | None, belt_speed: float | None
) -> _Contents:
    path = table.path
    if columns is None and "motor_position" in table.columns:
        raise _has_motor(path)
    columns = table.own_columns if columns is None else columns
    quantities, notes = quantities_of(table, columns, belt_speed)
    time = quantities.pop("time")
    belt = quantities.get("belt_velocity", np.full(len(time), 0.0))
    optional = ("force", "disturbance", "reference", "velocity")
    used = {name: quantities[name] for name in optional if name in quantities}
    used |= {"position": quantities["position"], "belt_velocity": belt}
    for name, values in used.items():
        count = np.count_nonzero(np.isfinite(values))
        if name not in _MAY_LACK_VALUES and count < FEWEST <= len(values):
            raise InvalidInputError(
                f"{path}: {name.replace('_', ' ')} (column {columns[name]}) has {count} finite "
                f"numbers in {len(values)} rows: identification needs at least {FEWEST}"
            )
    return stamps_of(path, time), used, None, notes


def _has_motor(path: Path) -> InvalidInputError:
    return InvalidInputError(
        f"identification needs an ideal motor: {path} has the motion of a motor, on which the "
        "force acts"
    )


def _of_bag(
    path: Path, namespace: str | None, belt_speed: float | None, layout: BagLayout
) -> _Contents:
    with Recording(path, namespace, belt_speed=belt_speed, layout=layout) as recording:
        states = recording.joint_states
        states = states[states.is_valid]
        if len(states) == 0:
            raise BagError(f"the bag {path} holds no joint states: the motion is unknown")
        forces, disturbances = recording.control_forces, recording.applied_disturbances
        references = recording.references
        notes = recording.notes
        plant = values_of(recording.metadata("stickslip_ros/plant") or {})
    if states.has_motor:
        raise _has_motor(path)
    stamp = states.stamp
    columns = {"position": states.position, "belt_velocity": states.belt_velocity}
    columns["velocity"] = states.velocity
    if len(forces):
        columns["force"] = _held(forces, stamp, plant)
    if len(disturbances):
        columns["disturbance"] = _since(stamp, disturbances.stamp, disturbances.force, before=0.0)
    if len(references):
        columns["reference"] = _since(stamp, references.stamp, references.position, before=nan)
    delay = plant.get("force_delay", 0.0)
    late = isinstance(delay, int | float) and delay > 0.0
    return stamp, columns, float(delay) if late else None, notes


def _held(forces: ForceColumns, stamp: IntArray, plant: Mapping[str, Any]) -> FloatArray:
    """Return the force that acts from each sample on: limited, rounded and late as by the actuator.

    Of a force that lags it is the mean until the next sample.
    """
    held = _since(stamp, forces.stamp, forces.force, before=0.0)
    given = {name: plant.get(f"actuator.{name}") for name in ("limit", "resolution")}
    limiter = Actuator(
        **{name: float(value) for name, value in given.items() if isinstance(value, int | float)}
    ).limiter
    if limiter is not None:
        held = np.array([limiter(force) for force in held.tolist()])
    time_constant = plant.get("actuator.time_constant", 0.0)
    if not isinstance(time_constant, int | float) or not time_constant > 0.0 or len(stamp) < 2:
        return held
    return lagged(held, float(np.median(np.diff(stamp))) / NANOSECONDS / time_constant)


def _since(stamp: IntArray, since: IntArray, values: FloatArray, *, before: float) -> FloatArray:
    """Return the newest value at each stamp, and another one before the first."""
    order = np.argsort(since, kind="stable")
    place = np.searchsorted(since[order], stamp, "right") - 1
    return np.where(place >= 0, values[order][np.maximum(place, 0)], before)
