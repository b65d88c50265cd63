"""The disturbance observer: what the force does not explain is estimated, and compensated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import expm1
from typing import ClassVar, Self

from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.control.base import TABLE, FeedbackLaw, LinearFeedback, State, superposed
from stickslip_ros.model.control.pid import moved_mass, tracking_error
from stickslip_ros.model.drive import Drive
from stickslip_ros.samples import Reference, Sample


@dataclass(frozen=True)
class DisturbanceObserver(FeedbackLaw):
    """PD control with a disturbance observer, u = k_p e + k_d e' + m r'' - d_e.

    d = m x'' - u, all forces but that of the controller, spring and friction among them, is
    estimated through a low-pass filter of the cutoff frequency g, d_e' = g (d - d_e), without a
    measured acceleration: d_e = g m x' - p with p' = g (u + d_e). (K. Ohnishi, M. Shibata,
    T. Murakami, Motion control for advanced mechatronics, IEEE/ASME Transactions on Mechatronics
    1(1), 1996.) The filter is exact for samples that are held; it knows the force limit.
    """

    name: ClassVar[str] = "disturbance_observer"
    follows_reference: ClassVar[bool] = True
    state_units: ClassVar[Mapping[str, str | None]] = {"filtered": "N", "filter_input": "N"}
    tuned: ClassVar[Sequence[str]] = ("position_gain", "velocity_gain", "bandwidth")

    nominal_mass: float = constant(1.0, "Mass m that the observer assumes.", "kg", positive=True)
    bandwidth: float = constant(1.0, "Cutoff frequency g of the estimate.", "rad/s", positive=True)
    position_gain: float = constant(1.0, "Gain k_p of the position error.", "N/m", at_least=0.0)
    velocity_gain: float = constant(1.0, "Gain k_d of the velocity error.", "N s/m", at_least=0.0)

    @override
    def initial_state(self, sample: Sample, reference: Reference) -> State:
        # No disturbance is known yet.
        momentum_flow = self.bandwidth * self.nominal_mass * sample.body(self.feedback).velocity
        return momentum_flow, momentum_flow

    @override
    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        filtered, held = state
        seen = sample.body(self.feedback)
        filtered -= expm1(-self.bandwidth * elapsed) * (held - filtered)
        momentum_flow = self.bandwidth * self.nominal_mass * seen.velocity
        disturbance = momentum_flow - filtered
        error, rate = tracking_error(seen, reference)
        force = self.position_gain * error + self.velocity_gain * rate - disturbance
        force += self.nominal_mass * reference.filled[2]
        return force, (filtered, self.limited(force) + momentum_flow)

    @override
    def linear_feedback(self, period: float) -> LinearFeedback:
        return superposed(replace(self, feedback=TABLE), period).for_body(self.feedback)

    @override
    def for_drive(self, drive: Drive) -> Self:
        return replace(self, nominal_mass=moved_mass(drive))
