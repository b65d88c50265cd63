"""Shared memory of this machine, which ROS needs some of to be loaded."""

import os
from pathlib import Path

from stickslip_ros.errors import RunError

SHARED_MEMORY = Path("/dev/shm")
_TRACING_FILES = 2
"""A page each, which the tracing library of ROS writes to when it is loaded."""


def free_shared_memory() -> int:
    """Return how many bytes of shared memory are free."""
    found = os.statvfs(SHARED_MEMORY)
    return found.f_bavail * found.f_frsize


def check_shared_memory() -> None:
    """Raise RunError where loading ROS would end this process by SIGBUS."""
    least = _TRACING_FILES * os.sysconf("SC_PAGESIZE")
    if not SHARED_MEMORY.is_dir() or free_shared_memory() >= least:
        return
    written = [file for file in SHARED_MEMORY.glob("lttng-ust-wait-*") if file.stat().st_blocks > 0]
    if len(written) < _TRACING_FILES:
        raise RunError(
            f"shared memory is full: {SHARED_MEMORY} has {free_shared_memory()} bytes free, and to "
            f"be loaded ROS needs {least}; remove what is left there"
        )
