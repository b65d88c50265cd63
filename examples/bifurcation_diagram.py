"""Where the uncontrolled drive sticks, slips and rests: its bifurcation diagram over belt speed.

Each of 120 belt speeds is simulated until the motion has settled. The lines come from theory: the
critical feed speed (Hopf) and the stick-slip onset speed.
"""

import sys
from pathlib import Path

import stickslip_ros as ss

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)

drive = ss.scenario("paper", expects_control=False)
diagram = ss.sweep(drive, belt_speed=(0.02, 0.6, 120))
diagram.plot().savefig(folder / "bifurcation_diagram.png")
