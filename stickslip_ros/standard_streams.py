"""Standard streams that are closed, and what stands in for them."""

import os
import sys
from typing import TextIO, cast


def open_closed_streams() -> None:
    """Let those that are closed lead nowhere.

    Otherwise the next file or socket gets the number of one, and is what others write to.
    """
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free: this one
            os.set_inheritable(number, True)
        if getattr(sys, name) is None:
            setattr(sys, name, nowhere(mode))


def nowhere(mode: str = "w") -> TextIO:
    """Return what may stand in for a standard stream: the interpreter flushes them at exit."""
    return cast(TextIO, open(os.devnull, mode, encoding="utf-8"))
