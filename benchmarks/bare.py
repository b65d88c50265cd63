"""Bare heyoka: integrators of slip and stick, and the loop over these phases."""

from math import copysign, ulp
from typing import Any

import heyoka as hy

from stickslip_ros.model.drive import UNBOUNDED_SPEED, Drive


class BareMotion:
    """Motion from rest for any drive with cubic Stribeck friction and m = N = 1, not scaled.

    With `controlled`, the washout law acts without sampling; its filter starts at rest.
    """

    def __init__(self, *, controlled: bool = False) -> None:
        x, y, w = hy.make_vars("x", "y", "w")
        damping, stiffness, static, belt, corner, linear, cubic_gain, slope, cubic, sign = (
            hy.par[n] for n in range(10)
        )
        filtered = y - corner * w
        force = linear * filtered + cubic_gain * filtered * filtered * filtered
        r = y - belt
        reaction = stiffness * x + damping * y - (force if controlled else 0.0)
        friction = -static * sign + slope * r - cubic * r * r * r
        falling = hy.event_direction.negative
        filter_equation = [(w, filtered)] if controlled else []
        self.controlled = controlled
        slip = hy.taylor_adaptive(
            [(x, y), (y, friction - reaction), *filter_equation],
            [0.0] * (2 + controlled),
            t_events=[
                hy.t_event(sign * r, direction=falling),
                hy.t_event(1.0 - sign * y / UNBOUNDED_SPEED, direction=falling),
            ],
            fast_math=True,
        )
        stick = hy.taylor_adaptive(
            [(x, y), (y, 0.0 * y), *filter_equation],
            [0.0] * (2 + controlled),
            t_events=[
                hy.t_event(static - reaction, direction=falling),
                hy.t_event(static + reaction, direction=falling),
            ],
        )
        # Creating the views of their arrays costs as much as a short step.
        self.slip: tuple[Any, Any, Any] = (slip, slip.state, slip.pars)
        self.stick: tuple[Any, Any, Any] = (stick, stick.state, stick.pars)

    def run(
        self, drive: Drive, end: float, gains: tuple[float, float, float] = (1.0, 0.0, 0.0)
    ) -> tuple[float, float]:
        """Return displacement and velocity at the time `end`; gains are d, k1, k2."""
        law, belt, stiffness, damping = (
            drive.friction, drive.belt_speed, drive.stiffness, drive.damping
        )  # fmt: skip
        drop, static = law.static - law.minimum, law.static
        slope = 1.5 * drop / law.minimum_speed
        cubic = 0.5 * drop / law.minimum_speed**3
        corner, linear, cubic_gain = gains
        for _, _, parameters in (self.slip, self.stick):
            values = [damping, stiffness, static, belt, *gains, slope, cubic, 0.0]
            parameters[:] = values[: len(parameters)]
        now, x, y, w, force = 0.0, 0.0, 0.0, 0.0, 0.0
        sign = -1.0 if belt > 0.0 else 0.0
        while now < end:
            taylor, state, parameters = self.slip if sign else self.stick
            state[0], state[1] = x, y
            if self.controlled:
                state[2] = w
            taylor.time = now
            if sign:
                parameters[-1] = sign
            outcome = int(taylor.propagate_until(end)[0])
            x, y = float(state[0]), float(state[1])
            if self.controlled:
                w = float(state[2])
                filtered = belt - corner * w
                force = linear * filtered + cubic_gain * filtered * filtered * filtered
            now = float(taylor.time)
            if outcome == int(hy.taylor_outcome.time_limit):
                break
            taylor.reset_cooldowns()
            reaction = stiffness * x + damping * belt - force
            sticks = sign and abs(reaction) <= static
            sign = 0.0 if sticks else -copysign(1.0, reaction)
            y = belt + sign * ulp(1.0)
        return x, y
