"""The courses that scenarios know: piece by piece a straight line and a sine."""

from abc import abstractmethod
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from itertools import pairwise
from math import cos, inf, isfinite, pi
from math import sin as float_sin
from typing import Any, ClassVar, NamedTuple, Self

from typing_extensions import override

from stickslip_ros.physics.model.constants import constant
from stickslip_ros.physics.model.course import Course, NoCourse
from stickslip_ros.physics.model.functions import sin


class CourseKind(StrEnum):
    """Shape of a course over time."""

    NONE = "none"
    STEP = "step"
    IMPULSE = "impulse"
    RAMP = "ramp"
    SINE = "sine"
    TRAPEZOID = "trapezoid"
    TABLE = "table"


class Piece(NamedTuple):
    """Part of a course: offset + slope (t - origin) + swing sin(rate (t - origin)), up to end."""

    origin: float
    """Time that the piece counts from, s."""
    offset: float
    """Value at the origin."""
    slope: float
    """Rate of the straight line, per second."""
    swing: float
    """Amplitude of the sine."""
    rate: float
    """Angular frequency of the sine, rad/s."""
    end: float
    """Time at which the next piece starts, s; infinite after the last corner."""


@dataclass(frozen=True)
class _Lines(Course):
    """The equations of all courses of straight lines: they share their compiled flows."""

    switches: ClassVar[Sequence[str]] = Piece._fields

    def value(self, time: Any, switches: Sequence[Any]) -> Any:
        origin, offset, slope, _, _, _ = switches
        return offset + slope * (time - origin)


@dataclass(frozen=True)
class _LinesAndSines(_Lines):
    """The equations of courses with sines."""

    def value(self, time: Any, switches: Sequence[Any]) -> Any:
        origin, offset, slope, swing, rate, _ = switches
        since = time - origin
        return offset + slope * since + swing * sin(rate * since)


_LINES, _LINES_AND_SINES = _Lines(), _LinesAndSines()


@dataclass(frozen=True)
class PiecewiseCourse(Course):
    """Course of pieces that are a straight line and a sine each."""

    name: ClassVar[str]
    """Name of the course in the parameters."""
    switches: ClassVar[Sequence[str]] = Piece._fields

    @abstractmethod
    def pieces(self) -> Sequence[Piece]:
        """Return the pieces in the order of time.

        The first one starts before the motion or with it, the last one ends at infinity. Pieces of
        no length are ignored.
        """

    @property
    def equations(self) -> Course:
        """The equations that all courses of straight lines share; see `Course.equations`."""
        return _LINES

    @override
    def value(self, time: Any, switches: Sequence[Any]) -> Any:
        return self.equations.value(time, switches)

    @override
    def switches_at(self, time: float) -> Sequence[float]:
        return self._pieces[bisect_right(self._ends, time)]

    @override
    def next_switch_time(self, switches: Sequence[float]) -> float:
        return switches[-1]

    def rates(self, time: float) -> tuple[float, float]:
        """Return first and second derivative, at a corner those after it; a jump has none."""
        origin, _, slope, swing, rate, _ = self.switches_at(time)
        if not swing:
            return slope, 0.0
        turn = rate * (time - origin)
        return slope + swing * rate * cos(turn), -swing * rate * rate * float_sin(turn)

    def integral(self, start: float, end: float) -> float:
        """Return the exact integral; see `Course.integral`."""
        total = 0.0
        while True:
            origin, offset, slope, swing, rate, last = self.switches_at(start)
            until = end if end <= last else last
            length, middle = until - start, 0.5 * (start + until) - origin
            total += length * (offset + slope * middle)
            if swing:
                half = 0.5 * rate
                total += swing / half * float_sin(rate * middle) * float_sin(half * length)
            if until == end:
                return total
            start = until

    @cached_property
    @override
    def bounds(self) -> tuple[float, float]:
        values = [value for piece in self._used for value in self._extremes(piece)]
        return min(values), max(values)

    @cached_property
    @override
    def steepest(self) -> float:
        return max(abs(piece.slope) + abs(piece.swing) * piece.rate for piece in self._used)

    def _extremes(self, piece: Piece) -> list[float]:
        """Return the values at the start of a piece, and at the turns and the end of a sine."""
        start = max(piece.origin, 0.0)
        times = [start]
        if piece.swing:
            quarter = 0.5 * pi / piece.rate
            times += [piece.origin + turns * quarter for turns in (1.0, 3.0)]
            if piece.end < inf:
                times.append(piece.end)
        return [self.value(time, piece) for time in times if start <= time <= piece.end]

    @cached_property
    def _pieces(self) -> Sequence[Piece]:
        found: list[Piece] = []
        now = -inf
        for piece in self.pieces():
            if piece.end > now:
                found.append(piece)
                now = piece.end
        return found

    @property
    def _used(self) -> Sequence[Piece]:
        """The pieces that do not end before the motion starts."""
        return [piece for piece in self._pieces if piece.end > 0.0]

    @cached_property
    def _ends(self) -> Sequence[float]:
        return [piece.end for piece in self._pieces[:-1]]


