"""A drive whose slide never sticks but creeps: without inertia while it is slow."""

from functools import cached_property
from math import copysign, inf, ulp
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

from stickslip_ros.model.control import ContinuousControl
from stickslip_ros.model.dimensionless_drive import SPEED
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_system import SLIP, UNSEEN, DriveSystem
from stickslip_ros.model.hybrid import Flow, Guard, Instant, Mode

CREEP = "creep"
"""The flow of a slide without inertia. Its first switch is sgn(v_r), as in slip."""

_INERTIA = 1e-4
"""Share of the direct effect that inertia may have in creep.

The speed of creep takes account of inertia to first order, so that its error is of the order of the
square of this.
"""
_SLOWEST_CHANGE = 1e-2
"""Least speed, in the rate sensitivity, with which the spring is taken to be bent."""

_LEAVING_SPEED_RATIO = 2.0
"""Ratio of the speeds at which creep ends and begins."""

_ENTRY_SPEED_CHANGE = 1e-9
"""Change of the speed, in that at which creep begins, of a slide that is too fast for it."""

_PASSED_OVER = 1e-4
"""Speed, in that at which creep begins, below which a slide that does not creep is not followed."""

_MOST_GROWTH = 8.0
"""Logarithm of the growth of the speed of creep in one step."""

_REVERSAL_SPEED = 2.0**-45
"""Speed, in that at which creep begins, behind zero at which creep changes its direction."""


