"""The motion of a drive, integrated to machine precision.

The names below are loaded when they are first used: what only asks for a controller or a sampled
loop does without the integrator.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stickslip_ros.motion.motion import Motion, RecordedMotion

__all__ = ["Motion", "RecordedMotion"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from stickslip_ros.motion import motion

    return getattr(motion, name)
