"""Recurrence: a phase that starts as an earlier one did, to the last bit, is the same phase."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle

from stickslip_ros.model.hybrid import Mode
from stickslip_ros.motion.phase import Phase

_MOST_PHASES = 10_000
"""Phases that are kept, at most."""


@dataclass(slots=True)
class KnownPhase:
    """Start of a phase, and what passes then, up to a guard."""

    mode: Mode
    state: bytes
    """State at its start, before the mode is entered."""
    phase: Phase


class Recurrence:
    """Phases of one advance of an autonomous system, up to the first that is known."""

    def __init__(self) -> None:
        self._phases: list[KnownPhase] = []
        self._numbers: dict[tuple[Mode, bytes], int] = {}

    def is_known(self, phase: Phase, mode: Mode, state: "memoryview[float]") -> bool:
        """Note a phase, and the mode and the state of the next; return if that is known."""
        phases, values = self._phases, state.tobytes()
        if phases:
            phases[-1].phase = phase
        first = self._numbers.setdefault((mode, values), len(phases))
        if first < len(phases):
            self._phases = phases[first:]
            return True
        if first < _MOST_PHASES:
            phases.append(KnownPhase(mode, values, phase))
        return False

    def phases(self) -> Iterator[KnownPhase]:
        """Return the phases that follow, without end, once `is_known` has returned True."""
        return cycle(self._phases)
