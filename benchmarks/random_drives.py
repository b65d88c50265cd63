"""Random drives with signals of belt, load and disturbance, each with its reference.

What the package gets, and the formulas of the reference, come from the same numbers.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from typing import Any, NamedTuple

import numpy as np

from benchmarks import dop853
from benchmarks.dop853 import Array, Curve, Dop853Drive, Solution
from stickslip_ros.measures.breakpoints import Breakpoints
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import (
    Coulomb,
    Directional,
    Exponential,
    FrictionLaw,
    Linear,
    Stribeck,
    Table,
)
from stickslip_ros.model.signals import NO_SIGNAL, SIGNALS, Signal, table
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.motion.sampled_loop import SampledLoop

KINDS = ("step", "impulse", "ramp", "sine", "trapezoid", "table")
LAWS = ("stribeck", "coulomb", "linear", "exponential", "exponent", "table")
PLACES = ("belt", "load", "disturbance", "together")
"""Where the signal of a kind acts; together with two of other kinds in the last case."""

PERIODS = 20
SAMPLES = 20
"""Per natural period. A disturbance is held from sample to sample."""

Random = np.random.Generator


def random_law(name: str, draw: Random, speed: float) -> tuple[FrictionLaw, Curve]:
    """Return a law and its curve; `speed` (m/s) is the unit of speeds."""
    static = float(draw.uniform(0.3, 0.6))
    lower = float(draw.uniform(0.3, 0.9)) * static
    width = float(draw.uniform(0.15, 0.8)) * speed
    viscous = float(draw.uniform(0.0, 0.2)) / speed
    match name:
        case "stribeck":
            width = max(width, 0.4 * speed)
            return Stribeck(static, lower, width), dop853.stribeck(static, lower, width)
        case "coulomb":
            return Coulomb(static, viscous), dop853.coulomb(static, viscous)
        case "linear":
            slope = 0.3 * viscous
            return Linear(static, slope), dop853.linear(static, slope)
        case "exponential" | "exponent":
            exponent = 1.0 if name == "exponential" else float(draw.choice([1.5, 2.0, 3.0]))
            numbers = (static, lower, width, viscous, exponent)
            return Exponential(*numbers), dop853.exponential(*numbers)
        case _:
            speeds = [0.0, *(np.cumsum(draw.uniform(0.05, 0.3, 6)) * speed).tolist()]
            values = [static, *draw.uniform(0.15, 0.6, 6).tolist()]
            table = Table(tuple(zip(speeds, values, strict=True)))
            return table, dop853.tabulated(speeds, values)


@dataclass(frozen=True)
class RandomSignal:
    """A signal as its constants, for the package and for the reference."""

    kind: str
    constants: Mapping[str, Any]

    @property
    def reference(self) -> dop853.Signal:
        made = {
            "none": dop853.none,
            "step": dop853.step,
            "impulse": dop853.step,
            "ramp": dop853.ramp,
            "sine": dop853.sine,
            "trapezoid": dop853.trapezoid,
            "table": dop853.points,
        }
        return made[self.kind](**self.constants)

    @property
    def packaged(self) -> Signal:
        """The signal of the package."""
        values = dict(self.constants)
        match self.kind:
            case "none":
                return NO_SIGNAL
            case "impulse":
                values["period"] = values.pop("duration")
            case "table":
                return table(list(zip(values["times"], values["values"], strict=True)))
            case _:
                pass
        return SIGNALS[self.kind](**values)


NONE = RandomSignal("none", {})


def random_signal(
    kind: str, size: float, sample: float, draw: Random, *, held: bool = False
) -> RandomSignal:
    """Return a signal of a size at most; `sample` is the time from sample to sample, s.

    Every other one has its corners at samples, and all that are `held` between samples.
    """
    at_samples = bool(draw.uniform() < 0.5) or held

    def time(least: float, most: float) -> float:
        samples = float(draw.uniform(least, most))
        return sample * (round(samples) if at_samples else samples)

    share = float(draw.uniform(0.2, 0.9)) if draw.uniform() < 0.9 else 1.0
    amplitude = float(draw.choice([-1.0, 1.0])) * share * size
    start, duration = time(0.0, 5.0 * SAMPLES), time(SAMPLES, 12.0 * SAMPLES)
    numbers: dict[str, Any] = {"amplitude": amplitude, "start": start, "duration": duration}
    match kind:
        case "impulse":
            numbers["duration"] = sample
        case "sine":
            if draw.uniform() < 0.5:
                numbers["duration"] = inf
            numbers["frequency"] = float(10.0 ** draw.uniform(-1.0, 0.5)) / (SAMPLES * sample)
        case "trapezoid":
            edge = time(2.0, 5.0 * SAMPLES)
            numbers |= {"duration": duration + 2.0 * edge, "frequency": 1.0 / edge}
        case "table":
            times = np.cumsum([time(0.3 * SAMPLES, 4.0 * SAMPLES) for _ in range(6)]).tolist()
            numbers = {"times": times, "values": (amplitude * draw.uniform(-1, 1, 6)).tolist()}
        case _:
            pass
    return RandomSignal(kind, numbers)


@dataclass(frozen=True)
class RandomDrive:
    """A drive with its start, SI units."""

    plain: Drive
    """Without signals."""
    forward: Curve
    backward: Curve
    belt: RandomSignal
    load: RandomSignal
    force: RandomSignal
    position: float
    velocity: float

    @property
    def drive(self) -> Drive:
        plain = self.plain
        return Drive(
            plain.mass, plain.damping, plain.stiffness, plain.normal_force, plain.belt_speed,
            plain.friction, self.belt.packaged, self.load.packaged,
        )  # fmt: skip

    @property
    def sample(self) -> float:
        """Time from sample to sample, s."""
        return self.plain.natural_period / SAMPLES

    @property
    def scales(self) -> Array:
        """L and V."""
        return np.array([self.plain.length_scale, self.plain.speed_scale])

    def reference(self, periods: float = PERIODS, **options: float) -> Dop853Drive:
        plain = self.plain
        end = periods * plain.natural_period
        return Dop853Drive(
            plain.mass,
            plain.damping,
            plain.stiffness,
            self.forward,
            self.backward,
            self.belt.reference.plus(plain.belt_speed),
            self.load.reference.plus(plain.normal_force),
            self.force.reference.held(self.sample, end),
            **options,
        )

    def solution(self, periods: float = PERIODS, **options: float) -> Solution:
        """Return the reference at the samples, from the first one."""
        times = self.sample * np.arange(round(periods * SAMPLES) + 1)
        return self.reference(periods, **options).run(self.position, self.velocity, times)

    def motion(self, periods: float = PERIODS) -> tuple[Array, Breakpoints]:
        """Return the motion of the package: position and velocity at the samples, breakpoints."""
        motion = RecordedMotion(self.drive, self.position, self.velocity)
        loop = SampledLoop(
            motion, 1.0 / self.sample, 0, expects_control=False, disturbance=self.force.packaged
        )
        samples = [loop.sample]
        samples += [loop.advance() for _ in range(round(periods * SAMPLES))]
        found = np.array([(each.position, each.velocity) for each in samples])
        return found, motion.take_breakpoints()


class Units(NamedTuple):
    """Scales of a drive, SI units."""

    mass: float
    rate: float
    normal: float

    @property
    def stiffness(self) -> float:
        return self.mass * self.rate**2

    @property
    def length(self) -> float:
        return self.normal / self.stiffness

    @property
    def speed(self) -> float:
        return self.length * self.rate

    def belt_speed(self, draw: Random) -> float:
        return float(draw.choice([0.0, 0.1, 0.2, 0.3, -0.1, -0.2]) * self.speed)


def random_units(draw: Random) -> Units:
    return Units(*(float(10.0 ** draw.uniform(*ends)) for ends in ((-2, 3), (-1, 3), (-2, 4))))


def drive_of_place(seed: int, law: str, kind: str, place: str) -> RandomDrive:
    """Return a drive with a signal of a kind in a place; every other one has a law by direction."""
    number, names = KINDS.index(kind), ("none", *KINDS)
    kinds = {"belt": "none", "load": "none", "force": "none"}
    if place == "together":
        others = (number + 1 + seed) % len(KINDS), (number + 2 + 2 * seed) % len(KINDS)
        chosen = [kind, *(KINDS[each] for each in others)]
        kinds = dict(zip(np.roll([*kinds], seed).tolist(), chosen, strict=True))
    else:
        kinds["force" if place == "disturbance" else place] = kind
    belt, load, force = kinds["belt"], kinds["load"], kinds["force"]
    directional = seed % 2 == 1
    draw = np.random.default_rng(
        [seed, LAWS.index(law), directional, *(names.index(each) for each in (belt, load, force))]
    )
    units = random_units(draw)
    normal, length, speed = units.normal, units.length, units.speed
    friction, forward = random_law(law, draw, speed)
    backward = forward
    if directional:
        reverse, backward = random_law(law, draw, speed)
        friction = Directional(friction, reverse)
    plain = Drive(
        mass=units.mass,
        damping=float(draw.uniform(0.02, 0.2) * units.rate * units.mass),
        stiffness=units.stiffness,
        normal_force=normal,
        belt_speed=units.belt_speed(draw),
        friction=friction,
    )
    sample = plain.natural_period / SAMPLES
    start = draw.integers(3)  # at rest, at the speed of the belt, anywhere
    velocity = [0.0, plain.belt_speed, draw.uniform(-0.5, 0.5) * speed][start]
    return RandomDrive(
        plain,
        forward,
        backward,
        random_signal(belt, 0.4 * speed, sample, draw) if belt != "none" else NONE,
        random_signal(load, normal, sample, draw) if load != "none" else NONE,
        random_signal(force, 0.5 * normal, sample, draw, held=True) if force != "none" else NONE,
        float(draw.choice([0.0, draw.uniform(-1.0, 1.0)]) * length),
        float(velocity),
    )


SHORTEST = 1e-5
"""Phases of stick or slip that are shorter, in natural periods, do not count: rounding makes some
where a load takes all of the normal force from a slide at rest."""


def sticks_of(breakpoints: Breakpoints) -> list[tuple[float, float]]:
    """Return start and end of each phase of stick."""
    found: list[tuple[float, float]] = []
    for (start, _), (end, sticking) in pairwise(
        zip(breakpoints.time.tolist(), breakpoints.sticking.tolist(), strict=True)
    ):
        if not sticking or start == end:
            continue
        found.append((start, end))
    return found


def without_short(phases: list[tuple[float, float]], shortest: float) -> list[tuple[float, float]]:
    """Return phases of stick without those, and the slip between them, that are too short."""
    found: list[tuple[float, float]] = []
    for start, end in phases:
        if found and start - found[-1][1] <= shortest:
            start = found.pop()[0]
        found.append((start, end))
    return [each for each in found if each[1] - each[0] > shortest]


@dataclass(frozen=True)
class Difference:
    """Largest differences between two motions of a drive."""

    state: float
    """Of position and velocity, in shares of the range of each."""
    events: float
    """Of the times at which a phase of stick starts or ends, in natural periods; infinite if the
    numbers of phases differ."""
    sticks: int
    """Number of phases of stick."""


def difference(
    drive: RandomDrive,
    solution: Solution,
    found: Array,
    sticks: list[tuple[float, float]],
) -> Difference:
    expected = np.column_stack([solution.position, solution.velocity])
    scales = np.maximum(np.ptp(expected, axis=0), 1e-3 * drive.scales)  # a slide may rest
    period = drive.plain.natural_period
    long = [without_short(phases, SHORTEST * period) for phases in (solution.sticks, sticks)]
    events = inf
    if len(long[0]) == len(long[1]):
        events = float(np.abs(np.subtract(*long)).max(initial=0.0)) / period
    state = float((np.abs(found - expected) / scales).max())
    return Difference(state, events, len(long[0]))
