"""Signals: functions of time that belt speed, load, disturbance and reference follow."""

from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import cos, inf, isclose, isfinite, pi
from math import sin as float_sin
from typing import Any, NamedTuple

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import Scales
from stickslip_ros.model.functions import sin
from stickslip_ros.samples import NO_REFERENCE, Reference
from stickslip_ros.stamps import STAMP_ROUNDING

_ROUNDING = 2.0**-49
"""Share of the time by which rounding may put a corner beside a sample that is meant to be it."""


class Piece(NamedTuple):
    """Part of a signal: offset + slope (t - origin) + swing sin(rate (t - origin)), up to end."""

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
    """Time at which the next piece starts, s; infinite for the last one."""


@dataclass(frozen=True)
class Signal:
    """Function of time in pieces, each a straight line and a sine; without pieces it is zero.

    `step`, `impulse`, `ramp`, `sine`, `trapezoid` and `table` make one. Belt speed and load follow
    it continuously, a disturbance holds it between samples, see `held`.
    """

    pieces: tuple[Piece, ...] = ()
    """The pieces in the order of time; the last one ends at infinity."""

    @property
    def switches(self) -> Sequence[str]:
        """Names of the values that are constant within a piece."""
        return Piece._fields if self.pieces else ()

    @cached_property
    def has_sine(self) -> bool:
        """Whether a piece has a sine: the equation of the others is shorter."""
        return any(piece.rate for piece in self.pieces)

    @cached_property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value from time 0 on."""
        values = [value for piece in self._used for value in self._extremes(piece)] or [0.0]
        return min(values), max(values)

    @cached_property
    def steepest(self) -> float:
        """Largest absolute derivative by time."""
        rates = (abs(piece.slope) + abs(piece.swing) * piece.rate for piece in self._used)
        return max(rates, default=0.0)

    def at(self, time: float) -> float:
        """Return the value at a time; where a piece ends that of the next one.

        Parameters
        ----------
        time : float
            Time, s.
        """
        return float(self.value(time, self.switches_at(time)))

    def reference(self, time: float) -> Reference:
        """Return position, velocity and acceleration at a time; a jump has no velocity.

        Parameters
        ----------
        time : float
            Time between two stamps, s: what starts within their rounding after it has started.
        """
        if not self.pieces:
            return NO_REFERENCE
        origin, _, slope, swing, rate, _ = piece = self.switches_at(time + STAMP_ROUNDING)
        turn = rate * (time - origin)
        return Reference(
            float(self.value(time, piece)),
            slope + swing * rate * cos(turn),
            -swing * rate * rate * float_sin(turn) if swing else 0.0,
        )

    def integral(self, start: float, end: float) -> float:
        """Return the exact integral over an interval, in the unit of the value times s.

        Parameters
        ----------
        start, end : float
            Ends of the interval, s.
        """
        total = 0.0
        while self.pieces:
            origin, offset, slope, swing, rate, last = self.switches_at(start)
            until = end if end <= last else last
            length, middle = until - start, 0.5 * (start + until) - origin
            total += length * (offset + slope * middle)
            if swing:
                half = 0.5 * rate
                total += swing / half * float_sin(rate * middle) * float_sin(half * length)
            if until == end:
                break
            start = until
        return total

    def value(self, time: Any, switches: Sequence[Any]) -> Any:
        """Return the value at a time within a piece.

        Parameters
        ----------
        time : float, complex or expression
            Time, s.
        switches : sequence of float or expression
            Values of `switches`.
        """
        if not switches:
            return 0.0
        origin, offset, slope, swing, rate, _ = switches
        since = time - origin
        line = offset + slope * since
        return line + swing * sin(rate * since) if self.has_sine else line

    def switches_at(self, time: float) -> Sequence[float]:
        """Return the switches of the piece that starts at a time, or in which it lies.

        Parameters
        ----------
        time : float
            Time, s.
        """
        return self.pieces[bisect_right(self._ends, time)] if self.pieces else ()

    def next_switch_time(self, switches: Sequence[float]) -> float:
        """Return the time, s, at which a piece ends.

        Parameters
        ----------
        switches : sequence of float
            Values of `switches`.
        """
        return switches[-1] if switches else inf

    def scaled(self, scales: Scales, unit: str) -> "Signal":
        """Return the signal in other units.

        Parameters
        ----------
        scales : Scales
            The units.
        unit : str
            Unit of the values, such as "m/s".
        """
        time, value, rate = map(scales.factor, ("s", unit, "Hz"))
        return Signal(
            tuple(
                Piece(
                    piece.origin * time,
                    piece.offset * value,
                    piece.slope * value * rate,
                    piece.swing * value,
                    piece.rate * rate,
                    piece.end * time,
                )
                for piece in self.pieces
            )
        )

    def held(self, period: float) -> "Signal":
        """Return the signal to read at whole periods and to hold between.

        It never acts before its start, but from the first sample at or after it on. A corner beside
        a sample by no more than rounding is at the sample.

        Parameters
        ----------
        period : float
            Sample period, s.
        """
        return Signal(_of_some_length(_on_grid(piece, period) for piece in self.pieces))

    @cached_property
    def _ends(self) -> Sequence[float]:
        return [piece.end for piece in self.pieces[:-1]]

    @property
    def _used(self) -> Sequence[Piece]:
        """The pieces that do not end before the motion starts."""
        return [piece for piece in self.pieces if piece.end > 0.0]

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


NO_SIGNAL = Signal()
"""The signal of what is constant."""


def step(amplitude: float, start: float = 0.0, duration: float = inf) -> Signal:
    """Return a signal that has an amplitude while it lasts, and is zero before and after.

    Parameters
    ----------
    amplitude : float
        Value while it lasts.
    start : float
        Time at which it starts, s.
    duration : float
        Time that it lasts, s.
    """
    return _signal(_held(0.0, start), _held(amplitude, start + duration), _held(0.0, inf))


def impulse(amplitude: float, period: float, start: float = 0.0) -> Signal:
    """Return a step that lasts for one sample.

    Parameters
    ----------
    amplitude : float
        Value while it lasts.
    period : float
        Sample period, s.
    start : float
        Time at which it starts, s.
    """
    return step(amplitude, start, period)


def ramp(amplitude: float, start: float = 0.0, duration: float = 1.0) -> Signal:
    """Return a signal that rises to its amplitude in a straight line, and then stays.

    Parameters
    ----------
    amplitude : float
        Value at the end.
    start : float
        Time at which it starts, s.
    duration : float
        Time of the rise, s.

    Raises
    ------
    InvalidInputError
        If the duration is not positive and finite.
    """
    _check_duration("ramp", duration)
    end = start + duration
    return _signal(_held(0.0, start), _line(start, 0.0, end, amplitude), _held(amplitude, inf))


def sine(
    amplitude: float, start: float = 0.0, duration: float = inf, frequency: float = 1.0
) -> Signal:
    """Return a sine that starts at zero, and is zero before and after it lasts.

    Parameters
    ----------
    amplitude : float
        Amplitude.
    start : float
        Time at which it starts, s.
    duration : float
        Time that it lasts, s.
    frequency : float
        Frequency, Hz.
    """
    wave = Piece(start, 0.0, 0.0, amplitude, 2.0 * pi * frequency, start + duration)
    return _signal(_held(0.0, start), wave, _held(0.0, inf))


def trapezoid(
    amplitude: float, start: float = 0.0, duration: float = 2.0, frequency: float = 1.0
) -> Signal:
    """Return a signal that rises in a straight line, holds, and falls to zero.

    Parameters
    ----------
    amplitude : float
        Value between rise and fall.
    start : float
        Time at which it starts, s.
    duration : float
        Time from the start of the rise to the end of the fall, s.
    frequency : float
        One over the time of the rise, and of the fall, Hz.

    Raises
    ------
    InvalidInputError
        If the duration is not finite, or too short.

    Examples
    --------
    >>> from stickslip_ros.model.signals import trapezoid
    >>> feed = trapezoid(amplitude=0.04, duration=5.0, frequency=0.5)
    >>> [feed.at(time) for time in (0.0, 1.0, 2.0, 4.0, 6.0)]
    [0.0, 0.02, 0.04, 0.02, 0.0]
    """
    _check_duration("trapezoid", duration)
    if duration * frequency < 2.0:
        raise InvalidInputError(
            f"duration = {duration} s: must be at least 2/frequency = {2.0 / frequency:g} s for a "
            "trapezoid"
        )
    edge, end = 1.0 / frequency, start + duration
    top, fall = start + edge, end - edge
    return _signal(
        _held(0.0, start),
        _line(start, 0.0, top, amplitude),
        _held(amplitude, fall),
        _line(fall, amplitude, end, 0.0),
        _held(0.0, inf),
    )


def table(points: Sequence[tuple[float, float]]) -> Signal:
    """Return straight lines between points; the first and the last value are held outside.

    Parameters
    ----------
    points : sequence of (float, float)
        Time, s, and value of each point.

    Raises
    ------
    InvalidInputError
        If there are no points, they are not finite, or their times do not increase.
    """
    if not points:
        raise InvalidInputError("the table has no points: must have at least one")
    if not all(isfinite(value) for point in points for value in point):
        raise InvalidInputError("times and values must be finite")
    for number, ((before, _), (after, _)) in enumerate(pairwise(points), start=2):
        if after <= before:
            raise InvalidInputError(
                f"point {number} of the table: the time must be above the one before"
            )
    (first, start), (_, last) = points[0], points[-1]
    lines = [_line(*before, *after) for before, after in pairwise(points)]
    signal = _signal(_held(start, first), *lines, _held(last, inf))
    if not isfinite(signal.steepest):
        raise InvalidInputError("times and values rise too steeply: the slopes must be finite")
    return signal


SIGNALS: Mapping[str, Callable[..., Signal]] = {
    make.__name__: make for make in (step, impulse, ramp, sine, trapezoid, table)
}
"""The functions that make the signals, by kind."""


def _signal(*pieces: Piece) -> Signal:
    return Signal(_of_some_length(pieces))


def _of_some_length(pieces: Iterable[Piece]) -> tuple[Piece, ...]:
    kept: list[Piece] = []
    for piece in pieces:
        if piece.end > (kept[-1].end if kept else -inf):
            kept.append(piece)
    return tuple(kept)


def _on_grid(piece: Piece, period: float) -> Piece:
    """Return a piece that ends at a sample if that is so but for rounding."""
    if piece.end == inf:
        return piece
    sample = round(piece.end / period) * period
    return piece._replace(end=sample) if isclose(piece.end, sample, rel_tol=_ROUNDING) else piece


def _held(value: float, end: float) -> Piece:
    return Piece(0.0, value, 0.0, 0.0, 0.0, end)


def _line(start: float, before: float, end: float, after: float) -> Piece:
    slope = (after - before) / (end - start) if end > start else 0.0
    return Piece(start, before, slope, 0.0, 0.0, end)


def _check_duration(kind: str, duration: float) -> None:
    if not (isfinite(duration) and duration > 0.0):
        raise InvalidInputError(f"duration = {duration} s: must be above 0 and finite for a {kind}")
