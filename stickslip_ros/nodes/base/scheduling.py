"""Real-time scheduling of this process: priority, processor, memory; and what sleeping misses."""

import ctypes
import os
import resource
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from errno import EPERM
from itertools import count
from pathlib import Path
from typing import Any

from stickslip_ros.scenarios.parameter_group import NodeParameters

_THREADS = Path("/proc/self/task")
_MCL_CURRENT_AND_FUTURE = 3


def schedule_process(parameters: NodeParameters) -> list[str]:
    """Schedule the threads of this process, and those that they start, as the parameters say.

    Return a sentence for each parameter that this system refuses. At its default a parameter
    changes nothing, so that one of several nodes in a process may set it.
    """
    refused: list[str] = []
    for name, (apply, remedy) in _APPLIED.items():
        value = getattr(parameters, name)
        if value == parameters.known[name].default:
            continue
        if not _THREADS.is_dir():
            refused.append(f"{name} = {value} has no effect: it needs Linux")
            continue
        try:
            apply(value)
        except OSError as error:
            refused.append(f"{name} = {value} has no effect: {error.strerror}; {remedy}")
    return refused


def share_missed(period: float, duration: float = 1.0) -> float:
    """Return the share of deadlines that a loop misses here that only sleeps until each one.

    It is what Python can reach on this machine at this `period` (s) now, without any node.
    """
    started, missed, number = time.monotonic(), 0, 0
    for number in count(1):
        deadline = started + number * period
        time.sleep(max(deadline - time.monotonic(), 0.0))
        missed += time.monotonic() - deadline > period
        if deadline - started >= duration:
            break
    return missed / number


def _set_priority(priority: int) -> None:
    _for_threads(os.sched_setscheduler, os.SCHED_FIFO, os.sched_param(priority))


def _set_affinity(processor: int) -> None:
    _for_threads(os.sched_setaffinity, {processor})


def _for_threads(apply: Callable[..., object], *values: Any) -> None:
    for thread in _THREADS.iterdir():
        with suppress(ProcessLookupError):  # it ended meanwhile
            apply(int(thread.name), *values)


def _lock_memory(_: bool) -> None:
    # Below an unlimited bound it would succeed now, and later allocations would fail.
    unlimited = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY
    if not unlimited and os.geteuid() != 0:
        raise PermissionError(EPERM, "the memory that this user may lock is limited")
    library = ctypes.CDLL(None, use_errno=True)
    if library.mlockall(_MCL_CURRENT_AND_FUTURE):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


_LIMITS = "see /etc/security/limits.conf"
_APPLIED: Mapping[str, tuple[Callable[[Any], None], str]] = {
    "thread_priority": (_set_priority, f"allow it by a line `@realtime - rtprio 99`, {_LIMITS}"),
    "cpu_affinity": (_set_affinity, f"this machine has {os.cpu_count()} processors, from 0"),
    "lock_memory": (_lock_memory, f"allow it by a line `@realtime - memlock unlimited`, {_LIMITS}"),
}
