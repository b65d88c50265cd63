"""How much faster than scipy is the stick-slip motion, at the same or better accuracy?

Ours: `Motion.advance` over 190 natural periods from rest (drive with m = k = N = 1, damping 0.02,
Stribeck friction 0.4/0.25/0.5), without recording. Peer: scipy's solve_ivp (DOP853, rtol 1e-11,
atol 1e-12) with the same stick and slip modes and its own event location, timed over 19 periods.
Times are per natural period.

The error is the larger one of displacement and velocity after all 190 periods. The reference is the
Taylor series of the same motion in decimal arithmetic with 40 digits.

A tick is the work of the plant per sample: a new force, then a step of 1 or 10 ms. Peer: a bare
heyoka integrator of the same slipping motion with the same two terminal events. The peer of a tick
with a signal is the tick of the same drive without it.

A tick of the loop also has the sensor, the washout controller and the actuator, of `feed_drive` at
1 kHz. The peer of one with a sensor or an actuator is the same tick with ideal ones.
"""

import time
from collections.abc import Callable
from decimal import Decimal, localcontext
from math import copysign, pi

import heyoka as hy
import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.slices import Row, by_turns, compare_times, show
from stickslip_ros.model.drive import UNBOUNDED_SPEED, Drive
from stickslip_ros.model.friction import Stribeck
from stickslip_ros.model.signals import Signal, ramp, sine
from stickslip_ros.motion.controller import answer
from stickslip_ros.motion.motion import Motion
from stickslip_ros.scenarios.files import load_scenario

DAMPING, STATIC, MINIMUM, MINIMUM_SPEED = 0.02, 0.4, 0.25, 0.5
SLOPE = 3.0 * (STATIC - MINIMUM) / (2.0 * MINIMUM_SPEED)
CUBIC = (STATIC - MINIMUM) / (2.0 * MINIMUM_SPEED**3)
BELT_SPEEDS = (0.2, 0.4)
PURE_SLIP_SPEED = 1.0
"""Belt speed at which the motion from rest does not stick, so that all ticks are alike."""

PERIODS, SCIPY_PERIODS = 190, 19
ROUNDS, MOTIONS, TICKS = 9, 20, 2000
FORCES = [0.001 * (n % 2) for n in range(TICKS)]
RTOL, ATOL = 1e-11, 1e-12
ENCODER, DIFFERENCE = "sensor.position_resolution=1e-6", "sensor.velocity=difference"

State = tuple[float, float]


def motion(belt_speed: float, **signals: Signal) -> Motion:
    friction = Stribeck(STATIC, MINIMUM, MINIMUM_SPEED)
    return Motion(Drive(1.0, DAMPING, 1.0, 1.0, belt_speed, friction, **signals), 0.0, 0.0)


def by_scipy(belt_speed: float, end: float) -> State:
    """Return displacement and velocity at the time `end`, from rest."""

    def slip(_: float, state: np.ndarray, sign: float) -> State:
        x, y = state
        r = y - belt_speed
        return y, -STATIC * sign + SLOPE * r - CUBIC * r**3 - DAMPING * y - x

    def stick(_: float, state: np.ndarray) -> State:
        return state[1], 0.0

    def lands(_: float, state: np.ndarray, sign: float) -> float:
        return sign * (state[1] - belt_speed)

    def breaks(_: float, state: np.ndarray) -> float:
        return STATIC - abs(state[0] + DAMPING * state[1])

    for event in (lands, breaks):
        event.terminal, event.direction = True, -1.0
    options = {"method": "DOP853", "rtol": RTOL, "atol": ATOL}
    now, state, sign = 0.0, np.zeros(2), -1.0
    while True:
        if sign:
            part = solve_ivp(slip, (now, end), state, events=lands, args=(sign,), **options)
        else:
            part = solve_ivp(stick, (now, end), state, events=breaks, **options)
        now, state = part.t[-1], part.y[:, -1]
        if part.status == 0:
            return float(state[0]), float(state[1])
        state[1] = belt_speed
        reaction = state[0] + DAMPING * belt_speed
        sign = 0.0 if sign and abs(reaction) <= STATIC else -copysign(1.0, reaction)


def by_series(belt_speed: float, end: float) -> State:
    """Return the result of `by_scipy`, computed with the exact binary values of the constants."""
    damping, static, slope, cubic = (Decimal(c) for c in (DAMPING, STATIC, SLOPE, CUBIC))
    order, longest = 36, Decimal("0.25")

    def slip(x0: Decimal, y0: Decimal, sign: int) -> tuple[list[Decimal], list[Decimal]]:
        x, y, r, square = [x0], [y0], [y0 - belt], []
        for k in range(order):
            square.append(sum(r[i] * r[k - i] for i in range(k + 1)))
            cube = sum(square[i] * r[k - i] for i in range(k + 1))
            constant = -static * sign if k == 0 else 0
            x.append(y[k] / (k + 1))
            y.append((constant + slope * r[k] - cubic * cube - damping * y[k] - x[k]) / (k + 1))
            r.append(y[-1])
        return x, y

    with localcontext() as context:
        context.prec = 40
        belt, left = Decimal(belt_speed), Decimal(end)
        x, y, sign = Decimal(0), Decimal(0), -1
        while left > 0:
            if sign == 0:
                step = min(left, max(Decimal(0), (static - damping * belt - x) / belt))
                x, left, sign = x + belt * step, left - step, -1
                continue
            series = slip(x, y, sign)
            step = min(left, longest)
            if sign * (_at(series[1], step) - belt) < 0:
                step = _crossing(series[1], belt, step)
                x, y, left = _at(series[0], step), belt, left - step
                reaction = x + damping * belt
                sign = 0 if abs(reaction) <= static else -int(copysign(1.0, reaction))
            else:
                x, y, left = _at(series[0], step), _at(series[1], step), left - step
        return float(x), float(y)


