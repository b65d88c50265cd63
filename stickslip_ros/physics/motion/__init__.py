"""The motion of a drive, integrated to machine precision."""

from stickslip_ros.physics.motion.motion import Motion
from stickslip_ros.physics.motion.recorded_motion import RecordedMotion

__all__ = ["Motion", "RecordedMotion"]
