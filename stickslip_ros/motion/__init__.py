"""The motion of a drive, integrated to machine precision."""

from stickslip_ros.motion.motion import Motion, RecordedMotion

__all__ = ["Motion", "RecordedMotion"]
