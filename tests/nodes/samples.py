"""Messages that an observer receives from a plant."""

import time
from itertools import pairwise

from stickslip_ros.record.codec import unpack_header
from stickslip_ros.record.topics import JOINT_STATES
from tests.nodes.graph import Graph


class Samples:
    """Stamps of the joint states that the observer hears, and when it heard them."""

    def __init__(self, graph: Graph) -> None:
        self.stamps: list[int] = []
        self.arrivals: list[float] = []
        self._graph = graph
        graph.subscribe(JOINT_STATES, self._take)

    def _take(self, message: bytes) -> None:
        self.arrivals.append(time.monotonic())
        self.stamps.append(unpack_header(message))

    def wait_for(self, count: int) -> None:
        """Wait until as many further samples have come."""
        enough = len(self.stamps) + count
        self._graph.wait_until(lambda: len(self.stamps) >= enough, f"{count} further samples")

    def gaps(self, first: int = 0) -> list[float]:
        """Return the times, s, between samples that follow each other."""
        return [b - a for a, b in pairwise(self.arrivals[first:])]
