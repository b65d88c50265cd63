"""A drive whose motor has dry friction: it slips on the guide, or sticks to it.

The modes of the drive are the products of those of the slide and those of the motor. The switch of
the motor is sgn(X' - v_belt), 0 while it sticks.
"""

from dataclasses import replace
from math import copysign

from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import POSITION, SIGN, SPEED
from stickslip_ros.model.drive_system import SLIP, STICK, DriveSystem
from stickslip_ros.model.hybrid import Flow, Instant, Mode, with_switches
from stickslip_ros.model.rounding import SPEED_ROUNDING, off_speed, rounding_of


class MotorFrictionSystem(DriveSystem):
    """Drive with a motor that may stick. What a guard of one body changes, the other may feel."""

    def __init__(self, drive: Drive, control: ContinuousControl | None = None) -> None:
        super().__init__(drive, control)
        self.has_parts = True
        assert self.drive.motor is not None
        self._holding_force = float(self.drive.motor.friction)
        self._x = self.slots.motor.start
        self._y = self._x + 1

    def flow(self, name: str) -> Flow:
        """Return a flow; its last guards are those of the motor."""
        flow, kind = super().flow(name), type(self)
        guards = self.expressions.motor_guards(kind.motor_reaches_guide, kind.release_motor)
        return replace(flow, guards=(*flow.guards, *guards))

    def motor_reaches_guide(self, mode: Mode, instant: Instant) -> Mode:
        """Let the motor stick, or slip on in either direction."""
        instant.state[self._y] = self.belt_speed(mode, instant.time)
        return self._with_motor(mode, self._resting_sign(mode, instant))

    def release_motor(self, mode: Mode, instant: Instant, *, sign: float) -> Mode:
        """Let the motor slip in a direction, where the force on it exceeds its dry friction."""
        return self._with_motor(mode, sign)

    def starting_mode(self, instant: Instant) -> Mode:
        """Return the mode in which both bodies start."""
        return self._motor_after_jump(super().starting_mode(instant), instant)

    def settled(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode that continues, of both bodies."""
        return self._motor_settled(super().settled(mode, instant), instant)

    def switch_inputs(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode after the corners and steps of the signals up to an instant."""
        return self._motor_after_jump(super().switch_inputs(mode, instant), instant)

    def apply_pending_guards(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode after all guards that rounding has put behind, of both bodies."""
        mode = super().apply_pending_guards(mode, instant)
        if mode.flow == SLIP:
            relative_speed = instant.state[SPEED] - self.belt_speed(mode, instant.time)
            if mode.switches[SIGN] * relative_speed < 0.0:
                mode = self.reach_belt(mode, instant)
        elif mode.flow == STICK:
            mode = self._resting(mode, instant)
        return self._motor_settled(mode, instant)

    def nudge_off_guard(self, mode: Mode, instant: Instant) -> None:
        """Move both bodies, by rounding errors, off guards on which they start."""
        super().nudge_off_guard(mode, instant)
        state, sign = instant.state, self._motor_sign(mode)
        belt_speed = self.belt_speed(mode, instant.time)
        if sign != 0.0 and state[self._y] != belt_speed:
            return
        held, limit = self.motor_held(mode, instant), self._holding_force
        margin = self._rounding(instant)
        # A motor ahead needs less friction.
        if sign == 0.0:
            if abs(held) > limit - margin:
                state[self._x] -= copysign(margin, held)
            return
        if -sign * held < limit + margin:
            state[self._x] -= sign * margin
        state[self._y] = off_speed(belt_speed, sign)

    def _motor_after_jump(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode where the speed of the guide, or the state, may have jumped."""
        belt_speed = self.belt_speed(mode, instant.time)
        relative_speed = instant.state[self._y] - belt_speed
        if abs(relative_speed) > SPEED_ROUNDING:
            return self._with_motor(mode, copysign(1.0, relative_speed))
        instant.state[self._y] = belt_speed
        return self._with_motor(mode, self._resting_sign(mode, instant))

    def _motor_settled(self, mode: Mode, instant: Instant) -> Mode:
        sign, belt_speed = self._motor_sign(mode), self.belt_speed(mode, instant.time)
        if sign * (instant.state[self._y] - belt_speed) > 0.0:
            return mode
        instant.state[self._y] = belt_speed  # without the rounding of the integration
        held = self.motor_held(mode, instant)
        if sign != 0.0 and -sign * held >= self._holding_force - self._rounding(instant):
            return mode  # just released: rounding must not lead back
        resting = self._resting_sign(mode, instant)
        return mode if resting == sign else self._with_motor(mode, resting)

    def _resting_sign(self, mode: Mode, instant: Instant) -> float:
        """Return the switch of a motor that has the speed of the guide."""
        held = self.motor_held(mode, instant)
        if abs(held) <= self._holding_force:
            return 0.0
        return -copysign(1.0, held)

    def _rounding(self, instant: Instant) -> float:
        """Return what rounding may add to the dry friction that the motor needs."""
        state, drive = instant.state, self.drive
        stretch = drive.stiffness * (abs(state[POSITION]) + abs(state[self._x]))
        rate = drive.damping * (abs(state[SPEED]) + abs(state[self._y]))
        force = abs(self.forces.control_force(instant)) + self._holding_force
        return rounding_of(stretch + rate + force)

    def _motor_sign(self, mode: Mode) -> float:
        return mode.switches[self.switch_slots.motor.start]

    def _with_motor(self, mode: Mode, sign: float) -> Mode:
        return with_switches(mode, self.switch_slots.motor.start, (sign,))
