"""A machine that stands in for yours: what its PLC exports of a run at one feed.

`python plc_export.py FEED...` writes FEED.csv for each feed, in mm/s. With `GAINS.yaml` behind, a
scenario with the washout controller that runs on the machine, it writes FEED-GAINS.csv. Without,
somebody taps on the slide a few times above 45 mm/s.
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


def exported(feed: float, file: Path, gains: Path | None) -> None:
    """Write what the PLC exports of a run."""
    machine = ss.scenario("feed_drive", controller=None, belt_speed=1e-3 * feed, **MACHINE)
    if gains:
        law = ss.scenario(gains).control_law
        names = ("corner_frequency", "linear_gain", "cubic_gain", "force_limit")
        constants = {name: getattr(law, name) for name in names}
        washout = {"controller": "washout", "expects_control": True, "start_after": 0.0}
        machine = ss.scenario(machine, **washout, **constants)
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


feeds, last = sys.argv[1:], sys.argv[-1]
gains = Path(feeds.pop()) if last.endswith(".yaml") else None
for feed in feeds:
    exported(float(feed), Path(f"{feed}-{gains.stem}.csv" if gains else f"{feed}.csv"), gains)
