"""Stamps: instants of simulated time in nanoseconds, as ROS counts it."""

NANOSECONDS = 1_000_000_000
"""Nanoseconds in a second."""

END_OF_TIME = 2**31 * NANOSECONDS
"""Stamp, ns, beyond ROS time; only a message whose nanoseconds exceed a second can reach it."""

STAMP_ROUNDING = 1e-9
"""Time by which rounding to whole nanoseconds may shorten the time between two stamps, s."""
