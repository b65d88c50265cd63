"""The ROS 2 nodes: thin shells around the physics, and their bringup."""

import os
import signal
import sys
from pathlib import Path

from stickslip_ros.errors import RunError

SHARED_MEMORY = Path("/dev/shm")
_TRACING, _TRACING_FILES = "lttng-ust-wait-*", 2
"""A page each, which the tracing library of ROS writes to when it is loaded."""


def end_quietly_if_interrupted() -> None:
    """Let SIGINT end this process without a traceback, until what it runs handles it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def free_shared_memory() -> int:
    """Return how many bytes of shared memory are free."""
    found = os.statvfs(SHARED_MEMORY)
    return found.f_bavail * found.f_frsize


def check_shared_memory() -> None:
    """Raise RunError where loading ROS would end this process by SIGBUS."""
    least = _TRACING_FILES * os.sysconf("SC_PAGESIZE")
    if not SHARED_MEMORY.is_dir() or free_shared_memory() >= least:
        return
    written = [file for file in SHARED_MEMORY.glob(_TRACING) if file.stat().st_blocks > 0]
    if len(written) < _TRACING_FILES:
        raise RunError(
            f"shared memory is full: {SHARED_MEMORY} has {free_shared_memory()} bytes free, and to "
            f"be loaded ROS needs {least}; remove what is left there"
        )


def prepare_process() -> None:
    """Prepare this process for a node, before ROS is loaded, which takes a second."""
    end_quietly_if_interrupted()
    try:
        check_shared_memory()
    except RunError as error:
        sys.exit(f"stickslip_ros: {error}")


if sys.argv[:1] == ["-m"] and any(word.startswith(f"{__name__}.") for word in sys.orig_argv):
    prepare_process()  # one of the modules here is run
