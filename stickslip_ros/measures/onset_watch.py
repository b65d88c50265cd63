"""The onset of vibration of a running machine, from the ring-downs of its last seconds."""

from math import inf

import numpy as np

from stickslip_ros.measures.onset import Onset, onset_of
from stickslip_ros.measures.ring_down import RingDown, ring_downs
from stickslip_ros.samples import NO_SAMPLES, SampleColumns
from stickslip_ros.stamps import NANOSECONDS

_WINDOW, _LONG = 8, 4
"""Time that a watch keeps, and length of a ring-down that need not have ended, in its pauses."""
_MOST_KEPT, _MOST_SAMPLES = 300, 100_000
"""Number of ring-downs and of samples that it keeps at most."""


class OnsetWatch:
    """Follows the onset of a running machine by the ring-downs in its last seconds.

    The pause between its looks, 1 s, must not be shorter than the period of the vibration.
    """

    def __init__(self) -> None:
        self.ring_downs: list[RingDown] = []
        self.onset = Onset([], {})
        self.pause = 1.0
        """Time between two looks, s."""
        self._kept, self._looks, self._after = NO_SAMPLES, 0, -inf

    def feed(self, samples: SampleColumns) -> list[RingDown]:
        """Add samples, in blocks of any length; return the ring-downs that have ended with them."""
        samples = samples[samples.is_valid]
        looks = np.append(self._looks, samples.stamp // round(self.pause * NANOSECONDS))
        ended: list[RingDown] = []
        first, self._looks = 0, int(looks[-1])
        for edge in np.flatnonzero(np.diff(looks)).tolist():
            self._kept = self._kept.followed_by(samples[first:edge])
            ended, first = [*ended, *self._look()], edge
        self._kept = self._kept.followed_by(samples[first:])[-_MOST_SAMPLES:]
        if ended:
            self.ring_downs = [*self.ring_downs, *ended][-_MOST_KEPT:]
            self.onset = onset_of(self.ring_downs)
        return ended

    def _look(self) -> list[RingDown]:
        kept = self._kept
        steps = np.diff(kept.stamp)
        usual = float(np.median(steps)) if len(steps) else 0.0
        gaps = np.flatnonzero((steps <= 0) | (steps > 1.5 * usual))
        kept = kept[int(gaps[-1]) + 1 :] if len(gaps) else kept
        if usual <= 0.0:
            return []
        first = kept.stamp[-1] - round(_WINDOW * self.pause * NANOSECONDS)
        self._kept = kept = kept[kept.stamp > first]
        origin, now = kept.stamp[[0, -1]] / NANOSECONDS
        period = usual / NANOSECONDS
        after = self._after - origin if self._after < now else -inf  # a clock may be set back
        seen = ring_downs(kept.position, kept.belt_velocity, period, after)
        ended = now - origin - 2.0 * period
        long = _LONG * self.pause
        finished = [ring for ring in seen if ring.end < ended or ring.end - ring.start > long]
        self._after = origin + finished[-1].end if finished else self._after
        return finished

    def status(self, margin: float, length: str = "m") -> tuple[str, bool]:
        """Return decay, onset and feed as text, and whether the feed is too near the onset.

        It is unless a share `margin` of the feed is above the upper limit of the onset. `length` is
        the unit of positions, "" for a dimensionless drive.
        """
        if not self.ring_downs:
            return "", False
        onset, feed = self.onset, float(abs(self._kept.belt_velocity[-1]))
        scale, unit, rate = (1e3, f" m{length}/s", " 1/s") if length else (1.0, "", "")
        text = f"decay {self.ring_downs[-1].decay_rate:.2g}{rate}, "
        if onset.speed and onset.lower and onset.upper:
            half = scale * (onset.upper - onset.lower) / 2.0
            text += f"onset {scale * onset.speed:.3g} +- {half:.2g}{unit}, "
        elif onset.upper:
            text += f"onset below {scale * onset.upper:.3g}{unit}, "
        near = (onset.upper or 0.0) > (1.0 - margin) * feed
        return f"{text}feed {scale * feed:.3g}{unit}", near
