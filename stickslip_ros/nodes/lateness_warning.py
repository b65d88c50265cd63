"""Whether forces and samples are in time: the share of those that were late lately, and why."""

from collections import deque

_WINDOW = 10
"""Looks over which shares are taken."""


class Punctuality:
    """Looks at the counts of a segment every now and then, and says what is wrong with them."""

    def __init__(self) -> None:
        self._counts = deque([(0, 0, 0)], maxlen=_WINDOW + 1)

    def look(
        self, samples: int, late_forces: int, missed_deadlines: int, *, controlled: bool
    ) -> str:
        """Return what there is to complain of in the last looks, if anything.

        While there is no controller, be it that none is expected, no force can be late.
        """
        counts = samples, late_forces, missed_deadlines
        if not controlled:  # from when there is one again its own forces count
            self._counts = deque(
                ((n, late_forces, missed) for n, _, missed in self._counts), maxlen=_WINDOW + 1
            )
        before = self._counts[0]
        self._counts.append(counts)
        number, late, missed = (now - then for now, then in zip(counts, before, strict=True))
        if number < 100:  # too few for a share of them to say anything
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
            f"{' and '.join(found)}: lower rate or real_time_factor, close what else is busy here, "
            "or set pace to lockstep"
        )
