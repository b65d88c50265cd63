"""Forces on their way from a controller to the drive: each arrives after a delay that may vary."""

from collections import deque
from collections.abc import Iterator
from math import floor
from random import Random


class ForcesUnderWay:
    """Forces that were sent and have not arrived; times are in sample periods.

    Without jitter force n, the answer to sample n, arrives at n + delay. The jitter adds a share of
    itself, uniformly distributed and independent from force to force. A force that would arrive
    after a newer one is lost.
    """

    def __init__(self, delay: float, jitter: float, seed: int) -> None:
        """Delay the forces by `delay` at least, and by `jitter` more at most."""
        self._delay, self._jitter = delay, jitter
        self._shortest = whole, rest = whole_and_rest(delay)
        # The only generator with a guarantee that its numbers stay the same.
        self._random = Random(seed)
        # In the order of arrival: number of the period, elapsed share of it, force, and number of
        # the sample that it answers, -1 for no sample, as before force 0.
        self._forces = deque((number, rest, 0.0, -1) for number in range(whole))
        self._acting_number = -1
        self.immediate = self._shortest == (0, 0.0) and jitter == 0.0
        """Whether each force acts immediately: then none that answers a sample is under way."""

    def send(self, number: int, answered: int, force: float) -> Iterator[tuple[int, float]]:
        """Send a force (N) at a sample; yield the number and the force of those that it overtakes.

        `answered` is the number of the sample that the force answers.
        """
        whole, rest = self._shortest
        if self._jitter > 0.0:
            whole, rest = whole_and_rest(self._delay + self._jitter * self._random.random())
            lost: dict[int, float] = {}
            while self._forces and self._forces[-1][:2] >= (number + whole, rest):
                _, _, overtaken, overtaken_number = self._forces.pop()
                lost[overtaken_number] = overtaken
            # A force that replaces others is under way several times.
            left = {answered, *(entry[3] for entry in self._forces)}
            for each in sorted(lost.keys() - left):
                if each > self._acting_number:
                    yield each, lost[each]
        self._forces.append((number + whole, rest, force, answered))

    def send_late(self, number: int, late: float, force: float) -> None:
        """Send a force (N) that answers no sample, `late` after a sample, without jitter."""
        whole, rest = whole_and_rest(late + self._delay)
        self._forces.append((number + whole, rest, force, -1))

    def arriving(self, number: int) -> Iterator[tuple[float, float]]:
        """Take the forces (N) that arrive in the period after a sample, each with its instant.

        In periods since the sample.
        """
        forces = self._forces
        while forces and forces[0][0] == number:
            _, instant, force, answered = forces.popleft()
            self._acting_number = max(self._acting_number, answered)
            yield instant, force


def whole_and_rest(delay: float) -> tuple[int, float]:
    """Split a delay in periods into whole periods and the remainder, ignoring rounding errors."""
    whole = round(delay)
    if abs(delay - whole) < 1e-9:
        return whole, 0.0
    return floor(delay), delay - floor(delay)
