"""A drive as a hybrid system: slip and stick of the slide, and the modes of its law and signals."""

from collections.abc import Sequence
from functools import cached_property
from math import copysign, inf, isfinite

import numpy as np

from stickslip_ros.errors import RunError
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.dimensionless_drive import DimensionlessDrive
from stickslip_ros.model.drive import UNBOUNDED_SPEED, Drive
from stickslip_ros.model.drive_expressions import DriveExpressions
from stickslip_ros.model.drive_layout import MEMORY, POSITION, SIGN, SPEED
from stickslip_ros.model.hybrid import Flow, Instant, Mode, with_switches
from stickslip_ros.model.rounding import (
    HYSTERESIS,
    LIFT_ROUNDING,
    SPEED_ROUNDING,
    TIME_ROUNDING,
    off_speed,
    rounding_of,
)
from stickslip_ros.model.signals import Signal

SLIP, STICK = "slip", "stick"
"""The flows of a drive. In slip the first switch is sgn(v_r), in stick it is 0."""

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
        law, belt, load = self.drive.friction, self.drive.belt, self.drive.load
        self.sticks = law.sticks
        """Whether the slide can move with the belt: not under a law that has a memory."""
        self.many_steps = not law.sticks or bool(self.drive.actuator.states)
        self.limits_steps = law.characteristic_speed != inf and law.sticks
        """Whether `longest_step` limits the steps of the integration."""
        self.has_parts = len(law.switches) > 0
        """Whether several margins may fall to zero at one instant, see `apply_pending_guards`."""
        self._frequency = drive.angular_frequency
        self._no_law = (0.0,) * len(law.switches)
        self.forward_limit, self.backward_limit = map(float, law.limits)
        largest = max(self.forward_limit, self.backward_limit)
        self._largest_friction = largest * (1.0 + load.bounds[1])
        self._largest_belt_acceleration = belt.steepest
        slowest, fastest = (self.drive.belt_speed + speed for speed in belt.bounds)
        self._below_belt, self._above_belt = slowest - SPEED_ROUNDING, fastest + SPEED_ROUNDING

    @cached_property
    def expressions(self) -> DriveExpressions:
        """The drive as expressions, in `symbols`."""
        return DriveExpressions(self)

    def flow(self, name: str) -> Flow:
        """Return the flow `SLIP` or `STICK`.

        In slip the guards are: the slide reaches the belt speed; the motion is unbounded. In stick:
        the reaction exceeds the limit against backward, and against forward slip. Then come those
        of the law, and that of a load that may lift the slide.
        """
        kind, drive = type(self), self.expressions
        if name == STICK:
            return drive.stick(kind.release, kind.lift)
        return drive.slip(kind.reach_belt, kind.diverge, kind.lift, kind.switch_friction)

    def reach_belt(self, mode: Mode, instant: Instant) -> Mode:
        """Stick, or slip on in either direction, where the slide reaches the belt speed."""
        instant.state[SPEED] = self.belt_speed(mode, instant.time)
        if self.sticks:
            return self._resting(mode, instant)
        return self._slip(mode, -mode.switches[SIGN], instant)

    def release(self, mode: Mode, instant: Instant, *, sign: float) -> Mode:
        """Slip in a direction where the reaction leaves its limit."""
        return self._slip(mode, sign, instant)

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
        slot = self.switch_slots.law
        sign, switches = mode.switches[SIGN], mode.switches[slot]
        after = self.drive.friction.switches_after(margin, sign, switches)
        return with_switches(mode, slot.start, after)

    def next_switch_time(self, mode: Mode) -> float:
        """Return the time of the next corner of the signals."""
        belt, load = mode.switches[self.switch_slots.belt], mode.switches[self.switch_slots.load]
        return min(self.drive.belt.next_switch_time(belt), self.drive.load.next_switch_time(load))

    def switch_inputs(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode after the corners and steps of the signals up to an instant."""
        time, slots = instant.time, self.switch_slots
        before = self.belt_speed(mode, time)
        belt = _after(self.drive.belt, mode.switches[slots.belt], time)
        load = _after(self.drive.load, mode.switches[slots.load], time)
        mode = with_switches(mode, slots.belt.start, (*belt, *load))
        self._check_contact(mode, instant)
        belt_speed = self.belt_speed(mode, time)
        relative_speed = instant.state[SPEED] - belt_speed
        if abs(relative_speed) <= SPEED_ROUNDING:
            instant.state[SPEED] = belt_speed
            return self._resting(mode, instant)  # acceleration of the belt, or load, jumps
        sign = copysign(1.0, relative_speed)
        if sign == mode.switches[SIGN] and abs(belt_speed - before) <= SPEED_ROUNDING:
            return mode
        return self._slip(mode, sign, instant)

    def starting_mode(self, instant: Instant) -> Mode:
        """Return stick, or slip in the direction of the relative speed; see the class."""
        belt = self.drive.belt.switches_at(instant.time)
        load = self.drive.load.switches_at(instant.time)
        motor = (0.0,) * len(self.switches[self.switch_slots.motor])
        stick = Mode(STICK, (0.0, *self._no_law, *belt, *load, *motor))
        self._check_contact(stick, instant)
        return self._settled_at(self.belt_speed(stick, instant.time), stick, instant)

    def settled(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode that continues, mostly the same.

        It is asked at the start of each advance, since inputs may have changed. It moves the state
        off the guards of a mode that continues; that of another one follows where it is entered.
        """
        state, sign = instant.state, mode.switches[SIGN]
        if self.has_parts:
            if (following := self.apply_pending_guards(mode, instant)) is not mode:
                return following
        elif (sign < 0.0 and state[SPEED] < self._below_belt) or (
            sign > 0.0 and state[SPEED] > self._above_belt
        ):
            return mode  # in less time
        if self.steady:
            return self._settled_at(self._speed, mode, instant)
        belt_speed = self.belt_speed(mode, instant.time)
        if mode.flow == STICK:  # without the rounding of the integration
            state[SPEED] = belt_speed
        return self._settled_at(belt_speed, mode, instant)

    def _settled_at(self, belt_speed: float, mode: Mode, instant: Instant) -> Mode:
        relative_speed = instant.state[SPEED] - belt_speed
        if relative_speed == 0.0:
            resting = self._resting(mode, instant)
            if resting is mode and self.closed_flow is None:
                self.nudge_off_guard(mode, instant)
            return resting
        sign = copysign(1.0, relative_speed)
        return mode if mode.switches[SIGN] == sign else self._slip(mode, sign, instant)

    def continued(self, before: Mode, mode: Mode, instant: Instant) -> Mode:
        """Return the mode of a changed drive that slips on, as `before`, under the same law."""
        sign, slot = mode.switches[SIGN], self.switch_slots.law
        if mode.flow != SLIP or sign != before.switches[SIGN]:
            return mode
        return self._slip(with_switches(mode, slot.start, before.switches[slot]), sign, instant)

    def _check_contact(self, mode: Mode, instant: Instant) -> None:
        if self.may_lift and self.normal_force(mode, instant.time) < -LIFT_ROUNDING:
            self.lift(mode, instant)

    def apply_pending_guards(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode after the margins of the law that rounding has put below zero.

        heyoka finds the first guard of several at one instant.
        """
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
        switches = mode.switches[self.switch_slots.law]
        if mode.flow != SLIP or not switches:
            return None
        speed, memory = self._relative_speed(mode, instant), self._memory(instant)
        margins = self.drive.friction.margins(speed, mode.switches[SIGN], memory, switches)
        for number, margin in enumerate(margins):
            if margin <= -HYSTERESIS / 2.0:
                return number
        return None

    def is_unbounded(self, instant: Instant) -> bool:
        """Return whether the slide is faster than `UNBOUNDED_SPEED`."""
        return abs(instant.state[SPEED]) > UNBOUNDED_SPEED

    def nudge_off_guard(self, mode: Mode, instant: Instant) -> None:
        """Move the slide, by rounding errors, off a guard on which it starts.

        One that sticks is moved to where the friction that it needs is within the limits, one that
        starts to slip to where it is beyond them, and off the speed of the belt.
        """
        state, sign = instant.state, mode.switches[SIGN]
        belt_speed = self.belt_speed(mode, instant.time)
        if sign != 0.0 and state[SPEED] != belt_speed:
            return
        if self.sticks:
            state[POSITION] -= self._displacement_off_limit(mode, instant)
        elif self._is_at_rest(mode, instant):
            return
        if sign != 0.0:
            state[SPEED] = off_speed(belt_speed, sign)

    def _displacement_off_limit(self, mode: Mode, instant: Instant) -> float:
        state, sign = instant.state, mode.switches[SIGN]
        force = self.forces.control_force(instant)
        held = self.held_force(mode, instant, force)
        limit = self.backward_limit if (sign or -held) < 0.0 else self.forward_limit
        if self._loaded:
            limit *= self.normal_force(mode, instant.time)
        size = abs(state[POSITION]) + abs(held) + abs(force) + limit
        if self.drive.motor is not None:
            size += sum(map(abs, state[self.slots.motor]))
        # Without a spring no displacement changes the reaction.
        margin = self.drive.stiffness * rounding_of(size)
        if sign == 0.0:
            return copysign(margin, held) if abs(held) > limit - margin else 0.0
        return sign * margin if abs(held) < limit + margin else 0.0

    def _is_at_rest(self, mode: Mode, instant: Instant) -> bool:
        """Return whether a slide with a memory stays where it is, on a belt that does not move."""
        state, law, sign = instant.state, self.drive.friction, mode.switches[SIGN]
        if not self.steady or self._loaded or any(state[SPEED:MEMORY]):
            return False
        memory, switches = self._memory(instant), mode.switches[self.switch_slots.law]
        rates = law.memory_rates(0.0, sign, memory, switches)
        force = self.friction_force(mode, instant) - self.held_force(mode, instant)
        return not any((*rates, *state[self.slots.control.start :], force))

    def longest_step(self, instant: Instant) -> float:
        """Return a time in which the speed changes by the law's characteristic speed at most.

        The relative speed, that is: signals change normal force and belt speed. heyoka chooses a
        step from the series at its start. It would miss an exponential that is negligible there and
        rises before the step ends.
        """
        state, drive, reaction = instant.state, self.drive, self.forces.reaction(instant)
        stretch, _ = self.forces.stretch(state)
        acceleration = (
            abs(reaction) + drive.stiffness * abs(stretch) + abs(state[SPEED])
            + self._largest_friction + self._largest_belt_acceleration
        )  # fmt: skip
        return drive.friction.characteristic_speed / acceleration if acceleration > 0.0 else inf

    def overflow(self, mode: Mode, instant: Instant) -> Mode:
        """Set the speed at which a motion counts as unbounded: what overflows exceeds any speed.

        Raises RunError where it is the friction of another package's law that is not finite.
        """
        law = self.drive.friction
        if law.package and mode.flow == SLIP:
            with np.errstate(all="ignore"):
                friction = self._coefficient(mode, instant)
            if not isfinite(friction):
                raise RunError(
                    f"the friction law {law.name} of package {law.package} fails: its coefficient "
                    f"is {friction}, which must be a finite number"
                )
        sign = copysign(1.0, -self.forces.reaction(instant))
        instant.state[SPEED] = sign * UNBOUNDED_SPEED
        return self._slip(mode, sign, instant)

    def _slip(self, mode: Mode, sign: float, instant: Instant) -> Mode:
        """Return slip in a direction; the signals stay in their pieces."""
        law, slot = self.drive.friction, self.switch_slots.law
        switches: Sequence[float] = ()
        if law.switches:
            state = self._relative_speed(mode, instant), sign, self._memory(instant)
            before = mode.switches[slot]
            same = sign == mode.switches[SIGN]
            switches = law.switches_following(before, *state) if same else law.switches_at(*state)
        return Mode(SLIP, (sign, *switches, *mode.switches[slot.stop :]))

    def _resting(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode of a slide that has the speed of the belt."""
        if self.sticks:
            normal = self._normal if not self._loaded else self.normal_force(mode, instant.time)
            held = self.held_force(mode, instant)
            if held > normal * self.backward_limit:
                return self._slip(mode, -1.0, instant)
            if held < -normal * self.forward_limit:
                return self._slip(mode, 1.0, instant)
            if mode.flow == STICK:
                return mode
            return Mode(STICK, (0.0, *self._no_law, *mode.switches[self.switch_slots.law.stop :]))
        forward = self._slip(mode, 1.0, instant)
        accelerates = self.friction_force(forward, instant) >= self.held_force(mode, instant)
        return forward if accelerates else self._slip(mode, -1.0, instant)


def _after(signal: Signal, switches: Sequence[float], time: float) -> Sequence[float]:
    """Return the switches of a signal after its corners up to a time, or within its rounding."""
    while (corner := signal.next_switch_time(switches)) <= time * (1.0 + TIME_ROUNDING):
        switches = signal.switches_at(corner)
    return switches
