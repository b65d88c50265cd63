"""The bifurcation diagram by theory: equilibria and limit cycles, stable and unstable.

Friction that falls quickly with speed makes the Hopf bifurcation subcritical: up to the fold the
drive rests or vibrates, depending on where it starts. The unstable cycle between the two, which no
simulation shows, separates the starts.
"""

import sys
from pathlib import Path

import stickslip_ros as ss

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)

drive = ss.scenario(
    "paper", expects_control=False, friction_law="exponential", friction_decay_speed=0.1
)
found = ss.stability(drive)
print("critical feed speed (Hopf):", *(f"{speed:.4f}" for speed in found.open_loop["hopf_speeds"]))

found.plot().savefig(folder / "stable_and_unstable_cycles.png")
