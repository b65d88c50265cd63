"""Answers of the washout controller to a recorded run, with other gains.

Feeds the states of the reference bag to the control law, without ROS: once with the recorded
parameters, which gives the recorded forces to the last bit, and once with twice the linear gain.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

from stickslip_ros.model.control import Washout
from stickslip_ros.motion.controller import Controller
from stickslip_ros.record.reader import Recording

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)

with Recording(Path(__file__).parents[1] / "bags" / "reference") as recording:
    states, forces = recording.joint_states, recording.control_forces
    table = recording.metadata("stickslip_ros/washout_controller")
names = ("corner_frequency", "linear_gain", "cubic_gain", "force_limit", "start_after")
recorded = Washout(**{name: json.loads(table[name]) for name in names})
doubled = replace(recorded, linear_gain=2.0 * recorded.linear_gain)

time = 1e-9 * (states.stamp - states.stamp[0])
samples = states.samples()
figure = Figure(figsize=(8.0, 3.6), layout="constrained")
axes = figure.subplots()
for law in (doubled, recorded):
    controller = Controller(law)
    answers = [controller.answer(sample) for sample in samples]
    axes.plot(time, answers, lw=1.0, label=f"linear gain {law.linear_gain:.0f} N s/m")
assert answers[: len(forces.force)] == forces.force.tolist()
axes.set(xlim=(2.4, 3.0), xlabel="time (s)", ylabel="control force (N)")
axes.legend()
figure.savefig(folder / "replay_into_a_controller.png")
