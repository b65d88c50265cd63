"""The LuGre law with the constants of Canudas de Wit, Olsson, Astrom and Lischinsky, 1995, table I.

Stick-slip under a spring that is pulled (here the belt moves: x is the extension of the spring), a
PID controller that hunts around 1 m, presliding, and break-away over the rate of the force.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Exponential, LuGre
from stickslip_ros.motion import Motion

LAW = LuGre(
    Exponential(static=1.5, kinetic=1.0, decay_speed=1e-3, viscous=0.4, exponent=2.0),
    bristle_stiffness=1e5,
    bristle_damping=np.sqrt(1e5),
)
SPRING = Drive(1.0, 0.0, 2.0, 1.0, 0.1, LAW)
FREE = Drive(1.0, 0.0, 0.0, 1.0, 0.0, LAW)
PERIOD = 1e-3

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
folder.mkdir(parents=True, exist_ok=True)
figure = Figure(figsize=(9.0, 6.4), layout="constrained")
(spring, hunting), (presliding, break_away) = figure.subplots(2, 2)


def rows(
    drive: Drive, duration: float, force=lambda time, motion: 0.0, period=PERIOD
) -> np.ndarray:
    """Return time, displacement, velocity and friction force of a motion under a held force."""
    motion, found = Motion(drive, 0.0, 0.0), []
    for time in period * np.arange(round(duration / period)):
        motion.force = force(time, motion)
        motion.advance(period)
        found.append((time, motion.position, motion.velocity, -motion.friction_force))
    return np.array(found).T


time, x, velocity, friction = rows(SPRING, 40.0)
spring.plot(time, x, label="extension, m")
spring.plot(time, velocity, label="its rate, m/s")
spring.plot(time, -friction, lw=0.8, label="friction, N")
spring.set(title="Stick-slip under a spring", xlabel="time, s")
spring.legend(loc="upper right")

integral = 0.0


def pid(_: float, motion: Motion) -> float:
    """Return the force of the controller, Kp 3, Ki 4, Kv 6."""
    global integral
    error = motion.position - 1.0
    integral += error * PERIOD
    return -3.0 * error - 4.0 * integral - 6.0 * motion.velocity


time, x, *_ = rows(FREE, 100.0, pid)
hunting.plot(time, x)
hunting.set(title="PID control hunts", xlabel="time, s", ylabel="displacement, m")
upward = time[1:][(x[1:] > 1.0) & (x[:-1] <= 1.0) & (time[1:] > 40.0)]
print(f"hunting, sampled at 1 kHz: period {np.diff(upward).mean():.3f} s")

time, x, _, friction = rows(FREE, 4.0, lambda t, _: 1.425 * np.sin(np.pi * t / 2.0) ** 3)
presliding.plot(1e6 * x, friction)
presliding.set(title="Presliding", xlabel="displacement, µm", ylabel="friction, N")

rates = np.geomspace(0.5, 50.0, 9)
forces = []
for rate in rates:
    step = min(1e-3, 1e-3 / rate)
    forces.append(rows(FREE, 2.2 / rate, lambda t, _, r=rate: r * t, step)[3].max())
print(f"break-away at {forces[0]:.3f} N for {rates[0]} N/s, {forces[-1]:.3f} N for {rates[-1]} N/s")
break_away.semilogx(rates, forces, "o-")
break_away.set(title="Break-away", xlabel="rate of the force, N/s", ylabel="largest friction, N")
figure.savefig(folder / "lugre_1995.png")
