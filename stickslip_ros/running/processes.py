"""The processes of a run: started, watched and ended together."""

import subprocess
import time
from collections.abc import Sequence

from stickslip_ros.nodes.base.child_process import GUARD_TIMEOUT, start_child

EXIT_TIMEOUT = 2.0 * GUARD_TIMEOUT + 2.0
"""Time, s, that all of them have to end."""


class Processes:
    """Processes by the names of their nodes."""

    def __init__(self) -> None:
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, command: Sequence[str], *, guarded: bool = False) -> None:
        """Start a command as `start_child` does."""
        self._processes[name] = start_child(command, guarded=guarded)

    def rename(self, name: str, new_name: str) -> None:
        """Call a process by another name from now on."""
        self._processes[new_name] = self._processes.pop(name)

    def ended(self) -> dict[str, int]:
        """Return the return code of each process that has ended."""
        codes = {name: process.poll() for name, process in self._processes.items()}
        return {name: code for name, code in codes.items() if code is not None}

    def end(self) -> list[str]:
        """End all processes; return the names of those that had to be killed."""
        for process in self._processes.values():
            process.terminate()
        deadline = time.monotonic() + EXIT_TIMEOUT
        killed: list[str] = []
        for name, process in self._processes.items():
            try:
                process.wait(max(deadline - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                killed.append(name)
        return killed
