"""What the charts of the page show at a moment, in the units of their axes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.nodes.observer import ObserverNode
from stickslip_ros.nodes.topics import AMPLITUDE, FREQUENCY, STICK_FRACTION
from stickslip_ros.physics.drive import Drive
from stickslip_ros.plots.live_trace import Line, LiveTrace
from stickslip_ros.plots.units import Units
from stickslip_ros.scenario.parameters import PlantParameters

PERIODS = (10, 50, 200)
"""Natural periods that the traces may show."""

_QUANTITIES = (("displacement", "m"), ("velocity", "m/s"), ("control force", "N"))
_ORBIT_PERIODS = 5.0
_BUCKETS = 400
_UNKNOWN_PERIOD = 1.0


class Frames:
    """Makes frames of what an observer has heard."""

    def __init__(self, observer: ObserverNode, trace: LiveTrace) -> None:
        self._observer = observer
        self._trace = trace
        self._drive_of: tuple[Mapping[str, Any], Drive | None] = ({}, None)

    @property
    def drive(self) -> Drive | None:
        """The drive as it is at present; None while the plant has not told of it."""
        values = self._observer.parameters["plant"]
        if values is not self._drive_of[0]:
            try:
                drive = PlantParameters.validated(values, "plant").as_drive() if values else None
            except InvalidInputError:  # a plant of another version
                drive = None
            self._drive_of = values, drive
        return self._drive_of[1]

    @property
    def period(self) -> float:
        """Natural period, s, or that of the last cycle where the drive is not known."""
        if self.drive is not None:
            return self.drive.natural_period
        frequencies = self._observer.cycles[FREQUENCY]
        return 1.0 / frequencies[-1] if frequencies and frequencies[-1] > 0 else _UNKNOWN_PERIOD

    def frame(self, periods: int) -> dict[str, Any]:
        """Return what to draw: the last `periods` natural periods, and the last cycles."""
        period, drive = self.period, self.drive
        self._trace.longest = PERIODS[-1] * period
        frame = self._trace.frame(periods * period, _ORBIT_PERIODS * period, _BUCKETS)
        cycles = self._cycles(drive)
        if frame is None:
            return {"samples": None, "cycles": cycles}
        units = Units.of(drive)
        magnitudes = _magnitudes(drive)
        (length, *_), (speed, *_), (force, *_) = axes = [
            units.axis(*quantity, magnitude)
            for quantity, magnitude in zip(_QUANTITIES, magnitudes, strict=True)
        ]
        rest = None
        if drive is not None and drive.belt_speed:
            rest = drive.equilibrium_position / length
        return {
            "samples": {
                "end": frame.end,
                "window": periods * period,
                "position": _points(frame.position, length),
                "velocity": _points(frame.velocity, speed),
                "belt": _points(frame.belt_velocity, speed),
                "force": _points(frame.force, force),
                "orbit": _points(frame.orbit, speed, length),
                "equilibrium": rest,
                "belt_speed": float(frame.belt_velocity.y[-1]) / speed,
            },
            "labels": [label for _, label in axes],
            "cycles": cycles,
        }

    def _cycles(self, drive: Drive | None) -> dict[str, Any]:
        amplitudes = list(self._observer.cycles[AMPLITUDE])
        scale, label = Units.of(drive).axis("amplitude", "m", _magnitudes(drive)[0])
        return {
            "count": self._observer.cycle_count,
            "amplitude": [amplitude / scale for amplitude in amplitudes],
            "stick_fraction": list(self._observer.cycles[STICK_FRACTION]),
            "label": label,
        }


def _magnitudes(drive: Drive | None) -> tuple[float, float, float]:
    """Return how large displacement, speed and force are about.

    That follows from the drive, not from the motion: so a vibration that dies away is seen to.
    """
    if drive is None:
        return 1.0, 1.0, 1.0
    friction = abs(float(drive.friction.static)) * drive.normal_force
    return friction / drive.stiffness, abs(drive.belt_speed) or drive.speed_scale, friction


def _points(line: Line, y_scale: float, x_scale: float = 1.0) -> NDArray[np.float32]:
    return np.column_stack([line.x / x_scale, line.y / y_scale]).astype(np.float32)
