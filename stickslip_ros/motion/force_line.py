"""The line from a controller to the drive: each force arrives after a delay that may vary."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from math import floor
from random import Random

Overtaken = tuple[int, float]
"""Number of the sample that a lost force answers, and the force (N)."""


class ForceLine:
    """Forces that were sent and have not arrived, and the one that acts; times are in periods.

    Without jitter force n, the answer to sample n, arrives at n + delay. The jitter adds a share of
    itself, uniformly distributed and independent from force to force. A force that would arrive
    after a newer one is lost.
    """

    def __init__(self, delay: float, jitter: float, seed: int) -> None:
        """Delay the forces by `delay` at least, and by `jitter` more at most."""
        self.acting = 0.0
        """Force that has arrived last, N, as the limiter left it."""
        self.limiter: Callable[[float], float] | None = None
        """Limits a force that arrives, see `Actuator.limiter`."""
        self.by_arrival = False
        """Whether commands that answer no sample are sent: then no answers are."""
        self._delay, self._jitter = delay, jitter
        self._shortest = whole, rest = whole_and_rest(delay)
        # The only generator with a guarantee that its numbers stay the same.
        self._random = Random(seed)
        # In the order of arrival: number of the period, elapsed share of it, force, and number of
        # the sample that it answers, -1 for no sample, as before force 0.
        self._under_way = deque((number, rest, 0.0, -1) for number in range(whole))
        self._acting_number = -1
        self.immediate = self._shortest == (0, 0.0) and jitter == 0.0
        """Whether each force acts when it is sent: then none is under way."""

    def send(self, number: int, answered: int, force: float) -> Iterable[Overtaken]:
        """Send a force (N) at a sample; return those that it overtakes.

        `answered` is the number of the sample that the force answers.
        """
        if self.immediate:
            self.acting = force if self.limiter is None else self.limiter(force)
            return ()
        whole, rest = self._shortest
        overtaken: Iterable[Overtaken] = ()
        if self._jitter > 0.0:
            whole, rest = whole_and_rest(self._delay + self._jitter * self._random.random())
            overtaken = self._overtake((number + whole, rest), answered)
        self._under_way.append((number + whole, rest, force, answered))
        return overtaken

    def _overtake(self, arrival: tuple[int, float], answered: int) -> list[Overtaken]:
        """Take away what would not arrive before a newer force."""
        lost: dict[int, float] = {}
        while self._under_way and self._under_way[-1][:2] >= arrival:
            _, _, force, number = self._under_way.pop()
            lost[number] = force
        # A force that replaces others is under way several times.
        left = {answered, *(entry[3] for entry in self._under_way)}
        numbers = sorted(lost.keys() - left)
        return [(number, lost[number]) for number in numbers if number > self._acting_number]

    def command(self, number: int, late: float, force: float) -> None:
        """Send a force (N) that answers no sample, `late` after a sample, without jitter."""
        whole, rest = whole_and_rest(late + self._delay)
        self._under_way.append((number + whole, rest, force, -1))
        self.by_arrival, self.immediate = True, False

    def arrivals(self, number: int) -> Iterator[float]:
        """Yield the instants after a sample, within its period, before a force starts to act."""
        under_way = self._under_way
        while under_way and under_way[0][0] == number:
            _, instant, force, answered = under_way.popleft()
            self._acting_number = max(self._acting_number, answered)
            yield instant
            self.acting = force if self.limiter is None else self.limiter(force)


def whole_and_rest(delay: float) -> tuple[int, float]:
    """Split a delay in periods into whole periods and the remainder, ignoring rounding errors."""
    whole = round(delay)
    if abs(delay - whole) < 1e-9:
        return whole, 0.0
    return floor(delay), delay - floor(delay)
