"""An independent solution of slide and motor: scipy's DOP853, with events of its own.

It has the equations as books have them, and shares nothing with the package. With v = x' - v_b and
V = X' - v_b, and dry friction that holds either body exactly,

    m x'' = -k (x - X) - c (x' - X') - c_g v - N f(v, z) + d
    M X'' = k (x - X) + c (x' - X') - c_m V - F sgn(V) + u.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import copysign, exp
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.integrate import DOP853
from scipy.optimize import brentq

Array = npt.NDArray[np.float64]


class Piece(NamedTuple):
    """Inputs that are constant up to a time."""

    end: float
    motor_force: float
    slide_force: float
    belt_speed: float


@dataclass(frozen=True)
class Curve:
    """Size of a static coefficient over the speed: exponential, and Coulomb's without a fall."""

    static: float
    kinetic: float
    decay: float

    def __call__(self, w: float) -> float:
        return self.kinetic + (self.static - self.kinetic) * exp(-w / self.decay)


@dataclass(frozen=True)
class Bristles:
    """LuGre's memory on a curve; with no damping and no fall it is Dahl's.

    `sign` is that of v; a phase keeps it beyond its end, since DOP853 is not accurate to its
    tolerance in a step in which abs(v) turns.
    """

    curve: Curve
    stiffness: float
    damping: float

    def rate(self, v: float, z: float, sign: int) -> float:
        return v - self.stiffness * sign * v * z / self.curve(sign * v)

    def coefficient(self, v: float, z: float, sign: int) -> float:
        return self.stiffness * z + self.damping * self.rate(v, z, sign)


