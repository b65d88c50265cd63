"""Forecast of a run in real time: which forces will be late, and a rate at which few would be."""

import time
from collections.abc import Callable, Sequence
from math import floor, log10

import numpy as np

from stickslip_ros.measures.timing import NOTABLE_SHARE, percentage
from stickslip_ros.text import quantity

FORECAST_DURATION = 60.0
"""Duration of a run, s of wall time, beyond which a forecast is made."""
_SETTLED, _OBSERVED = 1.0, 2.0
"""Wall time, s, that is left out at the start, where all is done for the first time; and that is
observed."""


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
