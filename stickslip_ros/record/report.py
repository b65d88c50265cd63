"""Report the measures and counts of a recorded run, from a bag or a table."""

import json
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from math import inf
from pathlib import Path
from sys import float_info
from typing import Any

import numpy as np

from stickslip_ros.arrays import BoolArray, IntArray
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.measures.feed import moving_part, relative_to_feed
from stickslip_ros.measures.run_meter import RunAnalysis, RunMeter, RunObserver
from stickslip_ros.measures.sample_assumptions import SampleAssumptions, reading_of
from stickslip_ros.measures.slips import SlipMeter, SlipThreshold
from stickslip_ros.measures.timing import Timing
from stickslip_ros.record.bag_layout import ANY_LAYOUT, BagLayout
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.table_clock import LONGEST
from stickslip_ros.record.table_columns import ANY_FORM, TableFormat
from stickslip_ros.record.table_file import TableRecording, is_table, read_table
from stickslip_ros.record.topics import CONTROL_FORCE, JOINT_STATES
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import quantity

_DEFAULT_WINDOW = 20
"""Cycles to average over for a recording of others."""
_LEAST_STEPS, _LEAST_SAMPLES = 5.0, 15.0
"""Steps of the encoder in the amplitude, and samples per cycle, below which a stick may hide."""
_NOISES = 6.0
"""Least drop of a slip, in standard deviations of the noise, that is not noise."""


