"""The flows of a dimensionless drive as expressions, from its equations."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, cast

import heyoka as hy

from stickslip_ros.model import equations
from stickslip_ros.model.constants import constants_of
from stickslip_ros.model.dimensionless_drive import DimensionlessDrive
from stickslip_ros.model.drive import UNBOUNDED_SPEED, Drive, DriveConstants
from stickslip_ros.model.drive_layout import SIGN, SPEED, DriveSwitches
from stickslip_ros.model.equations import DriveForces
from stickslip_ros.model.hybrid import Flow, Guard, Instant, Mode, Transition
from stickslip_ros.model.motor import Motor
from stickslip_ros.model.rounding import HYSTERESIS, LIFT_ROUNDING
from stickslip_ros.model.symbols import with_symbols

_UNSEEN = 2.0**-60
"""Factor of a series that has no part in the choice of steps."""


class DriveExpressions:
    """Rates, margins and marks of the flows of a drive, in its symbols."""

    def __init__(self, system: DimensionlessDrive) -> None:
        self._system = system
        self._state, constants, inputs, switches, time = system.symbols
        self._instant = Instant(cast("Any", self._state), cast("Any", inputs))
        symbolic = constants_of(DriveConstants).keys() & constants
        parts = {
            name: with_symbols(getattr(system.drive, name), name, constants)
            for name in ("friction", "actuator", "motor")
            if getattr(system.drive, name) is not None
        }
        self.drive = replace(system.drive, **{name: constants[name] for name in symbolic}, **parts)
        """The drive with its symbols for constants."""
        control = system.control
        if control is not None:
            control = with_symbols(control, "control", constants)
        self._forces = DriveForces(self.drive, control, system.slots)
        self._sign = switches[SIGN]
        self._switches = DriveSwitches(*(switches[slot] for slot in system.switch_slots))
        self.belt_speed = equations.belt_speed(self.drive, time, self._switches.belt)
        """Speed of the belt."""
        speed = self._state[SPEED]
        self._belt_acceleration = _by_time(self.drive, time, self._switches.belt, 0.0 * speed)
        self._normal = equations.normal_force(self.drive, time, self._switches.load)

    def stick(self, release: Callable[..., Mode], lift: Transition) -> Flow:
        """Return the flow in which the slide moves with the belt; guards lead to these.

        `release` is called with the sign of the slip.
        """
        speed, acceleration, held = self._state[SPEED], self._belt_acceleration, self._reaction()
        if not self._system.steady:
            held += self.drive.mass * acceleration
        forward_limit, backward_limit = self.drive.friction.limits
        return Flow(
            rates=(speed, acceleration, *self._part_rates()),
            guards=(
                Guard(self._normal * backward_limit - held, partial(release, sign=-1.0)),
                Guard(self._normal * forward_limit + held, partial(release, sign=1.0)),
                *self._lift_guards(lift),
            ),
            marks=self._marks_of_stick(),
        )

    def slip(
        self, belt: Transition, diverge: Transition, lift: Transition, switch: Callable[..., Mode]
    ) -> Flow:
        """Return the flow in which the slide slips; guards lead to these.

        `switch` is called with the number of a margin of the law.
        """
        law, sign, speed = self.drive.friction, self._sign, self._state[SPEED]
        relative_speed, switches = speed - self.belt_speed, self._switches.law
        memory = self._state[self._system.slots.memory]
        friction = self._normal * law.friction(relative_speed, sign, memory, switches)
        acceleration = equations.acceleration(self.drive, friction, self._reaction())
        margins = law.margins(relative_speed, sign, memory, switches)
        return Flow(
            rates=(
                speed,
                acceleration,
                *law.memory_rates(relative_speed, sign, memory, switches),
                *self._part_rates(),
            ),
            guards=(
                Guard(sign * relative_speed, belt),
                # The slide diverges in the direction of the slip. The margin is of the order of
                # one, since heyoka's error is relative to the largest of states and events.
                Guard(1.0 - sign * speed / UNBOUNDED_SPEED, diverge),
                *(
                    Guard(margin + HYSTERESIS, partial(switch, margin=number))
                    for number, margin in enumerate(margins)
                ),
                *self._lift_guards(lift),
            ),
            marks=self._marks_of_slip(acceleration, relative_speed),
            step_limiters=self._step_limiters(relative_speed),
        )

    def motor_guards(self, guide: Transition, release: Callable[..., Mode]) -> tuple[Guard, ...]:
        """Return the guards of a motor: it reaches the guide, slips backward, or forward.

        Each is a constant while the motor is in another mode. `release` is called with the sign.
        """
        motor, (sign,) = self.drive.motor, self._switches.motor
        assert motor is not None
        _, speed = self._state[self._system.slots.motor]
        slips = sign * sign
        held = self._motor_reaction() + motor.mass * self._belt_acceleration
        sticks = 1.0 - slips
        return (
            Guard(sticks + sign * (speed - self.belt_speed), guide),
            Guard(slips + sticks * (motor.friction - held), partial(release, sign=-1.0)),
            Guard(slips + sticks * (motor.friction + held), partial(release, sign=1.0)),
        )

    def sliding_acceleration(self, position: Any, speed: Any, force: Any) -> Any:
        """Return the acceleration in slip: static law, steady belt, ideal motor."""
        drive, relative_speed = self.drive, speed - self.belt_speed
        held = equations.reaction(drive, position, speed, force)
        if self._system.has_guide_damping:
            held += equations.guide_reaction(drive, relative_speed)
        friction = self._normal * drive.friction.coefficient(relative_speed, self._sign)
        return equations.acceleration(drive, friction, held)

    def _reaction(self) -> Any:
        """Return the reaction of the slide."""
        reaction = self._forces.reaction(self._instant)
        if self._system.has_guide_damping:
            relative_speed = self._state[SPEED] - self.belt_speed
            reaction += equations.guide_reaction(self.drive, relative_speed)
        return reaction

    def _motor_reaction(self) -> Any:
        _, speed = self._state[self._system.slots.motor]
        return self._forces.motor_reaction(self._instant, speed - self.belt_speed)

    def _part_rates(self) -> tuple[Any, ...]:
        """Return the rates of control, actuator and motor."""
        rates = [*self._forces.control_rates(self._state)]
        if forces := self._state[self._system.slots.actuator]:
            rates += self.drive.actuator.state_rates(self._instant.inputs[0], forces)
        if self.drive.motor is not None:
            _, speed = self._state[self._system.slots.motor]
            rates += [speed, self._motor_acceleration(self.drive.motor)]
        return tuple(rates)

    def _motor_acceleration(self, motor: Motor) -> Any:
        reaction = self._motor_reaction()
        if not motor.sticks:
            return -reaction / motor.mass
        (sign,) = self._switches.motor
        slips = sign * sign
        slipping = -(motor.friction * sign + reaction) / motor.mass
        return slips * slipping + (1.0 - slips) * self._belt_acceleration

    def _lift_guards(self, lift: Transition) -> list[Guard]:
        """Return the guard of a load that may lift the slide."""
        return [Guard(self._normal + LIFT_ROUNDING, lift)] if self._system.may_lift else []

    def _step_limiters(self, relative_speed: Any) -> tuple[Any, ...]:
        """Return what makes heyoka see an exponential that is negligible, see `longest_step`.

        The acceleration of a slide with a memory has no useful bound.
        """
        constants = self._system.symbols.constants
        if "step_limiter" not in constants:
            return ()
        return (0.2 + 0.1 * hy.cos(relative_speed * constants["step_limiter"]),)

    def _marks_of_slip(self, acceleration: Any, relative_speed: Any) -> tuple[Any, ...]:
        """Return turning points and peaks, and where a slide that never sticks becomes slow."""
        marks = [self._state[SPEED], acceleration]
        if not self.drive.friction.sticks:
            slow = self._system.symbols.constants["stick_speed"]
            marks += [relative_speed - slow, relative_speed + slow]
        return self._unseen(marks)

    def _marks_of_stick(self) -> tuple[Any, ...]:
        """Return turning points and peaks of a belt whose speed varies."""
        if self._system.steady:
            return ()
        speed, acceleration = self._state[SPEED], self._belt_acceleration
        epoch = hy.par[self._system.index["epoch"]]  # added to the time everywhere
        varies = hy.diff(acceleration, epoch) != hy.expression(0.0)
        return self._unseen([speed, acceleration] if varies else [speed])

    def _unseen(self, marks: Sequence[Any]) -> tuple[Any, ...]:
        """Return marks that have no part in the choice of many steps.

        heyoka chooses its steps by the largest series. Those of the marks must not be: otherwise a
        motion that is recorded would differ in its rounding from one that is not.
        """
        return tuple(_UNSEEN * mark for mark in marks) if self._system.many_steps else (*marks,)


def _by_time(drive: Drive, time: Any, switches: Sequence[Any], zero: Any) -> Any:
    """Return the acceleration of the belt as an expression; `zero` if its speed is constant."""
    instant = hy.expression("time_of_signal")
    speed = drive.belt.value(instant, switches)
    if not isinstance(speed, hy.expression):
        return zero
    return zero + hy.subs(hy.diff(speed, instant), {instant: time})
