"""The critical feed speed by theory, and the vibration that begins there in simulation.

Near the critical speed the amplitude grows with the square root of the distance, by averaging as
2 sqrt(v_b1^2 - v^2). Below the stick-slip onset speed the simulated amplitude departs from
that curve.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import stickslip_ros as ss

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)

drive = ss.scenario("paper", expects_control=False)
theory = ss.stability(drive)
(hopf,) = theory.open_loop["hopf_speeds"]
onset = theory.sticking["onset_speed"]
print(f"critical feed speed (Hopf) {hopf:.5f}, stick-slip onset speed {onset:.5f}")

found = ss.sweep(drive, belt_speed=(0.35, 0.5, 61), transient=400)
speeds, below = np.linspace(0.35, 0.5, 61), np.linspace(0.35, hopf, 300)

figure = Figure(figsize=(7.0, 4.2), layout="constrained")
axes = figure.subplots()
axes.plot(below, 2.0 * np.sqrt(hopf**2 - below**2), "k--", label="averaging")
axes.plot(speeds, found.columns.amplitude, ".", label="simulation")
axes.axvline(hopf, color="C2", ls=":", label="critical feed speed (Hopf)")
axes.axvline(onset, color="C1", ls="-.", label="stick-slip onset speed")
axes.set(xlabel="belt speed", ylabel="amplitude of the displacement")
axes.legend()
figure.savefig(folder / "hopf_point_versus_simulation.png")
