"""Two stable motions side by side: which starts lead to rest, and which to stick-slip.

With the exponential Stribeck law both are stable at this belt speed. A grid of 30 by 30 starts
gives the basin of attraction of each, and its share of the starts.
"""

import sys
from pathlib import Path

import stickslip_ros as ss

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)

drive = ss.scenario(
    "paper",
    expects_control=False,
    belt_speed=1.5,
    damping=0.1,
    friction_law="exponential",
    friction_static=1.0,
    friction_kinetic=0.5,
)
found = ss.basin(drive, position=(-2.0, 3.0, 30), velocity=(-2.5, 2.5, 30))
for attractor in found.attractors:
    print(f"{attractor.regime}: {attractor.share:.3f} of the starts")
found.plot().savefig(folder / "basins.png")
