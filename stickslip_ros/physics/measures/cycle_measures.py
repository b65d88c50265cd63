"""The cycle measures, from breakpoints: amplitude, stick fraction, period and regime."""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from enum import StrEnum
from itertools import pairwise
from typing import Any, NamedTuple, Self

import numpy as np

from stickslip_ros.physics.measures.breakpoints import Breakpoints

EQUILIBRIUM_SPEED = 1e-3
"""Speed amplitude, in belt speeds, below which the slide counts as resting in equilibrium."""

UNBOUNDED_BELT_SPEEDS = 1e3
"""Speed of the slide, in belt speeds, beyond which a sampled motion is said to run away."""

STEADY = 1e-3
"""Share by which the amplitudes of the cycles measured may differ in a motion that has settled."""

LEAST_CYCLES = 3
"""Cycles from which on it is told whether a motion is steady."""

GRAZING = 1e-8
"""Stick fraction up to which a cycle only touches the belt's speed, and slips all the time.

The stick fraction grows with the root of the distance from grazing: this is what the rounding of
the belt's speed makes of it.
"""

_NOISE = 1e-9
"""Share of the belt speed, or of the fastest motion seen, below which speeds are rounding."""

_STALE_PERIODS = 3.0
"""A motion without a turn for so many of its last periods has stopped cycling."""


class Regime(StrEnum):
    """What kind of motion it is."""

    STICK_SLIP = "stick_slip"
    PURE_SLIP = "pure_slip"
    EQUILIBRIUM = "equilibrium"
    STUCK = "stuck"
    UNBOUNDED = "unbounded"

    @classmethod
    def label(cls, regime: str | None) -> str:
        """Return what a person reads of a regime, or of none, wherever one is shown."""
        return "no whole cycle" if regime is None else _LABELS[cls(regime)]


_LABELS = {
    Regime.STICK_SLIP: "stick-slip",
    Regime.PURE_SLIP: "pure slip",
    Regime.EQUILIBRIUM: "equilibrium",
    Regime.STUCK: "stuck",
    Regime.UNBOUNDED: "unbounded",
}


class Trend(StrEnum):
    """How the amplitude changes in a motion that is not steady."""

    DECAYING = "decaying"
    GROWING = "growing"
    VARYING = "varying"


def with_trend(regime: str, trend: str | None) -> str:
    """Return a regime as a person reads it: what is not steady says so."""
    return f"{regime}, not steady: {trend}" if trend else regime


class Cycle(NamedTuple):
    """One cycle, from one upward zero crossing of the velocity to the next; SI units."""

    amplitude: float
    velocity_amplitude: float
    midpoint: float
    period: float
    frequency: float
    stick_fraction: float


@dataclass(frozen=True)
class Measures:
    """Means of the last whole cycles; null (None) is what does not exist.

    In equilibrium, stuck and unbounded there is no period and no frequency. While no cycle has
    been completed and the motion has not come to rest either, the regime too is null.
    """

    amplitude: float | None
    """Half the peak-to-peak displacement, m."""
    velocity_amplitude: float | None
    """Half the peak-to-peak velocity, m/s."""
    midpoint: float | None
    """Middle of the displacement, m."""
    period: float | None
    """s"""
    frequency: float | None
    """Hz"""
    stick_fraction: float | None
    """Stick time over time."""
    cycles: int
    """How many cycles the means are over."""
    regime: Regime | None
    steady: bool | None = None
    """Whether the motion has settled: the amplitudes of the cycles measured, three at least, differ
    by no more than a thousandth; a rest has lasted for as many cycles as are measured at most, and
    small ones around it do not grow. What runs away has settled, too. Null is too little to tell.
    """
    trend: Trend | None = None
    """How the amplitude changes, null unless `steady` is false."""

    def as_dict(self) -> dict[str, float | int | str | None]:
        """Return the measures by their names, ready for JSON."""
        return asdict(self)


def measures_of(report: Mapping[str, Any]) -> Measures:
    """Return the measures that a report has by name."""
    return Measures(**{measure.name: report[measure.name] for measure in fields(Measures)})


