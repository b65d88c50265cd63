"""The measures of a run: those of its samples and those of its control forces."""

from typing import Any

import numpy as np

from stickslip_ros.physics.measures.control_forces import ForceMeter, ForceSettler, SettledForces
from stickslip_ros.physics.measures.observer import RunObserver
from stickslip_ros.physics.measures.reading import EXACT, Reading
from stickslip_ros.physics.measures.sample_meter import SampleMeter
from stickslip_ros.samples import ForceColumns
from stickslip_ros.stamps import NANOSECONDS


class RunMeter:
    """Measures a run from its record: the samples and the control forces."""

    def __init__(
        self,
        window: int,
        *,
        dropped_known: bool = False,
        observer: RunObserver | None = None,
        reading: Reading = EXACT,
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
        self._settler = ForceSettler()
        self._observer = observer

    def feed_forces(self, forces: ForceColumns, dropped: ForceColumns) -> SettledForces:
        """Add the forces that follow, published and dropped; return those that are settled."""
        self.force.feed(forces)
        self.dropped += len(dropped)
        return self._apply(self._settler.feed(forces, dropped))

    def finish(self) -> SettledForces:
        """End the run: forces not reported as dropped have acted. Return these forces."""
        return self._apply(self._settler.finish())

    def _apply(self, settled: SettledForces) -> SettledForces:
        sent, acted = settled
        self.applied.feed(ForceColumns(sent.stamp, np.where(acted, sent.force, 0.0)))
        if self._observer is not None:
            time = (sent.stamp - self.motion.origin) / NANOSECONDS
            self._observer.take_control(time, sent.force, acted)
        return settled

    def report(self, *, quick: bool = False) -> dict[str, Any]:
        """Return the measures and counts by name, ready for JSON; SI units.

        `notes` are sentences that say why the measures may be wrong. `quick` as in `SampleMeter`.
        """
        motion = self.motion
        notes: list[str] = []
        if motion.steps_back:
            notes.append(
                f"the stamp of {motion.steps_back} of {motion.samples} samples is not later than "
                "the one before, and the motion is cut there: the plant was restarted, or the "
                "samples of several plants are mixed"
            )
        return {
            **motion.measures(quick=quick).as_dict(),
            "position_noise": motion.position_noise,
            "peak_force": self.force.peak_force,
            "resting_force": self.force.resting_force,
            "peak_applied_force": self.applied.peak_force if self.dropped_known else None,
            "resting_applied_force": self.applied.resting_force if self.dropped_known else None,
            "dropped_forces": self.dropped if self.dropped_known else None,
            "samples": motion.samples,
            "lost_samples": motion.lost_samples,
            "duration": motion.duration,
            "notes": notes,
        }
