"""An independent solution of drives whose friction has a memory: scipy's Radau and DOP853.

It has the equations of the laws as their sources have them, and shares nothing with the package.
With the relative speed v = x' - v_b of the slide, s = sgn v, and the memory z,

    m v' + c (v + v_b) + k x = u - N f(v, z),    x' = v + v_b,    z' = Z(v, z).

A mode has the direction s and what else a law has; it ends where one of its guards falls to zero.
There the integration starts again: the instant is found by integrating up to it, so that neither an
interpolation nor a kink of the equations costs accuracy.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import pi, sin
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import Radau
from scipy.optimize import brentq

Array = npt.NDArray[np.float64]
Curve = Callable[[float], float]
"""Size g of a static law, without its viscous part, over the speed abs(v)."""
Mode = tuple[float, ...]
"""The direction s, and what else is constant in a mode of the law."""


@dataclass(frozen=True)
class Law:
    """One direction of a law: dahl, lugre and elasto_plastic have the deflection z."""

    curve: Curve
    stiffness: float
    damping: float = 0.0
    viscous: float = 0.0

    def coefficient(self, v: float, z: Sequence[float], mode: Mode) -> float:
        (rate,) = self.rates(v, z, mode)
        return self.stiffness * z[0] + self.damping * rate + self.viscous * v

    def rates(self, v: float, z: Sequence[float], mode: Mode) -> Sequence[float]:
        return [v - self.stiffness * mode[0] * v * z[0] / self.curve(mode[0] * v)]

    def mode(self, s: float, v: float, z: Sequence[float]) -> Mode:
        return (s,)

    def guards(self, v: float, z: Sequence[float], mode: Mode) -> list[tuple[float, Mode]]:
        """Values above zero, each with the mode that follows where it falls to zero."""
        return []

    def start(self, v: float) -> list[float]:
        return [0.0]


@dataclass(frozen=True)
class ElastoPlastic(Law):
    """The second number of a mode is 0 for alpha = 0, 1 for the sine and 2 for alpha = 1."""

    least: float = 0.0
    break_away: float = 0.7

    @property
    def z_b(self) -> float:
        return self.break_away * self.least / self.stiffness

    def rates(self, v: float, z: Sequence[float], mode: Mode) -> Sequence[float]:
        s, part = mode
        z_ss = self.curve(s * v) / self.stiffness
        alpha = 0.5 * part
        if part == 1.0:
            middle = (z_ss + self.z_b) / 2.0
            alpha = 0.5 + 0.5 * sin(pi * (s * z[0] - middle) / (z_ss - self.z_b))
        return [v * (1.0 - alpha * s * z[0] / z_ss)]

    def mode(self, s: float, v: float, z: Sequence[float]) -> Mode:
        z_ss = self.curve(s * v) / self.stiffness
        return (s, 0.0 if s * z[0] <= self.z_b else 2.0 if s * z[0] >= z_ss else 1.0)

    def guards(self, v: float, z: Sequence[float], mode: Mode) -> list[tuple[float, Mode]]:
        s, part = mode
        z_ss = self.curve(s * v) / self.stiffness
        low, high = (s * z[0] - self.z_b) / z_ss, s * z[0] / z_ss - 1.0
        if part == 0.0:
            return [(-low, (s, 1.0))]
        return [(high, (s, 1.0))] if part == 2.0 else [(low, (s, 0.0)), (-high, (s, 2.0))]


@dataclass(frozen=True)
class MaxwellSlip(Law):
    """The mode has 1 for each element that slips."""

    elements: int = 4
    attraction: float = 100.0

    @property
    def stiffnesses(self) -> list[float]:
        yields = [(i + 1) / self.elements for i in range(self.elements)]
        parts = [1.0 / each for each in yields]
        return [self.stiffness * part / sum(parts) for part in parts]

    def coefficient(self, v: float, z: Sequence[float], mode: Mode) -> float:
        return sum(s * each for s, each in zip(self.stiffnesses, z, strict=True)) + self.viscous * v

    def rates(self, v: float, z: Sequence[float], mode: Mode) -> Sequence[float]:
        s, *slips = mode
        g, w = self.curve(s * v), 1.0 / self.elements
        return [
            self.attraction * (s * w - stiffness * each / g) / stiffness if slip else v
            for stiffness, each, slip in zip(self.stiffnesses, z, slips, strict=True)
        ]

    def mode(self, s: float, v: float, z: Sequence[float]) -> Mode:
        limit = self.curve(s * v) / self.elements
        pairs = zip(self.stiffnesses, z, strict=True)
        return (s, *(float(s * stiffness * each >= limit) for stiffness, each in pairs))

    def guards(self, v: float, z: Sequence[float], mode: Mode) -> list[tuple[float, Mode]]:
        s, *slips = mode
        limit = self.curve(s * v) / self.elements
        found: list[tuple[float, Mode]] = []
        for i, (stiffness, each, slip) in enumerate(zip(self.stiffnesses, z, slips, strict=True)):
            if not slip:
                after = (s, *slips[:i], 1.0, *slips[i + 1 :])
                found.append((1.0 - s * stiffness * each / limit, after))
        return found

    def start(self, v: float) -> list[float]:
        return [0.0] * self.elements


class LostError(Exception):
    """The solver has lost the motion: it must not be compared with."""


@dataclass
class MemoryDrive:
    """Drive in any units; `forward` is its law for v > 0 and `backward` that for v < 0."""

    mass: float
    damping: float
    stiffness: float
    normal: float
    belt_speed: float
    forward: Any
    backward: Any
    solver: Any = Radau
    rtol: float = 1e-11
    force: float = 0.0
    options: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        rate = (self.stiffness / self.mass) ** 0.5 if self.stiffness else 1.0
        length = self.normal / self.stiffness if self.stiffness else 1.0
        self._speed, self._length, self._time = length * rate, length, 1.0 / rate
        self._returns = 0

    def law(self, s: float) -> Any:
        return self.forward if s > 0.0 else self.backward

    def run(self, position: float, velocity: float, times: Array) -> Array:
        """Return position and velocity from time 0, at `times`."""
        v = velocity - self.belt_speed
        law = self.law(v)
        state = np.array([position, v, *law.start(v)])
        self._atol = 1e-3 * self.rtol * np.array([self._length, self._speed, *self._scales(law)])
        if v == 0.0:
            mode = self._reversed(state)
        else:
            s = 1.0 if v > 0.0 else -1.0
            mode = law.mode(s, v, state[2:].tolist())
        found = [state[:2].copy()]
        for start, end in zip(times[:-1].tolist(), times[1:].tolist(), strict=True):
            state, mode = self._advance(mode, start, end, state)
            found.append(state[:2].copy())
        states = np.array(found)
        states[:, 1] += self.belt_speed
        return states

    def _scales(self, law: Any) -> list[float]:
        return [law.curve(0.0) / law.stiffness] * len(law.start(0.0))

    def _reversed(self, state: Array) -> Mode:
        """Return the mode at v = 0: the slide moves in the direction of its acceleration."""
        z = state[2:].tolist()
        forward = self.forward.mode(1.0, 0.0, z)
        if self._rates(forward)(0.0, np.array([state[0], 0.0, *z]))[1] >= 0.0:
            return forward
        return self.backward.mode(-1.0, 0.0, z)

    def _rates(self, mode: Mode) -> Callable[[float, Array], list[float]]:
        law = self.law(mode[0])

        def rates(_: float, state: Array) -> list[float]:
            x, v, *z = state.tolist()
            y = v + self.belt_speed
            friction = self.normal * law.coefficient(v, z, mode)
            held = self.damping * y + self.stiffness * x - self.force
            return [y, -(held + friction) / self.mass, *law.rates(v, z, mode)]

        return rates

    def _guards(self, mode: Mode, state: Array) -> list[float]:
        _, v, *z = state.tolist()
        law = self.law(mode[0])
        return [mode[0] * v / self._speed, *(value for value, _ in law.guards(v, z, mode))]

    def _solver(self, mode: Mode, now: float, state: Array, end: float) -> Any:
        options = {"max_step": 0.3 * self._time, **self.options}
        atol = self._atol
        return self.solver(self._rates(mode), now, state, end, rtol=self.rtol, atol=atol, **options)

    def _advance(self, mode: Mode, now: float, end: float, state: Array) -> tuple[Array, Mode]:
        while now < end * (1.0 - 1e-15):
            now, state, guard = self._phase(mode, now, end, state)
            if guard == 0:
                state[1] = 0.0
                mode = self._reversed(state)
            elif guard is not None:
                _, v, *z = state.tolist()
                mode = self.law(mode[0]).guards(v, z, mode)[guard - 1][1]
        return state, mode

    def _phase(
        self, mode: Mode, now: float, end: float, state: Array
    ) -> tuple[float, Array, int | None]:
        begin, now, end = now, 0.0, end - now
        solver = self._solver(mode, now, state, end)
        # A guard on which a phase starts is zero, to rounding.
        armed = np.array(self._guards(mode, state)) > 1e-13
        armed[0] = state[1] != 0.0
        while solver.status == "running":
            failure = solver.step()
            if failure:
                raise LostError(failure)
            path, last = solver.dense_output(), solver.t_old
            for part in (0.25, 0.5, 0.75, 1.0):
                time = solver.t if part == 1.0 else solver.t_old + part * solver.step_size
                values = np.array(self._guards(mode, solver.y if part == 1.0 else path(time)))
                crossed = np.flatnonzero(armed & (values <= 0.0))
                if len(crossed):
                    roots = [self._root(mode, path, number, last, time) for number in crossed]
                    first = int(np.argmin(roots))
                    guard = int(crossed[first])
                    until, reached = self._reach(mode, solver, roots[first], guard)
                    return begin + until, reached, guard
                late = np.flatnonzero(~armed & (values < -1e-9))
                if len(late):  # the phase has left through the guard on which it starts
                    if late[0] == 0 or self._returns > 1000:
                        raise LostError(f"no departure at {begin + time}")
                    self._returns += 1
                    return begin, state, int(late[0])
                armed |= values > 1e-13
                last = time
        return begin + end, solver.y, None

    def _root(self, mode: Mode, path: Any, guard: int, start: float, end: float) -> float:
        def value(time: float) -> float:
            return self._guards(mode, path(time))[guard]

        if value(start) <= 0.0:
            return start
        if value(end) >= 0.0:
            return end
        return float(brentq(value, start, end, xtol=1e-300, rtol=1e-15))

    def _reach(self, mode: Mode, solver: Any, time: float, guard: int) -> tuple[float, Array]:
        """Return the time at which a guard is zero, and the state, integrated up to there."""
        start = solver.t_old
        state = solver.dense_output()(start)
        rates = self._rates(mode)
        for _ in range(6):
            if time <= start:
                return start, state.copy()
            again = self._solver(mode, start, state, time)
            while again.status == "running":
                failure = again.step()
                if failure:
                    raise LostError(failure)
            value, step = self._guards(mode, again.y)[guard], 1e-7 * self._time
            ahead = again.y + step * np.array(rates(time, again.y))
            slope = (self._guards(mode, ahead)[guard] - value) / step
            if slope == 0.0 or abs(value / slope) < 1e-15 * self._time:
                break
            time -= value / slope
        return time, again.y
