"""Effects of an encoder of 1 um and an actuator that lags on a washout controller.

The velocity is the difference of positions over some samples. A longer difference tells smaller
steps of the velocity, and tells them later; a lag of the actuator delays the force, too.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import stickslip_ros as ss

SPANS, LAGS = (1, 2, 4, 8), (0.0, 1e-3, 3e-3)
BEGIN, END = 3.0, 5.0

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)


def drive(spans: int, lag: float) -> ss.Scenario:
    """Return feed_drive under control from the start."""
    encoder = {"sensor_position_resolution": 1e-6, "sensor_velocity": "difference"}
    return ss.scenario(
        "feed_drive",
        start_after=0.0,
        sensor_difference_samples=spans,
        actuator_time_constant=lag,
        **encoder,
    )


figure = Figure(figsize=(10.0, 4.2), layout="constrained")
trace, force, gain = figure.subplots(1, 3)
print("lag, ms  samples  amplitude, um  rms force, N  peak force, N  stable gains, N s/m")
for lag, mark in zip(LAGS, "osd", strict=True):
    forces: list[float] = []
    weakest: list[float] = []
    strongest: list[float] = []
    for spans in SPANS:
        scenario = drive(spans, lag)
        found = ss.simulate(scenario, duration=END).trajectory
        rest = found[found.time > BEGIN]
        amplitude = 1e6 * np.ptp(rest.position) / 2.0
        forces.append(float(np.sqrt(np.mean(rest.control_force**2))))
        ((low, high),) = ss.stability(scenario).sampled_loop["stable_linear_gains"]
        weakest.append(-high)
        strongest.append(-low)
        peak = np.abs(rest.control_force).max()
        print(
            f"{1e3 * lag:7g}  {spans:7d}  {amplitude:13.2f}  {forces[-1]:12.2f}  {peak:13.2f}"
            f"  {low:.0f} to {high:.0f}"
        )
        if lag == LAGS[1] and spans in (1, 8):
            shown = rest.time < BEGIN + 0.2
            label = f"{spans} sample{'s' * (spans > 1)}"
            trace.plot(1e3 * (rest.time[shown] - BEGIN), rest.control_force[shown], label=label)
    label = f"lag of {1e3 * lag:g} ms"
    force.plot(SPANS, forces, marker=mark, label=label)
    gain.plot(SPANS, strongest, marker=mark, label=label)
gain.plot(SPANS, weakest, color="black", ls="--", lw=1.0, label="least, lag of 3 ms")
trace.set(title="control force at rest, lag of 1 ms", xlabel="time, ms", ylabel="force, N")
force.set(title="force by rounding", xlabel="samples of the difference", ylabel="rms force, N")
force.set(xscale="log", yscale="log", xticks=SPANS, xticklabels=SPANS)
gain.set(
    title="linear gains: largest, least",
    xlabel="samples of the difference",
    ylabel="-k, N s/m",
)
gain.set(xscale="log", yscale="log", xticks=SPANS, xticklabels=SPANS)
force.set(yticks=(0.05, 0.1, 0.2, 0.5), yticklabels=("0.05", "0.1", "0.2", "0.5"))
for pane in (trace, force, gain):
    pane.legend(loc="best" if pane is not trace else "lower right")
    pane.minorticks_off()
figure.savefig(folder / "encoder_and_actuator.png")
