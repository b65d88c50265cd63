"""The measures of control forces, and which of the published forces acted."""

from itertools import islice
from math import isfinite
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, IntArray
from stickslip_ros.samples import ForceColumns

HELD_FORCES = 20_000
"""Number of later forces during which a force may still be reported as dropped."""


class ForceMeter:
    """Measures the control force, fed in blocks of columns of any length.

    The result does not depend on how the run is divided into blocks. The meter keeps only past
    magnitudes that are larger than all later ones: no other can be the largest up to the end.
    """

    def __init__(self) -> None:
        self._peak = 0.0
        self._first: int | None = None
        self._stamp = np.empty(0, dtype=np.int64)
        self._magnitude = np.empty(0)

    def feed(self, forces: ForceColumns) -> None:
        """Add the forces that follow.

        Forces that are not finite are skipped. Where time goes back, the last tenth is
        that of the time from there.
        """
        finite = np.isfinite(forces.force)
        stamp = np.concatenate([self._stamp, forces.stamp[finite]])
        magnitude = np.concatenate([self._magnitude, np.abs(forces.force[finite])])
        if len(stamp) == 0:
            return
        self._peak = max(self._peak, float(magnitude.max()))
        restarts = np.flatnonzero(np.diff(stamp) < 0) + 1
        if len(restarts) > 0:
            stamp, magnitude = stamp[restarts[-1] :], magnitude[restarts[-1] :]
        if self._first is None or len(restarts) > 0:
            self._first = int(stamp[0])
        largest_later = np.maximum.accumulate(magnitude[:0:-1])[::-1]
        kept = np.append(magnitude[:-1] > largest_later, True)
        last = int(stamp[-1])
        kept &= stamp >= last - (last - self._first) // 10
        self._stamp, self._magnitude = stamp[kept], magnitude[kept]

    @property
    def peak_force(self) -> float | None:
        """Largest magnitude of the force, N; None without forces."""
        return None if self._first is None else self._peak

    @property
    def resting_force(self) -> float | None:
        """Final force, the largest magnitude in the last tenth of the time, N, or None."""
        return None if self._first is None else float(self._magnitude[0])


class SettledForces(NamedTuple):
    """Published forces, and whether each acted."""

    sent: ForceColumns
    acted: BoolArray


class DroppedForces:
    """Forces that are reported as dropped, each kept until it is found among the published ones."""

    def __init__(self) -> None:
        self._number: dict[tuple[int, float], int] = {}

    def add(self, forces: ForceColumns) -> None:
        """Add forces that were dropped; forces that are not finite never act anyway."""
        for dropped in zip(forces.stamp.tolist(), forces.force.tolist(), strict=True):
            if isfinite(dropped[1]):
                self._number[dropped] = self._number.get(dropped, 0) + 1
        for oldest in list(islice(self._number, max(0, len(self._number) - HELD_FORCES))):
            del self._number[oldest]

    def among(self, sent: ForceColumns) -> IntArray:
        """Return the rows of published forces that were dropped; each drop counts once."""
        if not self._number:
            return np.empty(0, np.int64)
        rows: list[int] = []
        known = np.isin(sent.stamp, [stamp for stamp, _ in self._number])
        for row in np.flatnonzero(known).tolist():
            force = int(sent.stamp[row]), float(sent.force[row])
            if force in self._number:
                rows.append(row)
                self._number[force] -= 1
                if self._number[force] == 0:
                    del self._number[force]
        return np.array(rows, np.int64)


class ForceSettler:
    """Determines which published forces acted, from those that were dropped.

    A force and the report that it was dropped may come in either order, up to 20,000 forces apart.
    """

    def __init__(self) -> None:
        self._held = ForceColumns(np.empty(0, np.int64), np.empty(0))
        self._acted = np.empty(0, np.bool_)
        """Whether each held force acted, as far as it is known."""
        self._dropped = DroppedForces()

    def feed(self, sent: ForceColumns, dropped: ForceColumns) -> SettledForces:
        """Add published forces and dropped ones; return the forces that are settled."""
        self._held = self._held.followed_by(sent)
        self._acted = np.concatenate([self._acted, np.isfinite(sent.force)])
        self._dropped.add(dropped)
        undecided = ForceColumns(self._held.stamp, np.where(self._acted, self._held.force, np.nan))
        self._acted[self._dropped.among(undecided)] = False
        return self._release(max(len(self._held) - HELD_FORCES, 0))

    def finish(self) -> SettledForces:
        """Return the forces still held: no more reports follow."""
        return self._release(len(self._held))

    def _release(self, number: int) -> SettledForces:
        settled = SettledForces(self._held[:number], self._acted[:number])
        self._held, self._acted = self._held[number:], self._acted[number:]
        return settled
