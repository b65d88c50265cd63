"""Child processes that end with their parent, however the parent ends.

As a program (`python -m stickslip_ros.nodes.base.child_process COMMAND …`) this module guards an
arbitrary command and all its children. It does not load ROS, so that it starts quickly.
"""

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress

GUARD_TIMEOUT = 3.0
"""Time, s, for a guarded command to end after SIGINT, and again after SIGTERM."""

EXIT_TIMEOUT = 2.0 * GUARD_TIMEOUT + 2.0
"""Time, s, for children to end after SIGTERM."""

_PARENT_VARIABLE = "STICKSLIP_ROS_PARENT"


def start_child(command: Sequence[str], *, guarded: bool = False) -> subprocess.Popen[bytes]:
    """Start a command that ends with this process; its output goes to standard error.

    Either the command calls `die_with_parent`, or it is guarded: then SIGTERM to the returned
    process ends the command and its children by SIGINT, SIGTERM and SIGKILL in turn.
    """
    guard = [sys.executable, "-m", __name__] if guarded else []
    return subprocess.Popen(
        [*guard, *command],
        env=os.environ | {_PARENT_VARIABLE: str(os.getpid())},
        stdin=subprocess.DEVNULL,
        stdout=2,  # not sys.stderr, which may be replaced by an object that is no file
        start_new_session=True,  # Ctrl-C reaches this process only, which ends them in order
    )


class ChildProcesses:
    """Children of this process by name, which are watched, and ended together."""

    def __init__(self) -> None:
        self._children: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, command: Sequence[str], *, guarded: bool = False) -> None:
        """Start a child, as `start_child` does."""
        self._children[name] = start_child(command, guarded=guarded)

    def rename(self, name: str, new: str) -> None:
        """Give a child another name."""
        self._children[new] = self._children.pop(name)

    def ended(self) -> dict[str, int]:
        """Return the return codes of the children that have ended."""
        codes = {name: child.poll() for name, child in self._children.items()}
        return {name: code for name, code in codes.items() if code is not None}

    def end(self) -> list[str]:
        """End all of them; return the names of those that did not end within EXIT_TIMEOUT."""
        for child in self._children.values():
            child.terminate()
        deadline, killed = time.monotonic() + EXIT_TIMEOUT, list[str]()
        for name, child in self._children.items():
            try:
                child.wait(max(deadline - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                killed.append(name)
                child.kill()
                child.wait()
        return killed


def how_it_ended(status: int) -> str:
    """Return in words how a process ended, from its return code."""
    return f"killed by signal {-status}" if status < 0 else f"exit status {status}"


def die_with_parent() -> None:
    """Have SIGTERM sent to this process when the parent that used `start_child` ends.

    Linux only; on other systems this does nothing.
    """
    parent = os.environ.pop(_PARENT_VARIABLE, "")
    if parent:
        end_with(int(parent))


def end_with(parent: int) -> None:
    """Have SIGTERM sent to this process when its parent, with that process number, ends.

    Linux only; on other systems this does nothing.
    """
    if sys.platform == "linux":
        _signal_at_death_of_parent(signal.SIGTERM)
        if os.getppid() != parent:
            sys.exit(1)


def main() -> None:
    """Run the command in the arguments; end with its status, or end it on SIGTERM."""
    die_with_parent()
    # The command may belong to another Python environment, which must find its own libraries.
    os.environ.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None)
    awaited = {signal.SIGTERM, signal.SIGCHLD}
    signal.pthread_sigmask(signal.SIG_BLOCK, awaited)

    def prepare() -> None:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, awaited)
        if sys.platform == "linux":
            _signal_at_death_of_parent(signal.SIGKILL)

    try:
        child = subprocess.Popen(sys.argv[1:], process_group=0, preexec_fn=prepare)
    except OSError as error:
        sys.exit(f"{sys.argv[1]} cannot be started: {error.strerror}")
    while child.poll() is None:
        if signal.sigwait(awaited) == signal.SIGTERM:
            _end(child)
    with suppress(ProcessLookupError):  # children that it left behind
        os.killpg(child.pid, signal.SIGKILL)
    if child.returncode < 0:
        number = -child.returncode
        with suppress(OSError):  # SIGKILL has no handler
            signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {number})
        os.kill(os.getpid(), number)
    sys.exit(child.returncode)


def _end(child: subprocess.Popen[bytes]) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        os.killpg(child.pid, number)
        with suppress(subprocess.TimeoutExpired):
            child.wait(GUARD_TIMEOUT)
            return
    print(f"{sys.argv[1]} ends neither on SIGINT nor on SIGTERM: killed", file=sys.stderr)
    os.killpg(child.pid, signal.SIGKILL)
    child.wait()


def _signal_at_death_of_parent(number: signal.Signals) -> None:
    ctypes.CDLL(None).prctl(1, number)  # PR_SET_PDEATHSIG


if __name__ == "__main__":
    main()
