"""A recorded run as numpy arrays: displacement, control force, and what was measured.

Reads the reference bag of this repository. Any bag of `stickslip run`, or of `ros2 bag record`,
works the same way, and no ROS is needed.
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import stickslip_ros as ss

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)
bag = Path(__file__).parents[1] / "bags" / "reference"

print(ss.read_bag(bag, end=2.5))  # s: until the controller is switched on

recorded = ss.read_bag(bag)
states, forces = recorded.samples, recorded.forces
start = states.stamp[0]  # ns

figure = Figure(figsize=(8.0, 5.0), layout="constrained")
above, below = figure.subplots(2, 1, sharex=True)
above.plot(1e-9 * (states.stamp - start), 1e6 * states.position, lw=0.8)
above.set_ylabel("displacement (µm)")
below.step(1e-9 * (forces.stamp - start), forces.force, where="post", color="C1", lw=0.8)
below.set(xlabel="time (s)", ylabel="control force (N)")
figure.savefig(folder / "read_a_bag.png")
