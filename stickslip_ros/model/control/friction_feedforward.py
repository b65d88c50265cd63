"""PID control with the friction of the reference as a feed-forward."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.control.base import State
from stickslip_ros.model.control.pid import Pid, moved_mass, tracking_error
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Exponential
from stickslip_ros.model.functions import exp
from stickslip_ros.samples import Reference, Sample

_SHARES = np.geomspace(1e-5, 1e2, 2000)
"""Speeds at which friction is taken over, in units of the speed of its law."""


@dataclass(frozen=True)
class FrictionFeedforward(Pid):
    """PID control with the feed-forward m r'' + F(v), v the reference's velocity on the guide.

    F(v) = s [F_k + (F_s - F_k) exp(-(|v|/v_s)^n)] + c v with s = sgn v is the exponential law that
    `identify` fits, as forces (B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, Automatica 30,
    1994). It feeds nothing back: the linear form is that of PID control. v is the velocity of the
    reference, less that of the guide where it moves.
    """

    name: ClassVar[str] = "friction_feedforward"

    nominal_mass: float = constant(1.0, "Mass m that is accelerated.", "kg", at_least=0.0)
    kinetic_force: float = constant(0.25, "Kinetic friction F_k.", "N", at_least=0.0)
    static_force: float = constant(0.4, "Static friction F_s.", "N", at_least=0.0)
    decay_speed: float = constant(
        0.5, "Speed v_s of the decay from F_s to F_k.", "m/s", positive=True
    )
    exponent: float = constant(1.0, "Exponent n of the decay.", at_least=1.0, at_most=100.0)
    viscous_damping: float = constant(0.0, "Viscous damping c.", "N s/m", at_least=0.0)

    @override
    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        error, rate = tracking_error(sample.body(self.feedback), reference)
        _, velocity, acceleration = reference.filled
        speed = velocity - sample.belt_velocity
        forward = self.nominal_mass * acceleration + self.viscous_damping * speed
        if speed != 0.0:
            forward += self.size(abs(speed)) * (1.0 if speed > 0.0 else -1.0)
        force, integral = self.force_and_integral(state[0], elapsed, error, rate, forward)
        return force, (integral,)

    def size(self, speed: float) -> float:
        """Return the friction without its viscous part.

        Parameters
        ----------
        speed : float
            Sliding speed, m/s, at least 0.

        Returns
        -------
        float
            Size of the friction force, N.
        """
        decay = exp(-((speed / self.decay_speed) ** self.exponent))
        return self.kinetic_force + (self.static_force - self.kinetic_force) * decay

    @override
    def for_drive(self, drive: Drive) -> Self:
        law, load = getattr(drive.friction, "forward", drive.friction), drive.normal_force
        law = getattr(law, "curve", law)
        viscous = getattr(law, "viscous", 0.0) * load
        if isinstance(law, Exponential):
            forces = law.static * load, law.kinetic * load
            decay, exponent = law.decay_speed, law.exponent
        else:  # the speed at which 1/e of the fall is left
            speeds = _SHARES * min(law.characteristic_speed, 1e3 * drive.speed_scale)
            dry = -load * law.coefficient(speeds, np.ones(len(speeds))) - viscous * speeds
            forces = law.limits[0] * load, dry.min()
            left = forces[1] + (forces[0] - forces[1]) * exp(-1.0)
            decay, exponent = speeds[np.flatnonzero(dry <= left * (1.0 + 1e-9))[0]], 1.0
        if drive.fastest_belt == 0.0:
            viscous += drive.damping
        return replace(
            self,
            nominal_mass=moved_mass(drive),
            static_force=float(forces[0]),
            kinetic_force=float(forces[1]),
            decay_speed=float(decay),
            exponent=exponent,
            viscous_damping=viscous,
        )
