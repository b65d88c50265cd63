"""Blocks of ticks of a sampled loop in one compiled step: control law, force and motion.

From one sample to the next, Python takes several times longer than the integration.
"""

from collections.abc import Callable
from functools import cache, partial
from math import factorial
from typing import Any, Self

import heyoka as hy
import numpy as np

from stickslip_ros.model.control import NO_REFERENCE, ControlLaw
from stickslip_ros.model.drive_system import STICK
from stickslip_ros.model.hybrid import HybridSystem, Mode
from stickslip_ros.model.plain_drive import PlainDriveSystem
from stickslip_ros.model.symbols import numbers, structure, with_symbols
from stickslip_ros.motion.compilation import compiled_function
from stickslip_ros.motion.compiled_flow import parameter_values
from stickslip_ros.motion.controller import Controller
from stickslip_ros.motion.motion import RecordedMotion
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.samples import Sample

LEAST_TICKS = 5_000
"""Ticks of a run from which blocks are worth their compilation."""

_COEFFICIENTS = 128
"""Number of coefficients in the series of a block: more take too long to compile."""

_LARGEST_ORDER = 20
_ROUNDING = 2.0**-52
_NEAR = 2.0**-40
"""Margin of a guard up to which a tick is left to the integrator."""

_MOST_LEFT = 64
"""Ticks after which a block is tried again, at most."""


class TickBlocks:
    """Advances a loop, its motion and its controller by blocks of ticks that reach no guard.

    A tick is the control law as an expression, and the Taylor series of the motion under the held
    force. A bound of the series shows that no guard is reached. Where it does not, or where the
    series is too short, the tick is left to the loop.
    """

    def __init__(self, loop: SampledLoop, motion: RecordedMotion, controller: Controller) -> None:
        """Take what `for_loop` accepts."""
        self._loop, self._motion, self._controller = loop, motion, controller
        self._blocks: dict[Mode, _Block] = {}
        self.left = 1
        """Number of ticks that the loop is to take after `advance`."""

    @classmethod
    def for_loop(
        cls, loop: SampledLoop, motion: RecordedMotion, controller: Controller | None
    ) -> Self | None:
        """Return the blocks of a loop, or None if something acts or records that they lack."""
        if controller is None or type(motion) is not RecordedMotion or motion.recording:
            return None
        law, system = controller.law, motion.core.system
        is_possible = (
            vars(type(law)).get("accepts_expressions", False)
            and not law.of_motor
            and loop.is_ideal
            and isinstance(system, PlainDriveSystem)
            and not system.limits_steps
            and _order(loop, motion) <= _LARGEST_ORDER
            and system.shared("is polynomial", partial(_is_polynomial, system))
        )
        return cls(loop, motion, controller) if is_possible else None

    def advance(self, most: int) -> list[float]:
        """Advance by `most` ticks, or up to where a guard may be; return their forces, N."""
        loop, motion, controller = self._loop, self._motion, self._controller
        first, period = loop.sample.stamp, loop.stamps.period.numerator
        if not controller.continues(first, period):
            return []
        mode, instant = motion.core.mode, motion.core.instant
        if mode not in self._blocks:
            self._blocks[mode] = _Block(loop, motion, controller.law)
        forces, end = self._blocks[mode].run([*instant.state, *controller.state], most)
        if not forces:
            self.left = min(2 * self.left, _MOST_LEFT)
            return []
        self.left, (x, y, *state) = 1, end
        controller.skip(first + (len(forces) - 1) * period, tuple(state))
        motion.skip((x, y), forces[-1], len(forces), loop.period)
        loop.skip(len(forces), forces[-1])
        return forces


