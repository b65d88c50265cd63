"""Measures of a motion: its cycles, from breakpoints or from samples."""

from stickslip_ros.physics.measures.cycle_measures import Cycle, CycleMeter, Measures, Regime

__all__ = ["Cycle", "CycleMeter", "Measures", "Regime"]
