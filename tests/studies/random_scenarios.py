"""Random scenarios, and changes of each after which the answers are known to be the same.

A slide without control, or under a washout law; friction of seven laws, two of them with a memory;
belts at rest, slow and fast, in both directions; damping from very low to far above critical, some
near a Hopf point. Every other slide starts where the spring is relaxed.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from math import pi
from typing import Any, NamedTuple

import numpy as np
import pytest

from stickslip_ros.measures.cycle_measures import Measures, Regime
from stickslip_ros.measures.cycle_meter import STEADY_CHANGE
from stickslip_ros.motion.trajectory import TrajectoryRecorder
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.show.run_history import RunHistory
from stickslip_ros.studies.settling import ControlledDrive, MotionState, SettlingOptions, settle
from stickslip_ros.studies.simulate import simulate

Values = Mapping[str, float]

LAWS = ("stribeck", "coulomb", "exponential", "stiction", "linear", "lugre", "dahl")

UNITS = {
    "mass": (1, 0, 0),
    "damping": (1, 0, -1),
    "stiffness": (1, 0, -2),
    "normal_force": (1, 1, -2),
    "bias_force": (1, 1, -2),
    "belt_speed": (0, 1, -1),
    "initial.position": (0, 1, 0),
    "initial.velocity": (0, 1, -1),
    "rate": (0, 0, -1),
    "friction.static": (0, 0, 0),
    "friction.minimum": (0, 0, 0),
    "friction.kinetic": (0, 0, 0),
    "friction.minimum_speed": (0, 1, -1),
    "friction.decay_speed": (0, 1, -1),
    "friction.viscous": (0, -1, 1),
    "friction.slope": (0, -1, 1),
    "friction.bristle_stiffness": (0, -1, 0),
    "friction.bristle_damping": (0, -1, 1),
    "corner_frequency": (0, 0, -1),
    "linear_gain": (1, 0, -1),
    "cubic_gain": (1, -2, 1),
}
"""Powers of mass, length and time in the unit of each parameter."""

SPEEDS = ("friction.minimum_speed", "friction.decay_speed")
LENGTHS, RATES = ("amplitude", "midpoint"), ("velocity_amplitude",)


class RandomScenario(NamedTuple):
    """A scenario by its parameters."""

    law: str
    values: Values
    """Parameters of plant and control law, SI units."""
    periods: float = 60.0
    """Duration of a run, in natural periods."""

    @property
    def controlled(self) -> bool:
        return "linear_gain" in self.values

    @property
    def period(self) -> float:
        """Natural period, s."""
        return 2.0 * pi * (self.values["mass"] / self.values["stiffness"]) ** 0.5

    @property
    def length(self) -> float:
        """Displacement by the normal force, m."""
        return self.values["normal_force"] / self.values["stiffness"]

    @property
    def scenario(self) -> Scenario:
        texts = [f"plant.friction.law={self.law}"]
        texts += [f"plant.expects_control={'true' if self.controlled else 'false'}"]
        for name, value in self.values.items():
            node = "washout_controller" if name.endswith(("gain", "frequency")) else "plant"
            texts.append(f"{node}.{name}={value!r}")
        return load_scenario("paper", texts)

    def changed(self, change: Callable[[str, float], float]) -> "RandomScenario":
        values = {name: change(name, value) for name, value in self.values.items()}
        return self._replace(values=values)

    def measures(self, **seen: Any) -> Measures:
        """Measures of a run."""
        return simulate(self.scenario, self.periods * self.period, **seen)


def random_scenario(seed: int) -> RandomScenario:
    draw = np.random.default_rng([seed, 67])
    law = LAWS[seed % len(LAWS)]
    mass, frequency, normal = (
        float(10.0 ** draw.uniform(*ends)) for ends in ((-1, 3), (0.3, 3), (-1, 4))
    )
    speed, length = normal / mass / frequency, normal / mass / frequency**2
    dampings = draw.uniform(0.002, 0.1), draw.uniform(0.1, 2.0), 10.0 ** draw.uniform(0.3, 1.8)
    damping = float(draw.choice(dampings, p=[0.6, 0.2, 0.2]))
    static = float(draw.uniform(0.2, 0.6))
    lower, width = static * float(draw.uniform(0.3, 0.95)), speed * float(draw.uniform(0.2, 0.8))
    constants = {
        "stribeck": {"minimum": lower, "minimum_speed": width},
        "coulomb": {"viscous": float(draw.uniform(0.0, 0.1)) / speed},
        "exponential": {"kinetic": lower, "decay_speed": width},
        "stiction": {"kinetic": lower},
        "linear": {"slope": float(draw.uniform(0.0, 0.05)) / speed},
        "lugre": {
            "kinetic": lower,
            "decay_speed": width,
            "bristle_stiffness": float(draw.uniform(50.0, 500.0)) / length,
            "bristle_damping": float(draw.uniform(0.5, 3.0)) / speed,
        },
        "dahl": {"bristle_stiffness": float(draw.uniform(20.0, 100.0)) / length},
    }[law]
    belts = 0.0, draw.uniform(0.02, 0.2), draw.uniform(0.2, 1.0)
    belt = float(draw.choice(belts, p=[0.15, 0.35, 0.5]))
    values = {
        "mass": mass,
        "damping": damping * mass * frequency,
        "stiffness": mass * frequency**2,
        "normal_force": normal,
        "bias_force": 0.0,
        "belt_speed": float(draw.choice([-1.0, 1.0])) * belt * speed,
        "initial.position": float(draw.choice([0.0, draw.uniform(-1.0, 1.0)])) * length,
        "initial.velocity": float(draw.choice([0.0, draw.uniform(-0.5, 0.5)])) * speed,
        "rate": float(10.0 ** draw.uniform(0.3, 2.0)) * frequency / (2.0 * pi),
        "friction.static": static,
        **{f"friction.{name}": value for name, value in constants.items()},
    }
    if law == "stribeck" and draw.uniform() < 0.5:  # near the Hopf point
        slope = 1.5 * (static - lower) / width * (1.0 - (belt * speed / width) ** 2)
        if slope > 0.0:
            values["damping"] = normal * slope * float(draw.uniform(0.97, 1.03))
    elif draw.uniform() < 0.35:
        values |= {
            "rate": float(draw.uniform(30.0, 100.0)) * frequency / (2.0 * pi),
            "corner_frequency": float(draw.uniform(0.3, 3.0)) * frequency,
            "linear_gain": -float(draw.uniform(0.02, 0.8)) * mass * frequency,
            "cubic_gain": -float(draw.uniform(0.0, 0.5)) * mass * frequency / speed**2,
        }
    return RandomScenario(law, values)


def _drawn(one: RandomScenario) -> Measures:
    recorder = TrajectoryRecorder(one.values["rate"])
    return one.measures(observer=RunHistory(), recorder=recorder)


def _shared(one: RandomScenario) -> Measures:
    """The normal force is 1/30, and the coefficients are 30 times as large."""
    share = 30.0

    def change(name: str, value: float) -> float:
        if name == "normal_force":
            return value / share
        return value * share if name.startswith("friction.") and name not in SPEEDS else value

    return one.changed(change).measures()


def _mirrored(one: RandomScenario) -> Measures:
    signed = "belt_speed", "initial.position", "initial.velocity"
    measures = one.changed(lambda name, value: -value if name in signed else value).measures()
    midpoint = measures.midpoint
    return replace(measures, midpoint=None if midpoint is None else -midpoint)


def _rescaled(one: RandomScenario) -> Measures:
    """In units of 7 kg, 30 mm and 0.4 s."""
    units = 7.0, 0.03, 0.4

    def change(name: str, value: float) -> float:
        return value / float(np.prod(np.power(units, UNITS[name])))

    measures = one.changed(change).measures()
    scales = dict.fromkeys(LENGTHS, 0.03) | dict.fromkeys(RATES, 0.03 / 0.4) | {"period": 0.4}
    return replace(
        measures,
        **{
            name: None if getattr(measures, name) is None else getattr(measures, name) * scale
            for name, scale in scales.items()
        },
    )


def _shifted(one: RandomScenario) -> Measures:
    """A bias force moves the equilibrium by half of the length."""
    shift = 0.5 * one.length
    moved = {
        "bias_force": shift * one.values["stiffness"],
        "initial.position": one.values["initial.position"] + shift,
    }
    measures = one._replace(values={**one.values, **moved}).measures()
    midpoint = measures.midpoint
    return replace(measures, midpoint=None if midpoint is None else midpoint - shift)


def _twice_as_often(one: RandomScenario) -> Measures:
    return one.changed(lambda name, value: 2.0 * value if name == "rate" else value).measures()


def _as_in_a_sweep(one: RandomScenario) -> Measures:
    scenario = one.scenario
    initial = scenario.plant.initial
    case = ControlledDrive.from_scenario(scenario)
    return settle(case, MotionState(initial.position, initial.velocity), SettlingOptions()).measures


class Change(NamedTuple):
    """A change, and what it leaves as it is."""

    measures: Callable[[RandomScenario], Measures]
    """Of the changed scenario, back in the units and the frame of the original."""
    near: float
    """Largest relative error, and in lengths and speeds of the drive."""
    near_controlled: float | None = None
    """The same with control; None: the same value."""
    same_cycles: bool = True
    """Whether the cycles are the same; otherwise only motions that are steady are compared."""
    periods: float = 60.0
    """Duration of the original, in natural periods."""


CHANGES = {
    "drawn": Change(_drawn, 1e-7),
    "shared": Change(_shared, 1e-7),
    "mirrored": Change(_mirrored, STEADY_CHANGE, same_cycles=False),
    "rescaled": Change(_rescaled, 1e-6),
    "bias": Change(_shifted, 1e-6),
    "rate": Change(_twice_as_often, 1e-7, 0.1, same_cycles=False),
    "sweep": Change(_as_in_a_sweep, 2.0 * STEADY_CHANGE, same_cycles=False, periods=250.0),
}


@cache
def original(seed: int, periods: float) -> tuple[RandomScenario, Measures]:
    """Return a scenario, and the measures of its run over so many natural periods."""
    one = random_scenario(seed)._replace(periods=periods)
    return one, one.measures()


def differences(seed: int, name: str) -> list[str]:
    """Return what a change alters that it should not: names of measures, with both values."""
    change = CHANGES[name]
    one, before = original(seed, change.periods)
    return compared(one, change, before, change.measures(one))


def compared(one: RandomScenario, change: Change, before: Measures, after: Measures) -> list[str]:
    """Return the measures that differ, with both values."""
    near = change.near_controlled if one.controlled and change.near_controlled else change.near
    names = ["regime", "steady", "trend"]
    if not change.same_cycles:
        if not (before.steady and after.steady):
            return []
        names = ["regime"]
    numbers = [*LENGTHS, *RATES, "period", "stick_fraction"]
    if before.regime not in (Regime.PURE_SLIP, Regime.STICK_SLIP):
        numbers = ["midpoint"]
    speed = one.length * 2.0 * pi / one.period
    least = dict.fromkeys(LENGTHS, one.length) | dict.fromkeys(RATES, speed) | {"stick_fraction": 1}
    found = [n for n in names if getattr(before, n) != getattr(after, n)]
    for number in numbers:
        wanted, value = getattr(before, number), getattr(after, number)
        if wanted is None or value is None:
            same = value is wanted
        else:
            same = value == pytest.approx(wanted, rel=near, abs=near * least.get(number, 0.0))
        found += [] if same else [number]
    return [f"{each}: {getattr(before, each)}, {getattr(after, each)}" for each in found]
