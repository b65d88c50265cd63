"""The callback by which a long computation reports its progress."""

from collections.abc import Callable

Progress = Callable[[float], None]
"""Receives the completed fraction, from 0 to 1."""
