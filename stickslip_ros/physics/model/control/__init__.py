"""The control laws: one file each, and one entry each in `CONTROL_LAWS`."""

from stickslip_ros.physics.model.control.base import ContinuousControl, ControlLaw, LinearFeedback
from stickslip_ros.physics.model.control.velocity_feedback import VelocityFeedback
from stickslip_ros.physics.model.control.washout import Washout
from stickslip_ros.samples import NO_REFERENCE, Reference

CONTROL_LAWS: dict[str, type[ControlLaw]] = {law.name: law for law in (Washout, VelocityFeedback)}
"""Every control law by its name; the first is the default.

`stickslip_ros.scenarios.foreign_laws` adds those of other packages, found by their entry points.
"""

__all__ = [
    "CONTROL_LAWS",
    "NO_REFERENCE",
    "ContinuousControl",
    "ControlLaw",
    "LinearFeedback",
    "Reference",
    "VelocityFeedback",
    "Washout",
]
