"""Handle SIGINT while a process of this package is still importing."""

import os
import signal
import sys

NODE_SCRIPTS = (
    "plant_node",
    "controller_node",
    "washout_controller_node",
    "analyzer_node",
    "replay_node",
)
"""Installed scripts that start a node."""


def is_run(package: str, *scripts: str) -> bool:
    """Return whether this process runs a module of `package`, or one of the installed scripts."""
    if sys.argv[:1] == ["-m"]:
        return any(word.startswith(f"{package}.") for word in sys.orig_argv)
    return os.path.basename("".join(sys.argv[:1])) in scripts


def end_quietly_if_interrupted() -> None:
    """Let SIGINT end this process without a traceback until the program handles it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def raise_interrupts() -> None:
    """Let SIGINT raise KeyboardInterrupt again instead of ending this process quietly."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)
