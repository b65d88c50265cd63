"""The PID law of motion control, with anti-windup."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import expm1
from typing import ClassVar

from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.control.base import FeedbackLaw, LinearFeedback, State, superposed
from stickslip_ros.model.drive import Drive
from stickslip_ros.samples import MotorSample, Reference, Sample


@dataclass(frozen=True)
class Pid(FeedbackLaw):
    """PID control of the displacement, u = k_p e + k_i int e + k_d e', with e = r - x.

    Without a reference r is 0, at rest in the frame of the controller. e' is the measured velocity,
    not a difference of errors. The integral is a sum over the samples. Beyond `force_limit` it
    follows what the limit leaves of the force, by back-calculation (K. J. Astrom, T. Hagglund,
    Advanced PID Control, 2006, section 3.5), with the time constant `tracking_time`.
    """

    name: ClassVar[str] = "pid"
    follows_reference: ClassVar[bool] = True
    state_units: ClassVar[Mapping[str, str | None]] = {"integral": "N"}
    tuned: ClassVar[Sequence[str]] = ("position_gain", "integral_gain", "velocity_gain")

    position_gain: float = constant(
        1.0, "Gain k_p of the position error; positive gains act against it.", "N/m", at_least=0.0
    )
    integral_gain: float = constant(
        0.1, "Gain k_i of the integral of the position error.", "N/(m s)", at_least=0.0
    )
    velocity_gain: float = constant(1.0, "Gain k_d of the velocity error.", "N s/m", at_least=0.0)
    tracking_time: float = constant(
        0.1, "Time constant of the anti-windup at the force limit.", "s", positive=True
    )

    @override
    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        error, rate = tracking_error(sample.body(self.feedback), reference)
        force, integral = self.force_and_integral(state[0], elapsed, error, rate, 0.0)
        return force, (integral,)

    def force_and_integral(
        self, integral: float, elapsed: float, error: float, rate: float, forward: float
    ) -> tuple[float, float]:
        """Return the force with a feed-forward, and the integral after the sample.

        Parameters
        ----------
        integral : float
            Integral part of the force before the sample, N.
        elapsed : float
            Time since the last sample, s.
        error, rate : float
            Errors of position, m, and velocity, m/s.
        forward : float
            Feed-forward force, N.

        Returns
        -------
        tuple of float
            Force and integral part, N.
        """
        integral += self.integral_gain * elapsed * error
        force = self.position_gain * error + integral + self.velocity_gain * rate + forward
        excess = force - self.limited(force)
        return force, integral + expm1(-elapsed / self.tracking_time) * excess

    @override
    def linear_feedback(self, period: float) -> LinearFeedback | None:
        return self.linear_part(period)

    def linear_part(self, period: float) -> LinearFeedback:
        """Return PID control alone, without what a derived law adds to it.

        Parameters
        ----------
        period : float
            Sample period, s.
        """
        gains = {name: getattr(self, name) for name in Pid.tuned}
        return superposed(Pid(**gains), period).for_body(self.feedback)


def tracking_error(body: Sample | MotorSample, reference: Reference) -> tuple[float, float]:
    """Return the errors of position, m, and velocity, m/s; what has no reference is held at 0."""
    position, velocity, _ = reference.filled
    return position - body.position, velocity - body.velocity


def moved_mass(drive: Drive) -> float:
    """Return the mass, kg, that the control force moves: slide and motor."""
    return drive.mass if drive.motor is None else drive.mass + drive.motor.mass
