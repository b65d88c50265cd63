"""A machine that stands in for yours: what its PLC exports of a run at one feed.

`python plc_export.py FILE FEED [GAINS]` writes FILE; FEED is in mm/s. GAINS is a scenario with the
washout controller that runs on the machine; without it there is none. Above 45 mm/s somebody taps
on the slide, a few times.
"""

import sys
from pathlib import Path

import stickslip_ros as ss

MACHINE = {
    "mass": 190.0,  # kg
    "stiffness": 7.4e6,  # N/m
    "damping": 2600.0,  # N s/m
    "normal_force": 4000.0,  # N
    "friction_law": "exponential",
    "friction_static": 0.19,
    "friction_kinetic": 0.11,
    "friction_decay_speed": 0.04,  # m/s
    "rate": 1000.0,  # Hz
    "force_delay": 1e-3,  # s: a cycle of the bus
    "sensor_position_resolution": 1e-6,  # m: scale of 1 um
    "sensor_velocity": "difference",
}
TAPS, TAP_FORCE, TAP_LENGTH = (1.0, 2.0, 3.0, 4.0, 5.0), 1000.0, 4e-3  # s, N, s
DURATION = 6.0  # s

file, feed = Path(sys.argv[1]), float(sys.argv[2])
machine = ss.scenario("feed_drive", controller=None, belt_speed=1e-3 * feed, **MACHINE)
if len(sys.argv) > 3:
    gains = ss.scenario(sys.argv[3]).control_law
    machine = ss.scenario(
        machine,
        controller="washout",
        expects_control=True,
        start_after=0.0,
        corner_frequency=gains.corner_frequency,
        linear_gain=gains.linear_gain,
        cubic_gain=gains.cubic_gain,
        force_limit=gains.force_limit,
    )
elif feed > 45.0:
    taps = file.with_suffix(".taps")
    shape = ((0.0, 0.0), (TAP_LENGTH / 2, TAP_FORCE), (TAP_LENGTH, 0.0))
    points = (f"{tap + time:.4f},{force}\n" for tap in TAPS for time, force in shape)
    taps.write_text("time,force\n" + "".join(points))
    machine = ss.scenario(machine, disturbance_kind="table", disturbance_file=str(taps))

lags = ss.simulate(machine, duration=DURATION).to_pandas()["measured_position"]  # m, over time
with file.open("w") as export:
    export.write("Trace 1;Axis X\nTime;SetPos;SetVel;ActPos\nms;mm;mm/s;mm\n")
    for time, lag in lags.items():
        row = 1e3 * time, feed * time, feed, feed * time - 1e3 * lag
        export.write(";".join(f"{value:.4f}" for value in row).replace(".", ",") + "\n")
