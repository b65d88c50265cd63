"""The feed drive vibrates until the washout controller is switched on at 5 s.

Simulates the scenario for 8 s, prints what was measured of the last cycles, and plots the run.
"""

import sys
from pathlib import Path

import stickslip_ros as ss

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)

for duration in (5.0, 8.0):  # s
    run = ss.simulate(ss.scenario("feed_drive"), duration=duration)
    print(f"after {duration} s: {run.measures.regime}, {1e6 * run.measures.amplitude:.1f} µm")

run.plot().savefig(folder / "simulate_and_plot.png")
