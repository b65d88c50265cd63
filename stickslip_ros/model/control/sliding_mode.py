"""Sliding mode control with a boundary layer."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.control.base import FeedbackLaw, LinearFeedback, State
from stickslip_ros.model.control.pid import moved_mass, tracking_error
from stickslip_ros.model.drive import Drive
from stickslip_ros.samples import Reference, Sample

_RESERVE = 1.5
"""Switching force over the largest friction: without a reserve nothing holds the surface."""


@dataclass(frozen=True)
class SlidingMode(FeedbackLaw):
    """Sliding mode control, u = m (r'' + L e') + K sat(s/B), on the surface s = e' + L e = 0.

    The switching force K must exceed friction, spring and disturbance together; sat is linear up to
    1 and then constant. The boundary layer B avoids that samples and delays make the force switch
    from sample to sample (J.-J. E. Slotine, W. Li, Applied Nonlinear Control, 1991, section 7.2).
    With B = 0 the force switches. Within the layer the law is linear, with the gains K L/B and
    K/B + m L; a rest outside, where K is too small, is not.
    """

    name: ClassVar[str] = "sliding_mode"
    follows_reference: ClassVar[bool] = True
    tuned: ClassVar[Sequence[str]] = ("slope", "boundary_layer")

    nominal_mass: float = constant(1.0, "Mass m that the law assumes.", "kg", at_least=0.0)
    slope: float = constant(1.0, "Slope L of the surface: decay rate on it.", "1/s", at_least=0.0)
    switching_force: float = constant(1.0, "Switching force K.", "N", at_least=0.0)
    boundary_layer: float = constant(
        0.5, "Boundary layer B of the surface; 0: the force switches.", "m/s", at_least=0.0
    )

    @override
    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        error, rate = tracking_error(sample.body(self.feedback), reference)
        distance, layer = rate + self.slope * error, self.boundary_layer
        share = distance / layer if layer > abs(distance) else (distance > 0.0) - (distance < 0.0)
        force = self.nominal_mass * (reference.filled[2] + self.slope * rate)
        return force + self.switching_force * share, state

    @override
    def linear_feedback(self, period: float) -> LinearFeedback | None:
        if self.boundary_layer == 0.0:
            return None
        gain = self.switching_force / self.boundary_layer
        direct = -np.array([gain * self.slope, gain + self.nominal_mass * self.slope])
        feedback = LinearFeedback(np.empty((0, 0)), np.empty((0, 2)), np.empty(0), direct)
        return feedback.for_body(self.feedback)

    @override
    def for_drive(self, drive: Drive) -> Self:
        force = _RESERVE * max(map(abs, drive.friction.limits)) * drive.normal_force
        return replace(self, nominal_mass=moved_mass(drive), switching_force=force)