class CreepingDrive(DriveSystem):
    """Drive with a law whose viscosity grows without bound as the slide slows down.

    Where friction balances all other forces, a deviation of the speed then decays at a rate that
    no explicit method can follow. Below a speed the slide is therefore taken to have the speed at
    which friction balances them, with the inertia of the change of that speed: the first two terms
    of the slow manifold (N. Fenichel, Journal of Differential Equations 31, 1979).
    """

    slaves = True

    def __init__(self, drive: Drive, control: ContinuousControl | None = None) -> None:
        super().__init__(drive, control)
        self._sensitivity = sensitivity = float(self.drive.friction.rate_sensitivity)
        change = self.drive.fastest_belt + _SLOWEST_CHANGE * sensitivity
        rounding = ulp(max(self.drive.fastest_belt, 1.0))
        self._limit = max(_INERTIA * sensitivity * sensitivity / change, 1e6 * rounding)
        self._least = max(_PASSED_OVER * self._limit, 1e3 * rounding)
        self.constants |= {"creep.limit": self._limit, "creep.least": self._least}
        self.limits_steps = True
        law, drive = self.drive.friction, self.drive
        steepest = [
            each if each < inf else 0.0 for each in (drive.belt.steepest, drive.load.steepest)
        ]
        self._loading = drive.stiffness * drive.fastest_belt + drive.damping * steepest[0]
        self._loading += float(law.static) * steepest[1]

    def flow(self, name: str) -> Flow:
        """Return the flow `SLIP` or `CREEP`; in slip the last guards lead to creep, or past it."""
        if name == SLIP:
            flow = super().flow(name)
            parts, constants = self._expressions, self.symbols.constants
            relative_speed = parts.speed - parts.belt_speed
            reached = parts.law.creep_limit(relative_speed, parts.sign, parts.memory)
            slow = (
                Guard(1.0 - constants["creep.limit"] / reached, type(self).slow_down),
                Guard(1.0 - constants["creep.least"] / reached, type(self).pass_belt),
            )
            return Flow(flow.rates, (*flow.guards, *slow), flow.marks, flow.step_limiters)
        return self._creep.flow

    @cached_property
    def _creep(self) -> "_Creep":
        kind, parts, law = type(self), self._expressions, self._expressions.law
        epoch, limit = hy.par[self.index["epoch"]], self.symbols.constants["creep.limit"]

        def balanced(speed: Any, acceleration: Any) -> Any:
            """Return the relative speed at which friction leaves this acceleration."""
            inertia = parts.drive.mass * (parts.belt_acceleration + acceleration)
            held = parts.reaction(speed) + inertia
            return law.creep_speed(held / parts.normal, parts.sign, parts.memory)

        def rates(relative_speed: Any) -> tuple[Any, ...]:
            speed = parts.belt_speed + relative_speed
            return (
                speed,
                0.0 * speed,
                *law.memory_rates(relative_speed, parts.sign, parts.memory, parts.switches.law),
                *parts.part_rates(speed),
            )

        first = balanced(parts.belt_speed, 0.0)
        change = hy.diff(first, epoch)
        for state, rate in zip(self.symbols.state, rates(first), strict=True):
            change += hy.diff(first, state) * rate
        relative_speed = balanced(parts.belt_speed + first, change)
        viscous = law.creep_limit(relative_speed, parts.sign, parts.memory)
        speed = parts.belt_speed + relative_speed
        return _Creep(
            relative_speed,
            viscous,
            Flow(
                rates=rates(relative_speed),
                guards=(
                    Guard(
                        parts.sign * relative_speed / limit + _REVERSAL_SPEED, kind.reverse_creep
                    ),
                    Guard(1.0 - viscous / (_LEAVING_SPEED_RATIO * limit), kind.speed_up),
                    *self._guards_of_parts(relative_speed),
                ),
                marks=(UNSEEN * speed,),
                slaved={SPEED: speed},
            ),
        )

    def slow_down(self, mode: Mode, instant: Instant) -> Mode:
        """Creep where the slide has become slow, unless it is about to pass the belt speed."""
        following = self._creeping(mode, instant)
        if following is not None:
            return following
        # Behind the guard, which would otherwise end the mode again.
        speed, sign = instant.state[SPEED], mode.switches[0]
        instant.state[SPEED] = speed - sign * max(
            4.0 * ulp(speed), _ENTRY_SPEED_CHANGE * self._limit
        )
        return mode

    def pass_belt(self, mode: Mode, instant: Instant) -> Mode:
        """Creep, or pass the speed of the belt at once: there the equations are too steep."""
        following = self._creeping(mode, instant)
        if following is not None:
            return following
        instant.state[SPEED] = self.belt_speed(mode, instant.time)
        return self._slip(mode, -mode.switches[0], instant)

    def nudge_off_guard(self, mode: Mode, instant: Instant) -> None:
        """Move a slide that slips off the speed of the belt."""
        if mode.flow != SLIP:
            return
        belt_speed, sign = self.belt_speed(mode, instant.time), mode.switches[0]
        relative_speed = instant.state[SPEED] - belt_speed
        reached = self.drive.friction.creep_limit(relative_speed, sign, self._memory(instant))
        if reached < self._least or relative_speed == 0.0:
            instant.state[SPEED] = belt_speed + sign * self._least * (1.0 + _ENTRY_SPEED_CHANGE)

    def speed_up(self, mode: Mode, instant: Instant) -> Mode:
        """Slip where the slide has become fast."""
        return Mode(SLIP, mode.switches)

    def reverse_creep(self, mode: Mode, instant: Instant) -> Mode:
        """Creep in the other direction, or slip if the law of that direction is less viscous."""
        following = self._toward(-mode.switches[0], mode, instant)
        _, viscous = self._compiled(following, instant)
        creeps = viscous < _LEAVING_SPEED_RATIO * self._limit
        return following if creeps else Mode(SLIP, following.switches)

    def reach_belt(self, mode: Mode, instant: Instant) -> Mode:
        """Slip in the other direction, or creep."""
        return self._slowed(super().reach_belt(mode, instant), instant)

    def switch_inputs(self, mode: Mode, instant: Instant) -> Mode:
        """Return the mode after the corners and steps of the signals up to an instant."""
        return self._slowed(super().switch_inputs(mode, instant), instant)

    def settled(self, mode: Mode | None, instant: Instant) -> Mode:
        """Return creep of a slow slide, or slip; see the class."""
        if mode is None or mode.flow == SLIP:
            return self._slowed(super().settled(mode, instant), instant)
        following = self._creeping(mode, instant)
        if following is None:  # forces have changed
            return super().settled(Mode(SLIP, mode.switches), instant)
        return mode if following == mode else following

    def friction_force(self, mode: Mode, instant: Instant) -> float:
        """Return the friction force on the slide; in creep it balances all other forces."""
        if mode.flow == CREEP:
            return self.held_force(mode, instant)
        return super().friction_force(mode, instant)

    def slave(self, mode: Mode, instant: Instant) -> None:
        """Set the speed of a slide that creeps."""
        if mode.flow != CREEP:
            return
        relative_speed, _ = self._compiled(mode, instant)
        instant.state[SPEED] = self.belt_speed(mode, instant.time) + relative_speed

    def longest_step(self, instant: Instant) -> float:
        """Return a time in which the speed of creep grows by some e-folds at most.

        heyoka does not see the growth of a speed that is far below that of the belt.
        """
        loading = self._loading
        if self.control is not None:
            loading += abs(self.control_force(instant)) + abs(instant.state[SPEED])
        return _MOST_GROWTH * self._sensitivity / loading if loading > 0.0 else inf

    def _slowed(self, mode: Mode, instant: Instant) -> Mode:
        """Return creep if the slide is slow, or else the mode itself."""
        law = self.drive.friction
        relative_speed = instant.state[SPEED] - self.belt_speed(mode, instant.time)
        viscous = law.creep_limit(relative_speed, mode.switches[0], self._memory(instant))
        return mode if viscous > self._limit else self._creeping(mode, instant) or mode

    def _creeping(self, mode: Mode, instant: Instant) -> Mode | None:
        """Return creep, and set the speed; None where that of creep would be too high."""
        state = instant.state
        before = state[SPEED]
        state[SPEED] = self.belt_speed(mode, instant.time)
        following = self._toward(-self.held_force(mode, instant), mode, instant)
        relative_speed, viscous = self._compiled(following, instant)
        if not viscous < _LEAVING_SPEED_RATIO * self._limit:
            state[SPEED] = before
            return None
        state[SPEED] += relative_speed
        return following

    def _toward(self, direction: float, mode: Mode, instant: Instant) -> Mode:
        """Return creep in a direction."""
        sign = copysign(1.0, direction)
        if sign == mode.switches[0]:
            return Mode(CREEP, mode.switches)
        return Mode(CREEP, self._slip(mode, sign, instant).switches)

    def _compiled(self, mode: Mode, instant: Instant) -> tuple[float, float]:
        """Return the relative speed of creep, and its measure of viscosity."""
        function = self.shared("creep", self._function)
        values = [*self.constants.values(), *instant.inputs, *mode.switches, instant.time]
        options = {"time": 0.0} if function.is_time_dependent else {}
        found = function(
            np.array(instant.state), pars=np.array(values[: function.nparams]), **options
        )
        return float(found[0]), float(found[1])

    def _function(self) -> Any:
        return hy.cfunc([self._creep.relative_speed, self._creep.viscous], list(self.variables))


class _Creep(NamedTuple):
    """The flow of creep, its relative speed and its measure of viscosity."""

    relative_speed: Any
    viscous: Any
    flow: Flow
