"""The control laws: one file each, and one entry each in `CONTROL_LAWS`."""

from stickslip_ros.model.control.base import ContinuousControl, ControlLaw, LinearFeedback
from stickslip_ros.model.control.cascade import Cascade
from stickslip_ros.model.control.disturbance_observer import DisturbanceObserver
from stickslip_ros.model.control.friction_feedforward import FrictionFeedforward
from stickslip_ros.model.control.lugre_observer import LugreObserver
from stickslip_ros.model.control.pid import Pid
from stickslip_ros.model.control.reset_integral import ResetIntegral
from stickslip_ros.model.control.sliding_mode import SlidingMode
from stickslip_ros.model.control.velocity_feedback import VelocityFeedback
from stickslip_ros.model.control.washout import Washout
from stickslip_ros.samples import NO_REFERENCE, Reference

CONTROL_LAWS: dict[str, type[ControlLaw]] = {
    law.name: law
    for law in (
        Washout,
        VelocityFeedback,
        Cascade,
        Pid,
        DisturbanceObserver,
        SlidingMode,
        ResetIntegral,
        FrictionFeedforward,
        LugreObserver,
    )
}
"""Every control law by its name; the first is the default.

`stickslip_ros.scenarios.foreign_laws` adds those of other packages, found by their entry points.
"""

__all__ = [
    "CONTROL_LAWS",
    "NO_REFERENCE",
    "Cascade",
    "ContinuousControl",
    "ControlLaw",
    "DisturbanceObserver",
    "FrictionFeedforward",
    "LinearFeedback",
    "LugreObserver",
    "Pid",
    "Reference",
    "ResetIntegral",
    "SlidingMode",
    "VelocityFeedback",
    "Washout",
]
