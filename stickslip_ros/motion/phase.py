"""A phase of a motion, and who takes note of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from stickslip_ros.model.drive_system import DriveSystem
from stickslip_ros.model.hybrid import Instant, Mode
from stickslip_ros.motion.compiled_flow import CompiledFlow

DIVERGENCE = -1
"""Stands for a guard where the rates exceed any bound."""


@dataclass(slots=True)
class Phase:
    """What has passed in one mode, up to a guard, a corner of the signals or an end.

    Times are those of the present advance.
    """

    mode: Mode
    end: float
    """Time at its end."""
    guard: int | None = None
    """Number of the guard that has ended it, or `DIVERGENCE`."""
    following: Mode | None = None
    """Mode that follows; None at the end of the motion."""
    origin: float = 0.0
    """Time from which durations and marks count: its start, without signals."""
    duration: float = 0.0
    bound: float = 0.0
    """Time until an end of the advance that would have shortened none of its steps."""
    points: Sequence[tuple[float | None, float, float]] = ()
    """Time, None at the end, and first two states, at the marks of the flow and at the end."""
    state_at_guard: Sequence[float] = ()
    """State at the guard: the mode that follows may set a part of it."""


class PhaseObserver(Protocol):
    """Takes note of the phases of a motion."""

    def start(self, system: DriveSystem, mode: Mode, instant: Instant) -> None:
        """Take note of an instant at which the motion starts, or starts again."""
        ...

    def begin(self, mode: Mode, flow: CompiledFlow | None, now: float, end: float) -> float:
        """Take note of the start of a phase at the time `now`; return its latest end."""
        ...

    def take(self, phase: Phase, system: DriveSystem, instant: Instant) -> None:
        """Take note of a phase that ends at an instant."""
        ...
