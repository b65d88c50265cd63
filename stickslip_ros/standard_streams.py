"""Replace standard streams that are closed."""

import os
import sys
from typing import TextIO, cast


def open_closed_streams() -> None:
    """Redirect the closed standard streams to the null device.

    Otherwise the next file or socket gets the file descriptor of a stream, and other code writes
    to it.
    """
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free descriptor: this one
            os.set_inheritable(number, True)
        if getattr(sys, name) is None:
            setattr(sys, name, nowhere(mode))


def nowhere(mode: str = "w") -> TextIO:
    """Return a substitute for a standard stream; the interpreter flushes them at exit."""
    return cast(TextIO, open(os.devnull, mode, encoding="utf-8"))
