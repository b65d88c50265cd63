"""Report the measures and counts of a recorded run."""

import json
from collections.abc import Callable
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import Any

from stickslip_ros.arrays import BoolArray, IntArray
from stickslip_ros.bags.reader import Recording
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.messages.topics import CONTROL_FORCE, JOINT_STATES
from stickslip_ros.physics.measures.observer import RunObserver
from stickslip_ros.physics.measures.run_meter import RunMeter
from stickslip_ros.physics.measures.stick_speed import automatic_stick_speed
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.stamps import NANOSECONDS

_DEFAULT_WINDOW = 20
"""Cycles to average over for a bag of another recorder."""
_LONGEST = 9e9
"""Longest time, s, that stamps can express."""


def report_of_bag(
    path: Path,
    *,
    start: float = 0.0,
    end: float = float("inf"),
    window: int | None = None,
    namespace: str | None = None,
    observer: RunObserver | None = None,
    take: Callable[[SampleColumns | ForceColumns], None] = lambda _: None,
) -> dict[str, Any]:
    """Return measures, counts and completeness of a recording, ready for JSON.

    Times count from the first joint state or, if there is none, from the first force.

    Parameters
    ----------
    path : Path
        A bag directory, or one MCAP file.
    start : float
        Start of the part that is measured, s; 0 includes everything from the beginning.
    end : float
        End of the part that is measured, s; samples at `end` are excluded.
    window : int or None
        Number of whole cycles at the end of the part over which the measures are averaged; None:
        as many as the analyzer used.
    namespace : str or None
        ROS namespace of the drive; None if the bag holds only one drive.
    observer : RunObserver or None
        Receives the samples and cycles of the whole part, with times as in `start` and `end`.
    take : callable, optional
        Receives the joint states and the control forces of the part as they are read, each in
        their order.

    Returns
    -------
    dict
        Measures (SI units) and counts by name. `complete` is True if `missing`, sentences on what
        the bag lacks, is empty. `notes` are sentences on what makes the measures doubtful.

    Raises
    ------
    BagError
        If `path` is not a bag, or holds neither joint states nor control forces.
    InvalidInputError
        If the part is empty.

    Examples
    --------
    >>> from pathlib import Path
    >>> from stickslip_ros.bags.report import report_of_bag
    >>> report = report_of_bag(Path("bags/reference"), start=1.0)
    >>> report["complete"], report["samples"]
    (True, 2001)
    """
    if not start < end:
        raise InvalidInputError(f"the part from {start} s to {end} s is empty")
    with Recording(path, namespace) as recording:
        meter = RunMeter(
            window or _window_at_recording(recording),
            dropped_known=recording.dropped_known,
            observer=observer,
            stick_speed=stick_speed_at_recording(recording),
        )
        run = _RunReader(meter, start, end, observer, take)
        # Measuring each chunk by itself would take twice as long.
        for block in recording.blocks(least=20_000):
            run.feed(*block)
        run.finish()
        missing = recording.missing
        if run.first is None:
            topics = ", ".join(
                f"{name} ({kind})" for name, kind in sorted(recording.topics.items())
            )
            raise BagError(
                f"the bag {path} holds no {JOINT_STATES.name} and no {CONTROL_FORCE.name}"
                + (f" in {namespace}" if namespace else "")
                + f" that can be read; its topics are: {topics or 'none'}"
                + "".join(f"; {sentence}" for sentence in missing)
            )
    if run.measured == 0:
        before = "" if end == float("inf") else f" and before {end:g} s"
        raise InvalidInputError(f"{path} holds no samples from {start:g} s on{before}")
    if not run.has_states:
        missing.append("the bag holds no joint states: the motion is unknown")
    return {**run.meter.report(), "complete": not missing, "missing": missing}


class _RunReader:
    """Feed a meter with the part of a run between two instants."""

    def __init__(
        self,
        meter: RunMeter,
        start: float,
        end: float,
        observer: RunObserver | None,
        take: Callable[[SampleColumns | ForceColumns], None],
    ) -> None:
        self.meter = meter
        self._observer, self._take = observer, take
        self.first: int | None = None
        """Stamp from which the instants count, ns, once it is known."""
        self.has_states = False
        self.measured = 0
        """Number of joint states and forces in the part."""
        self._start, self._end = (
            round(min(instant, _LONGEST) * NANOSECONDS)
            for instant in (start if start > 0.0 else -_LONGEST, end)
        )
        self._early: list[tuple[ForceColumns, ForceColumns]] = []

    def feed(self, states: SampleColumns, forces: ForceColumns, dropped: ForceColumns) -> None:
        if len(states.stamp) > 0:
            self.has_states = True
            first = self._begin(int(states.stamp[0])) if self.first is None else self.first
            part = states[self._part(states.stamp, first)]
            self.measured += len(part)
            self.meter.motion.feed(part)
            self._take(part)
            if self._observer is not None:
                time = (part.stamp - first) / NANOSECONDS
                self._observer.take_friction(time, part.friction_force)
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
        self.measured += len(forces)
        self.meter.feed_forces(forces, dropped)
        self._take(forces)

    def _part(self, stamp: IntArray, first: int) -> BoolArray:
        since = stamp - first
        return (since >= self._start) & (since < self._end)


def stick_speed_at_recording(recording: Recording) -> float | None:
    """Return the stick speed for the samples of a recording, see `SampleMeter`."""
    analyzer = recording.metadata("stickslip_ros/analyzer") or {}
    plant = recording.metadata("stickslip_ros/plant") or {}
    with suppress(KeyError, ValueError):
        given = float(analyzer["stick_speed"])
        if 0.0 <= given < inf:
            return given
    known: dict[str, Any] = {}
    for name, text in plant.items():
        with suppress(RecursionError, ValueError):
            known[name] = json.loads(text)
    return automatic_stick_speed(known)


def _window_at_recording(recording: Recording) -> int:
    kept = recording.metadata("stickslip_ros/analyzer") or {}
    try:
        window = int(kept["window"])
    except (KeyError, ValueError):
        return _DEFAULT_WINDOW
    return window if 0 < window <= 100_000 else _DEFAULT_WINDOW
