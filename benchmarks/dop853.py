"""An independent solution of drives: scipy's DOP853, with events of its own.

It has the equations of drives, laws and courses as books have them, and shares nothing with the
package. With the relative speed v = x' - v_b of the slide, and sgn v its direction,

    m x'' + c x' + k x = -sgn(v) N(t) f(abs(v)) + u(t)    while it slips,
    x' = v_b(t)                                           while it sticks.

Friction supplies h = m v_b' + c v_b + k x - u during stick. The slide breaks loose backward where
h exceeds N f(0) of v < 0, and forward where -h exceeds N f(0) of v > 0.
"""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import copysign, cos, exp, inf, pi, sin

import numpy as np
import numpy.typing as npt
from scipy.integrate import DOP853
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq, minimize_scalar

Array = npt.NDArray[np.float64]
Curve = Callable[[float], float]
"""Size f of the friction coefficient over the speed abs(v). An integrator also asks for it a little
beyond v = 0."""
Function = Callable[[float], float]


# Laws


def coulomb(static: float, viscous: float) -> Curve:
    return lambda w: static + viscous * w


def linear(static: float, slope: float) -> Curve:
    return lambda w: static - slope * w


def stribeck(static: float, minimum: float, minimum_speed: float) -> Curve:
    """Return the paper's cubic, which is lowest at `minimum_speed`."""
    a = 3.0 * (static - minimum) / (2.0 * minimum_speed)
    b = (static - minimum) / (2.0 * minimum_speed**3)
    return lambda w: static - a * w + b * w**3


def exponential(
    static: float, kinetic: float, decay_speed: float, viscous: float, exponent: float
) -> Curve:
    def size(w: float) -> float:
        power = copysign(abs(w / decay_speed) ** exponent, w)
        return kinetic + (static - kinetic) * exp(-power) + viscous * w

    return size


@dataclass(frozen=True)
class Piecewise:
    """A curve in smooth pieces, each from its start up to the next one.

    An integrator of high order is not accurate to its tolerance in a step that leads from piece to
    piece: each is a phase of its own, in which its function continues beyond its ends.
    """

    starts: Sequence[float]
    pieces: Sequence[Curve]

    def __call__(self, w: float) -> float:
        return self.pieces[self.number(w)](w)

    def number(self, w: float) -> int:
        return max(bisect_right(self.starts, w) - 1, 0)


def tabulated(speeds: Sequence[float], coefficients: Sequence[float]) -> Piecewise:
    """Piecewise cubic Hermite interpolation (PCHIP); constant beyond the last speed."""
    beyond = [*speeds, 3.0 * speeds[-1]]  # so that the slope is zero at the last speed
    cubics = PchipInterpolator(beyond, [*coefficients, coefficients[-1]]).c.T.tolist()

    def piece(start: float, cubic: Sequence[float]) -> Curve:
        a, b, c, d = cubic
        return lambda w: (((a * (w - start) + b) * (w - start) + c) * (w - start)) + d

    return Piecewise(speeds, [piece(*each) for each in zip(speeds, cubics, strict=True)])


# Courses


@dataclass(frozen=True)
class Signal:
    """A function of time in pieces: (start of the piece, value, rate). The first has no start."""

    pieces: Sequence[tuple[float, Function, Function]]

    @property
    def starts(self) -> list[float]:
        return [start for start, _, _ in self.pieces]

    def at(self, time: float) -> tuple[Function, Function]:
        """Return value and rate as functions, of the piece at a time."""
        _, value, rate = self.pieces[bisect_right(self.starts, time) - 1]
        return value, rate

    def plus(self, base: float) -> "Signal":
        return Signal([(start, _sum(base, value), rate) for start, value, rate in self.pieces])

    def held(self, period: float, end: float) -> "Signal":
        """Return the values at the multiples of a period, each held up to the next one."""
        found = [level(-inf, 0.0)]
        for number in range(round(end / period) + 1):
            # The sample at a corner has the value after it.
            value, _ = self.at(number * period * (1.0 + 1e-12))
            found.append(level(number * period, value(number * period)))
        changes = [b for a, b in pairwise(found) if b[1](0.0) != a[1](0.0)]
        return Signal([found[0], *changes])