@dataclass
class _Stretch:
    """Ends, extremes and stick time of a stretch of motion that goes on."""

    start: float
    end: float
    lowest: float
    highest: float
    slowest: float
    fastest: float
    stick_time: float = 0.0

    @classmethod
    def from_breakpoint(cls, breakpoints: Breakpoints, row: int) -> Self:
        time, position, velocity = (
            float(column[row])
            for column in (breakpoints.time, breakpoints.position, breakpoints.velocity)
        )
        return cls(time, time, position, position, velocity, velocity)

    def extend(self, breakpoints: Breakpoints, first: int, last: int) -> None:
        """Go on to the breakpoint `last`, the one before `first` being the end so far."""
        if last < first:
            return
        rows = slice(first, last + 1)
        # Stretches are short: lists take a fraction of the time that arrays would.
        position = breakpoints.position[rows].tolist()
        velocity = breakpoints.velocity[rows].tolist()
        self.end = float(breakpoints.time[last])
        self.lowest = min(self.lowest, *position)
        self.highest = max(self.highest, *position)
        self.slowest = min(self.slowest, *velocity)
        self.fastest = max(self.fastest, *velocity)
        stuck = breakpoints.sticking[rows]
        if stuck.any():
            durations = np.diff(breakpoints.time[first - 1 : last + 1])
            self.stick_time += float(durations[stuck].sum())

    @property
    def duration(self) -> float:
        return self.end - self.start

    def as_cycle(self) -> Cycle:
        stick_fraction = self.stick_time / self.duration
        return Cycle(
            amplitude=(self.highest - self.lowest) / 2.0,
            velocity_amplitude=(self.fastest - self.slowest) / 2.0,
            midpoint=(self.highest + self.lowest) / 2.0,
            period=self.duration,
            frequency=1.0 / self.duration,
            stick_fraction=stick_fraction if stick_fraction > GRAZING else 0.0,
        )