class _Block:
    """Compiled block of the ticks in one mode, with the values of its constants."""

    def __init__(self, loop: SampledLoop, motion: RecordedMotion, law: ControlLaw) -> None:
        system, mode, drive = motion.core.system, motion.core.mode, motion.drive
        order = _order(loop, motion)
        ticks, step = _COEFFICIENTS // order, loop.period * drive.angular_frequency
        constants = {
            "elapsed": loop.stamps.period.numerator * 1e-9,
            "length": drive.length_scale,
            "speed": drive.speed_scale,
            "weight": drive.force_scale,
            "belt_speed": drive.belt_speed,
            "step": step,
            "travel": system.belt_speed(mode, 0.0) * step,
            **dict(numbers(law, "law")),
        }
        make = partial(_compiled, system, mode.flow, law, [*constants], order, ticks)
        compiled = system.shared(("ticks", mode.flow, order, structure(law)), make)
        values = [*parameter_values(system, mode, (0.0,)), *constants.values()]
        rows, self._start = np.empty((ticks, compiled.nouts // ticks)), np.empty(compiled.nvars)
        self._compute = partial(
            compiled, self._start, rows.reshape(-1), np.array(values)[: compiled.nparams]
        )
        self._sure, self._forces, self._ends = rows[:, 0], rows[:, 1], rows[:, 2:]

    def run(self, state: list[float], most: int) -> tuple[list[float], list[float]]:
        """Return the forces of the ticks that reach no guard, `most` at most, and the end state."""
        start, sure, ends, forces = self._start, self._sure, self._ends, list[float]()
        ticks, last = len(sure), ends[-1]
        start[:] = state
        while len(forces) < most:
            self._compute()
            passed = min(ticks if sure[-1] else int(sure.sum()), most - len(forces))
            forces += self._forces[:passed].tolist()
            if passed < ticks:
                return forces, (ends[passed - 1] if passed else start).tolist()
            start[:] = last
        return forces, start.tolist()


def _compiled(
    system: HybridSystem, flow: str, law: ControlLaw, constants: list[str], order: int, ticks: int
) -> Any:
    """Return a function of the state that gives a row for each tick.

    It has 1, or 0 from the first tick on that may reach a guard, the force (N), and the state after
    the tick. The parameters are those of the system, and then `constants`.
    """
    given = {name: hy.par[number] for number, name in enumerate(constants, len(system.index))}
    law = with_symbols(law, "law", given)
    x, y, *held = names = hy.make_vars("x", "y", *(f"law.{name}" for name in law.state_units))
    sure, state, rows = hy.expression(1.0), tuple(held), list[Any]()
    for _ in range(ticks):
        velocity = given["belt_speed"] if flow == STICK else y * given["speed"]
        sample = Sample(0, x * given["length"], velocity, 0.0, 0.0, given["belt_speed"])
        force, state = law.respond(state, given["elapsed"], sample, NO_REFERENCE)
        force = hy.select(hy.gt(force, law.force_limit), law.force_limit, force)
        force = hy.select(hy.lt(force, -law.force_limit), -law.force_limit, force)
        scaled = force / given["weight"]
        if flow == STICK:
            before, x = _margins(system, flow, x, y, scaled), x + given["travel"]
            margins = before + _margins(system, flow, x, y, scaled)
        else:
            margins, x, y = _slip(system, flow, x, y, scaled, given["step"], order)
        for margin in margins:
            sure = hy.select(hy.gt(margin, _NEAR), sure, 0.0)
        rows += [sure, force, x, y, *state]
    return compiled_function(rows, names, opt_level=0)  # takes half of the time, and is as fast


def _margins(system: HybridSystem, flow: str, x: Any, y: Any, force: Any) -> list[Any]:
    values = dict(zip((*system.variables, *system.symbols.inputs), (x, y, force), strict=True))
    return [hy.subs(guard.margin, values) for guard in system.shared_flow(flow).guards]


def _slip(
    system: Any, flow: str, x: Any, y: Any, force: Any, step: Any, order: int
) -> tuple[list[Any], Any, Any]:
    """Return what is above zero if the slide slips on, and position and speed after a tick."""
    position = _Series(lambda k: speed[k - 1] * (step / k) if k else x)
    speed = _Series(lambda k: acceleration[k - 1] * (step / k) if k else y)
    acceleration = system.expressions.sliding_acceleration(position, speed, force)
    orders = range(order, -1, -1)
    sizes = [_size(speed[k]) for k in orders]
    change, rest = sum(sizes[:-1]), sizes[0] + sizes[1] / 256.0  # every second one may vanish
    # No margin changes by more than the speed.
    margins = [margin - change for margin in _margins(system, flow, x, y, force)]
    margins.append(_size(x) + _size(y) - rest / _ROUNDING)
    return margins, sum(position[k] for k in orders), sum(speed[k] for k in orders)


def _size(value: Any) -> Any:
    return hy.select(hy.lt(value, 0.0), -value, value)


def _is_polynomial(system: PlainDriveSystem) -> bool:
    """Return whether the friction law of a system accepts series."""
    speed = _Series(lambda k: system.variables[0])
    try:
        return system.expressions.sliding_acceleration(speed, speed, 0.0)[1] is not None
    except TypeError:
        return False


def _order(loop: SampledLoop, motion: RecordedMotion) -> int:
    """Return the order of the series of a tick, one above the largest if that is too low.

    Mostly the coefficients are those of an exponential of three times the time, or smaller.
    """
    step, order = 3.0 * loop.period * motion.drive.angular_frequency, 4
    while order <= _LARGEST_ORDER and step**order > 0.1 * _ROUNDING * factorial(order):
        order += 1
    return order


class _Series:
    """Power series in time, the motion between two samples; polynomials accept it.

    A coefficient is made from those before it when it is first asked for.
    """

    def __init__(self, coefficient: Callable[[int], Any]) -> None:
        self._coefficient = cache(coefficient)

    def __getitem__(self, number: int) -> Any:
        return self._coefficient(number)

    def __add__(self, other: Any) -> "_Series":
        if isinstance(other, _Series):
            return _Series(lambda k: self[k] + other[k])
        return _Series(lambda k: self[k] if k else self[k] + other)

    __radd__ = __add__

    def __neg__(self) -> "_Series":
        return self * -1.0

    def __sub__(self, other: Any) -> "_Series":
        return self + -other

    def __rsub__(self, other: Any) -> "_Series":
        return -self + other

    def __mul__(self, other: Any) -> "_Series":
        if isinstance(other, _Series):
            return _Series(lambda k: sum(self[i] * other[k - i] for i in range(k + 1)))
        return _Series(lambda k: self[k] * other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "_Series":
        return self * (1.0 / other)
