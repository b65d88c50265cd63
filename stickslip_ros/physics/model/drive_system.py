"""A drive as a hybrid system: slip and stick of the slide, and the modes of its law and signals."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import accumulate
from math import copysign, inf, ulp
from typing import Any, NamedTuple

import heyoka as hy

from stickslip_ros.errors import RunError
from stickslip_ros.physics.model import equations
from stickslip_ros.physics.model.constants import constants_of, numbers, structure, with_symbols
from stickslip_ros.physics.model.control import ContinuousControl
from stickslip_ros.physics.model.drive import Drive, DriveConstants, ScaledDrive
from stickslip_ros.physics.model.friction import FrictionLaw
from stickslip_ros.physics.model.hybrid import (
    Flow,
    Guard,
    HybridSystem,
    Instant,
    Mode,
    structure_number,
    with_switches,
)
from stickslip_ros.physics.model.signals import Signal

POSITION, SPEED, MEMORY = 0, 1, 2
"""Indices of X and Y in a state, and of the first state of the law's memory."""

UNBOUNDED_SPEED = 1e3
"""Dimensionless speed of the slide above which the motion counts as unbounded."""

SLIP, STICK = "slip", "stick"
"""The flows of a drive. In slip the first switch is sgn(v_r), in stick it is 0."""

_HYSTERESIS = 2.0**-45
"""Distance behind a guard of a part at which the mode ends.

The mode that follows then starts before its own guards: heyoka misses an event in a step that
starts on one. It also keeps rounding from leading back.
"""

_SMALLEST_STEP = 2.0**-35
"""Speed below which a change of the belt speed at a corner, or a relative speed, is rounding."""

TIME_ROUNDING = 2.0**-49
"""Share of the time by which rounding may put a corner after an instant that is meant to be it."""

_LIFT_ROUNDING = 2.0**-40
"""Normal force, in that of the drive, that is rounding where a load takes all of it away."""

_CHANGE_IN_A_STEP = 8.0
"""Change of the speed in a step, in the characteristic one, for a law with a memory.

An exponential that is below rounding at the start of a step is then hardly above it at the end.
"""

UNSEEN = 2.0**-60
"""Factor of a series that has no part in the choice of steps."""

_MOST_AT_ONCE = 100
"""Number of changes of mode at one instant above which there is no end of them."""


class _Parts(NamedTuple):
    """Switches, one group for each part."""

    law: Sequence[Any]
    belt: Sequence[Any]
    load: Sequence[Any]


@dataclass(frozen=True)
class _Expressions:
    """The parts of the flows of a drive, as expressions."""

    drive: Drive
    switches: _Parts
    sign: Any
    position: Any
    speed: Any
    memory: Sequence[Any]
    belt_speed: Any
    belt_acceleration: Any
    normal: Any
    reaction: Callable[[Any], Any]
    """Reaction at a speed of the slide."""
    part_rates: Callable[[Any], tuple[Any, ...]]
    """Rates of control and actuator at a speed of the slide."""

    @property
    def law(self) -> FrictionLaw:
        """The friction law."""
        return self.drive.friction