class CycleMeter:
    """Measures a motion as it comes, in blocks of breakpoints of any length, in constant memory."""

    def __init__(self, window: int) -> None:
        """Average over the last `window` cycles at most."""
        self._cycles: deque[Cycle] = deque(maxlen=window)
        self._amplitudes: deque[float] = deque(maxlen=max(window, LEAST_CYCLES))
        self._belt_speed = 0.0
        self._fastest = 0.0
        self._unbounded = False
        self.ends: list[float] = []
        """Time, s, at which each cycle was complete that `feed` returned last."""
        self.interrupt()

    def interrupt(self) -> None:
        """Drop the cycle under way: the next breakpoint does not continue the motion so far."""
        self._last = Breakpoints.empty()
        self._direction = 0.0
        self._open: _Stretch | None = None
        self._whole = False
        self._recent: list[_Stretch] = []
        self._sticking_since: float | None = None

    def report_run_away(self) -> None:
        """Say that the motion has left all bounds."""
        self._unbounded = True

    def feed(self, breakpoints: Breakpoints, belt_speed: float) -> list[Cycle]:
        """Take the breakpoints that follow, the belt moving at `belt_speed` (m/s).

        Return the cycles that were completed by them.
        """
        self.ends = []
        if len(breakpoints) == 0:
            return []
        self._belt_speed = belt_speed
        first = len(self._last)
        breakpoints = self._last.followed_by(breakpoints)
        if self._open is None:
            self._open = _Stretch.from_breakpoint(breakpoints, 0)
            first = 1
        completed: list[Cycle] = []
        for edge in self._upward_crossings(breakpoints):
            self._open.extend(breakpoints, first, edge)
            if self._whole and self._open.duration > 0.0:
                completed.append(self._open.as_cycle())
                self.ends.append(self._open.end)
            self._open = _Stretch.from_breakpoint(breakpoints, edge)
            self._whole = True
            self._recent = []
            first = edge + 1
        self._cycles.extend(completed)
        self._amplitudes.extend(cycle.amplitude for cycle in completed)
        self._open.extend(breakpoints, first, len(breakpoints) - 1)
        self._follow_recent(breakpoints, first)
        self._follow_sticking(breakpoints)
        self._last = breakpoints[len(breakpoints) - 1 :]
        return completed

    def measures(self) -> Measures:
        """Return the means over the last whole cycles."""
        if self._unbounded:
            return _without_cycles(None, Regime.UNBOUNDED, steady=True)
        period = self._cycles[-1].period if self._cycles else 0.0
        now = self._open.end if self._open else 0.0
        since = self._sticking_since
        if self._belt_speed == 0.0 and since is not None and now - since >= period:
            steady = True if self._lasts(now - since) else None
            return _without_cycles(self._recent_motion(), Regime.STUCK, steady=steady)
        since_turn = self._open.duration if self._open else 0.0
        if not self._cycles or since_turn > _STALE_PERIODS * period:
            recent = self._recent_motion()
            if (
                recent is None
                or recent.velocity_amplitude >= self._equilibrium_speed
                or recent.stick_fraction > 0.0  # it rides a slow belt
            ):
                return _without_cycles(None, None)
            steady = True if self._lasts(since_turn) else None
            return _without_cycles(recent, Regime.EQUILIBRIUM, steady=steady)
        mean = Cycle(*np.mean(self._cycles, axis=0).tolist())
        resting = mean.velocity_amplitude < self._equilibrium_speed
        trend = _trend(self._amplitudes, resting)
        steady = trend is None if len(self._amplitudes) >= LEAST_CYCLES else None
        count = len(self._cycles)
        if resting:
            return _without_cycles(mean, Regime.EQUILIBRIUM, count, steady=steady, trend=trend)
        regime = Regime.STICK_SLIP if mean.stick_fraction > 0.0 else Regime.PURE_SLIP
        return Measures(**mean._asdict(), cycles=count, regime=regime, steady=steady, trend=trend)

    def _lasts(self, rest: float) -> bool:
        """Return whether a rest of so long (s) has lasted for a window of the last cycles."""
        window = self._cycles.maxlen or 0
        return not self._cycles or rest >= window * self._cycles[-1].period

    @property
    def _equilibrium_speed(self) -> float:
        return EQUILIBRIUM_SPEED * abs(self._belt_speed)

    def _upward_crossings(self, breakpoints: Breakpoints) -> list[int]:
        """Return the breakpoints at which the velocity goes from negative to positive."""
        speed = np.abs(breakpoints.velocity)
        self._fastest = max(self._fastest, float(speed.max()))
        moving = np.flatnonzero(speed > _NOISE * max(self._fastest, abs(self._belt_speed)))
        if len(moving) == 0:
            return []
        directions = np.concatenate([[self._direction], np.sign(breakpoints.velocity[moving])])
        self._direction = float(directions[-1])
        rising = moving[(directions[:-1] < 0.0) & (directions[1:] > 0.0)]
        before = np.maximum(rising - 1, 0)
        return np.where(speed[before] <= speed[rising], before, rising).tolist()

    def _follow_recent(self, breakpoints: Breakpoints, first: int) -> None:
        """Keep the extremes of the last half, at least, of the stretch since the last crossing.

        Whenever the stretch, once longer than the last cycle, has doubled, what went before the
        last doubling is forgotten.
        """
        assert self._open is not None
        if not self._recent:
            self._recent = [_Stretch.from_breakpoint(breakpoints, first - 1)]
        row, last = first, len(breakpoints) - 1
        earliest = self._open.start + (self._cycles[-1].period if self._cycles else 0.0)
        while row <= last:
            current = self._recent[-1]
            due = max(2.0 * current.start - self._open.start, earliest)
            side = "left" if due > current.start else "right"
            doubled = row + int(np.searchsorted(breakpoints.time[row:], due, side))
            current.extend(breakpoints, row, min(doubled, last))
            if doubled <= last:
                self._recent = [current, _Stretch.from_breakpoint(breakpoints, doubled)]
            row = doubled + 1

    def _recent_motion(self) -> Cycle | None:
        """Return the latest part of a stretch without crossings, as if it were a cycle."""
        if not self._recent or self._recent[0].duration <= 0.0:
            return None
        merged = replace(self._recent[0])
        for part in self._recent[1:]:
            merged.end = part.end
            merged.lowest = min(merged.lowest, part.lowest)
            merged.highest = max(merged.highest, part.highest)
            merged.slowest = min(merged.slowest, part.slowest)
            merged.fastest = max(merged.fastest, part.fastest)
            merged.stick_time += part.stick_time
        return merged.as_cycle()

    def _follow_sticking(self, breakpoints: Breakpoints) -> None:
        slipping = np.flatnonzero(~breakpoints.sticking[1:])
        if len(breakpoints) > 1 and not breakpoints.sticking[-1]:
            self._sticking_since = None
        elif len(slipping) > 0 or self._sticking_since is None:
            row = int(slipping[-1]) + 1 if len(slipping) > 0 else 0
            self._sticking_since = float(breakpoints.time[row]) if len(breakpoints) > 1 else None


def _trend(amplitudes: Sequence[float], resting: bool) -> Trend | None:
    """Return how the amplitude changes from cycle to cycle; None if it does not, or for few.

    Around a slide that is `resting` only growth from each cycle to the next counts: else it comes
    to rest still, or what is measured is noise.
    """
    if len(amplitudes) < LEAST_CYCLES:
        return None
    first, last = amplitudes[0], amplitudes[-1]
    grows = last - first > STEADY * first
    if resting:
        monotone = all(before < after for before, after in pairwise(amplitudes))
        return Trend.GROWING if grows and monotone else None
    largest = max(amplitudes)
    if largest - min(amplitudes) <= STEADY * largest:
        return None
    if grows:
        return Trend.GROWING
    return Trend.DECAYING if first - last > STEADY * first else Trend.VARYING


def _without_cycles(
    motion: Cycle | None,
    regime: Regime | None,
    cycles: int = 0,
    *,
    steady: bool | None = None,
    trend: Trend | None = None,
) -> Measures:
    """Return the measures of a motion that has no period."""
    means = dict.fromkeys(Cycle._fields) if motion is None else motion._asdict()
    means |= {"period": None, "frequency": None}
    return Measures(**means, cycles=cycles, regime=regime, steady=steady, trend=trend)
