"""Which gains of the washout controller make the equilibrium stable, and how fast it settles.

Theory of the sampled loop, without a simulation: on the left the decay rate over cutoff frequency
and linear gain (the star marks the gains of the scenario), on the right the critical gain over the
delay of the force, for three sample rates.
"""

import sys
from pathlib import Path

import stickslip_ros as ss

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)

found = ss.stability("feed_drive")
for low, high in found.sampled_loop["stable_linear_gains"]:
    print(f"stable for linear gains from {low:.0f} to {high:.0f} N s/m")

found.plot().savefig(folder / "stability_map.png")
