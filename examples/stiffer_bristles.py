"""Bristles that are ever stiffer: the cycle of LuGre tends to that of its curve, which sticks.

The damping grows with the stiffness, D = sqrt(S m / N). The error of the period then falls as the
root of the stiffness. The elasto-plastic law tends to the same cycle.
"""

import sys
from math import sqrt
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from stickslip_ros.measures import CycleMeter
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import ElastoPlastic, Exponential, FrictionLaw, LuGre
from stickslip_ros.motion import RecordedMotion

CURVE = Exponential(static=0.4, kinetic=0.25, decay_speed=0.3)
STIFFNESSES = 10.0 ** np.arange(2.0, 5.1, 0.5)

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)


def period(law: FrictionLaw) -> float:
    """Return the mean period of ten cycles."""
    drive = Drive(1.0, 0.02, 1.0, 1.0, 0.2, law)
    motion = RecordedMotion(drive, 0.0, 0.0)
    meter = CycleMeter(10)
    motion.advance(120.0)
    meter.feed(motion.take_breakpoints(), drive.belt_speed)
    return meter.measures().period or float("nan")


exact = period(CURVE)
figure = Figure(figsize=(6.0, 4.2), layout="constrained")
axes = figure.subplots()
for kind, mark in ((LuGre, "o"), (ElastoPlastic, "s")):
    laws = [kind(CURVE, s, sqrt(s)) for s in STIFFNESSES]
    errors = np.abs([period(law) - exact for law in laws]) / exact
    order = np.polyfit(np.log(STIFFNESSES[2:]), np.log(errors[2:]), 1)[0]
    print(f"{kind.name}: period of {exact:.6f} s reached with order {order:.2f}")
    axes.loglog(STIFFNESSES, errors, mark, label=f"{kind.name}, order {order:.2f}")
axes.loglog(STIFFNESSES, errors[-1] * sqrt(1e5) / np.sqrt(STIFFNESSES), "k:", label="order -0.5")
axes.set(xlabel="bristle stiffness S, 1/m", ylabel="error of the period, relative")
axes.legend()
figure.savefig(folder / "stiffer_bristles.png")