def _sum(base: float, value: Function) -> Function:
    return lambda t: base + value(t)


def _zero(_: float) -> float:
    return 0.0


def level(start: float, value: float) -> tuple[float, Function, Function]:
    return start, lambda _: value, _zero


def line(start: float, before: float, end: float, after: float) -> tuple[float, Function, Function]:
    slope = (after - before) / (end - start)
    return start, lambda t: before + slope * (t - start), lambda _: slope


def none() -> Signal:
    return Signal([level(-inf, 0.0)])


def step(amplitude: float, start: float, duration: float) -> Signal:
    """Return A on [start, start + duration); an impulse is a step of one sample."""
    return Signal([level(-inf, 0.0), level(start, amplitude), level(start + duration, 0.0)])


def ramp(amplitude: float, start: float, duration: float) -> Signal:
    end = start + duration
    return Signal([level(-inf, 0.0), line(start, 0.0, end, amplitude), level(end, amplitude)])


def sine(amplitude: float, start: float, duration: float, frequency: float) -> Signal:
    omega = 2.0 * pi * frequency
    wave = (
        start,
        lambda t: amplitude * sin(omega * (t - start)),
        lambda t: amplitude * omega * cos(omega * (t - start)),
    )
    return Signal([level(-inf, 0.0), wave, level(start + duration, 0.0)])


def trapezoid(amplitude: float, start: float, duration: float, frequency: float) -> Signal:
    """Rises over 1/frequency, holds, and falls over 1/frequency to 0 at start + duration."""
    top, fall, end = start + 1.0 / frequency, start + duration - 1.0 / frequency, start + duration
    return Signal(
        [
            level(-inf, 0.0),
            line(start, 0.0, top, amplitude),
            level(top, amplitude),
            line(fall, amplitude, end, 0.0),
            level(end, 0.0),
        ]
    )


def points(times: Sequence[float], values: Sequence[float]) -> Signal:
    """Straight lines between the points; the end values are held."""
    table = list(zip(times, values, strict=True))
    lines = [line(*before, *after) for before, after in pairwise(table)]
    return Signal([level(-inf, values[0]), *lines, level(times[-1], values[-1])])


# Motion


class LostError(Exception):
    """The solver has lost the motion: it must not be compared with."""


@dataclass(frozen=True)
class Solution:
    position: Array
    velocity: Array
    sticks: list[tuple[float, float]]
    """Start and end of each phase of stick; the last one may end with the solution."""