def _held(value: float, end: float) -> Piece:
    return Piece(0.0, value, 0.0, 0.0, 0.0, end)


def _line(start: float, before: float, end: float, after: float) -> Piece:
    slope = (after - before) / (end - start) if end > start else 0.0
    return Piece(start, before, slope, 0.0, 0.0, end)


@dataclass(frozen=True)
class Step(PiecewiseCourse):
    """Has its amplitude while it lasts, and is zero before and after.

    Examples
    --------
    >>> from stickslip_ros.physics.model.courses import Step
    >>> step = Step(amplitude=2.0, start=1.0, duration=3.0)
    >>> [step.at(time) for time in (0.5, 1.0, 3.9, 4.0)]
    [0.0, 2.0, 2.0, 0.0]
    """

    name: ClassVar[str] = "step"
    amplitude: float = constant(0.0, "Value while it lasts.", "value")
    start: float = constant(0.0, "Time of the step.", "s", at_least=0.0)
    duration: float = constant(inf, "Time that it lasts.", "s", at_least=0.0)

    @override
    def pieces(self) -> Sequence[Piece]:
        end = self.start + self.duration
        return [_held(0.0, self.start), _held(self.amplitude, end), _held(0.0, inf)]


@dataclass(frozen=True)
class Impulse(Step):
    """Step that lasts for one sample."""

    name: ClassVar[str] = "impulse"

    @override
    def sampled(self, period: float) -> Self:
        return replace(self, duration=period)


@dataclass(frozen=True)
class Ramp(PiecewiseCourse):
    """Rises from zero to its amplitude in a straight line, and then stays.

    Examples
    --------
    >>> from stickslip_ros.physics.model.courses import Ramp
    >>> ramp = Ramp(amplitude=0.04, start=1.0, duration=2.0)
    >>> [ramp.at(time) for time in (0.5, 2.0, 3.0)]
    [0.0, 0.02, 0.04]
    """

    name: ClassVar[str] = "ramp"
    amplitude: float = constant(0.0, "Value at the end of the rise.", "value")
    start: float = constant(0.0, "Start of the rise.", "s", at_least=0.0)
    duration: float = constant(1.0, "Time of the rise.", "s", positive=True)

    @override
    def pieces(self) -> Sequence[Piece]:
        end = self.start + self.duration
        rise = _line(self.start, 0.0, end, self.amplitude)
        return [_held(0.0, self.start), rise, _held(self.amplitude, inf)]

    @override
    def refusal(self) -> str | None:
        return _refused_duration(self)


@dataclass(frozen=True)
class Sine(PiecewiseCourse):
    """Sine that starts at zero, and is zero before and after it lasts.

    Examples
    --------
    >>> from stickslip_ros.physics.model.courses import Sine
    >>> sine = Sine(amplitude=2.0, start=1.0, frequency=0.5)
    >>> [round(sine.at(time), 9) for time in (0.5, 1.5, 2.0, 2.5)]
    [0.0, 2.0, 0.0, -2.0]
    """

    name: ClassVar[str] = "sine"
    amplitude: float = constant(0.0, "Amplitude.", "value")
    start: float = constant(0.0, "Time of its first zero.", "s", at_least=0.0)
    duration: float = constant(inf, "Time that it lasts.", "s", at_least=0.0)
    frequency: float = constant(1.0, "Frequency.", "Hz", positive=True)

    @property
    @override
    def equations(self) -> Course:
        return _LINES_AND_SINES

    @override
    def pieces(self) -> Sequence[Piece]:
        end = self.start + self.duration
        rate = 2.0 * pi * self.frequency
        wave = Piece(self.start, 0.0, 0.0, self.amplitude, rate, end)
        return [_held(0.0, self.start), wave, _held(0.0, inf)]


