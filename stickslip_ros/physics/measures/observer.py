"""Observers: they see a run as it is measured, be it simulated, live or recorded."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Protocol

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.physics.measures.breakpoints import Breakpoints
from stickslip_ros.physics.measures.cycle_measures import Cycle


@dataclass(frozen=True)
class MeasuredMotion:
    """Breakpoints that follow those before, and what was measured with them."""

    breakpoints: Breakpoints
    belt_velocity: FloatArray
    """Velocity of the belt at each breakpoint, m/s."""
    cycles: Sequence[Cycle]
    """Those completed by these breakpoints."""
    cycle_ends: Sequence[float]
    """Time at which each of them was complete, s."""
    longest_step: float = inf
    """Time, s, between two breakpoints beyond which nothing is known of the motion between them."""


class MotionObserver(Protocol):
    """Sees a motion as it is measured; times in s from the start of the run, else SI units."""

    def take_motion(self, motion: MeasuredMotion) -> None:
        """Take the motion that follows."""
        ...


class RunObserver(MotionObserver, Protocol):
    """Sees a run as it is measured; times in s from the start of the run, else SI units."""

    def take_friction(self, time: FloatArray, force: FloatArray) -> None:
        """Take the friction force on the slide at the samples that follow, NaN if not known."""
        ...

    def take_control(self, time: FloatArray, force: FloatArray, acted: BoolArray) -> None:
        """Take the control forces that follow, and whether each acted, as far as it is known."""
        ...
