"""Shared memory of this machine; ROS needs a little of it to load."""

import os
from pathlib import Path

from stickslip_ros.errors import RunError

SHARED_MEMORY = Path("/dev/shm")
_TRACING_FILES = 2
"""Files of one page each that the tracing library of ROS writes when it is loaded."""


def free_shared_memory() -> int:
    """Return how many bytes of shared memory are free."""
    found = os.statvfs(SHARED_MEMORY)
    return found.f_bavail * found.f_frsize


def check_shared_memory() -> None:
    """Raise RunError if loading ROS would end this process by SIGBUS."""
    least = _TRACING_FILES * os.sysconf("SC_PAGESIZE")
    if not SHARED_MEMORY.is_dir() or free_shared_memory() >= least:
        return
    written = [file for file in SHARED_MEMORY.glob("lttng-ust-wait-*") if file.stat().st_blocks > 0]
    if len(written) < _TRACING_FILES:
        raise RunError(
            f"shared memory is full: {SHARED_MEMORY} has {free_shared_memory()} bytes free, and "
            f"ROS needs {least} to load; remove unused files there"
        )
