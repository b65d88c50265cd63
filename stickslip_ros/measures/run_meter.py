"""The measures of a run: those of its samples and those of its control forces."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, Protocol

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.measures.control_forces import ForceMeter, ForceSettler
from stickslip_ros.measures.mean_cycle import MeanCycle
from stickslip_ros.measures.sample_assumptions import EXACT, SampleAssumptions
from stickslip_ros.measures.sample_meter import MeasuredSamples, MotionObserver, SampleMeter
from stickslip_ros.measures.sampling_grid import LONGEST_GAP
from stickslip_ros.measures.timing import Timing
from stickslip_ros.samples import NO_FORCES, ForceColumns
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import quantity


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
        self.published: int | None = None
        """Number of samples published while the run was recorded; None while it is not known."""
        self.unmeasured = 0
        """Number of samples that were recorded and are not measured."""
        self._first_force: float = inf  # stamp, ns
        self._settler = ForceSettler()
        self._observer = observer

    def feed_forces(self, forces: ForceColumns, dropped: ForceColumns) -> None:
        """Add the forces that follow, published and dropped."""
        if len(forces):
            self._first_force = min(self._first_force, int(forces.stamp.min()))
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

    def report(self, measured: MeasuredSamples | None = None) -> dict[str, Any]:
        """Return the measures and counts by name, ready for JSON; SI units.

        They are those that the samples tell, which may have been `measured`. `notes` are sentences
        that say why the measures may be wrong.
        """
        motion, timing = self.motion, self.timing
        notes: list[str] = []
        samples = motion.samples + self.unmeasured
        lost: int | None = None
        if not motion.mixed:
            lost = max(motion.lost_samples - self.unmeasured, (self.published or 0) - samples, 0)
        if self.unmeasured:
            notes.append(f"{self.unmeasured} of the samples are recorded, and not measured here")
        if timing is not None and (complaint := timing.warning()):
            doubt = "" if timing.in_time else "the regime is doubtful: "
            notes.append(doubt + complaint)
        measured = measured or motion.measured()
        return {
            **measured.measures.as_dict(),
            "position_noise": motion.position_noise,
            "peak_force": self.force.peak_force,
            "resting_force": self.force.resting_force,
            "peak_applied_force": self.applied.peak_force if self.dropped_known else None,
            "resting_applied_force": self.applied.resting_force if self.dropped_known else None,
            "dropped_forces": self.dropped if self.dropped_known else None,
            "late_forces": None if timing is None else timing.late_forces,
            "missed_deadlines": None if timing is None else timing.missed_deadlines,
            "in_time": None if timing is None else timing.in_time,
            "samples": samples,
            "lost_samples": lost,
            "duration": None if motion.mixed else motion.duration,
            "notes": [*notes, *self._force_notes(), *measured.notes],
        }

    def _force_notes(self) -> list[str]:
        motion, late = self.motion, (self._first_force - self.motion.first) / NANOSECONDS
        if motion.mixed or not motion.samples or late == inf:
            return []
        if late <= LONGEST_GAP * motion.duration / motion.samples:
            return []
        if late > motion.duration:
            return ["the stamps of the control forces are later than those of all samples"]
        return [
            f"the first control force is {quantity(late, 's')} after the first sample: what acted "
            "before is not recorded, and the peak control force may be larger"
        ]
