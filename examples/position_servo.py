"""A control law of your own that tracks a reference: the position servo of a ball-screw axis.

The axis moves by 100 mm and back. Jumps of the reference's speed bring the force to its limit.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from stickslip_ros.measures import CycleMeter
from stickslip_ros.model.constants import constant
from stickslip_ros.model.control import ControlLaw
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb
from stickslip_ros.model.signals import trapezoid
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.motion.controller import Controller
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.motion.simulation import simulate_sampled
from stickslip_ros.motion.trajectory import TrajectoryRecorder

RATE, FORCE_LIMIT = 1000.0, 351.5065  # Hz, N


@dataclass(frozen=True)
class PositionServo(ControlLaw):
    """Two nested loops, u = k_v [k_p (r - x) - x']; without a reference they brake.

    Of Janot, Gautier, Brunot, Data Set and Reference Models of EMPS, Workshop on Nonlinear System
    Identification Benchmarks, 2019. Their voltage is 243.45 V/(m/s) times the brackets, at most
    10 V, and the force is 35.15065 N/V times the voltage.
    """

    name: ClassVar[str] = "position_servo"
    follows_reference: ClassVar[bool] = True

    position_gain: float = constant(160.18, "Gain k_p of the position loop.", "1/s", at_least=0.0)
    velocity_gain: float = constant(8557.426, "Gain k_v of the speed loop.", "N s/m", at_least=0.0)

    def respond(self, state, elapsed, sample, reference):
        """Return the force for a sample; see `ControlLaw.respond`."""
        lag = 0.0 if reference.position is None else reference.position - sample.position
        return self.velocity_gain * (self.position_gain * lag - sample.velocity), state


# Their fit: 95.1 kg, 203.5 N s/m, 20.4 N; no spring holds the axis.
AXIS = Drive(95.1, 203.5, 0.0, 1000.0, belt_speed=0.0, friction=Coulomb(static=0.0204))
MOTION = trapezoid(amplitude=0.1, start=0.1, duration=3.0)


def simulate(law, duration=3.5):
    """Return the trajectory of the axis, and the reference at its samples (m)."""
    motion = RecordedMotion(AXIS, position=0.0, velocity=0.0)
    recorder = TrajectoryRecorder(RATE)
    loop, controller = SampledLoop(motion, RATE, start=0), Controller(law, MOTION.reference)
    simulate_sampled(loop, motion, controller, duration, CycleMeter(20), recorder=recorder)
    moved = recorder.trajectory()
    return moved, np.array([MOTION.at(time) for time in moved.time])


if __name__ == "__main__":
    moved, reference = simulate(PositionServo(force_limit=FORCE_LIMIT))
    error = reference - moved.position
    rms, largest = np.sqrt(np.mean(error**2)), np.abs(error).max()
    print(f"tracking error: rms {1e3 * rms:.3f} mm, max {1e3 * largest:.3f} mm")
    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    above, middle, below = figure.subplots(3, 1, sharex=True)
    above.plot(moved.time, 1e3 * reference, "--", moved.time, 1e3 * moved.position)
    above.set(ylabel="position, mm\n(dashed: reference)")
    middle.plot(moved.time, 1e3 * error)
    middle.set(ylabel="tracking error, mm")
    below.plot(moved.time, moved.control_force)
    below.set(xlabel="time, s", ylabel="control force, N")
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build")
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "position_servo.png")
