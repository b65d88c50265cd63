"""A recording as identification uses it: evenly spaced samples of the motion and its inputs."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.stamps import NANOSECONDS

_FEWEST = 500
"""Fewest samples of a record."""
_LONGEST_GAP = 3.5
"""Longest distance of samples, in periods, that is bridged."""
_SLOW = 1.5
"""Steps of the encoder between samples below which rounding errors of successive ones are alike."""
_TURN = 10
"""Largest number of samples of a turning point."""
_FEW = 0.2
"""Share of samples up to which turning points are left out."""


@dataclass(frozen=True, eq=False)
class Record:
    """Evenly spaced samples of a slide and of what acts on it, arrays of shape (samples,).

    Examples
    --------
    >>> import numpy as np
    >>> from stickslip_ros.identification.record import Record
    >>> still = Record("log.csv", 1e-3, np.zeros(1000), np.full(1000, 0.04))
    >>> still.duration, still.part(0, 500).duration
    (1.0, 0.5)
    """

    name: str
    """What it was read from."""
    period: float
    """Sample period, s."""
    position: FloatArray
    """Measured displacement of the slide, m."""
    belt_velocity: FloatArray
    """Velocity of the belt, m/s."""
    force: FloatArray | None = None
    """Force on the slide, N, held from each sample to the next; None: none is recorded."""
    disturbance: FloatArray | None = None
    """Further known force on the slide, N, held likewise; None: none is recorded."""
    reference: FloatArray | None = None
    """Displacement that a controller followed, m; None: none is recorded."""

    @property
    def duration(self) -> float:
        """Number of samples times the period, s."""
        return len(self.position) * self.period

    @property
    def held_force(self) -> FloatArray:
        """Total of the known forces, N; zero if none is recorded."""
        total = np.zeros(len(self.position))
        for each in (self.force, self.disturbance):
            if each is not None:
                total = total + each
        return total

    @cached_property
    def weight(self) -> FloatArray:
        """Weight of the error of each position.

        The rounding error of an encoder stays the same while the position does, as at rest:
        successive samples of the same position count as one. At the turning points of a periodic
        motion it is the same in each cycle: they have no weight, if other samples are enough.
        """
        changes = np.flatnonzero(np.diff(self.position)) + 1
        lengths = np.diff([0, *changes.tolist(), len(self.position)])
        found = np.repeat(1.0 / np.sqrt(lengths), lengths)
        turning = _turning(self.position)
        if np.mean(turning) < _FEW:
            found[turning] = 0.0
        return found

    def part(self, start: int, end: int) -> Self:
        """Return the samples from `start` to before `end`."""
        optional = {
            name: None if column is None else column[start:end]
            for name in ("force", "disturbance", "reference")
            for column in (getattr(self, name),)
        }
        return replace(
            self,
            position=self.position[start:end],
            belt_velocity=self.belt_velocity[start:end],
            **optional,
        )


def evenly_spaced(name: str, stamp: IntArray, columns: dict[str, FloatArray]) -> list[Record]:
    """Return records with even spacing from samples whose clock may jitter and have gaps.

    Parameters
    ----------
    name : str
        What the samples were read from.
    stamp : array of shape (samples,)
        Stamps, ns.
    columns : dict
        Columns of `Record` by name. Samples of which one is not finite count as missing; only the
        reference may be.

    Returns
    -------
    list of Record
        A record for each part without a longer gap. Positions between samples are interpolated,
        forces are held.

    Raises
    ------
    InvalidInputError
        If no part is long enough.
    """
    known = np.ones(len(stamp), bool)
    for each in columns.keys() - {"reference"}:
        known &= np.isfinite(columns[each])
    known &= np.diff(stamp, prepend=np.iinfo(np.int64).min // 2) > 0
    time = (stamp[known] - stamp[0]) / NANOSECONDS
    columns = {each: values[known] for each, values in columns.items()}
    if len(time) < _FEWEST:
        raise InvalidInputError(
            f"{name} has {len(time)} samples: identification needs at least {_FEWEST}"
        )
    period = float(np.median(np.diff(time)))
    # Stamps are whole nanoseconds; the mean of the usual steps is the period.
    steps = np.diff(time)
    period = float(np.mean(steps[np.abs(steps - period) < 0.25 * period]))
    breaks = np.flatnonzero(steps > _LONGEST_GAP * period) + 1
    records: list[Record] = []
    for rows in np.split(np.arange(len(time)), breaks):
        if len(rows) < _FEWEST:
            continue
        own = time[rows]
        even = own[0] + period * np.arange(round((own[-1] - own[0]) / period) + 1)
        found: dict[str, FloatArray] = {}
        for each, values in columns.items():
            if np.abs(own - even[: len(own)]).max() < 1e-3 * period and len(own) == len(even):
                found[each] = values[rows]
            elif each in ("force", "disturbance"):
                last = np.searchsorted(own, even + 0.25 * period, "right") - 1
                found[each] = values[rows][np.maximum(last, 0)]
            else:
                found[each] = np.interp(even, own, values[rows])
        records.append(Record(name, period, **found))
    if not records:
        raise InvalidInputError(
            f"{name} has no {_FEWEST} samples without a gap of more than {_LONGEST_GAP:.0f} periods"
        )
    return records


def _turning(position: FloatArray) -> BoolArray:
    """Return which samples are at a turning point, within a few steps of the encoder."""
    steps = np.diff(position)
    sizes = np.abs(steps)
    found = np.zeros(len(position), bool)
    if not sizes.any():
        return found
    slow = sizes < _SLOW * float(sizes[sizes > 0.0].min())
    edges = np.flatnonzero(np.diff(np.concatenate([[False], slow, [False]])))
    for first, end in edges.reshape(-1, 2).tolist():
        inside = 0 < first and end < len(steps)
        if inside and end - first < _TURN and steps[first - 1] * steps[end] < 0.0:
            found[first : end + 1] = True
    return found
