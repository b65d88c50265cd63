"""The cascade of a feed drive: position loop, velocity loop, feed-forward, and a washout term."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from typing_extensions import override

from stickslip_ros.model.constants import constant
from stickslip_ros.model.control.base import (
    TABLE,
    ControlLaw,
    LinearFeedback,
    State,
    TwoBodyControl,
    body,
)
from stickslip_ros.model.control.washout import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.samples import Reference, Sample


@dataclass(frozen=True)
class Cascade(ControlLaw, TwoBodyControl):
    """Proportional position loop around a proportional-integral velocity loop, with a washout.

    The commanded velocity is v_c = Kv (r - p) + r', and u = Kp (v_c - q) + I + m_f r'' + washout,
    I' = Ki (v_c - q), with position p and velocity q of the bodies that `feedback` and
    `velocity_feedback` name, and the reference r, 0 in the moving frame without one. The washout
    acts on the velocity of the body that `washout_feedback` names. With an ideal motor each is the
    slide. For samples, I is a sum of rectangles, and does not grow while u is beyond its limit.
    With Kp = Ki = m_f = 0 the law is the washout, with k1 = k2 = 0 the cascade of feed drives
    (Gross, Hamann, Wiegaertner, Electrical Feed Drives in Automation, 2001).
    """

    name: ClassVar[str] = "cascade"
    states: ClassVar[Sequence[str]] = ("integral", "w")
    tuned: ClassVar[Sequence[str]] = ("position_gain", "velocity_gain", "integral_gain")
    follows_reference: ClassVar[bool] = True
    state_units: ClassVar[Mapping[str, str | None]] = {
        "integral": "N", "rate": "N/s", **Washout.state_units
    }  # fmt: skip

    position_gain: Any = constant(1.0, "Gain Kv of the position.", "1/s", at_least=0.0)
    velocity_gain: Any = constant(1.0, "Gain Kp of the velocity.", "N s/m", at_least=0.0)
    integral_gain: Any = constant(
        0.1, "Gain Ki of the velocity's integral.", "N/m", at_least=0.0, simplifies=True
    )
    feed_forward_mass: Any = constant(0.0, "Mass m_f of the feed-forward.", "kg", at_least=0.0)
    corner_frequency: Any = constant(2.0, "Cutoff frequency d.", "rad/s", positive=True)
    linear_gain: Any = constant(0.0, "Linear gain k1 of the washout.", "N s/m")
    cubic_gain: Any = constant(0.0, "Cubic gain k2 of the washout.", "N s^3/m^3")
    feedback: str = body(TABLE, "position is fed back")
    velocity_feedback: str = body(TABLE, "velocity is fed back")
    washout_feedback: str = body(TABLE, "velocity passes the washout")

    @property
    def washout(self) -> Washout:
        """The washout term."""
        gains = self.corner_frequency, self.linear_gain, self.cubic_gain
        return Washout(*gains, feedback=self.washout_feedback)

    @override
    def initial_state(self, sample: Sample, reference: Reference) -> State:
        return 0.0, 0.0, *self.washout.initial_state(sample, reference)

    @override
    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        integral, rate, *memory = state
        position, velocity, acceleration = reference.filled
        error = self.position_gain * (position - sample.body(self.feedback).position) + velocity
        error -= sample.body(self.velocity_feedback).velocity
        added, memory = self.washout.respond((memory[0], memory[1]), elapsed, sample, reference)
        added += self.velocity_gain * error + self.feed_forward_mass * acceleration
        after = integral + rate * elapsed
        if abs(added + after) > max(self.force_limit, abs(added + integral)):
            after = integral
        return added + after, (after, self.integral_gain * error, *memory)

    @override
    def linear_feedback(self, period: float) -> LinearFeedback:
        added, error = self.washout.linear_feedback(period), np.zeros(4)
        error[0 if self.feedback == TABLE else 2] -= self.position_gain
        error[1 if self.velocity_feedback == TABLE else 3] -= 1.0
        # I at the last sample, its rate, and the washout's z, as far as they act on the force.
        kept = np.flatnonzero([self.integral_gain, self.integral_gain, self.linear_gain])
        matrix = np.array([[1.0, period, 0.0], [0.0] * 3, [0.0, 0.0, added.state[0, 0]]])
        output, inputs = np.array([1.0, period, added.output[0]]), np.zeros((4, 4))
        inputs[1], inputs[3] = self.integral_gain * error, self.velocity_gain * error
        inputs[2:, : len(added.direct)] += added.input[0], added.direct
        return LinearFeedback(matrix[np.ix_(kept, kept)], inputs[kept], output[kept], inputs[3])

    @override
    def silenced(self) -> Self:
        gains = ["position_gain", "velocity_gain", "integral_gain", "linear_gain", "cubic_gain"]
        return replace(self, **dict.fromkeys(gains, 0.0))

    @override
    def rest(self, position: Any, speed: Any) -> Sequence[Any]:
        return 0.0, *self.washout.rest(0.0, _seen(self.washout_feedback, speed))

    @override
    def state_rates(self, position: Any, speed: Any, states: Sequence[Any]) -> Sequence[Any]:
        gain: Any = self.integral_gain
        rate = gain * self._error(position, speed)
        if isinstance(gain, float) and gain == 0.0:  # not determined: it decays
            rate = -self.corner_frequency * states[0]
        seen = _seen(self.washout_feedback, speed)
        return rate, *self.washout.state_rates(0.0, seen, states[1:])

    def control_force(self, position: Any, speed: Any, states: Sequence[Any]) -> Any:
        """Return u without a reference."""
        washed = self.washout.control_force(0.0, _seen(self.washout_feedback, speed), states[1:])
        return self.velocity_gain * self._error(position, speed) + states[0] + washed

    def _error(self, position: Any, speed: Any) -> Any:
        seen = _seen(self.feedback, position), _seen(self.velocity_feedback, speed)
        return -self.position_gain * seen[0] - seen[1]

    @override
    def state_scales(self, drive: Drive) -> Sequence[float]:
        return drive.force_scale, *self.washout.state_scales(drive)


def _seen(which: str, pair: Any) -> Any:
    return pair[0] if which == TABLE else pair[1]
