"""The forces of a simulated motion, for an observer."""

from math import ceil, inf

import numpy as np

from stickslip_ros.physics.measures.observer import MeasuredMotion, RunObserver
from stickslip_ros.physics.motion.motion import Motion

_STEPS_PER_PERIOD = 60
"""Least number of steps in a natural period: a line through their ends then shows the motion."""


class MotionTracer:
    """Advances a motion in short steps, and passes its forces and the motion to an observer."""

    def __init__(self, motion: Motion, observer: RunObserver, longest_period: float = inf) -> None:
        """Trace a motion; the steps are parts of its natural period, of at most this one (s)."""
        self._motion, self._observer, self._longest_period = motion, observer, longest_period
        self._now = 0.0
        self._forces: list[tuple[float, float, float, float]] = []
        """Time (s) and force (N) from then on; time, and friction force (N) up to then."""

    def advance(self, duration: float) -> None:
        """Advance the motion by `duration` (s), or until it is unbounded."""
        motion = self._motion
        period = min(motion.drive.natural_period, self._longest_period)
        steps = max(1, ceil(duration / period * _STEPS_PER_PERIOD))
        for _ in range(steps):
            if motion.unbounded:
                break
            start, force = self._now, motion.applied_force
            motion.advance(duration / steps)
            self._now += duration / steps
            self._forces.append((start, force, self._now, motion.friction_force))

    def take_motion(self, motion: MeasuredMotion) -> None:
        """Pass the motion to the observer, and the forces up to its end."""
        start, force, end, friction = np.array(self._forces).reshape(-1, 4).T
        self._forces.clear()
        self._observer.take_motion(motion)
        self._observer.take_control(start, force, np.ones(len(force), dtype=bool))
        self._observer.take_friction(end, friction)
