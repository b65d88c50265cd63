"""Stamps: instants of simulated time in nanoseconds, as ROS counts it."""

NANOSECONDS = 1_000_000_000
"""In a second: what stamps count."""

END_OF_TIME = 2**31 * NANOSECONDS
"""Stamp, ns, that ROS time does not reach; only nanoseconds beyond a second make one."""
