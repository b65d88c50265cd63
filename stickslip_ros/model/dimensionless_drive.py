"""A drive and its control, dimensionless: states, constants and forces, also as expressions."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import accumulate, pairwise
from math import inf
from typing import Any, NamedTuple

import heyoka as hy

from stickslip_ros.model import equations
from stickslip_ros.model.constants import constants_of
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.control.base import seen_by
from stickslip_ros.model.drive import Drive, DriveConstants, ScaledDrive
from stickslip_ros.model.hybrid import HybridSystem, Instant, Mode, structure_number
from stickslip_ros.model.motor import Motor
from stickslip_ros.model.symbols import numbers, structure, with_symbols

POSITION, SPEED, MEMORY = 0, 1, 2
"""Indices of X and Y in a state, and of the first state of the law's memory."""

LIFT_ROUNDING = 2.0**-40
"""Normal force, in that of the drive, that is rounding where a load takes all of it away."""

_CHANGE_IN_A_STEP = 8.0
"""Change of the speed in a step, in the characteristic one, for a law with a memory.

An exponential that is below rounding at the start of a step is then hardly above it at the end.
"""


class Parts(NamedTuple):
    """What each part of a drive that has switches has of something."""

    law: Any
    belt: Any
    load: Any
    motor: Any


class Expressions:
    """A dimensionless drive as expressions, in its symbols."""

    def __init__(self, system: "DimensionlessDrive") -> None:
        state, constants, inputs, switches, time = system.symbols
        drive, control = system.drive, system.control
        of_drive = constants_of(DriveConstants).keys() & constants
        parts = {
            name: with_symbols(getattr(drive, name), name, constants)
            for name in ("friction", "actuator", "motor")
            if getattr(drive, name) is not None
        }
        own = {name: constants[name] for name in of_drive}
        self.drive = drive = replace(drive, **own, **parts)
        self.law = drive.friction
        self.switches = own = system.by_part(switches)
        self.sign, self.speed = switches[0], state[SPEED]
        self.memory = state[MEMORY : system.control_states.start]
        self.belt_speed = equations.belt_speed(drive, time, own.belt)
        self.belt_acceleration = _by_time(drive, time, own.belt, 0.0 * self.speed)
        self.normal = equations.normal_force(drive, time, own.load)
        self._position, self._inputs = state[POSITION], inputs
        self._control = None if control is None else with_symbols(control, "control", constants)
        self._of_control = state[system.control_states]
        self._lagging = state[system.actuator_states]
        self._of_motor = state[system.motor_states]
        self._has_guide_damping = system.has_guide_damping

    def reaction(self, speed: Any) -> Any:
        """Return the reaction of the slide at a speed of it."""
        stretch, rate = stretched(self._position, speed, self._of_motor)
        force = self._inputs[1] if self._of_motor else self._control_force(speed)
        found = equations.reaction(self.drive, stretch, rate, force)
        if self._has_guide_damping:
            found += equations.guide_reaction(self.drive, speed - self.belt_speed)
        return found

    def _control_force(self, speed: Any) -> Any:
        """Return the force on the slide, or on a motor of finite mass."""
        force = self._inputs[0]
        if self._control is not None:
            seen = seen_by(self._control, self._position, speed, self._of_motor)
            force = self._control.control_force(*seen, self._of_control)
        elif self._lagging:
            force = self.drive.actuator.force(force, self._lagging)
            if not self._of_motor:
                force += self._inputs[1]
        return force

    def motor_reaction(self, speed: Any) -> Any:
        """Return the reaction of the motor at a speed of the slide."""
        assert self.drive.motor is not None
        stretch = stretched(self._position, speed, self._of_motor)
        relative_speed = self._of_motor[1] - self.belt_speed
        return equations.motor_reaction(
            self.drive, self.drive.motor, *stretch, relative_speed, self._control_force(speed)
        )

    def motor_held(self, speed: Any) -> Any:
        """Return the dry friction that a motor needs to move with the guide."""
        assert self.drive.motor is not None
        return self.motor_reaction(speed) + self.drive.motor.mass * self.belt_acceleration

    def part_rates(self, speed: Any) -> tuple[Any, ...]:
        """Return the rates of control, actuator and motor at a speed of the slide."""
        rates: list[Any] = []
        if self._control is not None:
            seen = seen_by(self._control, self._position, speed, self._of_motor)
            rates += self._control.state_rates(*seen, self._of_control)
        if self._lagging:
            rates += self.drive.actuator.state_rates(self._inputs[0], self._lagging)
        if self.drive.motor is not None:
            rates += [self._of_motor[1], self._motor_acceleration(self.drive.motor, speed)]
        return tuple(rates)

    def _motor_acceleration(self, motor: Motor, speed: Any) -> Any:
        reaction = self.motor_reaction(speed)
        if not motor.sticks:
            return -reaction / motor.mass
        (sign,) = self.switches.motor
        slips = sign * sign
        slipping = -(motor.friction * sign + reaction) / motor.mass
        return slips * slipping + (1.0 - slips) * self.belt_acceleration


