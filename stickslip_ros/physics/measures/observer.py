"""Observers: they receive a run as it is measured, whether simulated, live or recorded."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, Protocol

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.physics.measures.breakpoints import Breakpoints
from stickslip_ros.physics.measures.cycle_fit import MeanCycle
from stickslip_ros.physics.measures.cycle_measures import Cycle


@dataclass(frozen=True)
class MeasuredMotion:
    """Breakpoints that continue a motion, and the cycles measured with them."""

    breakpoints: Breakpoints
    belt_velocity: FloatArray
    """Velocity of the belt at each breakpoint, m/s."""
    cycles: Sequence[Cycle]
    """Cycles completed by these breakpoints."""
    cycle_ends: Sequence[float]
    """Time at which each of these cycles ended, s."""
    longest_step: float = inf
    """Longest time between two breakpoints, s, over which the motion between them is known."""


@dataclass(frozen=True)
class Conclusions:
    """What was concluded from a record beyond its measures."""

    mean_cycle: MeanCycle | None
    """Mean cycle under noise; None for exact samples, and cycles that are not alike."""
    slips: Mapping[str, Any] | None
    """Slips as `SlipMeter.report` has them; None if they were not asked for."""


class MotionObserver(Protocol):
    """Receives a motion as it is measured; times in s from the start of the run, SI units."""

    def take_motion(self, motion: MeasuredMotion) -> None:
        """Receive the motion that follows."""
        ...


class RunObserver(MotionObserver, Protocol):
    """Receives a run as it is measured; times in s from the start of the run, SI units."""

    def take_friction(self, time: FloatArray, force: FloatArray) -> None:
        """Receive the friction force on the slide at the samples that follow; NaN if unknown."""
        ...

    def take_control(self, time: FloatArray, force: FloatArray, acted: BoolArray) -> None:
        """Receive the control forces that follow, and whether each acted, as far as it is known."""
        ...

    def take_conclusions(self, conclusions: Conclusions) -> None:
        """Receive what was concluded, at the end of the run."""
        ...