@dataclass(frozen=True)
class Trapezoid(PiecewiseCourse):
    """Rises to its amplitude, holds it and falls to zero.

    Examples
    --------
    >>> from stickslip_ros.physics.model.courses import Trapezoid
    >>> feed = Trapezoid(amplitude=0.04, duration=5.0, frequency=0.5)
    >>> [feed.at(time) for time in (0.0, 1.0, 2.0, 4.0, 6.0)]
    [0.0, 0.02, 0.04, 0.02, 0.0]
    """

    name: ClassVar[str] = "trapezoid"
    amplitude: float = constant(0.0, "Value between rise and fall.", "value")
    start: float = constant(0.0, "Start of the rise.", "s", at_least=0.0)
    duration: float = constant(2.0, "Time from the start to the end of the fall.", "s",
                               positive=True)  # fmt: skip
    frequency: float = constant(
        1.0, "One over the time of the rise, and of the fall.", "Hz", positive=True
    )

    @override
    def pieces(self) -> Sequence[Piece]:
        edge, end = 1.0 / self.frequency, self.start + self.duration
        top, fall = self.start + edge, end - edge
        return [
            _held(0.0, self.start),
            _line(self.start, 0.0, top, self.amplitude),
            _held(self.amplitude, fall),
            _line(fall, self.amplitude, end, 0.0),
            _held(0.0, inf),
        ]

    @override
    def refusal(self) -> str | None:
        refusal = _refused_duration(self)
        if refusal is None and self.duration * self.frequency < 2.0:
            least = 2.0 / self.frequency
            return (
                f"duration = {self.duration} s: must be at least 2/frequency = {least:g} s "
                "for a trapezoid"
            )
        return refusal


@dataclass(frozen=True)
class Table(PiecewiseCourse):
    """Straight lines between given points; the first and the last value are held outside.

    Examples
    --------
    >>> from stickslip_ros.physics.model.courses import Table
    >>> table = Table(times=(1.0, 3.0), values=(0.0, 0.5))
    >>> [table.at(time) for time in (0.0, 2.0, 9.0)]
    [0.0, 0.25, 0.5]
    """

    name: ClassVar[str] = "table"
    times: tuple[float, ...] = constant((0.0,), "Times of the points, increasing.", "s")
    values: tuple[float, ...] = constant((0.0,), "Values at these times.", "value")

    @override
    def pieces(self) -> Sequence[Piece]:
        points = list(zip(self.times, self.values, strict=True))
        lines = [_line(*before, *after) for before, after in pairwise(points)]
        return [_held(self.values[0], self.times[0]), *lines, _held(self.values[-1], inf)]

    @override
    def refusal(self) -> str | None:
        if not self.times or len(self.times) != len(self.values):
            return (
                f"times and values have {len(self.times)} and {len(self.values)} numbers: must "
                "have as many, at least one"
            )
        if not all(map(isfinite, (*self.times, *self.values))):
            return "times and values must be finite"
        for number, (before, after) in enumerate(pairwise(self.times), start=2):
            if after <= before:
                return f"point {number} of the table: the time must be above the one before"
        if not isfinite(self.steepest):
            return "times and values rise too steeply: the slopes must be finite"
        return None


def _refused_duration(course: Ramp | Trapezoid) -> str | None:
    if isfinite(course.duration) and course.duration > 0.0:
        return None
    return f"duration = {course.duration} s: must be above 0 and finite for a {course.name}"


COURSES: Mapping[str, type[Course]] = {
    CourseKind.NONE: NoCourse,
    **{each.name: each for each in (Step, Impulse, Ramp, Sine, Trapezoid, Table)},
}
"""The courses by name."""
