"""Measures of a motion: its cycles, from breakpoints or from samples."""

from stickslip_ros.measures.cycle_measures import Cycle, Measures, Regime
from stickslip_ros.measures.cycle_meter import CycleMeter

__all__ = ["Cycle", "CycleMeter", "Measures", "Regime"]
