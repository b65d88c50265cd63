"""The drives of the two shipped scenarios, reference values of limit cycles, and their measures."""

from typing import NamedTuple

from stickslip_ros.measures.cycle_measures import Measures
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.model.actuator import Actuator
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Stribeck
from stickslip_ros.motion import RecordedMotion

PAPER = Drive(
    mass=1.0,
    damping=0.02,
    stiffness=1.0,
    normal_force=1.0,
    belt_speed=0.4,
    friction=Stribeck(static=0.4, minimum=0.25, minimum_speed=0.5),
)
"""Scales of one: its SI numbers are the dimensionless ones."""

FEED_DRIVE = Drive(
    mass=100.0,
    damping=200.0,
    stiffness=1e6,
    normal_force=1000.0,
    belt_speed=0.04,
    friction=Stribeck(static=0.4, minimum=0.25, minimum_speed=0.05),
)
"""The same drive in other units: 100 rad/s, 1 mm and 0.1 m/s instead of one."""


def lag(time_constant: float) -> Actuator:
    """An actuator that only lags, by a time constant in s."""
    return Actuator(time_constant=time_constant)


class LimitCycle(NamedTuple):
    belt_speed: float
    amplitude: float
    velocity_amplitude: float
    stick_fraction: float
    period: float
    midpoint: float


LIMIT_CYCLES = [
    LimitCycle(0.2, 0.318603222, 0.259152231, 0.285506954, 7.06772953, 0.261039897),
    LimitCycle(0.3, 0.394200937, 0.346695251, 0.204072402, 6.61204441, 0.275610715),
    LimitCycle(0.4, 0.434086183, 0.414381028, 0.100062954, 6.39242362, 0.326321421),
    LimitCycle(0.46, 0.337968726, 0.335036166, 0.0, 6.36478480, 0.313080028),
]
"""Of the paper's drive, computed with another integrator, to nine digits."""


def settled(motion: RecordedMotion, transient: float, measured: float, window: int = 1) -> Measures:
    """The measures of what a motion does after a transient; both last so many natural periods."""
    period = motion.drive.natural_period
    motion.advance(transient * period)
    motion.take_breakpoints()
    motion.advance(measured * period)
    meter = CycleMeter(window)
    meter.feed(motion.take_breakpoints(), motion.drive.belt_speed)
    if motion.unbounded:
        meter.unbounded = True
    return meter.measures()
