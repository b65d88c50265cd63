"""The result of a run of the closed loop: columns, measures, diagnostics."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import RunError
from stickslip_ros.measures.cycle_measures import Measures
from stickslip_ros.measures.run_meter import RunMeter
from stickslip_ros.measures.sample_assumptions import SampleAssumptions
from stickslip_ros.record.reader import Recording
from stickslip_ros.samples import ForceColumns, SampleColumns


class Diagnostics(NamedTuple):
    """Diagnostics of a node at the end of a run, as on /diagnostics.

    Examples
    --------
    >>> from stickslip_ros.testing import ClosedLoop
    >>> with ClosedLoop("feed_drive") as loop:
    ...     plant = loop.run(0.1).diagnostics["plant"]
    >>> plant.message, plant.figures["samples"]
    ('', 101)
    """

    level: bytes
    """OK, WARN or ERROR of diagnostic_msgs/msg/DiagnosticStatus."""
    message: str
    """The problem; empty if there is none."""
    figures: dict[str, Any]
    """Values by key, as in the table of diagnostics."""


@dataclass(frozen=True, eq=False)
class RunResult:
    """The recording and the measures of one run; SI units, stamps in ns.

    Examples
    --------
    >>> from stickslip_ros.testing import ClosedLoop
    >>> with ClosedLoop("feed_drive", controller=None) as loop:
    ...     result = loop.run(2.0)
    >>> str(result.measures.regime), result.peak_force
    ('stick_slip', None)
    >>> len(result.time) == len(result.states)
    True
    """

    states: SampleColumns
    """All samples."""
    forces: ForceColumns
    """All published control forces, each with the stamp of the sample that it answers."""
    dropped_forces: ForceColumns
    """The control forces that did not act."""
    disturbances: ForceColumns
    """The disturbance force at each sample at which it changed."""
    measures: Measures
    """Measures over the last whole cycles of this run, at most `analyzer.window` of them."""
    peak_force: float | None
    """Largest magnitude of the published control force, N; None without forces."""
    resting_force: float | None
    """Final force: the same over the last tenth of the run."""
    peak_applied_force: float | None
    """Largest magnitude of the control force that acted, N; None without forces."""
    resting_applied_force: float | None
    """Final applied force: the same over the last tenth of the run."""
    late_forces: int
    """Number of samples whose force had not arrived when it was due."""
    lost_samples: int
    """Number of samples missing in `states`; always 0 in lockstep."""
    diagnostics: dict[str, Diagnostics]
    """Diagnostics by node name: plant and, if it ran, the controller."""

    @property
    def time(self) -> FloatArray:
        """Time of each sample since the first one of this run, s."""
        return (self.states.stamp - self.states.stamp[0]) * 1e-9


def result_of(
    bag: Path, window: int, reading: SampleAssumptions, diagnostics: dict[str, Diagnostics]
) -> RunResult:
    """Read a run and measure it over the last `window` cycles.

    Raises RunError if the recording is incomplete, BagError if it cannot be read.
    """
    with Recording(bag) as recording:
        states, forces = recording.joint_states, recording.control_forces
        disturbances, dropped = recording.applied_disturbances, recording.dropped_forces
        if not recording.complete:
            raise RunError(f"the recording of the run failed: {'; '.join(recording.missing)}")
    meter = RunMeter(window, reading=reading)
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
