"""The meter of a run: of its samples and its control forces."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, Protocol

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.measures.control_forces import ForceMeter, ForceSettler
from stickslip_ros.measures.following import Followed
from stickslip_ros.measures.mean_cycle import MeanCycle
from stickslip_ros.measures.sample_assumptions import EXACT, SampleAssumptions
from stickslip_ros.measures.sample_meter import MotionObserver, SampleMeter
from stickslip_ros.measures.timing import Timing
from stickslip_ros.samples import NO_FORCES, ForceColumns
from stickslip_ros.stamps import NANOSECONDS


@dataclass(frozen=True)
class RunAnalysis:
    """Results of a record beyond its measures."""

    mean_cycle: MeanCycle | None
    """Mean cycle under noise; None for exact samples, and cycles that are not alike."""
    slips: Mapping[str, Any] | None
    """Slips as `slip_report` has them; None if they were not asked for."""
    followed: Followed | None = None
    """How it follows its reference; None without one."""


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
    """Measures a run from its record, the samples and the control forces; see `report_of`."""

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
        self.first_force = inf
        """Smallest stamp of a control force, ns; infinite without one."""
        self.followed: Followed | None = None
        """How the run follows its reference; None while it is not known, or without one."""
        self._settler = ForceSettler()
        self._observer = observer

    def feed_forces(self, forces: ForceColumns, dropped: ForceColumns) -> None:
        """Add the forces that follow, published and dropped."""
        if len(forces):
            self.first_force = min(self.first_force, int(forces.stamp.min()))
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
