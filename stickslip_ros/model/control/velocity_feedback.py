"""Velocity feedback: a damper, and optionally a spring, between the slide and the frame."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.control.base import (
    TABLE,
    ContinuousControl,
    FeedbackLaw,
    LinearFeedback,
    State,
)
from stickslip_ros.samples import Reference, Sample


@dataclass(frozen=True)
class VelocityFeedback(FeedbackLaw, ContinuousControl):
    """Force proportional to velocity and displacement, u = k0 x + k1 x'.

    A negative velocity gain is a damper between the slide and the frame. A position gain moves the
    equilibrium.
    """

    name: ClassVar[str] = "velocity_feedback"
    accepts_expressions: ClassVar[bool] = True
    tuned: ClassVar[Sequence[str]] = ("velocity_gain",)

    velocity_gain: Any = constant(
        -1.0, "Gain k1 of the velocity; a negative gain removes energy.", "N s/m"
    )
    position_gain: Any = constant(
        0.0, "Gain k0 of the displacement; it moves the equilibrium.", "N/m"
    )

    @override
    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        seen = sample if self.feedback == TABLE else sample.body(self.feedback)
        return self.control_force(seen.position, seen.velocity, ()), state

    @override
    def linear_feedback(self, period: float) -> LinearFeedback:
        direct = np.array([self.position_gain, self.velocity_gain])
        feedback = LinearFeedback(np.empty((0, 0)), np.empty((0, 2)), np.empty(0), direct)
        return feedback.for_body(self.feedback)

    @override
    def silenced(self) -> Self:
        return replace(self, position_gain=0.0, velocity_gain=0.0)

    def control_force(self, position: Any, speed: Any, states: Sequence[Any]) -> Any:
        """Return u = k0 x + k1 y; see `ContinuousControl.control_force`."""
        return self.position_gain * position + self.velocity_gain * speed

    def bound(self, speed: Any) -> Any:
        """Return k1 y: the spring stores what it takes; see `ContinuousControl.bound`."""
        return self.velocity_gain * speed
