"""The measures of a run: those of its samples, and those of its control forces and which acted."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Any, Protocol

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray, IntArray
from stickslip_ros.measures.cycle_fit import MeanCycle
from stickslip_ros.measures.sample_assumptions import EXACT, SampleAssumptions
from stickslip_ros.measures.sample_meter import MotionObserver, SampleMeter
from stickslip_ros.measures.timing import Timing
from stickslip_ros.samples import NO_FORCES, ForceColumns
from stickslip_ros.stamps import NANOSECONDS

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
        self._kept = NO_FORCES

    def feed(self, forces: ForceColumns) -> None:
        """Add the forces that follow.

        Forces that are not finite are skipped. Where time goes back, the last tenth is
        that of the time from there.
        """
        kept = self._kept.followed_by(forces[np.isfinite(forces.force)])
        if len(kept) == 0:
            return
        self._peak = max(self._peak, float(np.abs(kept.force).max()))
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
    def peak_force(self) -> float | None:
        """Largest magnitude of the force, N; None without forces."""
        return None if self._first is None else self._peak

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


@dataclass(frozen=True)
class RunAnalysis:
    """Results of a record beyond its measures."""

    mean_cycle: MeanCycle | None
    """Mean cycle under noise; None for exact samples, and cycles that are not alike."""
    slips: Mapping[str, Any] | None
    """Slips as `SlipMeter.report` has them; None if they were not asked for."""


class RunObserver(MotionObserver, Protocol):
    """Receives a run as it is measured; times in s from the start of the run, SI units."""

    def take_friction(self, time: FloatArray, force: FloatArray) -> None:
        """Receive the friction force on the slide at the samples that follow; NaN if unknown."""
        ...

    def take_control(self, time: FloatArray, force: FloatArray, acted: BoolArray) -> None:
        """Receive the control forces that follow, and whether each acted, as far as it is known."""
        ...

    def take_motor(self, time: FloatArray, states: FloatArray) -> None:
        """Receive displacement and velocity of slide and motor, as rows, shape (4, instants)."""
        ...

    def take_analysis(self, analysis: RunAnalysis) -> None:
        """Receive the analysis of the whole run, at its end."""
        ...


class RunMeter:
    """Measures a run from its record: the samples and the control forces."""

    def __init__(
        self,
        window: int,
        *,
        dropped_known: bool = False,
        observer: RunObserver | None = None,
        reading: SampleAssumptions = EXACT,
    ) -> None:
        """Average over the last `window` cycles at most; an `observer` receives motion and forces.

        `dropped_known` says whether dropped forces are reported; only then is it known which forces
        acted. `reading` as in `SampleMeter`.
        """
        self.motion = SampleMeter(window, observer, reading=reading)
        self.force = ForceMeter()
        """Control force as it was published."""
        self.applied = ForceMeter()
        """Control force that acted; a dropped one counts as zero."""
        self.dropped_known = dropped_known
        self.dropped = 0
        """Number of forces reported as dropped."""
        self.timing: Timing | None = None
        """How well the run kept its time; None while it is not known."""
        self._settler = ForceSettler()
        self._observer = observer

    def feed_forces(self, forces: ForceColumns, dropped: ForceColumns) -> None:
        """Add the forces that follow, published and dropped."""
        self.force.feed(forces)
        self.motion.drift.force.feed(forces.stamp / NANOSECONDS, forces.force)
        self.dropped += len(dropped)
        self._apply(*self._settler.feed(forces, dropped))

    def finish(self) -> None:
        """End the run: forces not reported as dropped have acted."""
        self._apply(*self._settler.feed(NO_FORCES, NO_FORCES, last=True))

    def _apply(self, sent: ForceColumns, acted: BoolArray) -> None:
        self.applied.feed(ForceColumns(sent.stamp, np.where(acted, sent.force, 0.0)))
        if self._observer is not None:
            time = (sent.stamp - self.motion.origin) / NANOSECONDS
            self._observer.take_control(time, sent.force, acted)

    def report(self, *, quick: bool = False) -> dict[str, Any]:
        """Return the measures and counts by name, ready for JSON; SI units.

        `notes` are sentences that say why the measures may be wrong. `quick` as in `SampleMeter`.
        """
        motion, timing = self.motion, self.timing
        notes: list[str] = []
        if timing is not None and (complaint := timing.warning()):
            doubt = "" if timing.in_time else "the regime is doubtful: "
            notes.append(doubt + complaint)
        measures = motion.measures(quick=quick)
        return {
            **measures.as_dict(),
            "position_noise": motion.position_noise,
            "peak_force": self.force.peak_force,
            "resting_force": self.force.resting_force,
            "peak_applied_force": self.applied.peak_force if self.dropped_known else None,
            "resting_applied_force": self.applied.resting_force if self.dropped_known else None,
            "dropped_forces": self.dropped if self.dropped_known else None,
            "late_forces": None if timing is None else timing.late_forces,
            "missed_deadlines": None if timing is None else timing.missed_deadlines,
            "in_time": None if timing is None else timing.in_time,
            "samples": motion.samples,
            "lost_samples": motion.lost_samples,
            "duration": motion.duration,
            "notes": [*notes, *motion.notes(measures)],
        }
