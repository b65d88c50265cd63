"""The washout controller under its names of version 0.1."""

from math import inf, nan

from stickslip_ros.deprecated_names import moved_from
from stickslip_ros.physics.loop.controller import Controller
from stickslip_ros.physics.model.control import Washout as WashoutLaw
from stickslip_ros.samples import Sample

__getattr__ = moved_from(__name__)


class OldWashoutParameters(WashoutLaw):
    """The washout law with the arguments of version 0.1."""

    def __init__(
        self,
        corner_frequency: float,
        linear_gain: float,
        cubic_gain: float,
        force_limit: float = inf,
        start_after: float = 0.0,
    ) -> None:
        super().__init__(
            corner_frequency,
            linear_gain,
            cubic_gain,
            force_limit=force_limit,
            start_after=start_after,
        )


class OldWashout(Controller):
    """The washout controller of version 0.1, which answers velocities."""

    law: WashoutLaw

    def __init__(self, parameters: WashoutLaw, low_passed: float | None = None) -> None:
        # The first sample replaces the held velocity.
        super().__init__(parameters, state=None if low_passed is None else (low_passed, 0.0))

    @property
    def parameters(self) -> WashoutLaw:
        """Constants of the law."""
        return self.law

    @parameters.setter
    def parameters(self, parameters: WashoutLaw) -> None:
        self.law = parameters

    @property
    def low_passed(self) -> float:
        """Low-passed speed z at the newest measurement, m/s."""
        return self.state[0] if self.state else 0.0

    def answer(self, sample: Sample | int, velocity: float = nan) -> float | None:
        """Return the force (N) for a stamp (ns) and a velocity (m/s), or for a sample."""
        if not isinstance(sample, Sample):
            sample = Sample(sample, nan, velocity, nan, nan, nan)
        return super().answer(sample)
