"""Test harness that runs the closed loop with your own controller."""

from stickslip_ros.nodes.base.network import own_domain
from stickslip_ros.testing.closed_loop import ClosedLoop, Controller
from stickslip_ros.testing.result import Diagnostics, RunResult

__all__ = ["ClosedLoop", "Controller", "Diagnostics", "RunResult", "own_domain"]
