"""What the web libraries log: a message is one line, and there are not many of them.

Whoever sends a request, such as a page of another web site, chooses parts of the messages.
"""

import logging
import sys
from pathlib import Path
from time import monotonic
from traceback import extract_tb
from typing import TextIO

from stickslip_ros.text import printable

_MOST_LINES, _PERIOD = 10, 60.0
"""Lines that are printed in each period, s."""
_LONGEST_LINE = 300


class WebLog(logging.StreamHandler[TextIO]):
    """Handler that prints messages to stderr, with errors named, but not where they occurred."""

    def __init__(self) -> None:
        super().__init__(sys.stderr)
        self._begun, self._lines = -_PERIOD, 0

    def format(self, record: logging.LogRecord) -> str:
        """Return a message on one line, with control characters escaped."""
        text, error = record.getMessage().strip(), record.exc_info and record.exc_info[1]
        frames = extract_tb(error.__traceback__)[-1:] if error else []
        if any(Path(frame.filename).parent.name in ("engineio", "socketio") for frame in frames):
            text = "a client sent a message that no page sends"
        if error:
            text = repr(error) if text == str(error).strip() else f"{text}: {error!r}"
        line = printable(text)
        return line if len(line) <= _LONGEST_LINE else f"{line[:_LONGEST_LINE]}..."

    def emit(self, record: logging.LogRecord) -> None:
        """Print a message, unless there were too many in this period."""
        if record.name == "nicegui" and record.stack_info:
            return  # a page was updated that has been closed: nobody misses it
        now = monotonic()
        if now - self._begun >= _PERIOD:
            self._begun, self._lines = now, 0
        self._lines += 1
        if self._lines <= _MOST_LINES:
            super().emit(record)
        elif self._lines == _MOST_LINES + 1:
            self.stream.write(f"further messages within {_PERIOD:.0f} s are not shown\n")
            self.flush()


def log_here_alone() -> None:
    """Let what all libraries log go through one `WebLog`; some have handlers of their own."""
    logging.basicConfig(handlers=[WebLog()], level=logging.WARNING, force=True)
    for name in logging.root.manager.loggerDict:
        logging.getLogger(name).handlers.clear()
