"""The washout control law, eq. 17 and 18: without sampling, and for held samples."""

from collections.abc import Mapping, Sequence
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
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.functions import expm1
from stickslip_ros.samples import Reference, Sample


@dataclass(frozen=True)
class Washout(FeedbackLaw, ContinuousControl):
    """Washout filter with linear and cubic velocity feedback, eq. 17 and 18.

    The filter is w' = y - d w with the output v = y - d w. As `continuous` control its state is w,
    m. For held samples it is discretised exactly; the state is then kept as z = d w, the low-passed
    speed, z' = d (y - z), so that the output does not jump when the cutoff frequency changes. The
    filter starts at rest.
    """

    name: ClassVar[str] = "washout"
    accepts_expressions: ClassVar[bool] = True
    tuned: ClassVar[Sequence[str]] = ("corner_frequency", "linear_gain")
    states: ClassVar[Sequence[str]] = ("w",)
    state_units: ClassVar[Mapping[str, str | None]] = {"low_passed": "m/s", "velocity": "m/s"}

    corner_frequency: Any = constant(
        2.0, "Cutoff frequency d of the filter.", "rad/s", positive=True
    )
    linear_gain: Any = constant(-1.0, "Linear gain k1; a negative gain removes energy.", "N s/m")
    cubic_gain: Any = constant(-1.0, "Cubic gain k2.", "N s^3/m^3")

    def force(self, filtered: Any) -> Any:
        """Return the control force, u = k1 v + k2 v^3, eq. 18.

        Parameters
        ----------
        filtered : float, array or expression
            Filter output v.

        Returns
        -------
        float, array or expression
            Force u, N for gains and speed in SI units.
        """
        return self.linear_gain * filtered + self.cubic_gain * filtered * filtered * filtered

    def initial_state(self, sample: Sample, reference: Reference) -> State:
        """Return a filter at rest: z = y, and y, m/s; see `ControlLaw.initial_state`."""
        velocity = sample.body(self.feedback).velocity
        return velocity, velocity

    @override
    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        low_passed, held = state
        velocity = (sample if self.feedback == TABLE else sample.body(self.feedback)).velocity
        low_passed -= expm1(-self.corner_frequency * elapsed) * (held - low_passed)
        return self.force(velocity - low_passed), (low_passed, velocity)

    def linear_feedback(self, period: float) -> LinearFeedback:
        """Return z' = z + q (y - z), u = k1 (y - z); see `ControlLaw.linear_feedback`."""
        step, gain = -expm1(-self.corner_frequency * period), self.linear_gain
        return LinearFeedback(
            np.array([[1.0 - step]]),
            np.array([[0.0, step]]),
            np.array([-gain]),
            np.array([0.0, gain]),
        ).for_body(self.feedback)

    def silenced(self) -> Self:
        """Return the filter alone, which gives no force."""
        return replace(self, linear_gain=0.0, cubic_gain=0.0)

    def rest(self, position: Any, speed: Any) -> Sequence[Any]:
        """Return w = y/d: the filter has no output; see `ContinuousControl.rest`."""
        return (speed / self.corner_frequency,)

    def state_rates(self, position: Any, speed: Any, states: Sequence[Any]) -> Sequence[Any]:
        """Return w' = v = y - d w, eq. 17; see `ContinuousControl.state_rates`."""
        return (speed - self.corner_frequency * states[0],)

    def control_force(self, position: Any, speed: Any, states: Sequence[Any]) -> Any:
        """Return u, eq. 17 and 18; see `ContinuousControl.control_force`."""
        return self.force(speed - self.corner_frequency * states[0])

    def state_scales(self, drive: Drive) -> Sequence[float]:
        """Return that from W to z = d w, m/s; see `ContinuousControl.state_scales`."""
        return (self.corner_frequency / drive.angular_frequency * drive.speed_scale,)

    def bound(self, speed: Any) -> Any:
        """Return forces that give at least the energy; see `ContinuousControl.bound`.

        With v = w' and d w the parts of y that pass the filter and do not, both periodic,
        int v w = 0: int v y = int v^2 <= int y^2. Where k2 < 0, by Young's inequality
        -int v^3 y = -int (v^4 + v^3 d w) <= (27/256) int (d w)^4 <= (27/256) int y^4.
        Otherwise, by Hoelder's, int v^3 y <= 8 int y^4, since v is at most twice as large as y in
        L^4.
        """
        cubic = -27.0 / 256.0 * self.cubic_gain if self.cubic_gain < 0.0 else 8.0 * self.cubic_gain
        return max(self.linear_gain, 0.0) * speed + cubic * speed**3
