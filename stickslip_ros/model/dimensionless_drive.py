"""A drive and its control, dimensionless: states, constants and forces."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from math import inf
from typing import Any

from stickslip_ros.model import equations
from stickslip_ros.model.constants import constants_of
from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.control.base import seen_by
from stickslip_ros.model.drive import Drive, DriveConstants, ScaledDrive
from stickslip_ros.model.drive_layout import SIGN, SPEED, states_of, switches_of
from stickslip_ros.model.equations import DriveForces
from stickslip_ros.model.hybrid import HybridSystem, Instant, Mode, structure_number
from stickslip_ros.model.rounding import LIFT_ROUNDING
from stickslip_ros.model.symbols import numbers, structure

_CHANGE_IN_A_STEP = 8.0
"""Change of the speed in a step, in the characteristic one, for a law with a memory.

An exponential that is below rounding at the start of a step is then hardly above it at the end.
"""


class DimensionlessDrive(HybridSystem):
    """Drive, dimensionless (see `Drive`), with a held force or with continuous control.

    The states are X, Y = X', the memory of the friction law, the states of the controller, those of
    the actuator, and position and velocity of a motor of finite mass.

    Drive and control are in SI units. Continuous control, eq. 19, acts without the actuator;
    without it the force is the input `force`. An actuator with states receives that input, and the
    input `disturbance` is added to its force; with a motor it is the force on the slide. Of a
    `ScaledDrive` also mass, stiffness and bias are constants.
    """

    def __init__(self, drive: Drive, control: ContinuousControl | None = None) -> None:
        self.drive = drive.dimensionless
        """The drive, dimensionless."""
        self.control = None if control is None else control.scaled(drive)
        """Continuous control, dimensionless."""
        law, actuator, motor = self.drive.friction, self.drive.actuator, self.drive.motor
        belt, load = self.drive.belt, self.drive.load
        self.states, self.slots = states_of(self.drive, self.control)
        self.switches, self.switch_slots = switches_of(self.drive)
        separate = bool(actuator.states) or motor is not None
        self.inputs = ("force", "disturbance") if separate else ("force",)
        self.forces = DriveForces(self.drive, self.control, self.slots)
        """The forces at an instant, but for friction."""
        self._loaded = bool(load.pieces)
        is_static = self.autonomous and not law.states and not law.switches
        self._static_friction = law.coefficient if is_static else None
        # What is constant, mostly: these take longer to look up.
        self._speed, self._normal = self.drive.belt_speed, self.drive.normal_force
        if isinstance(drive, ScaledDrive):
            of_law = (name for name, _ in numbers(law, "friction"))
            self.free_constants = ("mass", "damping", "stiffness", "bias_force", *of_law)
        self.structure = structure_number(
            (
                *(type(self), self.states, self.may_lift, drive.has_spring),
                *(self.is_biased, self.has_guide_damping),
                *((signal.switches, signal.has_sine) for signal in (belt, load)),
                *map(structure, (law, actuator, self.control, motor)),
                self.free_constants,
            )
        )
        self.constants = dict(self._named_constants())

    def _named_constants(self) -> Iterator[tuple[str, float]]:
        drive, law = self.drive, self.drive.friction
        names = ["damping", "belt_speed", *(["bias_force"] if self.is_biased else [])]
        yield from ((name, getattr(drive, name)) for name in names)
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
            if law.characteristic_speed != inf:
                yield "step_limiter", 1.0 / (_CHANGE_IN_A_STEP * law.characteristic_speed)
        free = [name for name in self.free_constants if name in constants_of(DriveConstants)]
        yield from ((name, getattr(drive, name)) for name in free if name not in names)

    @cached_property
    def is_biased(self) -> bool:
        """Whether a bias acts, or may act: a fit finds one."""
        return self.drive.bias_force != 0.0 or "bias_force" in self.free_constants

    @cached_property
    def has_guide_damping(self) -> bool:
        """Whether the guide damps the slide."""
        return self.drive.guide_damping != 0.0

    @cached_property
    def may_lift(self) -> bool:
        """Whether the normal force may fall below zero: then a guard ends the motion."""
        return 1.0 + self.drive.load.bounds[0] < -LIFT_ROUNDING

    @cached_property
    def steady(self) -> bool:
        """Whether the speed of the belt is constant."""
        return not self.drive.belt.pieces

    @cached_property
    def autonomous(self) -> bool:
        """Whether belt speed and load are constant."""
        return self.steady and not self._loaded

    def initial_state(self, position: float, velocity: float) -> list[float]:
        """Return the state at the start: the memory is that of the law, the controller at rest.

        The actuator gives no force, and the motor rests at the reference.
        """
        control, motor = self.control, (0.0,) * (0 if self.drive.motor is None else 2)
        memory = self.drive.friction.initial_memory(velocity - self.drive.belt_speed)
        rest: Sequence[float] = ()
        if control is not None:
            rest = control.rest(*seen_by(control, position, velocity, motor))
        lagging = (0.0,) * len(self.drive.actuator.states)
        return [position, velocity, *map(float, memory), *rest, *lagging, *motor]

    def held_inputs(self, control: float, disturbance: float) -> list[float]:
        """Return the values of `inputs` for these forces, which are one where both act alike."""
        return [control + disturbance] if len(self.inputs) == 1 else [control, disturbance]

    def belt_speed(self, mode: Mode, time: float) -> float:
        """Return the speed of the belt."""
        if self.steady:
            return self.drive.belt_speed
        return float(equations.belt_speed(self.drive, time, mode.switches[self.switch_slots.belt]))

    def belt_acceleration(self, mode: Mode, instant: Instant) -> float:
        """Return the acceleration of the belt."""
        if self.steady:
            return 0.0
        tiny = 1e-30j  # imaginary, so that nothing cancels
        switches = mode.switches[self.switch_slots.belt]
        speed: Any = equations.belt_speed(self.drive, instant.time + tiny, switches)
        return speed.imag / tiny.imag

    def normal_force(self, mode: Mode, time: float) -> float:
        """Return the normal force."""
        if not self._loaded:
            return self.drive.normal_force
        switches = mode.switches[self.switch_slots.load]
        return float(equations.normal_force(self.drive, time, switches))

    def held_force(self, mode: Mode, instant: Instant, force: float | None = None) -> float:
        """Return the friction that a slide needs to move with the belt; `force` may be known."""
        held: float = self.forces.reaction(instant, force)
        if self.steady and not self.has_guide_damping:
            return held
        if self.has_guide_damping:
            held += equations.guide_reaction(self.drive, self._relative_speed(mode, instant))
        return held + self.drive.mass * self.belt_acceleration(mode, instant)

    def motor_held(self, mode: Mode, instant: Instant) -> float:
        """Return the dry friction that a motor needs to move with the guide."""
        assert self.drive.motor is not None
        held = self.forces.motor_reaction(instant, 0.0)
        return held + self.drive.motor.mass * self.belt_acceleration(mode, instant)

    def friction_force(self, mode: Mode, instant: Instant) -> float:
        """Return the friction force on the slide."""
        sign = mode.switches[SIGN]
        if sign == 0.0:
            return self.held_force(mode, instant)
        if self._static_friction is not None:  # in less time
            coefficient = self._static_friction(instant.state[SPEED] - self._speed, sign)
            return self._normal * float(coefficient)
        return self.normal_force(mode, instant.time) * self._coefficient(mode, instant)

    def _coefficient(self, mode: Mode, instant: Instant) -> float:
        """Return the coefficient of friction in slip."""
        speed, memory = self._relative_speed(mode, instant), self._memory(instant)
        switches = mode.switches[self.switch_slots.law]
        return float(self.drive.friction.friction(speed, mode.switches[SIGN], memory, switches))

    def _relative_speed(self, mode: Mode, instant: Instant) -> float:
        return instant.state[SPEED] - self.belt_speed(mode, instant.time)

    def _memory(self, instant: Instant) -> Sequence[float]:
        return () if self.drive.friction.sticks else instant.state[self.slots.memory].tolist()
