"""How well the plant of a recording keeps its time, by its diagnostics."""

import time

from diagnostic_msgs.msg import DiagnosticArray

from stickslip_ros.measures.timing import Timing
from stickslip_ros.nodes.base.clients import NEXT_TRANSITION
from stickslip_ros.nodes.base.managed import FIRST_STAMP, STATE
from stickslip_ros.text import number_in


class PlantTiming:
    """Adds up the counts of a plant over its activations.

    What a paused plant repeats is left out: it may be from before this recording.
    """

    def __init__(self, plant: str) -> None:
        """Count from now on; `plant` is the full name of the node."""
        self._plant, self._since = plant, time.time_ns()
        self._activations: dict[str, Timing] = {}

    @property
    def total(self) -> Timing | None:
        """The counts of all activations; None if there is none."""
        counts = self._activations.values()
        return Timing(*map(sum, zip(*counts, strict=True))) if counts else None

    @property
    def complete(self) -> bool:
        """Whether all counts are of this recording: the plant started while it went on.

        The stamps of lockstep are no time of day, and do not tell that.
        """
        return all(number_in(first) >= self._since for first in self._activations)

    def take(self, health: DiagnosticArray) -> None:
        """Take the counts of the plant's activation, if they are there."""
        for status in health.status:
            values = {entry.key: entry.value for entry in status.values}
            paused = values.get(STATE) in NEXT_TRANSITION
            if status.name == self._plant and FIRST_STAMP in values and not paused:
                counts = (int(number_in(values.get(name, ""))) for name in Timing._fields)
                self._activations[values[FIRST_STAMP]] = Timing(*counts)
