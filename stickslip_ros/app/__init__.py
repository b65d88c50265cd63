"""The commands of `stickslip`, one file each."""

INTERRUPTED = 130
"""Exit status of a command that a signal has ended."""
