"""A friction law of your own, without a change to the package: the rational Stribeck law.

Derives a law, gives it to a drive, and computes critical speed and limit cycles next to those with
the law of the paper. With the rational law a stable cycle exists above the critical speed, next to
a stable equilibrium: the vibration begins and ends with a jump.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from matplotlib.figure import Figure

from stickslip_ros.model.constants import constant
from stickslip_ros.model.friction import FrictionLaw
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.theory.hopf import hopf_points
from stickslip_ros.theory.limit_cycles import limit_cycles


@dataclass(frozen=True)
class Rational(FrictionLaw):
    """-s [mu_k + (mu_s - mu_k) / (1 + delta |v_r|)] (Popp and Stelter, 1990)."""

    name: ClassVar[str] = "rational"
    kinetic: Any = constant(0.25, "Kinetic coefficient mu_k.", at_least=0.0)
    fading: Any = constant(4.0, "How fast the coefficient falls with speed.", "s/m", positive=True)

    @property
    def characteristic_speed(self) -> float:
        """The speed at which half of the difference is left."""
        return 1.0 / float(self.fading)

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return mu(v_r), for floats, arrays and symbolic expressions."""
        drop = (self.static - self.kinetic) / (1.0 + self.fading * relative_speed * sign)
        return -sign * (self.kinetic + drop)


folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)

paper = load_scenario("paper").plant.as_drive()
laws = {"Stribeck": paper.friction, "rational": Rational(static=0.4)}
figure = Figure(figsize=(8.0, 3.6), layout="constrained")
curve, cycles = figure.subplots(1, 2)
for name, law in laws.items():
    speeds = np.linspace(0.0, 1.0, 200)
    curve.plot(speeds, -law.coefficient(speeds, 1.0), label=name)
    drive = replace(paper, friction=law, damping=0.1)
    belt_speeds = np.linspace(0.1, 0.6, 21)
    found = [limit_cycles(replace(drive, belt_speed=speed)) for speed in belt_speeds.tolist()]
    stable = [[cycle.measures.amplitude for cycle in each if cycle.stable] for each in found]
    (line,) = cycles.plot(belt_speeds, [max(each, default=0.0) for each in stable], ".")
    for point in hopf_points(drive):
        print(f"{name}: critical feed speed (Hopf) {point.belt_speed:.4f}")
        cycles.axvline(point.belt_speed, color=line.get_color(), ls=":")
curve.set(xlabel="relative speed", ylabel="friction coefficient")
curve.legend()
cycles.set(xlabel="belt speed (dotted: critical speed)", ylabel="amplitude of the stable cycle")
figure.savefig(folder / "custom_friction_law.png")