def report_of_recording(
    path: Path,
    columns: Mapping[str, str] | None = None,
    *,
    table: bool | None = None,
    start: float = 0.0,
    end: float = float("inf"),
    window: int | None = None,
    namespace: str | None = None,
    stick_speed: float | None = None,
    belt_speed: float | None = None,
    form: TableFormat = ANY_FORM,
    layout: BagLayout = ANY_LAYOUT,
    slips: SlipThreshold | None = None,
    length: str = "m",
    observer: RunObserver | None = None,
    take: Callable[[SampleColumns | ForceColumns], None] = lambda _: None,
) -> dict[str, Any]:
    """Return measures, counts and completeness of a recording, ready for JSON.

    Times count from the first joint state or, if there is none, from the first force.

    Parameters
    ----------
    path : Path
        A bag directory, one MCAP file, or a table as text or MAT file.
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
    if not start < end:
        raise InvalidInputError(f"the part from {start} s to {end} s is empty")
    with ExitStack() as opened:
        recording = (
            read_table(path, columns, belt_speed, form)
            if (is_table(path) if table is None else table)
            else opened.enter_context(
                Recording(path, namespace, belt_speed=belt_speed, layout=layout)
            )
        )
        meter = RunMeter(
            window or _window_at_recording(recording),
            dropped_known=recording.dropped_known,
            observer=observer,
            reading=reading_at_recording(recording, stick_speed),
        )
        meter.timing = _timing_of_recording(recording)
        plant = recording.metadata("stickslip_ros/plant") or {}
        if start <= 0.0 and end == inf:
            meter.published = _published_at_recording(recording)
        run = _RunReader(meter, start, end, observer, take, slips)
        # Measuring each chunk by itself would take twice as long.
        for block in recording.blocks(least=20_000):
            if block.velocity_estimated and meter.motion.reading.noisy is None:
                meter.motion.reading = SampleAssumptions(noisy=True)
            run.whole = block.of_another_machine
            run.feed(*block[:3])
        run.finish()
        missing = recording.missing
        if run.first is None:
            topics = ", ".join(
                f"{name} ({kind})" for name, kind in sorted(recording.topics.items())
            )
            raise BagError(
                f"the bag {path} holds no {JOINT_STATES.name} and no {CONTROL_FORCE.name}"
                + (f" in {namespace}" if namespace else "")
                + f" that can be read; its topics are: {topics or 'none'}: --states-topic and "
                "--force-topic choose others" + "".join(f"; {sentence}" for sentence in missing)
            )
    report = run.report(path, length)
    notes = [*recording.notes, *report["notes"]]
    if report["peak_force"] is None and plant.get("expects_control") == "true":
        notes.append("the plant expects control, and no control force was recorded or is read")
    if not run.has_states:
        missing.append("the bag holds no joint states: the motion is unknown")
    return {**report, "notes": notes, "complete": not missing, "missing": missing}


class _RunReader:
    """Feed a meter with the part of a run between two instants."""

    def __init__(
        self,
        meter: RunMeter,
        start: float,
        end: float,
        observer: RunObserver | None,
        take: Callable[[SampleColumns | ForceColumns], None],
        slips: SlipThreshold | None,
    ) -> None:
        self.meter = meter
        self.whole = False
        """Whether it is of another machine, and fed in one block."""
        self._feed = 0.0
        self._notes: list[str] = []
        self._ends = f"from {start:g} s on" + ("" if end == inf else f" and before {end:g} s")
        self._slips = None if slips is None else (SlipMeter(slips), SlipMeter(slips))
        self._last_stamp = -1
        self._belt_speed = 0.0
        self._observer, self._take = observer, take
        self.first: int | None = None
        """Stamp from which the instants count, ns, once it is known."""
        self.has_states = False
        self._measured = 0
        self._start, self._end = (
            round(min(instant, LONGEST) * NANOSECONDS)
            for instant in (start if start > 0.0 else -LONGEST, end)
        )
        self._early: list[tuple[ForceColumns, ForceColumns]] = []

    def feed(self, states: SampleColumns, forces: ForceColumns, dropped: ForceColumns) -> None:
        if len(states.stamp) > 0:
            self.has_states = True
            first = self._begin(int(states.stamp[0])) if self.first is None else self.first
            part = states[self._part(states.stamp, first)]
            self._measured += len(part)
            self._find_slips(part)
            self._take(part)
            if self.whole:
                part = self._moving_part(part, first)
                part, self._feed = relative_to_feed(part)
            self.meter.motion.feed(part)
            if self._observer is not None:
                time = (part.stamp - first) / NANOSECONDS
                self._observer.take_friction(time, part.friction_force)
                if part.has_motor:
                    slide, motor = (
                        (part.position, part.velocity), (part.motor_position, part.motor_velocity)
                    )  # fmt: skip
                    self._observer.take_motor(time, np.array([*slide, *motor]))
        if self.first is None:
            self._early.append((forces, dropped))
            if sum(len(forces.stamp) for forces, _ in self._early) > 1_000_000:  # limits the memory
                self._begin_without_states()
        else:
            self._feed_forces(forces, dropped, self.first)

    def finish(self) -> None:
        """Measure what is still pending: the last forces, or all if there is no joint state."""
        self._begin_without_states()
        self.meter.finish()

    def report(self, path: Path, length: str) -> dict[str, Any]:
        """Return the measures and counts, and the slips if they were looked for."""
        if self._measured == 0:
            raise InvalidInputError(f"{path} holds no samples {self._ends}")
        report, slips = self.meter.report(), None
        notes = [*self._notes, *report["notes"]]
        if self._feed:
            feed = quantity(self._feed, f"{length}/s")
            advance = quantity(abs(self._feed) * (report["period"] or 0.0), length)
            notes = [
                *notes,
                f"the slide advances at {feed} on a guide at rest: the measures "
                f"are those of its position less this feed, {advance} in a cycle",
            ]
        guide = self.meter.motion.other_guide if self.whole else None
        if guide is not None and report["regime"] in (None, Regime.PURE_SLIP, Regime.STICK_SLIP):
            velocity, share = guide
            report = {**report, "regime": None, "stick_fraction": None}
            of_what = f"a velocity of {quantity(velocity, f'{length}/s')}" if velocity else "rest"
            notes = [
                *notes,
                f"relative to a guide at {of_what} the slide rests {share:.0%} of the time, and "
                "relative to the belt it does not: with this belt velocity the regime is known",
            ]
        elif self.whole and report["regime"] == Regime.PURE_SLIP:
            steps = report["amplitude"] / (self.meter.motion.drift.resolution or float_info.min)
            each = report["period"] / report["duration"] * report["samples"]
            few = f"{steps:.2g} steps of the encoder in the amplitude" * (steps < _LEAST_STEPS)
            few = few or f"{each:.2g} samples per cycle" * (each < _LEAST_SAMPLES)
            if few:
                report = {**report, "regime": None, "stick_fraction": None}
                notes = [*notes, f"the regime is not known: {few} do not tell whether it sticks"]
        if self._slips is not None:
            drops, rises = self._slips
            rising = not drops.count and rises.count > 0
            slips = (rises if rising else drops).report(self._belt_speed)
            if rising:
                notes = [*notes, "the slips are rises of the position: drops there are none"]
            noise, least = report["position_noise"], drops.threshold.drop
            if noise is not None and least < _NOISES * noise:
                notes = [
                    *notes,
                    f"the least drop of a slip, {quantity(least, length)}, is within the noise of "
                    f"the positions, {quantity(noise, length)}: some slips are noise",
                ]
        if self._observer is not None:
            self._observer.take_analysis(RunAnalysis(self.meter.motion.mean_cycle, slips))
        return {**report, "notes": notes, "slips": slips}

    def _moving_part(self, part: SampleColumns, first: int) -> SampleColumns:
        """Return the samples without the standstills before and after them."""
        rows = moving_part(part)
        moving = part[rows]
        sides = " and ".join(["before"] * (rows.start > 0) + ["after"] * (rows.stop < len(part)))
        if sides:
            since, until = ((stamp - first) / NANOSECONDS for stamp in moving.stamp[[0, -1]])
            whole = (part.stamp[-1] - first) / NANOSECONDS
            self._notes.append(
                f"the measures are those from {since:.4g} s to {until:.4g} s of {whole:.4g} s: "
                f"{sides}, the position stands"
            )
        return moving

    def _find_slips(self, part: SampleColumns) -> None:
        if self._slips is None or len(part) == 0:
            return
        part = part[part.is_valid]
        if len(part) == 0:
            return
        self._belt_speed = float(part.belt_velocity[-1])
        forward = np.diff(part.stamp, prepend=self._last_stamp) > 0
        part = part[forward]
        sign = -1.0 if self._belt_speed < 0.0 else 1.0
        time = (part.stamp - (self.first or 0)) / NANOSECONDS
        for direction, meter in zip((sign, -sign), self._slips, strict=True):
            meter.feed(time, direction * part.position)
        if len(part):
            self._last_stamp = int(part.stamp[-1])

    def _begin_without_states(self) -> None:
        stamps = [forces.stamp[0] for forces, _ in self._early if len(forces.stamp) > 0]
        if stamps:
            self._begin(int(stamps[0]))

    def _begin(self, first: int) -> int:
        self.first = self.meter.motion.origin = first
        for forces, dropped in self._early:
            self._feed_forces(forces, dropped, first)
        self._early.clear()
        return first

    def _feed_forces(self, forces: ForceColumns, dropped: ForceColumns, first: int) -> None:
        forces, dropped = (each[self._part(each.stamp, first)] for each in (forces, dropped))
        self._measured += len(forces)
        self.meter.feed_forces(forces, dropped)
        self._take(forces)

    def _part(self, stamp: IntArray, first: int) -> BoolArray:
        since = stamp - first
        return (since >= self._start) & (since < self._end)


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
