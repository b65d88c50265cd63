"""PID control with friction from an observer of the bristles of the contact."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.control.base import LinearFeedback, State
from stickslip_ros.model.control.friction_feedforward import FrictionFeedforward
from stickslip_ros.model.control.pid import tracking_error
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.functions import expm1
from stickslip_ros.samples import Reference, Sample

_DEFLECTION = 1e-5
"""Deflection, m, of bristles at break-away that is assumed where the friction law has none."""


@dataclass(frozen=True)
class LugreObserver(FrictionFeedforward):
    """PID control that adds the friction of an observed contact, u = u_pid + m r'' + F.

    The deflection z of the bristles follows the measured velocity on the guide,
    z' = v - S |v| z / g(v) + k e, and F = S z + D z' + c v, where g(v) is the size of the friction
    in steady slip (C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, A new model for
    control of systems with friction, IEEE Transactions on Automatic Control 40(3), 1995). The
    velocity of each sample is held over the time before it. With wrong constants it may
    over-compensate: then the loop vibrates although the same PID control does not.
    """

    name: ClassVar[str] = "lugre_observer"
    state_units: ClassVar[Mapping[str, str | None]] = {"integral": "N", "z": "m"}

    bristle_stiffness: float = constant(1000.0, "Stiffness S of the contact.", "N/m", positive=True)
    bristle_damping: float = constant(30.0, "Damping D of the contact.", "N s/m", at_least=0.0)
    observer_gain: float = constant(
        0.0, "Gain k by which the position error corrects the deflection.", "1/s", at_least=0.0
    )

    @override
    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        integral, deflection = state
        error, rate = tracking_error(sample.body(self.feedback), reference)
        speed = sample.velocity - sample.belt_velocity
        decay = self.bristle_stiffness * abs(speed) / max(self.size(abs(speed)), 1e-30)
        drift = speed + self.observer_gain * error - decay * deflection
        passed = decay * elapsed
        deflection += drift * (-expm1(-passed) / decay if passed > 0.0 else elapsed)
        change = speed + self.observer_gain * error - decay * deflection
        friction = self.bristle_stiffness * deflection + self.bristle_damping * change
        friction += self.viscous_damping * speed
        friction += self.nominal_mass * reference.filled[2]
        force, integral = self.force_and_integral(integral, elapsed, error, rate, friction)
        return force, (integral, deflection)

    @override
    def linear_feedback(self, period: float) -> LinearFeedback | None:
        return None  # it depends on the speed of the guide

    @override
    def for_drive(self, drive: Drive) -> Self:
        law = super().for_drive(drive)
        ratio = getattr(drive.friction, "bristle_stiffness", None)
        stiffness = law.static_force / _DEFLECTION if ratio is None else ratio * drive.normal_force
        damping = getattr(drive.friction, "bristle_damping", 0.0) * drive.normal_force
        return replace(law, bristle_stiffness=stiffness, bristle_damping=damping)