@dataclass
class Dop853Drive:
    """Drive in any units; `forward` is its law for v > 0 and `backward` that for v < 0.

    Without a spring the unit of time is 1 s.
    """

    mass: float
    damping: float
    stiffness: float
    forward: Curve
    backward: Curve
    belt: Signal = field(default_factory=none)
    normal: Signal = field(default_factory=lambda: none().plus(1.0))
    force: Signal = field(default_factory=none)
    rtol: float = 1e-12
    longest_step: float = 0.1
    """In units of sqrt(m/k), as the guards are looked at from step to step."""

    def __post_init__(self) -> None:
        self._time = (self.mass / self.stiffness) ** 0.5 if self.stiffness else 1.0
        sizes = [abs(value(start)) for start, value, _ in self.normal.pieces if start >= 0.0]
        self._newton = max([*sizes, abs(self.normal.at(0.0)[0](0.0))])
        self._length = self._newton / self.mass * self._time**2
        self._speed = self._length / self._time

    def run(self, position: float, velocity: float, times: Array) -> Solution:
        """Return the motion from time 0, at `times`, which increase."""
        self._found, self._times = np.empty((len(times), 2)), times
        self._sticks: list[tuple[float, float]] = []
        last = float(times[-1])
        starts = [*self.normal.starts, *self.belt.starts, *self.force.starts]
        ends = [*sorted({each for each in starts if 0.0 < each < last}), last]
        now, state = 0.0, (position, velocity)
        self._enter_pieces(now)
        mode = self._mode(now, state)
        for end in ends:
            while now < end:
                phase, before, start = mode, state, now
                now, state, following = self._phase(mode, now, end, state)
                if phase == 0:
                    self._note_stick(start, now)
                if following is None:
                    continue
                mode = following
                if mode == 0:  # at the speed of the belt
                    state = state[0], self._belt(now)
                    mode = self._mode(now, state)
                if now == start and state == before:
                    raise LostError(f"no end of events at {now}")
            speed = self._belt(now)
            self._enter_pieces(now)
            if mode == 0:
                steps = abs(self._belt(now) - speed) > 1e-13 * self._speed
                state = state[0], speed if steps else self._belt(now)
            mode = self._mode(now, state)
        return Solution(self._found[:, 0], self._found[:, 1], self._sticks)

    def _enter_pieces(self, time: float) -> None:
        self._belt, self._belt_rate = self.belt.at(time)
        self._normal, _ = self.normal.at(time)
        self._force, _ = self.force.at(time)

    def held(self, time: float, x: float) -> float:
        """Return h, the force by which the slide and the spring pull at a sticking contact."""
        inertia = self.mass * self._belt_rate(time) + self.damping * self._belt(time)
        return inertia + self.stiffness * x - self._force(time)

    def _mode(self, time: float, state: tuple[float, float]) -> int:
        """Return 0 for stick, else sgn v times the number, from 1, of the piece of the law."""
        relative_speed = state[1] - self._belt(time)
        if relative_speed != 0.0:
            sign = 1 if relative_speed > 0.0 else -1
            return sign * (1 + self._law(sign).number(abs(relative_speed)))
        held, normal = self.held(time, state[0]), self._normal(time)
        if held > normal * self.backward(0.0):
            return -1
        return 1 if held < -normal * self.forward(0.0) else 0

    def _phase(
        self, mode: int, now: float, end: float, state: tuple[float, float]
    ) -> tuple[float, tuple[float, float], int | None]:
        """Follow one phase; return its end, the state there, and the mode that follows.

        That is 0 if a slipping slide has reached the speed of the belt, where it need not stick,
        and None if nothing has happened.
        """
        solver = DOP853(
            self._rates(mode),
            now,
            state,
            end,
            rtol=self.rtol,
            atol=1e-2 * self.rtol * np.array([self._length, self._speed]),
            max_step=self.longest_step * self._time,
        )
        guards = self._guards(mode)
        watches = [_Watch(guard, now, state) for _, guard in guards]
        before = None
        while solver.status == "running":
            failure = solver.step()
            if failure:
                raise LostError(failure)
            path = solver.dense_output()
            found = [watch.crossing(before, path) for watch in watches]
            times = [each for each in found if each is not None]
            if times:
                until = min(times)
                self._keep(path, solver.t_old, until)
                taken = before if before is not None and until < solver.t_old else path
                x, y = taken(until).tolist()
                return until, (x, y), guards[found.index(until)][0]
            self._keep(path, solver.t_old, solver.t)
            before = path
        x, y = solver.y.tolist()
        return end, (x, y), None

    def _law(self, mode: int) -> Piecewise:
        curve = self.forward if mode > 0 else self.backward
        return curve if isinstance(curve, Piecewise) else Piecewise([0.0], [curve])

    def _rates(self, mode: int) -> Callable[[float, Array], tuple[float, float]]:
        belt, belt_rate, normal, force = self._belt, self._belt_rate, self._normal, self._force
        mass, damping, stiffness = self.mass, self.damping, self.stiffness
        curve, sign = self._law(mode).pieces[abs(mode) - 1], 1 if mode > 0 else -1

        def slip(time: float, state: Array) -> tuple[float, float]:
            x, y = state.tolist()
            friction = -sign * normal(time) * curve(sign * (y - belt(time)))
            return y, (friction - damping * y - stiffness * x + force(time)) / mass

        def stick(time: float, _: Array) -> tuple[float, float]:
            return belt(time), belt_rate(time)

        return slip if mode else stick

    def _guards(self, mode: int) -> list[tuple[int, Callable[[float, float, float], float]]]:
        """Return what is above zero during a phase, in units of one, and the mode beyond that."""
        belt, normal = self._belt, self._normal
        if mode:
            least, most = [*self._law(mode).starts, inf][abs(mode) - 1 :][:2]
            sign = 1 if mode > 0 else -1
            return [
                (mode - sign, lambda t, x, y: (sign * (y - belt(t)) - least) / self._speed),
                (mode + sign, lambda t, x, y: (most - sign * (y - belt(t))) / self._speed),
            ]
        ahead, back = self.forward(0.0), self.backward(0.0)
        return [
            (-1, lambda t, x, y: (normal(t) * back - self.held(t, x)) / self._newton),
            (1, lambda t, x, y: (normal(t) * ahead + self.held(t, x)) / self._newton),
        ]

    def _keep(self, path: Callable[[Array], Array], start: float, end: float) -> None:
        first, last = np.searchsorted(self._times, [start, end], side="right")
        if self._times[0] == start == 0.0:
            first = 0
        if last > first:
            self._found[first:last] = path(self._times[first:last]).T

    def _note_stick(self, start: float, end: float) -> None:
        if self._sticks and self._sticks[-1][1] == start:
            start = self._sticks.pop()[0]
        self._sticks.append((start, end))


