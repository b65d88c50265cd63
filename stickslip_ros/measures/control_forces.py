"""Control forces: which of them acted, and how large they were."""

from collections import Counter
from itertools import islice

import numpy as np

from stickslip_ros.arrays import BoolArray, IntArray
from stickslip_ros.samples import NO_FORCES, ForceColumns

HELD_FORCES = 20_000
"""Number of later forces during which a force may still be reported as dropped."""


class ForceMeter:
    """Measures the control force, fed in blocks of columns of any length.

    The result does not depend on how the run is divided into blocks. The meter keeps only past
    magnitudes that are larger than all later ones: no other can be the largest up to the end.
    """

    def __init__(self) -> None:
        self.peak_force: float | None = None
        """Largest magnitude of the force, N; None without forces."""
        self._first: int | None = None
        self._kept = NO_FORCES

    def feed(self, forces: ForceColumns) -> None:
        """Add the forces that follow.

        Forces that are not finite are skipped. Where time goes back, the last tenth is
        that of the time from there.
        """
        kept = self._kept.followed_by(forces[np.isfinite(forces.force)])
        if len(kept) == 0:
            return
        self.peak_force = max(self.peak_force or 0.0, float(np.abs(kept.force).max()))
        restarts = np.flatnonzero(np.diff(kept.stamp) < 0) + 1
        if len(restarts) > 0:
            kept, self._first = kept[restarts[-1] :], None
        if self._first is None:
            self._first = int(kept.stamp[0])
        magnitude, last = np.abs(kept.force), int(kept.stamp[-1])
        largest_later = np.maximum.accumulate(magnitude[:0:-1])[::-1]
        larger = np.append(magnitude[:-1] > largest_later, True)
        self._kept = kept[larger & (kept.stamp >= last - (last - self._first) // 10)]

    @property
    def resting_force(self) -> float | None:
        """Final force, the largest magnitude in the last tenth of the time, N, or None."""
        return None if self._first is None else float(np.abs(self._kept.force[0]))


class DroppedForces:
    """Forces that are reported as dropped, each kept until it is found among the published ones."""

    def __init__(self) -> None:
        self._number = Counter[tuple[int, float]]()

    def add(self, forces: ForceColumns) -> None:
        """Add forces that were dropped; forces that are not finite never act anyway."""
        forces = forces[np.isfinite(forces.force)]
        self._number.update(zip(forces.stamp.tolist(), forces.force.tolist(), strict=True))
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
            if self._number[force] > 0:
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
        self._held = NO_FORCES
        self._acting = np.empty(0)
        """The held forces, NaN where it is known that they did not act."""
        self._dropped = DroppedForces()

    def feed(
        self, sent: ForceColumns, dropped: ForceColumns, *, last: bool = False
    ) -> tuple[ForceColumns, BoolArray]:
        """Add published forces and dropped ones; return those that are settled and which acted.

        With these as the `last` ones, all are: no more reports follow.
        """
        self._held = self._held.followed_by(sent)
        self._acting = np.append(self._acting, sent.force)
        self._dropped.add(dropped)
        dropped_rows = self._dropped.among(ForceColumns(self._held.stamp, self._acting))
        self._acting[dropped_rows] = np.nan
        number = len(self._held) - (0 if last else min(len(self._held), HELD_FORCES))
        settled = self._held[:number], np.isfinite(self._acting[:number])
        self._held, self._acting = self._held[number:], self._acting[number:]
        return settled
