"""A belt that slows down through the critical speed and speeds up again, for two friction laws.

With the Stribeck law of the paper the Hopf bifurcation is supercritical: the vibration starts and
ends near the same speed. With the exponential law it is subcritical: rest is stable above the
critical speed, and so is stick-slip, up to the fold of the limit cycles. A small sine force
near resonance replaces the disturbances of a real drive: without any, the slide would rest beyond
that speed.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import stickslip_ros as ss
from stickslip_ros.motion.trajectory import Trajectory
from stickslip_ros.theory.limit_cycles import limit_cycles

RAMP = 2500.0
"""Time in which the belt slows down, and in which it speeds up."""
CASES = {
    "Stribeck: without hysteresis": ((0.35, 0.6), {"friction_law": "stribeck"}),
    "exponential: with hysteresis": (
        (0.2, 1.7),
        {
            "friction_law": "exponential",
            "friction_static": 0.4,
            "friction_kinetic": 0.25,
            "friction_decay_speed": 0.1,
        },
    ),
}

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)


def amplitudes(trajectory: Trajectory, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the belt speed and half the stroke in each stretch of so many samples."""
    whole = trajectory[: len(trajectory) // samples * samples]
    position, speed = (each.reshape(-1, samples) for each in (whole.position, whole.belt_velocity))
    return speed.mean(axis=1), np.ptp(position, axis=1) / 2.0


figure = Figure(figsize=(9.0, 4.2), layout="constrained")
panes = figure.subplots(1, 2)
for axes, (title, (speeds, law)) in zip(panes, CASES.items(), strict=True):
    slowest, fastest = speeds
    free = ss.scenario("paper", expects_control=False, belt_speed=fastest, rate=20.0, **law)
    theory = ss.stability(free)
    (hopf,) = theory.open_loop["hopf_speeds"]
    profile = folder / "belt.csv"
    profile.write_text(f"0,{fastest}\n{RAMP},{slowest}\n{2 * RAMP},{fastest}\n", encoding="utf-8")
    moving = ss.scenario(
        free,
        belt_speed=0.0,
        belt_kind="table",
        belt_file=str(profile),
        disturbance_kind="sine",
        disturbance_amplitude=1e-4,
        disturbance_frequency=0.159,
        initial_position=theory.equilibrium_position,
    )
    found = ss.simulate(moving, 2 * RAMP).trajectory
    speed, amplitude = amplitudes(found, 200)
    turn = len(speed) // 2
    axes.plot(speed[:turn], amplitude[:turn], "C0", label="belt slows down")
    axes.plot(speed[turn:], amplitude[turn:], "C1--", label="belt speeds up")
    for belt_speed in np.linspace(slowest, fastest, 26):
        at_speed = ss.scenario(free, belt_speed=belt_speed)
        for cycle in limit_cycles(at_speed.plant.as_drive()):
            axes.plot(belt_speed, cycle.measures.amplitude, "k." if cycle.stable else "kx", ms=4)
    axes.axvline(hopf, color="C2", ls=":", label="critical feed speed (Hopf)")
    axes.set(title=title, xlabel="belt speed", ylabel="amplitude of the displacement")
    print(f"{title}: critical feed speed (Hopf) {hopf:.4f}")
axes.plot([], [], "k.", label="stable limit cycle, by theory")
axes.plot([], [], "kx", ms=4, label="unstable limit cycle, by theory")
figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
figure.savefig(folder / "ramp_through_the_hopf_point.png")
