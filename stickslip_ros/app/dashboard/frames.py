"""The data of the charts at one instant, in the units of their axes."""

import struct
from io import StringIO
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np
import orjson

from stickslip_ros.app.dashboard.run_state import RunState
from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.drive import Drive
from stickslip_ros.motion.trajectory import Trajectory
from stickslip_ros.quantities import quantities_of
from stickslip_ros.record.topics import AMPLITUDE, FREQUENCY, STICK_FRACTION
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.show.live_trace import Line
from stickslip_ros.show.quantities import Units
from stickslip_ros.stamps import NANOSECONDS

PERIODS = (10, 50, 200)
"""Selectable lengths of the traces, in natural periods."""

_QUANTITIES = [quantities_of(Trajectory)[n] for n in ("position", "velocity", "control_force")]
_KEPT_PERIODS = 1.25 * PERIODS[-1]
"""A page requests the samples of its last frame a little after that frame.

In lockstep the last 50,000 rows, which are always kept, are the longer time.
"""
_UNKNOWN_PERIOD = 1.0
_LEAST_SPAN = 1e-3
"""Least length of an axis, relative to the largest value that the drive lets expect."""
_MARK_INTERVAL = 1.0
"""Time, s, between two changes of a parameter that have a mark each."""
_COLUMNS = "time", "position", "velocity", "belt_velocity", "friction_force", "control_force"


class Frames:
    """Build frames from what is known of a run."""

    def __init__(self, run: RunState) -> None:
        self._run = run

    @property
    def period(self) -> float:
        """Natural period, s, or the period of the last cycle if there is none, or it is unknown."""
        drive = self._run.drive
        if drive is not None and drive.has_spring:
            return drive.natural_period
        frequencies = list(self._run.cycles[FREQUENCY])[-1:]
        return next((1.0 / f for f in frequencies if 1e-9 < f < 1e9), _UNKNOWN_PERIOD)

    def feed(self, states: SampleColumns, forces: ForceColumns, dropped: ForceColumns) -> None:
        """Add received states, forces sent, and forces that were dropped."""
        self._run.trace.longest = _KEPT_PERIODS * self.period
        self._run.trace.feed(states, forces, dropped)

    def table(self, periods: int, end: float) -> str:
        """Return the samples of the last `periods` natural periods up to `end` (s) as CSV, SI."""
        columns = self._run.trace.samples(periods * self.period, end)
        text = StringIO()
        np.savetxt(text, np.transpose(columns), "%.9g", ",", header=",".join(_COLUMNS), comments="")
        return text.getvalue().replace("nan", "")

    def _marks(self, window: float) -> list[tuple[float, str]]:
        """Return the times (s before now) of events in the window, and their marks."""
        newest = self._run.trace.newest
        events = [event for event in list(self._run.events) if event.mark]
        # Of a slider that is moved in steps, the last.
        last = [
            one
            for one, other in zip_longest(events, events[1:])
            if other is None
            or other.when - one.when > _MARK_INTERVAL
            or other.mark.split()[0] != one.mark.split()[0]
        ]
        times = [((event.stamp - newest) / NANOSECONDS, event.mark) for event in last]
        return [(time, mark) for time, mark in times if -window < time <= 0.0]

    def frame(self, periods: int) -> bytes:
        """Return a frame with the last `periods` natural periods and the last cycles.

        A frame consists of the length of the JSON (4 bytes, little-endian), the JSON, padded with
        spaces to a multiple of 4 bytes, and x and y of each line in turn (32-bit floats). The JSON
        contains the number of points of each line.
        """
        period, drive = self.period, self._run.drive
        frame = self._run.trace.frame(periods * period, 5.0 * period, buckets=400)
        axes = _axes(drive)
        length, speed, force = (axis.scale for axis in axes)
        cycles = {
            "count": self._run.cycle_count,
            "amplitude": [a / length for a in list(self._run.cycles[AMPLITUDE])],
            "stick_fraction": list(self._run.cycles[STICK_FRACTION]),
            "label": axes[0].label.replace("displacement", "amplitude"),
        }
        body: dict[str, Any] = {"motion": None, "cycles": cycles}
        lines: dict[str, list[FloatArray]] = {}
        if frame is not None:
            lines = {
                "position": _scaled(frame.position, 1.0, length),
                "velocity": _scaled(frame.velocity, 1.0, speed),
                "belt": _scaled(frame.belt_velocity, 1.0, speed),
                "force": _scaled(frame.force, 1.0, force),
                "dropped": _scaled(frame.dropped, 1.0, force),
                "orbit": _scaled(frame.orbit, length, speed),
            }
            if drive is not None and drive.friction.states:
                lines["loop"] = _scaled(frame.loop, 1.0, drive.normal_force)
            in_equilibrium = drive is not None and drive.has_spring and drive.belt_speed
            body["motion"] = {
                "end": frame.end,
                "window": periods * period,
                "labels": [axis.label for axis in axes],
                "spans": [axis.span for axis in axes],
                "marks": self._marks(periods * period),
                "time_label": Units.for_drive(drive).label("time before now", "s"),
                "counts": {name: len(line[0]) for name, line in lines.items()},
                "equilibrium": (
                    drive.equilibrium_position / length if drive and in_equilibrium else None
                ),
                "belt_speed": float(frame.belt_velocity.y[-1]) / speed,
            }
        text = orjson.dumps(body)
        text += b" " * (-len(text) % 4)
        columns = [column for line in lines.values() for column in line]
        with np.errstate(over="ignore"):  # values that overflow are outside the page
            floats = [column.astype("<f4").tobytes() for column in columns]
        return b"".join([struct.pack("<I", len(text)), text, *floats])


class _Axis(NamedTuple):
    scale: float
    label: str
    span: float
    """Least length, in its unit: what is smaller is rounding."""


def _axes(drive: Drive | None) -> list[_Axis]:
    """Return the axes of displacement, speed and force.

    They depend on the drive, not on the motion, so that a decaying vibration is visible.
    """
    largest = (1.0, 1.0, 1.0)
    if drive is not None:
        friction = float(max(drive.friction.limits)) * drive.normal_force
        speed = abs(drive.belt_speed) or drive.speed_scale
        reach = friction / drive.stiffness if drive.has_spring else drive.length_scale
        largest = (reach, speed, friction)
    units = Units.for_drive(drive)
    axes: list[_Axis] = []
    for quantity, magnitude in zip(_QUANTITIES, largest, strict=True):
        scale, label = units.axis(quantity.label, quantity.unit, magnitude)
        axes.append(_Axis(scale, label, _LEAST_SPAN * magnitude / scale))
    return axes


def _scaled(line: Line, x_scale: float, y_scale: float) -> list[FloatArray]:
    return [line.x / x_scale, line.y / y_scale]