def _at(series: list[Decimal], step: Decimal) -> Decimal:
    value = Decimal(0)
    for coefficient in reversed(series):
        value = value * step + coefficient
    return value


def _crossing(series: list[Decimal], value: Decimal, end: Decimal) -> Decimal:
    """Return the step shortly before `end` at which the series has the value."""
    slopes = [k * coefficient for k, coefficient in enumerate(series)][1:]
    for _ in range(12):
        end -= (_at(series, end) - value) / _at(slopes, end)
    return end


def bare_integrator() -> hy.taylor_adaptive:
    """Return an integrator of `motion(PURE_SLIP_SPEED)`; parameter 0 is the force."""
    x, y = hy.make_vars("x", "y")
    r = y - PURE_SLIP_SPEED
    acceleration = STATIC + SLOPE * r - CUBIC * r * r * r - DAMPING * y - x + hy.par[0]
    events = [hy.t_event(-r), hy.t_event(1.0 + y / UNBOUNDED_SPEED)]
    return hy.taylor_adaptive([(x, y), (y, acceleration)], [0.0, 0.0], t_events=events)


def timed(run: Callable[[], object], count: int) -> Callable[[], float]:
    """Return a function that runs `run` and returns its duration, s, divided by `count`."""

    def measure() -> float:
        start = time.perf_counter()
        run()
        return (time.perf_counter() - start) / count

    return measure


def motion_rows(belt_speed: float) -> list[Row]:
    ours = motion(belt_speed)
    period = 2.0 * pi
    end = PERIODS * period

    def run_ours() -> None:
        for _ in range(MOTIONS):
            ours.restart(0.0, 0.0)
            ours.advance(end)

    run_ours()
    exact = by_series(belt_speed, end)
    our_error = error((ours.position, ours.velocity), exact)
    scipy_error = error(by_scipy(belt_speed, end), exact)
    our_times, scipy_times = by_turns(
        ROUNDS,
        timed(run_ours, MOTIONS * PERIODS),
        timed(lambda: by_scipy(belt_speed, SCIPY_PERIODS * period), SCIPY_PERIODS),
    )
    what = f"belt speed {belt_speed}"
    return [
        compare_times(f"{what}, natural period", our_times, "scipy", scipy_times, required=300.0),
        Row(f"{what}, error", "1", our_error, "scipy", scipy_error, scipy_error / our_error, 1.0),
    ]


def error(state: State, exact: State) -> float:
    return max(abs(a - b) for a, b in zip(state, exact, strict=True))


def ticks(moving: Motion, step: float) -> Callable[[], float]:
    """Return a function that times a tick of a motion."""

    def run() -> None:
        for force in FORCES:
            moving.force = force
            moving.advance(step)

    return timed(run, TICKS)


def tick_row(step: float) -> Row:
    bare = bare_integrator()

    def run_bare() -> None:
        now = float(bare.time)
        for force in FORCES:
            now += step
            bare.pars[0] = force
            bare.propagate_until(now)

    ours = ticks(motion(PURE_SLIP_SPEED), step)
    times, bare_times = by_turns(3 * ROUNDS, ours, timed(run_bare, TICKS))
    return compare_times(f"tick of {1e3 * step:g} ms", times, "bare heyoka", bare_times)


def signal_row(name: str, **signals: Signal) -> Row:
    step = 1e-2
    with_signal, without = motion(PURE_SLIP_SPEED, **signals), motion(PURE_SLIP_SPEED)
    times, plain = by_turns(3 * ROUNDS, ticks(with_signal, step), ticks(without, step))
    what = f"tick of {1e3 * step:g} ms, {name}"
    return compare_times(what, times, "no signal", plain, required=1.0 / 1.2)


def loop_ticks(*overrides: str) -> Callable[[], float]:
    """Return a function that times a tick of the loop of feed_drive."""
    scenario = load_scenario("feed_drive", ["washout_controller.start_after=0", *overrides])
    loop = scenario.plant.as_loop(Motion(scenario.plant.as_drive(), 0.0, 0.0))
    controller = scenario.controller.as_controller()

    def run() -> None:
        for _ in range(TICKS):
            answer(loop, controller)
            loop.advance()

    return timed(run, TICKS)


def part_row(name: str, *overrides: str) -> Row:
    rough, ideal = loop_ticks(*(f"plant.{each}" for each in overrides)), loop_ticks()
    times, plain = by_turns(3 * ROUNDS, rough, ideal)
    return compare_times(f"tick of the loop, {name}", times, "ideal", plain, required=1.0 / 1.1)


def measure() -> list[Row]:
    return [
        *(row for belt_speed in BELT_SPEEDS for row in motion_rows(belt_speed)),
        *(tick_row(step) for step in (1e-3, 1e-2)),
        signal_row("belt in a ramp", belt=ramp(0.1, duration=1e4)),
        signal_row("belt in a sine", belt=sine(0.02, frequency=0.3)),
        signal_row("load in a sine", load=sine(0.1, frequency=0.3)),
        part_row("encoder and difference", ENCODER, DIFFERENCE),
        part_row("the same with noise", ENCODER, DIFFERENCE, "sensor.position_noise=1e-7"),
        part_row("limit and rounding", "actuator.limit=500", "actuator.resolution=1"),
        part_row("lag", "actuator.time_constant=1e-3"),
    ]


if __name__ == "__main__":
    show(__doc__, measure)
