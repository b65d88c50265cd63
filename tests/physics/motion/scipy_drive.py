"""Another integrator of drives with courses: scipy's DOP853 with events, from the definitions."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from stickslip_ros.arrays import FloatArray

Function = Callable[[float], float]


@dataclass(frozen=True)
class Piecewise:
    """A function of time in pieces, with its derivative: (start of the piece, f, f')."""

    pieces: Sequence[tuple[float, Function, Function]]

    @property
    def starts(self) -> list[float]:
        return [start for start, _, _ in self.pieces]


@dataclass
class ScipyDrive:
    """m x'' + c x' + k x = -N(t) f(v) while it slips; x'' = v_b' while it sticks.

    `friction` is the size of the coefficient as a function of the relative speed in the direction
    of slip, at zero the static one.
    """

    mass: float
    damping: float
    stiffness: float
    friction: Function
    normal: Piecewise
    belt: Piecewise

    def run(self, position: float, velocity: float, times: FloatArray) -> FloatArray:
        """Return displacement and velocity at `times`, as rows."""
        second = (self.mass / self.stiffness) ** 0.5
        corners = {time for time in (*self.normal.starts, *self.belt.starts) if time > 0.0}
        ends = [*sorted(time for time in corners if time < times[-1]), float(times[-1])]
        found = np.empty((len(times), 2))
        filled, now, state = 0, 0.0, np.array([position, velocity])
        self._at(0.0)
        mode = self._mode(now, state, None)
        for end in ends:
            calm = 0.0
            if mode != 0 and abs(state[1] - self._belt(now)) < 1e-12:
                calm = now + 1e-2 * second  # up to then no event: the slide starts on one
            while now < end:
                until = min(end, calm) if calm > now else end
                events = self._events(mode) if calm <= now else []
                solution = solve_ivp(
                    self._rates(mode),
                    (now, until),
                    state,
                    "DOP853",
                    dense_output=True,
                    events=events or None,
                    rtol=1e-12,
                    atol=1e-14,
                    max_step=0.05 * second,
                )
                now, state = float(solution.t[-1]), solution.y[:, -1].copy()
                while filled < len(times) and times[filled] <= now:
                    found[filled] = solution.sol(times[filled])
                    filled += 1
                if solution.status == 1:
                    before = mode
                    mode = self._mode(now, state, mode)
                    if mode == before or before == 0:
                        calm = now + 1e-2 * second
                    if mode == 0:
                        state[1] = self._belt(now)
            jump = -self._belt(now)
            self._at(now)
            jump += self._belt(now)
            if mode != 0 or abs(jump) > 1e-12:
                slips = state[1] - self._belt(now)
                mode = int(np.sign(slips)) if abs(slips) > 1e-12 else self._mode(now, state, None)
            else:
                mode = self._mode(now, state, 0)
        return found

    def _at(self, time: float) -> None:
        """Use the pieces after a corner."""
        _, self._normal, _ = self.normal.pieces[bisect_right(self.normal.starts, time) - 1]
        _, self._belt, self._belt_rate = self.belt.pieces[bisect_right(self.belt.starts, time) - 1]

    def _held(self, time: float, position: float) -> float:
        """Return h = m v_b' + c v_b + k x."""
        belt = self.mass * self._belt_rate(time) + self.damping * self._belt(time)
        return belt + self.stiffness * position

    def _mode(self, time: float, state: FloatArray, before: int | None) -> int:
        """Return 0 for stick, otherwise the sign of the relative speed."""
        if before is None and state[1] != self._belt(time):
            return int(np.sign(state[1] - self._belt(time)))
        held, limit = self._held(time, state[0]), self._normal(time) * self.friction(0.0)
        if before == 0:  # at an event of stick it is at a limit, to rounding
            limit *= 1.0 - 1e-9
        return -1 if held > limit else 1 if held < -limit else 0

    def _rates(self, mode: int) -> Callable[[float, FloatArray], list[float]]:
        def rates(time: float, state: FloatArray) -> list[float]:
            x, v = state
            if mode == 0:
                return [v, self._belt_rate(time)]
            size = self.friction(mode * (v - self._belt(time)))
            force = -mode * self._normal(time) * size - self.damping * v - self.stiffness * x
            return [v, force / self.mass]

        return rates

    def _events(self, mode: int) -> list[Callable[[float, FloatArray], float]]:
        def limit(sign: int) -> Callable[[float, FloatArray], float]:
            return lambda time, state: (
                self._normal(time) * self.friction(0.0) + sign * self._held(time, state[0])
            )

        events = [limit(1), limit(-1)]
        if mode != 0:
            events = [lambda time, state: mode * (state[1] - self._belt(time))]
        for event in events:
            event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
        return events
