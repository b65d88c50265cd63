"""PID control whose integral is reset where the error changes its sign."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.control.base import LinearFeedback, State
from stickslip_ros.model.control.pid import Pid, tracking_error
from stickslip_ros.samples import Reference, Sample


@dataclass(frozen=True)
class ResetIntegral(Pid):
    """PID control that turns its integral round, I -> -a I, where the position error changes sign.

    For positioning: on a guide that sticks, a linear integral has to be emptied and filled again
    after each overshoot, and the axis hunts. The reset pushes back at once. (R. Beerens,
    A. Bisoffi, L. Zaccarian, W. P. M. H. Heemels, H. Nijmeijer, N. van de Wouw, Reset integral
    control for improved settling of PID-based motion systems with friction, Automatica 107, 2019.)

    An error within `reset_band` has no sign of its own: it keeps the last one, so that noise,
    rounding and the elastic contact do not reset. The law is not linear near the error 0.
    """

    name: ClassVar[str] = "reset_integral"
    state_units: ClassVar[Mapping[str, str | None]] = {"integral": "N", "side": None}

    reset_share: float = constant(
        0.5, "Share a of the integral that a reset turns round.", at_least=0.0, at_most=1.0
    )
    reset_band: float = constant(
        0.0, "Largest position error without a sign of its own.", "m", at_least=0.0
    )

    @override
    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        integral, side = state
        error, rate = tracking_error(sample.body(self.feedback), reference)
        if abs(error) > self.reset_band:
            before, side = side, 1.0 if error > 0.0 else -1.0
            if before == -side:
                integral *= -self.reset_share
        force, integral = self.force_and_integral(integral, elapsed, error, rate, 0.0)
        return force, (integral, side)

    @override
    def linear_feedback(self, period: float) -> LinearFeedback | None:
        return None