@dataclass
class TwoMasses:
    mass: float
    damping: float
    stiffness: float
    guide_damping: float
    normal_force: float
    motor_mass: float
    motor_damping: float
    motor_friction: float
    law: Curve | Bristles
    pieces: Sequence[Piece]
    law_of_force: Callable[[Sequence[float]], float] = lambda state: 0.0
    """Further force on the motor by the state x, x', X, X', z."""
    rtol: float = 1e-13
    events: list[float] = field(default_factory=list[float])
    both_stick: float = 0.0
    """Time for which both bodies stick."""

    def run(self, times: Array, start: Sequence[float] = (0.0,) * 5) -> Array:
        """Return x, x', X, X', z at times, which increase; by default from rest at zero."""
        self._time = (self.stiffness * (1.0 / self.mass + 1.0 / self.motor_mass)) ** -0.5
        self._unit = self.normal_force * self._time / self.mass
        found = np.empty((len(times), 5))
        state, now, self._piece = np.array(start), 0.0, self.pieces[0]
        mode = self._mode(state)
        for piece in self.pieces:
            jumps = piece.belt_speed != self._piece.belt_speed
            self._piece = piece
            mode = self._mode(state, None if jumps else mode)
            while now < piece.end:
                start = now
                now, state, event = self._phase(mode, now, state, times, found)
                if mode == (0, 0):
                    self.both_stick += now - start
                if event is not None:
                    self.events.append(now)
                    body, speed = divmod(event, 3)
                    if speed == 0:
                        state[1 + 2 * body] = piece.belt_speed
                        mode = self._at_rest(state, mode, body)
                    else:
                        sign = -1 if speed == 1 else 1
                        mode = (sign, mode[1]) if body == 0 else (mode[0], sign)
        return found

    def _zero(
        self, guard: Callable[[Array], float], path: Callable[[float], Array], a: float, b: float
    ) -> float:
        if guard(path(a)) <= 0.0:
            return a
        return float(brentq(lambda time: guard(path(time)), a, b, xtol=1e-300))

    def held(self, state: Sequence[float], body: int) -> float:
        """Return the friction that a body needs to have no acceleration."""
        x, y, far, rate, _ = state
        pull = self.stiffness * (x - far) + self.damping * (y - rate)
        if body == 0:
            return pull - self._piece.slide_force
        return -pull - self._piece.motor_force - self.law_of_force(state)

    def _limit(self, body: int) -> float:
        if body == 1:
            return self.motor_friction
        return self.normal_force * self.law.static if isinstance(self.law, Curve) else 0.0

    def _at_rest(self, state: Array, mode: tuple[int, int], body: int) -> tuple[int, int]:
        if body == 0 and isinstance(self.law, Bristles):
            return -mode[0], mode[1]
        held = self.held(state.tolist(), body)
        sign = 0 if abs(held) <= self._limit(body) else -int(copysign(1, held))
        return (sign, mode[1]) if body == 0 else (mode[0], sign)

    def _mode(self, state: Array, before: tuple[int, int] | None = None) -> tuple[int, int]:
        """Return the signs of both relative speeds, 0 where a body sticks."""
        mode = before or (1, 1)
        for body in (0, 1):
            relative = state[1 + 2 * body] - self._piece.belt_speed
            sticks = before is not None and before[body] == 0
            if sticks or abs(relative) < 1e-12 * self._unit:
                if body == 0 and isinstance(self.law, Bristles):
                    mode = (-int(copysign(1, self.held(state.tolist(), 0))), mode[1])
                    continue
                state[1 + 2 * body] = self._piece.belt_speed
                mode = self._at_rest(state, mode, body)
            else:
                sign = int(copysign(1, relative))
                mode = (sign, mode[1]) if body == 0 else (mode[0], sign)
        return mode

    def _phase(
        self, mode: tuple[int, int], now: float, state: Array, times: Array, found: Array
    ) -> tuple[float, Array, int | None]:
        piece = self._piece
        unit = self._unit
        atol = 1e-2 * self.rtol * np.array([unit * self._time, unit] * 2 + [unit * self._time])

        def rates(_: float, values: Array) -> Sequence[float]:
            _, y, _, rate, z = values.tolist()
            v, w = y - piece.belt_speed, rate - piece.belt_speed
            dz, accelerations = 0.0, [0.0, 0.0]
            if mode[0]:
                if isinstance(self.law, Bristles):
                    dz = self.law.rate(v, z, mode[0])
                    friction = -self.law.coefficient(v, z, mode[0])
                else:
                    friction = -mode[0] * self.law(mode[0] * v)
                force = self.normal_force * friction - self.guide_damping * v
                accelerations[0] = (force - self.held(values.tolist(), 0)) / self.mass
            if mode[1]:
                force = -self.motor_friction * mode[1] - self.motor_damping * w
                accelerations[1] = (force - self.held(values.tolist(), 1)) / self.motor_mass
            return [y, accelerations[0], rate, accelerations[1], dz]

        guards: dict[int, Callable[[Array], float]] = {}
        for body in (0, 1):
            if mode[body]:
                guards[3 * body] = lambda s, b=body: (
                    mode[b] * (s[1 + 2 * b] - piece.belt_speed) / unit
                )
            else:
                limit = self._limit(body)
                guards[3 * body + 1] = lambda s, b=body, f=limit: (
                    (f - self.held(s.tolist(), b)) / self.normal_force
                )
                guards[3 * body + 2] = lambda s, b=body, f=limit: (
                    (f + self.held(s.tolist(), b)) / self.normal_force
                )
        solver = DOP853(
            rates, now, state, piece.end, rtol=self.rtol, atol=atol, max_step=0.05 * self._time,
            first_step=1e-4 * min(self._time, piece.end - now),
        )  # fmt: skip
        armed = {key: guard(state) > 1e-11 for key, guard in guards.items()}
        while solver.status == "running":
            solver.step()
            path, event = solver.dense_output(), None
            end, after = solver.t, solver.y.copy()
            grid = np.linspace(solver.t_old, solver.t, 5)[1:]
            for key, guard in guards.items():
                left = solver.t_old
                for time in grid:
                    value = guard(path(time))
                    if not armed[key]:
                        armed[key] = value > 1e-11
                    elif value <= 0.0:
                        zero = self._zero(guard, path, left, time)
                        if zero < end or event is None:
                            end, after, event = zero, path(zero), key
                        break
                    left = time
            own = (times > solver.t_old) & (times <= end)
            if np.any(own):
                found[own] = path(times[own]).T
            if event is not None:
                return end, after, event
        return piece.end, after, None
