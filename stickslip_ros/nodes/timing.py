"""Timing of a run: which forces will be late, a rate at which few would be, and what is late."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from math import floor, log10

import numpy as np

from stickslip_ros.measures.timing import NOTABLE_SHARE, Timing, percentage
from stickslip_ros.text import quantity

FORECAST_DURATION = 60.0
"""Duration of a run, s of wall time, beyond which a forecast is made."""
_SETTLED, _OBSERVED = 1.0, 2.0
"""Wall time, s, that is left out at the start, where all is done for the first time; and that is
observed."""
_CHECKS = 10
"""Number of checks of the timing over which shares are computed."""


class Forecast:
    """Observes how long the first samples of a run wait for their forces."""

    def __init__(self, rate: float, due: Callable[[int], float]) -> None:
        """Observe samples at `rate` (Hz, wall time); `due` tells when one is, s, monotonic."""
        self._rate = rate
        self._due = due
        self._next = max(round(_SETTLED * rate), 1)
        self._last = self._next + max(round(_OBSERVED * rate), 1)
        self._waits: list[float] = []
        self.sentence = ""
        """The forecast; empty until it is known."""

    def answered(self, number: int) -> None:
        """Note that the force for a sample has come: it ends the wait of those before, too."""
        if self.sentence or number < self._next:
            return
        now, last = time.monotonic(), min(number, self._last)
        self._waits += [now - self._due(sample) for sample in range(self._next, last + 1)]
        self._next = last + 1
        if number >= self._last:
            self.sentence = forecast(self._waits, self._rate)


def forecast(waits: Sequence[float], rate: float) -> str:
    """Say how many forces will be late at a rate (Hz), and a rate at which few would be.

    `waits` are the times, s, from samples to their forces. A force is late after one period, so the
    rate that would do has a period that 99 % of them do not exceed. It has one significant digit.
    """
    late = float(np.mean(np.array(waits) * rate > 1.0))
    outlook = f"{quantity(rate, 'Hz')}: about {percentage(late)} of the forces will be late"
    if late <= NOTABLE_SHARE:
        return outlook
    longest = float(np.quantile(waits, 1.0 - NOTABLE_SHARE, method="higher"))
    enough = (1.0 + 1e-9) / longest  # rounding must not cost a digit
    digit = 10.0 ** floor(log10(enough))
    return f"{outlook}; {quantity(floor(enough / digit) * digit, 'Hz')} would do"


class TimingMonitor:
    """Checks the counts of late forces and samples of a segment regularly, and reports problems."""

    def __init__(self) -> None:
        self._counts = deque([(0, 0, 0)], maxlen=_CHECKS + 1)
        self._kind = ""

    def turns_to(self, kind: str) -> bool:
        """Return whether problems are of another kind than at the last call; empty: there is none.

        At the first call the last kind is none.
        """
        before, self._kind = self._kind, kind
        return kind != before

    def check(
        self, samples: int, late_forces: int, missed_deadlines: int, *, controlled: bool
    ) -> str:
        """Return a complaint about the last calls, or an empty string.

        Without a controller, expected or not, no force can be late.
        """
        counts = samples, late_forces, missed_deadlines
        if not controlled:  # only forces after its return count
            self._counts = deque(
                ((n, late_forces, missed) for n, _, missed in self._counts), maxlen=_CHECKS + 1
            )
        before = self._counts[0]
        self._counts.append(counts)
        latest = Timing(*(now - then for now, then in zip(counts, before, strict=True)))
        few = latest.samples < 100  # too few for a meaningful share
        return "" if few else latest.warning("latest ")
