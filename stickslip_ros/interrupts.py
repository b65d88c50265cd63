"""Handle SIGINT while a process of this package is still importing, or puts a file in its place."""

import os
import signal
import sys
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

NODE_SCRIPTS = (
    "plant_node",
    "controller_node",
    "washout_controller_node",
    "analyzer_node",
    "replay_node",
)
"""Installed scripts that start a node."""

_IMPORT_TIME = 0.05
"""Time, s, after which an interrupt amid an import is tried again."""


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
    """Let SIGINT raise KeyboardInterrupt instead of ending this process quietly."""
    if signal.getsignal(signal.SIGINT) in (signal.SIG_DFL, signal.default_int_handler):
        signal.signal(signal.SIGINT, _raise_after_import)


def _raise_after_import(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt; amid the import of a C extension it would be an ImportError."""
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    if frame is None:
        raise KeyboardInterrupt

    def interrupt(*_: object) -> None:
        signal.raise_signal(number)

    signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, _IMPORT_TIME)


@contextmanager
def interrupts_wait() -> Generator[None]:
    """Let a SIGINT that comes during this block count only after it."""
    came: list[int] = []
    try:
        before = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    except ValueError:  # only the main thread gets signals, and may set handlers
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before or signal.SIG_DFL)
        if came:
            signal.raise_signal(signal.SIGINT)
