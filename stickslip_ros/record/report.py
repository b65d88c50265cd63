"""Report the measures and counts of a recorded run, from a bag or a table."""

import json
from collections.abc import Mapping
from contextlib import nullcontext, suppress
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import Any

from stickslip_ros.errors import BagError
from stickslip_ros.measures.run_meter import RunMeter, RunObserver
from stickslip_ros.measures.sample_assumptions import SampleAssumptions, reading_of
from stickslip_ros.measures.slips import SlipThreshold
from stickslip_ros.measures.timing import Timing
from stickslip_ros.record.bag_layout import ANY_LAYOUT, BagLayout
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.run_feed import RunFeed, RunPart, Take
from stickslip_ros.record.table_columns import ANY_FORM, TableFormat
from stickslip_ros.record.table_file import TableRecording, is_table, read_table
from stickslip_ros.record.topics import CONTROL_FORCE, JOINT_STATES
from stickslip_ros.text import quantity

_DEFAULT_WINDOW = 20
"""Cycles to average over for a recording of others."""


def report_of_recording(
    path: Path,
    columns: Mapping[str, str] | None = None,
    *,
    table: bool | None = None,
    start: float = 0.0,
    end: float = inf,
    window: int | None = None,
    namespace: str | None = None,
    stick_speed: float | None = None,
    belt_speed: float | None = None,
    form: TableFormat = ANY_FORM,
    layout: BagLayout = ANY_LAYOUT,
    slips: SlipThreshold | None = None,
    length: str = "m",
    continued: Mapping[Path, float] = MappingProxyType({}),
    observer: RunObserver | None = None,
    take: Take = lambda _: None,
) -> dict[str, Any]:
    """Return measures, counts and completeness of a recording, ready for JSON.

    Times count from the first joint state or, if there is none, from the first force.

    Parameters
    ----------
    path : Path
        A bag directory, one file of a bag, or a table.
    columns : mapping or None
        Where a table has its quantities, as for `read_table`.
    table : bool or None
        Whether the file is a table; None: whether its name or content is that of one.
    start : float
        Start of the part that is measured, s; 0 includes everything from the beginning.
    end : float
        End of the part that is measured, s; samples at `end` are excluded.
    window : int or None
        Number of whole cycles at the end of the part over which the measures are averaged; None:
        as many as the analyzer used.
    namespace : str or None
        ROS namespace of the drive; None if the bag holds only one drive, or for a table.
    stick_speed : float or None
        Largest relative speed of a slide that sticks, m/s; None: as the analyzer used.
    belt_speed : float or None
        Belt speed, m/s, of a bag whose joint states have no belt, or in place of a column of a
        table.
    form : TableFormat, optional
        What is known of the form of a table; the rest is found.
    layout : BagLayout, optional
        Where a bag of another machine has motion and force; the rest is found.
    slips : SlipThreshold or None
        What counts as a slip; None: slips are not looked for.
    length : str, optional
        Unit of the positions in the notes, m or rad.
    continued : mapping, optional
        Bags that continue the run, with the gaps before them, s; see `runs_of`.
    observer : RunObserver or None
        Receives the samples and cycles of the whole part, with times as in `start` and `end`.
    take : callable, optional
        Receives the joint states and the control forces of the part as they are read, each in
        their order.

    Returns
    -------
    dict
        Measures (SI units) and counts by name. `complete` is True if `missing`, sentences on what
        the bag lacks, is empty. `notes` are sentences on what a table lacks, and on what makes the
        measures doubtful. Late forces and missed deadlines are those of the whole run.

    Raises
    ------
    BagError
        If `path` is not a bag or table, or holds neither joint states nor control forces.
    InvalidInputError
        If the part is empty, or a table does not have a column.
    """
    part = RunPart(start, end)
    with (
        nullcontext(read_table(path, columns, belt_speed, form))
        if (is_table(path) if table is None else table)
        else Recording(
            path, namespace, belt_speed=belt_speed, layout=layout, continued=[*continued]
        )
    ) as recording:
        meter = _meter_for(recording, window, stick_speed, observer)
        if start <= 0.0 and end == inf:
            meter.published = _kept_number(recording, "timing", "published")
        run = RunFeed(meter, part, observer, take, slips, recording.references)
        # Measuring each chunk by itself would take twice as long.
        for block in recording.blocks(least=20_000):
            run.feed(block)
        run.finish()
        if run.first is None and isinstance(recording, Recording):
            raise _nothing_in(recording, path, namespace)
        report = _completed(run.report(path, length), recording, has_states=run.has_states)
        report["notes"] += [
            f"{bag} continues the run {quantity(gap, 's')} after the bag before it"
            for bag, gap in continued.items()
        ]
        return report


