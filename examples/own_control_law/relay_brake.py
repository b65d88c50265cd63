"""A brake: a force of constant magnitude against the velocity."""

from dataclasses import dataclass
from typing import ClassVar

from stickslip_ros.model.constants import constant
from stickslip_ros.model.control import ControlLaw


@dataclass(frozen=True)
class RelayBrake(ControlLaw):
    """Constant force against the velocity; proportional to it within a band around zero."""

    name: ClassVar[str] = "relay_brake"

    braking_force: float = constant(120.0, "Magnitude of the force.", "N", at_least=0.0)
    band: float = constant(
        0.02, "Speed below which the force is proportional.", "m/s", positive=True
    )

    def respond(self, state, elapsed, sample, reference):
        """Return the force for a sample, and the state after it; this law has no state."""
        share = min(1.0, max(-1.0, sample.velocity / self.band))
        return -self.braking_force * share, state