class DimensionlessDrive(HybridSystem):
    """Drive, dimensionless (see `Drive`), with a held force or with continuous control.

    The states are X, Y = X', the memory of the friction law, the states of the controller, those of
    the actuator, and position and velocity of a motor of finite mass.

    Drive and control are in SI units. Continuous control, eq. 19, acts without the actuator;
    without it the force is the input `force`. An actuator with states receives that input, and the
    input `disturbance` is added to its force; with a motor it is the force on the slide. Of a
    `ScaledDrive` also mass, stiffness and bias are
    constants.
    """

    def __init__(self, drive: Drive, control: ContinuousControl | None = None) -> None:
        self.drive = drive.dimensionless
        self.control = None if control is None else control.scaled(drive)
        law, actuator, motor = self.drive.friction, self.drive.actuator, self.drive.motor
        signals = self.drive.belt, self.drive.load
        control_states = () if self.control is None else self.control.states
        self.states = (
            "x",
            "y",
            *(f"friction.{name}" for name in law.states),
            *control_states,
            *(f"actuator.{name}" for name in actuator.states),
            *(("motor.x", "motor.y") if motor is not None else ()),
        )
        first = MEMORY + len(law.states)
        self.control_states = slice(first, first + len(control_states))
        """The states of the controller, in a state."""
        lagging = self.control_states.stop
        self.actuator_states = slice(lagging, lagging + len(actuator.states))
        """The states of the actuator, in a state."""
        self.motor_states = slice(self.actuator_states.stop, len(self.states))
        """Position and velocity of the motor, in a state."""
        self.has_actuator = len(actuator.states) > 0
        self.has_guide_damping = self.drive.guide_damping != 0.0
        separate = self.has_actuator or motor is not None
        self.inputs = ("force", "disturbance") if separate else ("force",)
        of_motor = ("sign",) if motor is not None and motor.sticks else ()
        of_parts = Parts(law.switches, signals[0].switches, signals[1].switches, of_motor)
        named = (f"{part}.{name}" for part, own in of_parts._asdict().items() for name in own)
        self.switches = ("sign", *named)
        ends = pairwise(accumulate(map(len, of_parts), initial=1))
        self._parts = Parts(*(slice(*each) for each in ends))
        """The switches of each part, in those of the system."""
        self.has_parts = len(law.switches) > 0
        # Whether the normal force may fall below zero: then a guard ends the motion.
        self._may_lift = 1.0 + self.drive.load.bounds[0] < -LIFT_ROUNDING
        self._steady, self._loaded = not self.drive.belt.pieces, bool(self.drive.load.pieces)
        self.sticks = law.sticks
        self.many_steps = not law.sticks or self.has_actuator
        self.limits_steps = law.characteristic_speed != inf and law.sticks
        self._limits_by_series = law.characteristic_speed != inf and not law.sticks
        if isinstance(drive, ScaledDrive):
            of_law = (name for name, _ in numbers(law, "friction"))
            self.free_constants = ("mass", "damping", "stiffness", "bias_force", *of_law)
        self.structure = structure_number(
            (
                *(type(self), self.states, self._may_lift, drive.has_spring, self._has_bias),
                self.has_guide_damping,
                *((each.switches, each.has_sine) for each in signals),
                *map(structure, (law, actuator, self.control, motor)),
                self.free_constants,
            )
        )
        self.constants = dict(self._named_constants())
        # Whether friction follows from the speed alone.
        self._is_static = self.autonomous and not law.states and not law.switches
        self._reaction, self._coefficient = partial(equations.reaction, self.drive), law.coefficient

    def _named_constants(self) -> Iterator[tuple[str, float]]:
        drive, law = self.drive, self.drive.friction
        own = ["damping", "belt_speed", *(["bias_force"] if self._has_bias else [])]
        yield from ((name, getattr(drive, name)) for name in own)
        yield from numbers(law, "friction")
        if self.has_guide_damping:
            yield "guide_damping", drive.guide_damping
        yield from numbers(drive.actuator, "actuator")
        if drive.motor is not None:
            yield from numbers(drive.motor, "motor")
        if self.control is not None:
            yield from numbers(self.control, "control")
        if not law.sticks:
            # Of a slide with a memory that counts as sticking; it has no part in the motion.
            yield "stick_speed", 0.0
        if self._limits_by_series:
            yield "step_limiter", 1.0 / (_CHANGE_IN_A_STEP * law.characteristic_speed)
        free = [name for name in self.free_constants if name in constants_of(DriveConstants)]
        yield from ((name, getattr(drive, name)) for name in free if name not in own)

    @property
    def _has_bias(self) -> bool:
        return self.drive.bias_force != 0.0

    @cached_property
    def autonomous(self) -> bool:
        """Whether belt speed and load are constant."""
        return self._steady and not self._loaded

    def initial_state(self, position: float, velocity: float) -> list[float]:
        """Return the state at the start: the memory is that of the law, the controller at rest.

        The actuator gives no force, and the motor rests at the reference.
        """
        law, control = self.drive.friction, self.control
        memory = law.initial_memory(velocity - self.drive.belt_speed)
        without = (0.0,) * len(self.drive.actuator.states)
        motor = (0.0,) * (self.motor_states.stop - self.motor_states.start)
        seen = () if control is None else seen_by(control, position, velocity, motor)
        own = () if control is None else control.rest(*seen)
        return [position, velocity, *map(float, memory), *own, *without, *motor]

    def sliding_acceleration(self, position: Any, speed: Any, force: Any) -> Any:
        """Return the acceleration in slip, in `symbols`: static law, steady belt, ideal motor."""
        parts = self._expressions
        drive, relative_speed = parts.drive, speed - parts.belt_speed
        held = equations.reaction(drive, position, speed, force)
        if self.has_guide_damping:
            held += drive.guide_damping * relative_speed
        friction = parts.normal * parts.law.coefficient(relative_speed, parts.sign)
        return equations.acceleration(drive, friction, held)

    def belt_speed(self, mode: Mode, time: float) -> float:
        """Return the speed of the belt."""
        if self._steady:
            return self.drive.belt_speed
        return float(equations.belt_speed(self.drive, time, mode.switches[self._parts.belt]))

    def normal_force(self, mode: Mode, time: float) -> float:
        """Return the normal force."""
        if not self._loaded:
            return self.drive.normal_force
        return float(equations.normal_force(self.drive, time, mode.switches[self._parts.load]))

    def control_force(self, instant: Instant) -> float:
        """Return the force on the slide: held, with the actuator, or continuous control.

        With a motor of finite mass it is the force on that.
        """
        state, inputs = instant.state, instant.inputs
        if self.control is not None:
            own, motor = state[self.control_states], state[self.motor_states]
            seen = seen_by(self.control, state[POSITION], state[SPEED], motor)
            return self.control.control_force(*seen, own)
        if self.has_actuator:
            force = self.drive.actuator.force(inputs[0], state[self.actuator_states])
            return force if self.drive.motor is not None else force + inputs[1]
        return inputs[0]

    def reaction(self, instant: Instant, force: float | None = None) -> float:
        """Return h = X + 2 beta X' - U - bias of the slide at the belt speed; `force` is known."""
        state = instant.state
        x, y = state[POSITION], state[SPEED]
        if self.drive.motor is None:
            return self._reaction(x, y, self.control_force(instant) if force is None else force)
        stretch = stretched(x, y, state[self.motor_states])
        return self._reaction(*stretch, instant.inputs[1])

    def held_force(self, mode: Mode, instant: Instant) -> float:
        """Return the friction force that a slide needs to move with the belt."""
        held = self.reaction(instant)
        if self._steady and not self.has_guide_damping:
            return held
        if self.has_guide_damping:
            relative_speed = instant.state[SPEED] - self.belt_speed(mode, instant.time)
            held += equations.guide_reaction(self.drive, relative_speed)
        return held + self.drive.mass * self.belt_acceleration(mode, instant)

    def motor_held(self, mode: Mode, instant: Instant) -> float:
        """Return the dry friction that a motor needs to move with the guide."""
        state, motor = instant.state, self.drive.motor
        assert motor is not None
        stretch = stretched(state[POSITION], state[SPEED], state[self.motor_states])
        held = equations.motor_reaction(
            self.drive, motor, *stretch, 0.0, self.control_force(instant)
        )
        return held + motor.mass * self.belt_acceleration(mode, instant)

    def belt_acceleration(self, mode: Mode, instant: Instant) -> float:
        """Return the acceleration of the belt."""
        if self._steady:
            return 0.0
        tiny = 1e-30j  # imaginary, so that nothing cancels
        switches = mode.switches[self._parts.belt]
        speed: Any = equations.belt_speed(self.drive, instant.time + tiny, switches)
        return speed.imag / tiny.imag

    def friction_force(self, mode: Mode, instant: Instant) -> float:
        """Return the friction force on the slide."""
        sign = mode.switches[0]
        if sign == 0.0:
            return self.held_force(mode, instant)
        drive = self.drive
        if self._is_static:
            relative_speed = instant.state[SPEED] - drive.belt_speed
            return drive.normal_force * float(self._coefficient(relative_speed, sign))
        relative_speed = instant.state[SPEED] - self.belt_speed(mode, instant.time)
        memory, own = self._memory(instant), mode.switches[self._parts.law]
        coefficient = drive.friction.friction(relative_speed, sign, memory, own)
        return self.normal_force(mode, instant.time) * float(coefficient)

    @cached_property
    def _expressions(self) -> Expressions:
        return Expressions(self)

    def _memory(self, instant: Instant) -> Sequence[float]:
        return () if self.sticks else instant.state[MEMORY : self.control_states.start].tolist()

    def by_part(self, switches: Sequence[Any]) -> Parts:
        """Return the switches of each part."""
        law, belt, load, motor = self._parts
        return Parts(switches[law], switches[belt], switches[load], switches[motor])


def stretched(position: Any, speed: Any, motor: Sequence[Any]) -> tuple[Any, Any]:
    """Return the stretch of the spring and its rate: those of the slide, or against a motor."""
    return (position - motor[0], speed - motor[1]) if len(motor) else (position, speed)


def _by_time(drive: Drive, time: Any, switches: Sequence[Any], zero: Any) -> Any:
    """Return the acceleration of the belt as an expression; `zero` if its speed is constant."""
    instant = hy.expression("time_of_signal")
    speed = drive.belt.value(instant, switches)
    if not isinstance(speed, hy.expression):
        return zero
    return zero + hy.subs(hy.diff(speed, instant), {instant: time})
