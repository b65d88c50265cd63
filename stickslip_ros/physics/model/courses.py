"""The courses that scenarios know: piece by piece a straight line and a sine."""

from abc import abstractmethod
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import cos, pi
from math import sin as float_sin
from typing import Any, ClassVar, NamedTuple

from stickslip_ros.physics.model.constants import constants_of
from stickslip_ros.physics.model.course import Course
from stickslip_ros.physics.model.functions import sin


class Piece(NamedTuple):
    """Part of a course: offset + slope (t - origin) + swing sin(2 pi f (t - origin)), up to end."""

    origin: float
    """Time that the piece counts from, s."""
    offset: float
    """Value at the origin."""
    slope: float
    """Rate of the straight line, per second."""
    swing: float
    """Amplitude of the sine."""
    end: float
    """Time at which the next piece starts, s."""
    last: float = 0.0
    """1 for the piece after which there is none, otherwise 0."""


@dataclass(frozen=True)
class PiecewiseCourse(Course):
    """Course of pieces that are a straight line and a sine each."""

    switches: ClassVar[Sequence[str]] = Piece._fields

    frequency: ClassVar[float] = 0.0
    """Frequency of the sine, Hz; a constant of courses that have one."""

    @abstractmethod
    def pieces(self) -> Sequence[Piece]:
        """Return the pieces in the order of time; the first one starts with the motion."""

    def value(self, time: Any, switches: Sequence[Any]) -> Any:
        """Return the value; see `Course.value`.

        Parameters
        ----------
        time : float, complex or expression
            Time from the start of the motion, s.
        switches : sequence of float or expression
            Piece.

        Returns
        -------
        float, complex or expression
            Value.
        """
        origin, offset, slope, swing, _, _ = switches
        since = time - origin
        line = offset + slope * since
        if "frequency" not in constants_of(type(self)):
            return line
        return line + swing * sin(2.0 * pi * self.frequency * since)

    def margins(self, time: Any, switches: Sequence[Any]) -> Sequence[Any]:
        """Return the time to the next corner; see `Course.margins`.

        Parameters
        ----------
        time : float or expression
            Time from the start of the motion, s.
        switches : sequence of float or expression
            Piece.

        Returns
        -------
        sequence of float or expression
            One margin, s.
        """
        *_, end, last = switches
        return (last + (1.0 - last) * (end - time),)

    def switches_at(self, time: float) -> Sequence[float]:
        """Return the piece at a time; see `Course.switches_at`.

        Parameters
        ----------
        time : float
            Time from the start of the motion, s.

        Returns
        -------
        sequence of float
            Piece.
        """
        return self._pieces[bisect_right(self._ends, time)]

    def switches_after(self, margin: int, switches: Sequence[float]) -> Sequence[float]:
        """Return the next piece; see `Course.switches_after`.

        Parameters
        ----------
        margin : int
            0.
        switches : sequence of float
            Piece so far.

        Returns
        -------
        sequence of float
            Piece that follows.
        """
        return self.switches_at(Piece(*switches).end)

    def at(self, time: float) -> float:
        """Return the value at a time (s); after a jump at a corner."""
        return float(self.value(time, self.switches_at(time)))

    def rates(self, time: float) -> tuple[float, float]:
        """Return first and second derivative at a time (s); after a corner, without its jump."""
        piece = Piece(*self.switches_at(time))
        omega = 2.0 * pi * self.frequency
        since = omega * (time - piece.origin)
        return (
            piece.slope + piece.swing * omega * cos(since),
            -piece.swing * omega * omega * float_sin(since),
        )

    def integral(self, start: float, end: float) -> float:
        """Return the integral from a time to a later one (s), exactly."""
        total, now = 0.0, start
        while now < end:
            piece = Piece(*self.switches_at(now))
            until = end if piece.last else min(end, piece.end)
            total += self._antiderivative(piece, until) - self._antiderivative(piece, now)
            now = until
        return total

    def _antiderivative(self, piece: Piece, time: float) -> float:
        since, omega = time - piece.origin, 2.0 * pi * self.frequency
        swing = piece.swing / omega * (1.0 - cos(omega * since)) if piece.swing else 0.0
        return since * (piece.offset + 0.5 * piece.slope * since) + swing

    @cached_property
    def _pieces(self) -> Sequence[Piece]:
        *pieces, last = self.pieces()
        pieces = [piece for piece in pieces if piece.end > 0.0]
        return [*pieces, last._replace(end=pieces[-1].end if pieces else 0.0, last=1.0)]

    @cached_property
    def _ends(self) -> Sequence[float]:
        return [piece.end for piece in self._pieces[:-1]]
