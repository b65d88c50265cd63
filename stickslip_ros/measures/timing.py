"""How well a run kept its time."""

from typing import NamedTuple

NOTABLE_SHARE = 0.01
"""Share of the forces or samples above which it matters that they came late."""


class Timing(NamedTuple):
    """Counts of a plant: its samples, and those that were not served in time."""

    samples: int
    late_forces: int
    """Samples whose force had not arrived when it was due."""
    missed_deadlines: int
    """Samples that were published after the next one was due."""

    @property
    def in_time(self) -> bool:
        """Whether at most 1 % of the forces came late."""
        return self.late_forces <= NOTABLE_SHARE * self.samples

    def warning(self, which: str = "") -> str:
        """Return what came late in more than 1 % of the samples, and a remedy; else nothing.

        `which` says of which samples, as in "latest ".
        """
        causes = [
            f"{percentage(count / self.samples)} of the {which}{what}"
            for count, what in (
                (self.late_forces, "forces came late or not at all"),
                (self.missed_deadlines, "samples missed their deadlines"),
            )
            if count > NOTABLE_SHARE * self.samples
        ]
        if not causes:
            return ""
        return (
            f"{' and '.join(causes)}: lower rate or real_time_factor, close other busy programs, "
            "set pace to lockstep, or see that the controller answers"
        )


def percentage(share: float) -> str:
    """Return a share as a percentage with two significant digits."""
    return f"{float(f'{100.0 * share:.2g}'):g} %"
