"""Check whether forces and samples are in time, from the share of recent late ones."""

from collections import deque

_WINDOW = 10
"""Number of calls over which shares are computed."""


class Punctuality:
    """Checks the counts of a segment regularly, and reports problems."""

    def __init__(self) -> None:
        self._counts = deque([(0, 0, 0)], maxlen=_WINDOW + 1)

    def look(
        self, samples: int, late_forces: int, missed_deadlines: int, *, controlled: bool
    ) -> str:
        """Return a complaint about the last calls, or an empty string.

        Without a controller, expected or not, no force can be late.
        """
        counts = samples, late_forces, missed_deadlines
        if not controlled:  # only forces after its return count
            self._counts = deque(
                ((n, late_forces, missed) for n, _, missed in self._counts), maxlen=_WINDOW + 1
            )
        before = self._counts[0]
        self._counts.append(counts)
        number, late, missed = (now - then for now, then in zip(counts, before, strict=True))
        if number < 100:  # too few for a meaningful share
            return ""
        found = [
            f"{100.0 * count / number:.2g} % of the latest {what}"
            for count, what in (
                (late, "forces came late (the last one was held)"),
                (missed, "samples missed their deadlines"),
            )
            if count > 0.01 * number
        ]
        if not found:
            return ""
        return (
            f"{' and '.join(found)}: lower rate or real_time_factor, close other busy programs, "
            "or set pace to lockstep"
        )
