"""The measures of a run: those of its samples and those of its control forces."""

from typing import Any

import numpy as np

from stickslip_ros.physics.measures.control_forces import ForceMeter, ForceSettler, SettledForces
from stickslip_ros.physics.measures.observer import RunObserver
from stickslip_ros.physics.measures.sample_meter import SampleMeter
from stickslip_ros.samples import ForceColumns
from stickslip_ros.stamps import NANOSECONDS


class RunMeter:
    """Measures a run from what is recorded of it: the samples and the control force."""

    def __init__(
        self, window: int, *, dropped_known: bool = False, observer: RunObserver | None = None
    ) -> None:
        """Average over the last `window` cycles at most; an `observer` sees motion and forces.

        `dropped_known` says whether it is told which forces were dropped; only then it is known
        which acted.
        """
        self.motion = SampleMeter(window, observer)
        self.force = ForceMeter()
        """The force as it was sent."""
        self.applied = ForceMeter()
        """The force that acted; one that was dropped counts as none."""
        self.dropped_known = dropped_known
        self.dropped = 0
        """Forces that were told to be dropped."""
        self._settler = ForceSettler()
        self._observer = observer

    def feed_forces(self, forces: ForceColumns, dropped: ForceColumns) -> SettledForces:
        """Take the forces that follow, sent and dropped; return those of which it is settled."""
        self.force.feed(forces)
        self.dropped += len(dropped)
        return self._apply(self._settler.feed(forces, dropped))

    def finish(self) -> SettledForces:
        """End the run: what was not told to be dropped has acted. Return these forces."""
        return self._apply(self._settler.finish())

    def _apply(self, settled: SettledForces) -> SettledForces:
        sent, acted = settled
        self.applied.feed(ForceColumns(sent.stamp, np.where(acted, sent.force, 0.0)))
        if self._observer is not None:
            time = (sent.stamp - self.motion.origin) / NANOSECONDS
            self._observer.take_control(time, sent.force, acted)
        return settled

    def report(self) -> dict[str, Any]:
        """Return the measures and counts by name, ready for JSON; SI units.

        `notes` are sentences on what makes the measures doubtful.
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
            **motion.measures().as_dict(),
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
