"""The exact motion of a drive."""

from stickslip_ros.physics.motion.motion import Motion

__all__ = ["Motion"]
