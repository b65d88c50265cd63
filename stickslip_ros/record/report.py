"""Report the measures and counts of a recorded run, from a bag or a table."""

import json
from collections.abc import Mapping
from contextlib import nullcontext, suppress
from math import inf
from pathlib import Path
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
    observer: RunObserver | None = None,
    take: Take = lambda _: None,
) -> dict[str, Any]:
    """Return measures (SI units), counts and completeness of a recording by name, for JSON.

    `columns`, `form` and `belt_speed` are those of `read_table`; `namespace`, `layout` and
    `belt_speed` those of `Recording`. `table` says whether the file is a table; None: its name or
    content does. Measured is the part from `start` to `end`, a `RunPart`, whose times count from
    the first joint state or, if there is none, from the first force; late forces and missed
    deadlines are those of the whole run. `window` is the number of whole cycles at its end that are
    averaged, `stick_speed` the largest relative speed of a slide that sticks, m/s; None: as the
    analyzer used. Without `slips` these are not looked for. `length` is the unit of the positions
    in the notes, m or rad. The `observer` receives samples and cycles of the whole part, `take` its
    joint states and its control forces as they are read, each in their order.

    `complete` is True if `missing`, sentences on what the bag lacks, is empty; `notes` are
    sentences on what a table lacks, and on what makes the measures doubtful. Raises BagError if
    `path` is not a bag or table, or holds neither joint states nor control forces, and
    InvalidInputError if the part is empty, or a table does not have a column.
    """
    part = RunPart(start, end)
    with (
        nullcontext(read_table(path, columns, belt_speed, form))
        if (is_table(path) if table is None else table)
        else Recording(path, namespace, belt_speed=belt_speed, layout=layout)
    ) as recording:
        meter = _meter_for(recording, window, stick_speed, observer)
        if part.is_whole:
            meter.published = _published_at_recording(recording)
        run = RunFeed(meter, part, observer, take, slips)
        # Measuring each chunk by itself would take twice as long.
        for block in recording.blocks(least=20_000):
            run.feed(block)
        run.finish()
        if run.first is None:
            raise _nothing_in(recording, path, namespace)
        return _completed(run.report(path, length), recording, has_states=run.has_states)


def _meter_for(
    recording: Recording | TableRecording,
    window: int | None,
    stick_speed: float | None,
    observer: RunObserver | None,
) -> RunMeter:
    meter = RunMeter(
        window or _window_at_recording(recording),
        dropped_known=recording.dropped_known,
        observer=observer,
        reading=reading_at_recording(recording, stick_speed),
    )
    meter.timing = _timing_of_recording(recording)
    return meter


def _nothing_in(
    recording: Recording | TableRecording, path: Path, namespace: str | None
) -> BagError:
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
    """Return a report with what the recording lacks."""
    notes, missing = [*recording.notes, *report["notes"]], recording.missing
    plant = recording.metadata("stickslip_ros/plant") or {}
    if report["peak_force"] is None and plant.get("expects_control") == "true":
        notes.append("the plant expects control, and no control force was recorded or is read")
    if not has_states:
        missing.append("the bag holds no joint states: the motion is unknown")
    return {**report, "notes": notes, "complete": not missing, "missing": missing}


def reading_at_recording(
    recording: Recording | TableRecording, given: float | None = None
) -> SampleAssumptions:
    """Return how the samples of a recording are to be read, with a stick speed that is `given`."""
    analyzer = recording.metadata("stickslip_ros/analyzer") or {}
    plant = recording.metadata("stickslip_ros/plant") or {}
    if given is None:
        with suppress(KeyError, ValueError):
            recorded = float(analyzer["stick_speed"])
            given = recorded if 0.0 <= recorded < inf else None
    known: dict[str, Any] = {}
    for name, text in plant.items():
        with suppress(RecursionError, ValueError):
            known[name] = json.loads(text)
    return reading_of(known, given=given)


def _timing_of_recording(recording: Recording | TableRecording) -> Timing | None:
    kept = recording.metadata("stickslip_ros/timing") or {}
    try:
        timing = Timing(*(int(kept[name]) for name in Timing._fields))
    except (KeyError, ValueError):
        return None
    return timing if min(timing) >= 0 and max(timing) == timing.samples else None


def _published_at_recording(recording: Recording | TableRecording) -> int | None:
    kept = recording.metadata("stickslip_ros/timing") or {}
    with suppress(KeyError, ValueError):
        return int(kept["published"])
    return None


def _window_at_recording(recording: Recording | TableRecording) -> int:
    kept = recording.metadata("stickslip_ros/analyzer") or {}
    try:
        window = int(kept["window"])
    except (KeyError, ValueError):
        return _DEFAULT_WINDOW
    return window if 0 < window <= 100_000 else _DEFAULT_WINDOW
