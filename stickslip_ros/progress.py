"""How a long computation tells how far it is."""

from collections.abc import Callable

Progress = Callable[[float], None]
"""Takes the share that is done, from 0 to 1."""
