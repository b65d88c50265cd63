"""Records with an even clock from samples whose clock may jitter, wander and have gaps."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.record import FEWEST, Record, mean_held
from stickslip_ros.stamps import NANOSECONDS

_LONGEST_GAP = 3.5
"""Longest distance of samples, in periods, that is bridged."""
_LONGEST_DIFFERENCE, _DIFFERENCE_ERROR = 8, 1e-6
"""Samples over which a velocity may be a difference of positions; its error, in the largest one."""
_MISSING_DISTANCE = 0.75
"""Distance of a sample, in periods, from which it counts as missing."""
_STEP_TOLERANCE, _EVEN_SHARE = 0.25, 0.6
"""Largest difference of a time step from the period, as a share of it; share of the steps, at
least, that are so near."""
_JITTER = 0.25
"""Distance of samples from an even clock, in periods, up to which it jitters."""


def evenly_spaced(name: str, stamp: IntArray, columns: Mapping[str, FloatArray]) -> list[Record]:
    """Return records with even spacing from samples whose clock may jitter and have gaps.

    Stamps are in ns; columns are those of `Record`. Samples of which one is not finite count as
    missing; only the reference may be. Velocities are left out if they are differences of the
    positions, or if less than half of them are finite. Each part without a longer gap is a record:
    positions between samples are interpolated, forces are held; where the clock does more than
    jitter a force is the mean of what is held meanwhile. Raises InvalidInputError if no part is
    long enough, or the clock is not even up to gaps and jitter.
    """
    columns = dict(columns)
    velocity = columns.get("velocity")
    if velocity is not None and np.mean(np.isfinite(velocity)) < 0.5:
        del columns["velocity"]
    _check_clock(name, stamp)
    known = np.ones(len(stamp), bool)
    for column in columns.keys() - {"reference"}:
        known &= np.isfinite(columns[column])
    known &= np.diff(stamp, prepend=np.iinfo(np.int64).min // 2) > 0
    time = (stamp[known] - stamp[0]) / NANOSECONDS
    columns = {column: values[known] for column, values in columns.items()}
    if len(time) < FEWEST:
        raise InvalidInputError(
            f"{name} has {len(time)} samples: identification needs at least {FEWEST}"
        )
    steps = np.diff(time)
    # Where every other sample is missing, half of the steps are double.
    usual = float(np.quantile(steps, 0.5, method="lower"))
    # Stamps are whole nanoseconds; the mean of the usual steps is the period.
    period = float(np.mean(steps[np.abs(steps - usual) <= _STEP_TOLERANCE * usual]))
    breaks = np.flatnonzero(steps > _LONGEST_GAP * period) + 1
    records: list[Record] = []
    parts = np.split(np.arange(len(time)), breaks)
    long_enough = [rows for rows in parts if len(rows) >= FEWEST]
    left_out = 1.0 - sum(map(len, long_enough)) / len(time)
    for rows in long_enough:
        times = time[rows]
        even = times[0] + period * np.arange(round((times[-1] - times[0]) / period) + 1)
        far = _distances(even, times) > _MISSING_DISTANCE * period
        fields: dict[str, Any] = {"missing": far if far.any() else None, "left_out": left_out}
        jitters = float(_distances(times, even).max()) <= _JITTER * period
        as_measured = len(times) == len(even) and np.abs(times - even).max() < 1e-3 * period
        for column, values in columns.items():
            if as_measured:
                fields[column] = values[rows]
            elif column in ("force", "disturbance") and not jitters:
                fields[column] = mean_held(times, values[rows], np.append(even, even[-1] + period))
            elif column in ("force", "disturbance"):
                last = np.searchsorted(times, even + _JITTER * period, "right") - 1
                fields[column] = values[rows][np.maximum(last, 0)]
            else:
                fields[column] = np.interp(even, times, values[rows])
        if "velocity" in fields and _is_difference(fields["velocity"], fields["position"], period):
            del fields["velocity"]
        records.append(Record(name, period, **fields))
    if not records:
        raise InvalidInputError(
            f"{name} has no {FEWEST} samples without a gap of more than {_LONGEST_GAP:g} periods"
        )
    return records


def _check_clock(name: str, stamp: IntArray) -> None:
    """Refuse times that jump back, or whose steps are of no usual size."""
    steps = np.diff(stamp) / NANOSECONDS
    if not len(steps):
        return
    forward = steps[steps > 0.0]
    usual = float(np.median(forward)) if len(forward) else 0.0
    near = np.abs(forward - usual) <= _STEP_TOLERANCE * usual
    if float(steps.min()) < 0.0 or not len(forward) or float(np.mean(near)) < _EVEN_SHARE:
        raise InvalidInputError(
            f"{name}: the time steps are from {steps.min():.4g} s to {steps.max():.4g} s: they "
            "must be even up to gaps"
        )


def _distances(times: FloatArray, samples: FloatArray) -> FloatArray:
    """Return the distance of each time from the nearest sample; both increase."""
    after = np.clip(np.searchsorted(samples, times), 1, len(samples) - 1)
    return np.minimum(np.abs(samples[after] - times), np.abs(times - samples[after - 1]))


def _is_difference(velocity: FloatArray, position: FloatArray, period: float) -> bool:
    """Return whether velocities are made from the positions, over some samples or centrally."""
    allowed = _DIFFERENCE_ERROR * float(np.abs(velocity).max())
    for span in range(1, _LONGEST_DIFFERENCE + 1):
        differences = (position[span:] - position[:-span]) / (span * period)
        for late in {span, span // 2}:
            recorded = velocity[late : late + len(differences)]
            if float(np.median(np.abs(recorded - differences))) <= allowed:
                return True
    return False
