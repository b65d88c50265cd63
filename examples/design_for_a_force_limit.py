"""Gains for belt speeds of 15 to 50 mm/s and an actuator that can push with no more than 200 N.

The design proposes a washout controller and tests it in simulation. The figure shows the proposed
controller at 30 mm/s: it is switched on at 2 s.
"""

import sys
from pathlib import Path

import stickslip_ros as ss

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)

found = ss.design("feed_drive", belt_speed=(0.015, 0.05), force_limit=200.0)
print(found)

controlled = ss.scenario(found.scenario, belt_speed=0.03, start_after=2.0)
run = ss.simulate(controlled, duration=4.0)
print(f"{run.measures.regime}, {1e6 * run.measures.amplitude:.1f} µm")
run.plot().savefig(folder / "design_for_a_force_limit.png")