class _Watch:
    """Finds where a guard falls to zero, along the steps of a solver.

    A guard is zero, to rounding, where a phase starts on it: it counts once it has been positive.
    """

    PARTS = np.array([0.25, 0.5, 0.75, 1.0])
    FIRST_PARTS = np.array([*np.geomspace(1e-5, 0.1, 9), *PARTS])
    POSITIVE = 1e-11

    def __init__(
        self, guard: Callable[[float, float, float], float], time: float, state: Sequence[float]
    ) -> None:
        self._guard = guard
        self._seen = [(time, guard(time, *state))]
        self._armed = self._seen[0][1] > self.POSITIVE

    def crossing(self, before, path) -> float | None:
        """Return the first zero in the step of `path`, or late in the step before it."""

        def value(time: float) -> float:
            part = path if before is None or time >= path.t_old else before
            return self._guard(time, *part(time).tolist())

        parts = self.FIRST_PARTS if before is None else self.PARTS
        grid = path.t_old + (path.t - path.t_old) * parts
        grid[-1] = path.t
        states = path(grid)
        for time, x, y in zip(grid.tolist(), *states.tolist(), strict=True):
            self._seen = [*self._seen[-2:], (time, self._guard(time, x, y))]
            (earlier, higher), (_, now) = self._seen[-2:]
            if not self._armed:
                if now < -100.0 * self.POSITIVE:
                    raise LostError(f"the slide does not depart at {time}")
                self._armed = now > self.POSITIVE
                continue
            if now <= 0.0:
                return self._zero(value, earlier, time, higher)
            dip = self._dip(value)
            if dip is not None:
                return dip
        return None

    def _zero(self, value: Function, start: float, end: float, height: float) -> float:
        return end if height <= 0.0 else float(brentq(value, start, end, xtol=1e-300, rtol=1e-15))

    def _dip(self, value: Function) -> float | None:
        """Return a zero before a minimum between the last three points, or after the first one."""
        (first, high), *between, (last, after) = self._seen
        low = min(high, *(height for _, height in between), after)
        if low > 0.1 or low == after or (between and low == high):
            return None
        lowest = minimize_scalar(
            value, bounds=(first, last), method="bounded", options={"xatol": 1e-6 * (last - first)}
        ).x
        return self._zero(value, first, lowest, high) if value(lowest) < 0.0 else None
