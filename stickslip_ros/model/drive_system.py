"""A drive as a hybrid system: slip and stick of the slide, and the modes of its law and signals."""

from collections.abc import Sequence
from functools import partial
from math import copysign, inf, isfinite, ulp
from typing import Any

import heyoka as hy
import numpy as np

from stickslip_ros.errors import RunError
from stickslip_ros.model import equations
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.dimensionless_drive import (
    LIFT_ROUNDING,
    MEMORY,
    POSITION,
    SPEED,
    DimensionlessDrive,
    stretched,
)
from stickslip_ros.model.drive import UNBOUNDED_SPEED, Drive
from stickslip_ros.model.hybrid import TIME_ROUNDING, Flow, Guard, Instant, Mode, with_switches
from stickslip_ros.model.signals import Signal

SLIP, STICK = "slip", "stick"
"""The flows of a drive. In slip the first switch is sgn(v_r), in stick it is 0."""

_HYSTERESIS = 2.0**-45
"""Distance behind a guard of a part at which the mode ends.

The mode that follows then starts before its own guards: heyoka misses an event in a step that
starts on one. It also keeps rounding from leading back.
"""

SMALLEST_STEP = 2.0**-35
"""Speed below which a change of the belt speed at a corner, or a relative speed, is rounding."""

UNSEEN = 2.0**-60
"""Factor of a series that has no part in the choice of steps."""

_MOST_AT_ONCE = 100
"""Number of changes of mode at one instant above which there is no end of them."""


