"""Answers to samples: which forces are accepted, and which replaces a missing one."""

from collections import Counter
from collections.abc import Callable
from enum import StrEnum
from math import isfinite

from stickslip_ros.motion.sampler import SampleStamps


class Verdict(StrEnum):
    """Result of offering a force to the loop."""

    ACCEPTED = "accepted"
    NOT_FINITE = "not finite"
    NO_STAMP = "zero stamp"
    UNKNOWN_STAMP = "stamp of no sample"
    ANSWERED = "already answered stamp"
    TOO_LATE = "answers a sample that has passed"
    UNASKED = "answers a sample that asks for none, by answer_every"
    OVERTAKEN = "overtaken by a newer one"
    """The force was accepted, and a newer one came before it could act."""
    SUPERSEDED = "came after the command that answers the sample"


_ACCEPTED = Verdict.ACCEPTED  # in Python 3.11 looking it up takes a thirtieth of a sample


class Answers:
    """Forces that answer samples: the newest one counts, and may replace missing ones."""

    def __init__(
        self,
        stamps: SampleStamps,
        period: float,
        *,
        force_timeout: float,
        hold_late: bool,
        expects_control: bool,
        overtaken: Callable[[int, float], None],
        every: int,
    ) -> None:
        """Take answers to samples with these stamps, `period` (s) apart; see `SampledLoop`."""
        self.every = every
        """Samples from one that asks for a force to the next."""
        self._asked = 0
        self.late_forces = 0
        """Number of samples that the last force asked for did not reach in time."""
        self.silent_samples = 0
        """Number of samples that no command answered, see `hold`."""
        self.dropped: Counter[Verdict] = Counter()
        """Number of forces that did not act, by reason."""
        self.controller_present = expects_control
        """Whether an answer to the present sample can be expected: one came since the last gap."""
        self._stamps, self._period, self._timeout = stamps, period, force_timeout
        self._hold_late, self._expects_control = hold_late, expects_control
        self._overtaken = overtaken
        self._newest: tuple[int, float] = (-1, 0.0)
        self._newest_sent = -1

    @property
    def newest(self) -> int:
        """Number of the newest sample that is answered, -1 for none."""
        return self._newest[0]

    @property
    def force(self) -> float:
        """The newest force, N; 0 before the first."""
        return self._newest[1]

    def asks(self, number: int) -> bool:
        """Return whether a sample asks for a force: otherwise the last one is held."""
        return self.every == 1 or (number - self._asked) % self.every == 0

    def offer(self, stamp: int, force: float, present: int, present_stamp: int) -> Verdict:
        """Offer a force (N) as the answer to the sample of a stamp (ns); see `SampledLoop.offer`.

        `present` is the number of the present sample.
        """
        stamps, is_present = self._stamps, stamp == present_stamp
        number = present if is_present else stamps.number(stamp)
        if not isfinite(force):
            return self.refuse(Verdict.NOT_FINITE)
        if stamp == 0:
            return self.refuse(Verdict.NO_STAMP)
        if not (is_present or (0 <= number < present and stamps.stamp(number) == stamp)):
            return self.refuse(Verdict.UNKNOWN_STAMP)
        if not self.asks(number):
            if self.controller_present or number <= self._newest[0]:
                return self.refuse(Verdict.UNASKED)
            self._asked = number  # a controller that comes later counts from its first sample
        if number <= self._newest[0]:
            return self.refuse(Verdict.ANSWERED)
        if number < present and not self._hold_late:
            self.note_controller()
            return self.refuse(Verdict.TOO_LATE)
        self.accept(number, force)
        return _ACCEPTED

    def accept(self, number: int, force: float) -> None:
        """Take a force (N) as the answer to a sample that is newer than those answered."""
        if self._newest[0] > self._newest_sent:
            self.lose(*self._newest)
        self._newest = (number, force)
        self.controller_present = self._expects_control

    def refuse(self, reason: Verdict) -> Verdict:
        """Count a force that will not act; return the reason."""
        self.dropped[reason] += 1
        return reason

    def lose(self, number: int, force: float) -> None:
        """Count an accepted force (N) that will not act; tell whoever wants to know."""
        self.dropped[Verdict.OVERTAKEN] += 1
        self._overtaken(self._stamps.stamp(number), force)

    def note_controller(self) -> None:
        """Expect an answer to the present sample: the controller has sent something."""
        self.controller_present = self._expects_control

    def hold(self, number: int) -> None:
        """Answer a sample with the last force: no command comes for it."""
        self._newest = (number, self._newest[1])
        self.silent_samples += 1

    def due(self, number: int) -> tuple[int, float] | None:
        """Return the force (N) that is due for a sample, after the sample that it answers.

        That is the sample itself; an earlier one if the force replaces a missing one; -1 without a
        force. None if the sample asks for none, and no late one has come: the last one is held.
        """
        answered, force = self._newest
        asked = number if self.every == 1 else number - (number - self._asked) % self.every
        if answered < asked and self._expects_control:
            self.late_forces += 1
        if asked != number and answered <= self._newest_sent:
            return None
        if answered < asked:
            age = (number - answered) * self._period
            if not (self._hold_late and age <= self._timeout):
                self.controller_present = False
                return -1, 0.0
        if answered > self._newest_sent:
            self._newest_sent = answered
        return answered, force
