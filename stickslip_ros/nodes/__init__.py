"""The ROS 2 nodes: thin shells around the physics, and their bringup."""

import signal
import sys


def end_quietly_if_interrupted() -> None:
    """Let SIGINT end this process without a traceback, until what it runs handles it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


if sys.argv[:1] == ["-m"] and any(word.startswith(f"{__name__}.") for word in sys.orig_argv):
    end_quietly_if_interrupted()  # one of the modules here is run, and imports for a second