def _meter_for(
    recording: Recording | TableRecording,
    window: int | None,
    stick_speed: float | None,
    observer: RunObserver | None,
) -> RunMeter:
    kept = _kept_number(recording, "analyzer", "window") or 0
    meter = RunMeter(
        window or (kept if 0 < kept <= 100_000 else _DEFAULT_WINDOW),
        dropped_known=recording.dropped_known,
        observer=observer,
        reading=reading_at_recording(recording, stick_speed),
    )
    meter.timing = _timing_of_recording(recording)
    return meter


def _nothing_in(recording: Recording, path: Path, namespace: str | None) -> BagError:
    topics = ", ".join(f"{name} ({kind})" for name, kind in sorted(recording.topics.items()))
    return BagError(
        f"the bag {path} holds no {JOINT_STATES.name} and no {CONTROL_FORCE.name}"
        + (f" in {namespace}" if namespace else "")
        + f" that can be read; its topics are: {topics or 'none'}: --states-topic and "
        "--force-topic choose others" + "".join(f"; {sentence}" for sentence in recording.missing)
    )


def _completed(
    report: dict[str, Any], recording: Recording | TableRecording, *, has_states: bool
) -> dict[str, Any]:
    notes, missing = [*recording.notes, *report["notes"]], [*recording.missing]
    plant = recording.metadata("stickslip_ros/plant") or {}
    if report["peak_force"] is None and plant.get("expects_control") == "true":
        notes.append("the plant expects control, and no control force was recorded or is read")
    if not has_states:
        missing.append("the bag holds no joint states: the motion is unknown")
    return {**report, "notes": notes, "complete": not missing, "missing": missing}


def reading_at_recording(
    recording: Recording | TableRecording, given: float | None
) -> SampleAssumptions:
    """Return how the samples of a recording are to be read, with a stick speed that is `given`."""
    analyzer = recording.metadata("stickslip_ros/analyzer") or {}
    plant = recording.metadata("stickslip_ros/plant") or {}
    if given is None:
        with suppress(KeyError, ValueError):
            recorded = float(analyzer["stick_speed"])
            given = recorded if 0.0 <= recorded < inf else None
    return reading_of(values_of(plant), given=given)


def values_of(recorded: Mapping[str, str]) -> dict[str, Any]:
    """Return recorded parameters, of which a bag has texts; what is no JSON is left out."""
    values: dict[str, Any] = {}
    for name, text in recorded.items():
        with suppress(RecursionError, ValueError):
            values[name] = json.loads(text)
    return values


def _timing_of_recording(recording: Recording | TableRecording) -> Timing | None:
    kept = recording.metadata("stickslip_ros/timing") or {}
    with suppress(KeyError, ValueError):
        timing = Timing(*(int(kept[name]) for name in Timing._fields))
        return timing if min(timing) >= 0 and max(timing) == timing.samples else None


def _kept_number(recording: Recording | TableRecording, table: str, name: str) -> int | None:
    kept = recording.metadata(f"stickslip_ros/{table}") or {}
    with suppress(KeyError, ValueError):
        return int(kept[name])