class DriveSystem(HybridSystem):
    """Drive, dimensionless (see `Drive`), with a held force or with continuous control.

    The states are X, Y = X', the memory of the friction law, the states of the controller and those
    of the actuator. In slip the slide follows eq. 5; where it reaches the speed of the belt it
    sticks if its law can hold it, -mu_forward N <= h <= mu_backward N with the reaction h.
    Otherwise it passes that speed or slips the other way. In stick it moves with the belt until the
    reaction leaves these limits.

    Drive and control are in SI units. Continuous control, eq. 19, acts without the actuator;
    without it the force is the input `force`. An actuator with states receives that input, and the
    input `disturbance` is added to its force. Of a `ScaledDrive` also mass, stiffness and bias are
    constants.
    """

    def __init__(self, drive: Drive, control: ContinuousControl | None = None) -> None:
        self.drive = drive.dimensionless
        self.control = None if control is None else control.scaled(drive)
        law = self.drive.friction
        control_states = () if self.control is None else self.control.states
        self.states = (
            "x",
            "y",
            *(f"friction.{name}" for name in law.states),
            *control_states,
            *(f"actuator.{name}" for name in self.drive.actuator.states),
        )
        self.has_actuator = len(self.drive.actuator.states) > 0
        self.inputs = ("force", "disturbance") if self.has_actuator else ("force",)
        parts = (law.switches, self.drive.belt.switches, self.drive.load.switches)
        self.switches = (
            "sign",
            *(
                f"{part}.{name}"
                for part, names in zip(_Parts._fields, parts, strict=True)
                for name in names
            ),
        )
        self.has_parts = len(law.switches) > 0
        # Where the switches of law, belt and load start, after the sign.
        self._ends = list(accumulate(map(len, parts[:2]), initial=1))
        self._law = slice(1, self._ends[1])
        self._belt, self._load = slice(*self._ends[1:]), slice(self._ends[2], None)
        first = MEMORY + len(law.states)
        self.control_states = slice(first, first + len(control_states))
        """The states of the controller, in a state."""
        self.actuator_states = slice(self.control_states.stop, len(self.states))
        """The states of the actuator, in a state."""
        signals = self.drive.belt, self.drive.load
        # Whether the normal force may fall below zero: then a guard ends the motion.
        self._may_lift = 1.0 + self.drive.load.bounds[0] < -_LIFT_ROUNDING
        has_bias = self.drive.bias_force != 0.0
        self._steady, self._loaded = not self.drive.belt.pieces, bool(self.drive.load.pieces)
        self._reaction = partial(equations.reaction, self.drive)
        self._limits_by_series = law.characteristic_speed != inf and not law.sticks
        self._frequency, self._stiffness = drive.angular_frequency, self.drive.stiffness
        if isinstance(drive, ScaledDrive):
            of_law = (name for name, _ in numbers(law, "friction"))
            self.free_constants = ("mass", "damping", "stiffness", "bias_force", *of_law)
        self.structure = structure_number(
            (
                *(type(self), self.states, self._may_lift, drive.has_spring, has_bias),
                *((each.switches, each.has_sine) for each in signals),
                *map(structure, (law, self.drive.actuator, self.control)),
                self.free_constants,
            )
        )
        self._friction = law.friction
        self.sticks = law.sticks
        self.many_steps = not law.sticks or self.has_actuator
        self.forward_limit, self.backward_limit = map(float, law.limits)
        self._largest_friction = max(self.forward_limit, self.backward_limit)
        self._largest_friction *= 1.0 + self.drive.load.bounds[1]
        self._largest_belt_acceleration = self.drive.belt.steepest
        # Time at which the speed of the belt was last asked for, and that speed.
        self._seen_at = self._seen_belt_speed = inf
        self._characteristic_speed = law.characteristic_speed
        self.limits_steps = law.characteristic_speed != inf and law.sticks

    def named_constants(self) -> Iterator[tuple[str, float]]:
        """Yield name and value of each constant."""
        drive, law = self.drive, self.drive.friction
        own = ["damping", "belt_speed", *(["bias_force"] if drive.bias_force != 0.0 else [])]
        yield from ((name, getattr(drive, name)) for name in own)
        yield from numbers(law, "friction")
        yield from numbers(drive.actuator, "actuator")
        if self.control is not None:
            yield from numbers(self.control, "control")
        if not law.sticks:
            # Of a slide with a memory that counts as sticking; it has no part in the motion.
            yield "stick_speed", 0.0
        if self._limits_by_series:
            yield "step_limiter", 1.0 / (_CHANGE_IN_A_STEP * law.characteristic_speed)
        free = [name for name in self.free_constants if name in constants_of(DriveConstants)]
        yield from ((name, getattr(drive, name)) for name in free if name not in own)

    @cached_property
    def autonomous(self) -> bool:
        """Whether belt speed and load are constant."""
        return self._steady and not self._loaded

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
        parts = self._expressions
        margins = parts.law.margins(relative_speed, parts.sign, parts.memory, parts.switches.law)
        return [*_guards(margins, type(self).switch_friction), *self._lifted()]

    def _lifted(self) -> list[Guard]:
        if not self._may_lift:
            return []
        return [Guard(self._expressions.normal + _LIFT_ROUNDING, type(self).lift)]

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
        own = self._by_part(mode.switches).law
        return with_switches(
            mode, 1, self.drive.friction.switches_after(margin, mode.switches[0], own)
        )

    def next_switch_time(self, mode: Mode) -> float:
        """Return the time of the next corner of the signals."""
        own = self._by_part(mode.switches)
        return min(
            self.drive.belt.next_switch_time(own.belt), self.drive.load.next_switch_time(own.load)
        )

    def switch_inputs(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode after the corners and steps of the signals up to an instant."""
        time, own = instant.time, self._by_part(mode.switches)
        before = self.belt_speed(mode, time)
        belt = _after(self.drive.belt, own.belt, time)
        load = _after(self.drive.load, own.load, time)
        mode = with_switches(mode, self._ends[1], (*belt, *load))
        self._check_contact(mode, instant)
        belt_speed = self.belt_speed(mode, time)
        self._seen_at, self._seen_belt_speed = time, belt_speed
        relative_speed = instant.state[SPEED] - belt_speed
        if abs(relative_speed) <= _SMALLEST_STEP:
            instant.state[SPEED] = belt_speed
            return self._resting(mode, instant)  # acceleration of the belt, or load, jumps
        sign = copysign(1.0, relative_speed)
        if sign == mode.switches[0] and abs(belt_speed - before) <= _SMALLEST_STEP:
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
            if mode.switches[0] * (state[SPEED] - self._seen_belt_speed) > change + _SMALLEST_STEP:
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

    def _check_contact(self, mode: Mode, instant: Instant) -> None:
        if self._may_lift and self.normal_force(mode, instant.time) < -_LIFT_ROUNDING:
            self.lift(mode, instant)

    def apply_pending_guards(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode after the margins of the law that rounding has put below zero."""
        for _ in range(_MOST_AT_ONCE):
            enter = self._due(mode, instant)
            if enter is None:
                return mode
            mode = enter(mode, instant)
        raise RunError(
            f"the friction law {self.drive.friction.name} changes its mode more than "
            f"{_MOST_AT_ONCE} times at one instant"
        )

    def _due(self, mode: Mode, instant: Instant) -> Callable[[Mode, Instant], Mode] | None:
        """Return what enters the next mode of the law if a margin is below zero, or None."""
        drive, own, time = self.drive, self._by_part(mode.switches), instant.time
        if mode.flow == SLIP and own.law:
            speed = instant.state[SPEED] - self.belt_speed(mode, time)
            memory = self._memory(instant)
            for number, margin in enumerate(
                drive.friction.margins(speed, mode.switches[0], memory, own.law)
            ):
                if margin <= -_HYSTERESIS / 2.0:
                    return partial(self.switch_friction, margin=number)
        return None

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
            held = self._reaction(x, y, force) if self._steady else self.held_force(mode, instant)
            backward = sign < 0.0 or (sign == 0.0 and held > 0.0)
            limit = self.backward_limit if backward else self.forward_limit
            if self._loaded:
                limit *= self.normal_force(mode, instant.time)
            # Without a spring no displacement changes the reaction.
            margin = self._stiffness * 8.0 * ulp(abs(x) + abs(held) + abs(force) + limit)
            if sign == 0.0:
                if abs(held) > limit - margin:
                    state[POSITION] = x - copysign(margin, held)
                return
            if abs(held) < limit + margin:
                state[POSITION] = x - sign * margin
        state[SPEED] = y + sign * max(ulp(belt_speed), ulp(1.0))

    def longest_step(self, instant: Instant) -> float:
        """Return a time in which the speed changes by the law's characteristic speed at most.

        The relative speed, that is: signals change normal force and belt speed. heyoka chooses a
        step from the series at its start. It would miss an exponential that is negligible there and
        rises before the step ends.
        """
        state = instant.state
        acceleration = (
            abs(self.reaction(instant)) + self._stiffness * abs(state[POSITION]) + abs(state[SPEED])
            + self._largest_friction + self._largest_belt_acceleration
        )  # fmt: skip
        return self._characteristic_speed / acceleration if acceleration > 0.0 else inf

    def overflow(self, mode: Mode, instant: Instant) -> Mode:
        """Set the speed at which a motion counts as unbounded: what overflows exceeds any speed."""
        sign = copysign(1.0, -self.reaction(instant))
        instant.state[SPEED] = sign * UNBOUNDED_SPEED
        return self._slip(mode, sign, instant)

    def initial_state(self, position: float, velocity: float) -> list[float]:
        """Return the state at the start: the memory is that of the law, the controller at rest.

        The actuator gives no force.
        """
        law, control = self.drive.friction, self.control
        memory = law.initial_memory(velocity - self.drive.belt_speed)
        own = control.rest(position, velocity) if control is not None else ()
        without = (0.0,) * len(self.drive.actuator.states)
        return [position, velocity, *map(float, memory), *own, *without]

    def belt_speed(self, mode: Mode, time: float) -> float:
        """Return the speed of the belt."""
        return float(equations.belt_speed(self.drive, time, mode.switches[self._belt]))

    def normal_force(self, mode: Mode, time: float) -> float:
        """Return the normal force."""
        return float(equations.normal_force(self.drive, time, mode.switches[self._load]))

    def control_force(self, instant: Instant) -> float:
        """Return the force on the slide: held, with the actuator, or continuous control."""
        state, inputs = instant.state, instant.inputs
        if self.control is not None:
            own = state[self.control_states]
            return self.control.control_force(state[POSITION], state[SPEED], own)
        if self.has_actuator:
            lagging = state[self.actuator_states].tolist()
            return float(self.drive.actuator.force(inputs[0], lagging)) + inputs[1]
        return inputs[0]

    def reaction(self, instant: Instant) -> float:
        """Return h = X + 2 beta X' - U - bias."""
        state = instant.state
        return self._reaction(state[POSITION], state[SPEED], self.control_force(instant))

    def held_force(self, mode: Mode, instant: Instant) -> float:
        """Return the friction force that a slide needs to move with the belt."""
        if self._steady:
            return self.reaction(instant)
        tiny = 1e-30j  # imaginary, so that nothing cancels
        switches = mode.switches[self._belt]
        speed: Any = equations.belt_speed(self.drive, instant.time + tiny, switches)
        return self.reaction(instant) + self.drive.mass * (speed.imag / tiny.imag)

    def friction_force(self, mode: Mode, instant: Instant) -> float:
        """Return the friction force on the slide."""
        sign = mode.switches[0]
        if sign == 0.0:
            return self.held_force(mode, instant)
        relative_speed = instant.state[SPEED] - self.belt_speed(mode, instant.time)
        memory = self._memory(instant)
        coefficient = self._friction(relative_speed, sign, memory, mode.switches[self._law])
        return self.normal_force(mode, instant.time) * float(coefficient)

    @cached_property
    def _expressions(self) -> "_Expressions":
        state, constants, inputs, switches, time = self.symbols
        drive, control = self.drive, self.control
        of_drive = constants_of(DriveConstants).keys() & constants
        drive = replace(
            drive,
            **{name: constants[name] for name in of_drive},
            friction=with_symbols(drive.friction, "friction", constants),
            actuator=with_symbols(drive.actuator, "actuator", constants),
        )
        if control is not None:
            control = with_symbols(control, "control", constants)
        own, lagging = state[self.control_states], state[self.actuator_states]
        x = state[POSITION]

        def force(speed: Any) -> Any:
            if control is not None:
                return control.control_force(x, speed, own)
            if self.has_actuator:
                return drive.actuator.force(inputs[0], lagging) + inputs[1]
            return inputs[0]

        def part_rates(speed: Any) -> tuple[Any, ...]:
            of_control = () if control is None else control.state_rates(x, speed, own)
            of_actuator = ()
            if self.has_actuator:
                of_actuator = drive.actuator.state_rates(inputs[0], lagging)
            return (*of_control, *of_actuator)

        parts = self._by_part(switches)
        return _Expressions(
            drive=drive,
            switches=parts,
            sign=switches[0],
            position=x,
            speed=state[SPEED],
            memory=state[MEMORY : self.control_states.start],
            belt_speed=equations.belt_speed(drive, time, parts.belt),
            belt_acceleration=_by_time(drive, time, parts.belt, 0.0 * state[SPEED]),
            normal=equations.normal_force(drive, time, parts.load),
            reaction=lambda speed: equations.reaction(drive, x, speed, force(speed)),
            part_rates=part_rates,
        )

    def _memory(self, instant: Instant) -> Sequence[float]:
        return () if self.sticks else instant.state[MEMORY : self.control_states.start].tolist()

    def _by_part(self, switches: Sequence[Any]) -> _Parts:
        first, belt, load = self._ends
        return _Parts(switches[first:belt], switches[belt:load], switches[load:])

    def _starting(self, instant: Instant) -> Mode:
        """Return stick, with the switches that the signals have at an instant."""
        belt = self.drive.belt.switches_at(instant.time)
        load = self.drive.load.switches_at(instant.time)
        law = (0.0,) * len(self.drive.friction.switches)
        return Mode(STICK, (0.0, *law, *belt, *load))

    def _slip(self, mode: Mode, sign: float, instant: Instant) -> Mode:
        """Return slip in a direction; the signals stay in their pieces."""
        law, state = self.drive.friction, instant.state
        switches: Sequence[float] = ()
        if law.switches:
            relative_speed = state[SPEED] - self.belt_speed(mode, instant.time)
            switches = law.switches_at(relative_speed, sign, self._memory(instant))
        own = self._by_part(mode.switches)
        return Mode(SLIP, (sign, *switches, *own.belt, *own.load))

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


def _guards(margins: Sequence[Any], transition: Callable[..., Mode]) -> list[Guard]:
    return [
        Guard(margin + _HYSTERESIS, partial(transition, margin=number))
        for number, margin in enumerate(margins)
    ]


def _after(signal: Signal, switches: Sequence[float], time: float) -> Sequence[float]:
    """Return the switches of a signal after its corners up to a time, or within its rounding."""
    while (corner := signal.next_switch_time(switches)) <= time * (1.0 + TIME_ROUNDING):
        switches = signal.switches_at(corner)
    return switches


def _by_time(drive: Drive, time: Any, switches: Sequence[Any], zero: Any) -> Any:
    """Return the acceleration of the belt as an expression; `zero` if its speed is constant."""
    instant = hy.expression("time_of_signal")
    speed = drive.belt.value(instant, switches)
    if not isinstance(speed, hy.expression):
        return zero
    return zero + hy.subs(hy.diff(speed, instant), {instant: time})
