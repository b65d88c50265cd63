"""Parts of the tests: a control law and an actuator."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from stickslip_ros.model.actuator import Actuator
from stickslip_ros.model.constants import constant
from stickslip_ros.model.control import ControlLaw, Reference
from stickslip_ros.samples import Sample


def lag(time_constant: float) -> Actuator:
    """An actuator that only lags, by a time constant in s."""
    return Actuator(time_constant=time_constant)


@dataclass(frozen=True)
class Switching(ControlLaw):
    """A force that only has the sign of the velocity: not linear, and no equations."""

    name: ClassVar[str] = "switching"
    size: float = constant(0.1, "Size of the force.", "N")

    def respond(
        self, state: tuple[float, ...], elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, tuple[float, ...]]:
        return -float(np.sign(sample.velocity)) * self.size, state
