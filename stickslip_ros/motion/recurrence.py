"""Recurrence: a phase that starts as an earlier one did, to the last bit, is the same phase."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle
from typing import Any

from stickslip_ros.model.hybrid import Mode

_MOST_PHASES = 10_000
"""Phases that are kept, at most."""


@dataclass(slots=True)
class Phase:
    """Phase of a motion, from one guard to the next."""

    mode: Mode
    state: bytes
    """State at its start, before the mode is entered."""
    duration: float = 0.0
    bound: float = 0.0
    """Time from its start to an end of the advance that would have shortened none of its steps."""
    kept: Any = None
    """What the motion has kept of it."""


class Recurrence:
    """Phases of one advance of an autonomous system, up to the first that is known."""

    def __init__(self) -> None:
        self._phases: list[Phase] = []
        self._numbers: dict[tuple[Mode, bytes], int] = {}

    def is_known(
        self, mode: Mode, state: "memoryview[float]", duration: float, bound: float, kept: Any
    ) -> bool:
        """Note the end of a phase, and the mode and the state of the next; return if it is known.

        `duration`, `bound` and `kept` are those of the phase that ends.
        """
        phases, values = self._phases, state.tobytes()
        if phases:
            last = phases[-1]
            last.duration, last.bound, last.kept = duration, bound, kept
        first = self._numbers.setdefault((mode, values), len(phases))
        if first < len(phases):
            self._phases = phases[first:]
            return True
        if first < _MOST_PHASES:
            phases.append(Phase(mode, values))
        return False

    def phases(self) -> Iterator[Phase]:
        """Return the phases that follow, without end, once `is_known` has returned True."""
        return cycle(self._phases)
