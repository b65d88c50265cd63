"""A force of 100 N pushes the slide for half a second, at three gains of the washout controller.

The washout filter passes only what changes, so that the controller does not resist a constant
force: the slide moves to where spring and friction balance, and comes back. A larger gain damps
the vibration on the way there and back.
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import stickslip_ros as ss

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)

drive = ss.scenario(
    "feed_drive",
    start_after=0.0,
    disturbance_kind="step",
    disturbance_amplitude=100.0,  # N
    disturbance_start=2.0,  # s
    disturbance_duration=0.5,
)

figure = Figure(figsize=(8.0, 4.0), layout="constrained")
axes = figure.subplots()
for gain, dashes in ((-2000.0, "-"), (-3000.0, "--"), (-6000.0, "-.")):  # N s/m
    run = ss.simulate(ss.scenario(drive, linear_gain=gain), duration=4.0)
    shown = run.trajectory[run.trajectory.time > 1.9]
    position = 1e6 * shown.position
    axes.plot(shown.time, position, ls=dashes, lw=0.9, label=f"{gain:.0f} N s/m")
axes.axvspan(2.0, 2.5, color="0.9", zorder=0, label="100 N push the slide")
axes.set(xlabel="time (s)", ylabel="displacement (µm)")
axes.legend()
figure.savefig(folder / "disturbance_rejection.png")
