"""Rate-and-state friction: a stiffer spring ends stick-slip, which no law of speed alone can do.

Steady sliding is stable above the critical stiffness of Rice and Ruina (J. Appl. Mech. 50, 1983),
k_c = N (b - a)/L (1 + m V^2/(N a L)). The law of speed has the same friction in steady slip.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from stickslip_ros.measures import CycleMeter
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import RateState, Table
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.theory.hopf import hopf_points

LAW = RateState(
    kinetic=0.6, direct_effect=0.01, evolution_effect=0.02, slip_distance=1e-5, reference_speed=1e-6
)
DRIVE = Drive(mass=1.0, damping=0.0, stiffness=1.0, normal_force=1.0, belt_speed=1e-4, friction=LAW)
INERTIA = DRIVE.mass * DRIVE.belt_speed**2 / (LAW.direct_effect * LAW.slip_distance)
CRITICAL = (LAW.evolution_effect - LAW.direct_effect) / LAW.slip_distance * (1.0 + INERTIA)
SPEEDS = np.geomspace(1e-7, 1e-1, 60)
STEADY = Table(((0.0, 0.66), *((v, -float(LAW.coefficient(v, 1.0))) for v in SPEEDS.tolist())))

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)


def amplitude(drive: Drive) -> float:
    """Return half the stroke after a small push, when the motion has grown or decayed."""
    motion = RecordedMotion(drive, 1.001 * drive.equilibrium_position, drive.belt_speed)
    motion.recording = False
    motion.advance(20.0)
    motion.recording = True
    motion.take_breakpoints()
    motion.advance(30.0)
    meter = CycleMeter(5)
    meter.feed(motion.take_breakpoints(), drive.belt_speed)
    return meter.measures().amplitude or 0.0


ratios = np.concatenate([np.linspace(0.3, 0.95, 7), np.linspace(1.05, 2.0, 5)])
figure = Figure(figsize=(6.0, 4.2), layout="constrained")
axes = figure.subplots()
for law, label, mark in ((LAW, "rate and state", "o-"), (STEADY, "law of speed", "s--")):
    found = [amplitude(replace(DRIVE, friction=law, stiffness=r * CRITICAL)) for r in ratios]
    axes.plot(ratios, 1e6 * np.array(found), mark, label=label)
axes.axvline(1.0, color="k", ls=":", label="Rice and Ruina")
axes.set(xlabel="stiffness / critical stiffness", ylabel="amplitude, µm")
axes.legend()
figure.savefig(folder / "rate_and_state.png")
(point,) = hopf_points(replace(DRIVE, stiffness=CRITICAL))
print(f"critical stiffness {CRITICAL:.2f} N/m; critical speed at it {point.belt_speed:.9f} m/s")
