"""The report of a run: the measures and counts that it has beside those of the cycles."""

from dataclasses import asdict, dataclass
from math import inf
from typing import Annotated, Any

from stickslip_ros.measures.run_meter import RunMeter
from stickslip_ros.measures.sample_meter import MeasuredSamples
from stickslip_ros.measures.sampling_grid import LONGEST_GAP
from stickslip_ros.quantities import Quantity
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import quantity


@dataclass(frozen=True)
class RunReport:
    """Measures and counts of a run; those with a label are rows of its table, None is unknown."""

    position_noise: float | None
    """Standard deviation of the noise of the positions, m."""
    peak_force: Annotated[float | None, Quantity("peak control force", "N")]
    resting_force: Annotated[float | None, Quantity("final control force", "N")]
    peak_applied_force: Annotated[float | None, Quantity("peak control force acting", "N")]
    resting_applied_force: Annotated[float | None, Quantity("final control force acting", "N")]
    dropped_forces: Annotated[int | None, Quantity("dropped forces")]
    late_forces: Annotated[int | None, Quantity("late forces")]
    missed_deadlines: Annotated[int | None, Quantity("missed deadlines")]
    in_time: bool | None
    """Whether the loop has kept its time."""
    samples: Annotated[int, Quantity("samples")]
    lost_samples: Annotated[int | None, Quantity("lost samples")]
    duration: Annotated[float | None, Quantity("duration", "s")]
    notes: list[str]
    """Sentences that say why the measures may be wrong."""


def report_of(run: RunMeter, measured: MeasuredSamples | None = None) -> dict[str, Any]:
    """Return the measures of the cycles and the `RunReport` of a run by name, ready for JSON.

    They are those that the samples tell, which may have been `measured`; SI units. Where a
    reference is known those of `Following` are among them.
    """
    motion, timing, known = run.motion, run.timing, run.dropped_known
    measured = measured or motion.measured()
    samples = motion.samples + run.unmeasured
    lost = max(motion.lost_samples - run.unmeasured, (run.published or 0) - samples, 0)
    report = RunReport(
        position_noise=motion.position_noise,
        peak_force=run.force.peak_force,
        resting_force=run.force.resting_force,
        peak_applied_force=run.applied.peak_force if known else None,
        resting_applied_force=run.applied.resting_force if known else None,
        dropped_forces=run.dropped if known else None,
        late_forces=None if timing is None else timing.late_forces,
        missed_deadlines=None if timing is None else timing.missed_deadlines,
        in_time=None if timing is None else timing.in_time,
        samples=samples,
        lost_samples=None if motion.mixed else lost,
        duration=None if motion.mixed else motion.duration,
        notes=[*_notes(run), *measured.notes, *(run.followed.notes if run.followed else ())],
    )
    following = {} if run.followed is None else asdict(run.followed.values)
    return {**measured.measures.as_dict(), **asdict(report), **following}


def _notes(run: RunMeter) -> list[str]:
    notes: list[str] = []
    motion, late = run.motion, (run.first_force - run.motion.first) / NANOSECONDS
    if run.unmeasured:
        notes.append(f"{run.unmeasured} of the samples are recorded, and not measured here")
    if run.timing is not None and (complaint := run.timing.warning()):
        doubt = "" if run.timing.in_time else "the regime is doubtful: "
        notes.append(doubt + complaint)
    known = late < inf and not motion.mixed and motion.samples > 0
    if not known or late <= LONGEST_GAP * motion.duration / motion.samples:
        return notes
    if late > motion.duration:
        notes.append("the stamps of the control forces are later than those of all samples")
    else:
        notes.append(
            f"the first control force is {quantity(late, 's')} after the first sample: what acted "
            "before is not recorded, and the peak control force may be larger"
        )
    return notes
