"""What a run of the closed loop gave: columns, measures, diagnostics."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from stickslip_ros.arrays import FloatArray
from stickslip_ros.bags import Recording
from stickslip_ros.errors import RunError
from stickslip_ros.physics.measures.cycle_measures import Measures
from stickslip_ros.physics.measures.run_meter import RunMeter
from stickslip_ros.samples import ForceColumns, SampleColumns


class Diagnostics(NamedTuple):
    """What a node said of itself at the end of a run."""

    level: bytes
    """As in diagnostic_msgs/DiagnosticStatus: OK, WARN or ERROR."""
    message: str
    """What is wrong, in words; empty: nothing."""
    figures: dict[str, Any]


@dataclass(frozen=True, eq=False)
class RunResult:
    """One run: what was recorded in it, and what that comes to; SI units, stamps in ns."""

    states: SampleColumns
    """Every sample."""
    forces: ForceColumns
    """Every control force that was published; its stamp is that of the sample it answers."""
    dropped_forces: ForceColumns
    """Those of them that did not act."""
    disturbances: ForceColumns
    """The disturbance force at each sample at which it changed."""
    measures: Measures
    """Of the last whole cycles of this run, `analyzer.window` at most."""
    peak_force: float | None
    """Largest magnitude of the control force, N, as it was published; None without forces."""
    resting_force: float | None
    """The same over the last tenth of the run."""
    peak_applied_force: float | None
    """Largest magnitude of the control force that acted, N; None without forces."""
    resting_applied_force: float | None
    """The same over the last tenth of the run."""
    late_forces: int
    """Samples whose force had not come when it was due."""
    lost_samples: int
    """Samples that are missing in `states`; in lockstep none ever is."""
    diagnostics: dict[str, Diagnostics]
    """By the name of the node: plant and, if it ran, washout_controller."""

    @property
    def time(self) -> FloatArray:
        """Time of each sample from the first one of this run, s."""
        return (self.states.stamp - self.states.stamp[0]) * 1e-9

    @property
    def force_time(self) -> FloatArray:
        """Time of the sample that each force answers, from the first sample of this run, s."""
        return (self.forces.stamp - self.states.stamp[0]) * 1e-9


def result_of(bag: Path, window: int, diagnostics: dict[str, Diagnostics]) -> RunResult:
    """Read and measure a run, over the last `window` cycles.

    Raises RunError if the recording is not complete, BagError if it cannot be read.
    """
    with Recording(bag) as recording:
        states, forces = recording.joint_states, recording.control_forces
        disturbances, dropped = recording.applied_disturbances, recording.dropped_forces
        if not recording.complete:
            raise RunError(f"the recording of the run failed: {'; '.join(recording.missing)}")
    meter = RunMeter(window)
    meter.motion.feed(states)
    meter.feed_forces(forces, dropped)
    meter.finish()
    return RunResult(
        states=states,
        forces=forces,
        dropped_forces=dropped,
        disturbances=disturbances,
        measures=meter.motion.measures(),
        peak_force=meter.force.peak_force,
        resting_force=meter.force.resting_force,
        peak_applied_force=meter.applied.peak_force,
        resting_applied_force=meter.applied.resting_force,
        late_forces=diagnostics["plant"].figures["late_forces"],
        lost_samples=meter.motion.lost_samples,
        diagnostics=diagnostics,
    )
