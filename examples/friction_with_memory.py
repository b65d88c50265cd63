"""Effects of friction with a memory: loops over the speed, presliding loops, and the memory itself.

The slide of a machine tool vibrates on a falling curve; then a force with a bias swings below
break-away on a slide that no spring holds: with LuGre it drifts, with the elasto-plastic law not.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import ElastoPlastic, Exponential, FrictionLaw, LuGre, MaxwellSlip
from stickslip_ros.motion import Motion

CURVE = Exponential(static=0.4, kinetic=0.25, decay_speed=0.02)
LAWS = (
    LuGre(CURVE, 1e5, 100.0),
    ElastoPlastic(CURVE, 1e5, 100.0, 0.9),
    MaxwellSlip(CURVE, 1e5, 4, 1000.0),
)
FEED = Drive(100.0, 200.0, 1e6, 1000.0, 0.02, LAWS[0])
FREE = replace(FEED, damping=2e4, stiffness=0.0, belt_speed=0.0)

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)


def rows(drive: Drive, law: FrictionLaw, forces: np.ndarray, period: float) -> np.ndarray:
    """Return displacement, relative speed, friction coefficient and first memory at each step."""
    motion, found = Motion(replace(drive, friction=law), 0.0, drive.belt_speed), []
    for force in forces:
        motion.force = force
        motion.advance(period)
        relative_speed = motion.velocity - drive.belt_speed
        coefficient = motion.friction_force / drive.normal_force
        found.append((motion.position, relative_speed, coefficient, motion.memory[0]))
    return np.array(found).T


figure = Figure(figsize=(9.0, 7.6), layout="constrained")
panes = figure.subplots(3, 3)
cycle, swing = np.zeros(4000), 150.0 + 70.0 * np.sin(np.arange(1600) * (np.pi / 100.0))
for law, (loop, memory, presliding) in zip(LAWS, panes, strict=True):
    _, speed, coefficient, deflection = rows(FEED, law, cycle, 1e-4)
    loop.plot(1e3 * speed[-700:], coefficient[-700:])
    loop.set(title=law.name, xlabel="relative speed, mm/s", ylabel="friction coefficient")
    memory.plot(1e-1 * np.arange(1500), 1e6 * deflection[-1500:])
    memory.set(title="memory", xlabel="time, ms", ylabel="deflection, µm")
    x, *_ = rows(FREE, law, swing, 5e-2)
    presliding.plot(1e6 * x, swing, lw=0.8)
    presliding.set(title="presliding", xlabel="displacement, µm", ylabel="force, N")
    print(f"{law.name}: drift of {1e9 * (x[-1] - x[-201]):.2f} nm in the last of eight cycles")
figure.savefig(folder / "friction_with_memory.png")