class DriveSystem(DimensionlessDrive):
    """The modes of a drive: its flows, the guards between them, and where these lead.

    In slip the slide follows eq. 5; where it reaches the speed of the belt it sticks if its law can
    hold it, -mu_forward N <= h <= mu_backward N with the reaction h. Otherwise it passes that speed
    or slips the other way. In stick it moves with the belt until the reaction leaves these limits.
    """

    def __init__(self, drive: Drive, control: ContinuousControl | None = None) -> None:
        super().__init__(drive, control)
        law = self.drive.friction
        self._frequency = drive.angular_frequency
        self.forward_limit, self.backward_limit = map(float, law.limits)
        self._largest_friction = max(self.forward_limit, self.backward_limit)
        self._largest_friction *= 1.0 + self.drive.load.bounds[1]
        self._largest_belt_acceleration = self.drive.belt.steepest
        # Time at which the speed of the belt was last asked for, and that speed.
        self._seen_at = self._seen_belt_speed = inf
        self._characteristic_speed = law.characteristic_speed

    def flow(self, name: str) -> Flow:
        """Return the flow `SLIP` or `STICK`.

        In slip the guards are: the slide reaches the belt speed; the motion is unbounded. In stick:
        the reaction exceeds the limit against backward, and against forward slip. Then come those
        of the law, and that of a load that may lift the slide.
        """
        kind, parts = type(self), self._expressions
        drive, law, switches, sign = parts.drive, parts.law, parts.switches, parts.sign
        y, memory, normal = parts.speed, parts.memory, parts.normal
        reaction, part_rates = parts.reaction(y), parts.part_rates(y)
        if name == STICK:
            forward, backward = law.limits
            held = reaction if self._steady else reaction + drive.mass * parts.belt_acceleration
            return Flow(
                rates=(y, parts.belt_acceleration, *part_rates),
                guards=(
                    Guard(normal * backward - held, kind.release_backward),
                    Guard(normal * forward + held, kind.release_forward),
                    *self._lifted(),
                ),
                marks=self._marks_of_stick(y, parts.belt_acceleration),
            )
        relative_speed = y - parts.belt_speed
        friction = normal * law.friction(relative_speed, sign, memory, switches.law)
        acceleration = equations.acceleration(drive, friction, reaction)
        return Flow(
            rates=(
                y,
                acceleration,
                *law.memory_rates(relative_speed, sign, memory, switches.law),
                *part_rates,
            ),
            guards=(
                Guard(sign * relative_speed, kind.reach_belt),
                # The slide diverges in the direction of the slip. The margin is of the order of
                # one, since heyoka's error is relative to the largest of states and events.
                Guard(1.0 - sign * y / UNBOUNDED_SPEED, kind.diverge),
                *self._guards_of_parts(relative_speed),
            ),
            marks=self._marks_of_slip(y, acceleration, relative_speed),
            step_limiters=self._step_limiters(relative_speed),
        )

    def _step_limiters(self, relative_speed: Any) -> tuple[Any, ...]:
        """Return what makes heyoka see an exponential that is negligible, see `longest_step`.

        The acceleration of a slide with a memory has no useful bound.
        """
        if not self._limits_by_series:
            return ()
        return (0.2 + 0.1 * hy.cos(relative_speed * self.symbols.constants["step_limiter"]),)

    def _marks_of_slip(self, speed: Any, acceleration: Any, relative_speed: Any) -> tuple[Any, ...]:
        """Return turning points and peaks, and where a slide that never sticks becomes slow.

        heyoka chooses its steps by the largest series. Those of the marks must not be: otherwise a
        motion that is recorded would differ in its rounding from one that is not.
        """
        if not self.many_steps:
            return speed, acceleration
        found = [speed, acceleration]
        if not self.sticks:
            slow = self.symbols.constants["stick_speed"]
            found += [relative_speed - slow, relative_speed + slow]
        return tuple(UNSEEN * each for each in found)

    def _guards_of_parts(self, relative_speed: Any) -> list[Guard]:
        """Return the guards of the law, and of a load that may lift the slide."""
        parts, enter = self._expressions, type(self).switch_friction
        margins = parts.law.margins(relative_speed, parts.sign, parts.memory, parts.switches.law)
        of_law = (
            Guard(margin + _HYSTERESIS, partial(enter, margin=number))
            for number, margin in enumerate(margins)
        )
        return [*of_law, *self._lifted()]

    def _lifted(self) -> list[Guard]:
        if not self._may_lift:
            return []
        return [Guard(self._expressions.normal + LIFT_ROUNDING, type(self).lift)]

    def _marks_of_stick(self, speed: Any, acceleration: Any) -> tuple[Any, ...]:
        if self._steady:
            return ()
        epoch = hy.par[self.index["epoch"]]  # added to the time everywhere
        varies = hy.diff(acceleration, epoch) != hy.expression(0.0)
        found = (speed, acceleration) if varies else (speed,)
        return tuple(UNSEEN * each for each in found) if self.many_steps else found

    def reach_belt(self, mode: Mode, instant: Instant) -> Mode:
        """Stick, or slip on in either direction, where the slide reaches the belt speed."""
        instant.state[SPEED] = self.belt_speed(mode, instant.time)
        if self.sticks:
            return self._resting(mode, instant)
        return self._slip(mode, -mode.switches[0], instant)

    def release_backward(self, mode: Mode, instant: Instant) -> Mode:
        """Slip backward where the reaction exceeds its limit."""
        return self._slip(mode, -1.0, instant)

    def release_forward(self, mode: Mode, instant: Instant) -> Mode:
        """Slip forward where the reaction falls below its limit."""
        return self._slip(mode, 1.0, instant)

    def lift(self, mode: Mode, instant: Instant) -> Mode:
        """End the run: the slide lifts off the belt."""
        raise RunError(
            f"the normal force falls below 0 N at {instant.time / self._frequency:.6g} s: the load "
            "must leave it at 0 N or more"
        )

    def diverge(self, mode: Mode, instant: Instant) -> None:
        """End an unbounded motion."""

    def switch_friction(self, mode: Mode, instant: Instant, *, margin: int) -> Mode:
        """Enter the mode of the law that follows at one of its margins."""
        sign, own = mode.switches[0], mode.switches[self._parts.law]
        return with_switches(mode, 1, self.drive.friction.switches_after(margin, sign, own))

    def next_switch_time(self, mode: Mode) -> float:
        """Return the time of the next corner of the signals."""
        own = self.by_part(mode.switches)
        return min(
            self.drive.belt.next_switch_time(own.belt), self.drive.load.next_switch_time(own.load)
        )

    def switch_inputs(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode after the corners and steps of the signals up to an instant."""
        time, own = instant.time, self.by_part(mode.switches)
        before = self.belt_speed(mode, time)
        belt = _after(self.drive.belt, own.belt, time)
        load = _after(self.drive.load, own.load, time)
        mode = with_switches(mode, self._parts.belt.start, (*belt, *load))
        self._check_contact(mode, instant)
        belt_speed = self.belt_speed(mode, time)
        self._seen_at, self._seen_belt_speed = time, belt_speed
        relative_speed = instant.state[SPEED] - belt_speed
        if abs(relative_speed) <= SMALLEST_STEP:
            instant.state[SPEED] = belt_speed
            return self._resting(mode, instant)  # acceleration of the belt, or load, jumps
        sign = copysign(1.0, relative_speed)
        if sign == mode.switches[0] and abs(belt_speed - before) <= SMALLEST_STEP:
            return mode
        return self._slip(mode, sign, instant)

    def settled(self, mode: Mode | None, instant: Instant) -> Mode:
        """Return stick, or slip in the direction of the relative speed; see the class."""
        state, time = instant.state, instant.time
        sticks = mode is not None and mode.flow == STICK
        if mode is None:
            mode = self._starting(instant)
            self._check_contact(mode, instant)
        elif self.has_parts:
            if (following := self.apply_pending_guards(mode, instant)) is not mode:
                return following
        elif not sticks:
            # The belt has changed its speed by so much at most.
            change = self._largest_belt_acceleration * (time - self._seen_at)
            if mode.switches[0] * (state[SPEED] - self._seen_belt_speed) > change + SMALLEST_STEP:
                return mode
        belt_speed = self.belt_speed(mode, time)
        self._seen_at, self._seen_belt_speed = time, belt_speed
        if sticks and not self._steady:  # without the rounding of the integration
            state[SPEED] = belt_speed
        relative_speed = state[SPEED] - belt_speed
        if relative_speed == 0.0:
            settled = self._resting(mode, instant)
            if settled is mode:
                self.nudge_off_guard(mode, instant)
            return settled
        sign = 1.0 if relative_speed > 0.0 else -1.0
        return mode if mode.switches[0] == sign else self._slip(mode, sign, instant)

    def continued(self, before: Mode, mode: Mode, instant: Instant) -> Mode:
        """Return the mode of a changed drive that slips on, as `before`, under the same law."""
        if mode.flow != SLIP or mode.switches[0] != before.switches[0]:
            return mode
        own = before.switches[self._parts.law]
        return self._slip(with_switches(mode, 1, own), mode.switches[0], instant)

    def _relative_speed(self, mode: Mode, instant: Instant) -> float:
        return instant.state[SPEED] - self.belt_speed(mode, instant.time)

    def _check_contact(self, mode: Mode, instant: Instant) -> None:
        if self._may_lift and self.normal_force(mode, instant.time) < -LIFT_ROUNDING:
            self.lift(mode, instant)

    def apply_pending_guards(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode after the margins of the law that rounding has put below zero."""
        for _ in range(_MOST_AT_ONCE):
            margin = self._pending_margin(mode, instant)
            if margin is None:
                return mode
            mode = self.switch_friction(mode, instant, margin=margin)
        raise RunError(
            f"the friction law {self.drive.friction.name} changes its mode more than "
            f"{_MOST_AT_ONCE} times at one instant"
        )

    def _pending_margin(self, mode: Mode, instant: Instant) -> int | None:
        """Return the number of the first margin of the law that is below zero, or None."""
        own = mode.switches[self._parts.law]
        if mode.flow != SLIP or not own:
            return None
        speed = instant.state[SPEED] - self.belt_speed(mode, instant.time)
        law, memory = self.drive.friction, self._memory(instant)
        margins = law.margins(speed, mode.switches[0], memory, own)
        below = (number for number, each in enumerate(margins) if each <= -_HYSTERESIS / 2.0)
        return next(below, None)

    def is_unbounded(self, instant: Instant) -> bool:
        """Return whether the slide is faster than `UNBOUNDED_SPEED`."""
        return abs(instant.state[SPEED]) > UNBOUNDED_SPEED

    def nudge_off_guard(self, mode: Mode, instant: Instant) -> None:
        """Move a slide that starts to slip, or sticks near its limit, by rounding errors."""
        state, sign = instant.state, mode.switches[0]
        x, y = state[POSITION], state[SPEED]
        belt_speed = self.belt_speed(mode, instant.time)
        if sign != 0.0 and y != belt_speed:
            return
        if self.sticks:
            force = self.control_force(instant)
            held = self.reaction(instant, force) if self._steady else self.held_force(mode, instant)
            backward = sign < 0.0 or (sign == 0.0 and held > 0.0)
            limit = self.backward_limit if backward else self.forward_limit
            if self._loaded:
                limit *= self.normal_force(mode, instant.time)
            # Without a spring no displacement changes the reaction.
            size = abs(x) + abs(held) + abs(force) + limit
            if self.drive.motor is not None:
                size += sum(map(abs, state[self.motor_states]))
            margin = self.drive.stiffness * 8.0 * ulp(size)
            if sign == 0.0:
                if abs(held) > limit - margin:
                    state[POSITION] = x - copysign(margin, held)
                return
            if abs(held) < limit + margin:
                state[POSITION] = x - sign * margin
        elif self._is_at_rest(mode, instant):
            return
        state[SPEED] = y + sign * max(ulp(belt_speed), ulp(1.0))

    def _is_at_rest(self, mode: Mode, instant: Instant) -> bool:
        """Return whether a slide with a memory stays where it is, on a belt that does not move."""
        state, law, sign = instant.state, self.drive.friction, mode.switches[0]
        if not self._steady or self._loaded or any(state[SPEED:MEMORY]):
            return False
        memory, own = self._memory(instant), mode.switches[self._parts.law]
        rates = law.memory_rates(0.0, sign, memory, own)
        force = self.friction_force(mode, instant) - self.held_force(mode, instant)
        return not any((*rates, *state[self.control_states.start :], force))

    def longest_step(self, instant: Instant) -> float:
        """Return a time in which the speed changes by the law's characteristic speed at most.

        The relative speed, that is: signals change normal force and belt speed. heyoka chooses a
        step from the series at its start. It would miss an exponential that is negligible there and
        rises before the step ends.
        """
        state = instant.state
        stretch, _ = stretched(state[POSITION], state[SPEED], state[self.motor_states])
        acceleration = (
            abs(self.reaction(instant)) + self.drive.stiffness * abs(stretch) + abs(state[SPEED])
            + self._largest_friction + self._largest_belt_acceleration
        )  # fmt: skip
        return self._characteristic_speed / acceleration if acceleration > 0.0 else inf

    def overflow(self, mode: Mode, instant: Instant) -> Mode:
        """Set the speed at which a motion counts as unbounded: what overflows exceeds any speed.

        Raises RunError where it is the friction of another package's law that is not finite.
        """
        law = self.drive.friction
        if law.package and mode.flow == SLIP:
            speed, own = self._relative_speed(mode, instant), mode.switches[self._parts.law]
            with np.errstate(all="ignore"):
                friction = float(law.friction(speed, mode.switches[0], self._memory(instant), own))
            if not isfinite(friction):
                raise RunError(
                    f"the friction law {law.name} of package {law.package} fails: its coefficient "
                    f"is {friction}, which must be a finite number"
                )
        sign = copysign(1.0, -self.reaction(instant))
        instant.state[SPEED] = sign * UNBOUNDED_SPEED
        return self._slip(mode, sign, instant)

    def _starting(self, instant: Instant) -> Mode:
        """Return stick, with the switches that the signals have at an instant."""
        belt = self.drive.belt.switches_at(instant.time)
        load = self.drive.load.switches_at(instant.time)
        law = (0.0,) * len(self.drive.friction.switches)
        motor = (0.0,) * len(self.by_part(self.switches).motor)
        return Mode(STICK, (0.0, *law, *belt, *load, *motor))

    def _slip(self, mode: Mode, sign: float, instant: Instant) -> Mode:
        """Return slip in a direction; the signals stay in their pieces."""
        law, own = self.drive.friction, self.by_part(mode.switches)
        switches: Sequence[float] = ()
        if law.switches:
            state = self._relative_speed(mode, instant), sign, self._memory(instant)
            same = sign == mode.switches[0]
            switches = law.switches_following(own.law, *state) if same else law.switches_at(*state)
        return Mode(SLIP, (sign, *switches, *own.belt, *own.load, *own.motor))

    def _resting(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode of a slide that has the speed of the belt."""
        if self.sticks:
            normal = self.normal_force(mode, instant.time)
            held = self.held_force(mode, instant)
            if held > normal * self.backward_limit:
                return self._slip(mode, -1.0, instant)
            if held < -normal * self.forward_limit:
                return self._slip(mode, 1.0, instant)
            if mode.flow == STICK:
                return mode
            law = (0.0,) * len(self.drive.friction.switches)
            return Mode(STICK, with_switches(mode, 0, (0.0, *law)).switches)
        forward = self._slip(mode, 1.0, instant)
        accelerates = self.friction_force(forward, instant) >= self.held_force(mode, instant)
        return forward if accelerates else self._slip(mode, -1.0, instant)


def _after(signal: Signal, switches: Sequence[float], time: float) -> Sequence[float]:
    """Return the switches of a signal after its corners up to a time, or within its rounding."""
    while (corner := signal.next_switch_time(switches)) <= time * (1.0 + TIME_ROUNDING):
        switches = signal.switches_at(corner)
    return switches
