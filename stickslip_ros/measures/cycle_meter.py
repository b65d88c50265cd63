"""Cycles of a motion from its breakpoints, and their measures, in constant memory."""

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Sequence
from functools import reduce
from itertools import pairwise
from math import inf
from typing import Any, NamedTuple, Self

import numpy as np

from stickslip_ros.measures.breakpoints import Breakpoints
from stickslip_ros.measures.cycle_measures import (
    EQUILIBRIUM_SPEED,
    LEAST_CYCLES,
    STALE_PERIODS,
    STEADY_CHANGE_UNDER_NOISE,
    Cycle,
    CycleMeans,
    Measures,
    Regime,
    Trend,
    with_drift,
    without_cycles,
)
from stickslip_ros.measures.drift import Drift

STEADY_CHANGE = 1e-3
"""Largest relative difference between the amplitudes of the measured cycles of a steady motion, and
between their mean and the amplitude that they tend to."""

_CYCLES_TO_COME = 1000.0
"""Number of cycles to come in which a change that slows down no more counts."""

_RATIO_ERROR = 0.1
"""Largest error of 1 - q with which differences follow a geometric sequence of the ratio q."""

GRAZING_FRACTION = 1e-8
"""Stick fraction up to which a cycle counts as touching the belt speed without sticking.

The stick fraction grows with the root of the distance from grazing; this value is the effect of
rounding the belt speed.
"""

_NOISE = 1e-9
"""Speeds below this share of the belt speed, or of the highest speed so far, are rounding."""

_TIME_ROUNDING = 1e-9
"""Share of a duration by which the end of a part may be missed for rounding."""

_Columns = Sequence["memoryview[Any]"]
"""Breakpoints as views: elements of arrays take several times as long, lists more memory."""


class _Stretch(NamedTuple):
    """Ends, extremes and stick time of a part of a motion."""

    start: float
    end: float
    lowest: float
    highest: float
    slowest: float
    fastest: float
    stick_time: float

    @classmethod
    def between(cls, columns: _Columns, first: int, last: int) -> Self:
        """Return the part from one breakpoint to another."""
        time, position, velocity, sticking = columns
        rows, stuck = slice(first, last + 1), sticking[first + 1 : last + 1]
        sticks = [time[row] - time[row - 1] for row, held in enumerate(stuck, first + 1) if held]
        return cls(
            time[first],
            time[last],
            min(position[rows]),
            max(position[rows]),
            min(velocity[rows]),
            max(velocity[rows]),
            float(np.sum(sticks)) if len(sticks) > 1 else sum(sticks, 0.0),
        )

    def followed_by(self, later: "_Stretch") -> "_Stretch":
        return _Stretch(
            self.start,
            later.end,
            min(self.lowest, later.lowest),
            max(self.highest, later.highest),
            min(self.slowest, later.slowest),
            max(self.fastest, later.fastest),
            self.stick_time + later.stick_time,
        )

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
            stick_fraction=stick_fraction if stick_fraction > GRAZING_FRACTION else 0.0,
        )


class CycleMeter:
    """Measures a motion, fed in blocks of breakpoints of any length, in constant memory.

    Parameters
    ----------
    window : int
        Largest number of cycles to average over: the last ones.

    Examples
    --------
    The limit cycle of a drive:

    >>> from stickslip_ros.measures import CycleMeter
    >>> from stickslip_ros.model.drive import Drive
    >>> from stickslip_ros.model.friction import Stribeck
    >>> from stickslip_ros.motion import RecordedMotion
    >>> drive = Drive(mass=100.0, damping=200.0, stiffness=1e6, normal_force=1000.0,
    ...               belt_speed=0.04, friction=Stribeck(0.4, 0.25, 0.05))
    >>> motion = RecordedMotion(drive, position=0.0, velocity=0.0)
    >>> motion.advance(5.0)
    >>> meter = CycleMeter(window=20)
    >>> cycles = meter.feed(motion.take_breakpoints(), drive.belt_speed)
    >>> measures = meter.measures()
    >>> measures.regime.value, round(1e6 * measures.amplitude, 1)
    ('stick_slip', 434.1)
    """

    def __init__(self, window: int) -> None:
        self.drift = Drift()
        """Trends of the run, for its user to feed."""
        self.within = 0.0
        """Range, m, in which a slide counts as held."""
        self.rounding = 0.0
        """Speed, m/s, that is rounding where the belt is at rest."""
        self.unbounded = False
        """Whether the motion is reported as one that diverges."""
        self._cycles: deque[Cycle] = deque(maxlen=window)
        self._amplitudes: deque[float] = deque(maxlen=max(window, LEAST_CYCLES + 1))
        self._belt_speed = self._fastest_belt = 0.0
        self._fastest = 0.0
        self.ends: list[float] = []
        """Time, s, at which each cycle ended that `feed` returned last."""
        self.interrupt()

    def interrupt(self) -> None:
        """Drop the current cycle: the next breakpoint does not continue the motion so far."""
        self._last = Breakpoints.empty()
        self._direction = 0.0
        self._parts: list[_Stretch] = []
        """Parts of the stretch since the last crossing."""
        self._whole = False
        self._slid = inf, 0.0
        """Time until which it slid, and longest stick between two slides on a belt at rest, s."""

    def feed(
        self, breakpoints: Breakpoints, belt_speed: float, fastest_belt: float | None = None
    ) -> list[Cycle]:
        """Add the breakpoints that follow.

        Parameters
        ----------
        breakpoints : Breakpoints
            Breakpoints that continue the motion, in SI units.
        belt_speed : float
            Belt speed at the last of them, m/s.
        fastest_belt : float, optional
            Largest absolute belt speed of the motion, m/s, the scale of its speeds. By default the
            belt speed is constant.

        Returns
        -------
        list of Cycle
            Cycles completed by these breakpoints.
        """
        self.ends = []
        if len(breakpoints) == 0:
            return []
        self._belt_speed = belt_speed
        self._fastest_belt = abs(belt_speed) if fastest_belt is None else fastest_belt
        if len(self._last):
            breakpoints = self._last.followed_by(breakpoints)
        columns = [column.data for column in vars(breakpoints).values()]
        completed, last = list[Cycle](), 0
        for edge in self._upward_crossings(breakpoints):
            stretch = reduce(
                _Stretch.followed_by, [*self._parts, _Stretch.between(columns, last, edge)]
            )
            if self._whole and stretch.duration > 0.0:
                completed.append(stretch.as_cycle())
                self.ends.append(stretch.end)
                self._cycles.append(completed[-1])
                self._amplitudes.append(completed[-1].amplitude)
            self._parts, self._whole, last = [], True, edge
        self._follow(columns, last, len(breakpoints) - 1)
        (slides,) = (~breakpoints.sticking[1:]).nonzero()
        if len(slides) > 0:
            ends, (until, longest) = breakpoints.time[slides + 1], self._slid
            if belt_speed == 0.0:
                sticks = breakpoints.time[slides] - np.append(until, ends[:-1])
                longest = max(longest, float(sticks.max()))
            self._slid = float(ends[-1]), longest
        self._last = breakpoints[len(breakpoints) - 1 :]
        return completed

    def measures(self) -> Measures:
        """Return the means over the last whole cycles.

        Returns
        -------
        Measures
            Measures in SI units.
        """
        if self.unbounded:
            return without_cycles(None, Regime.UNBOUNDED, steady=True)
        return with_drift(self._measures(), self.drift)

    def _measures(self) -> Measures:
        period = self._cycles[-1].period if self._cycles else 0.0
        now = self._parts[-1].end if self._parts else 0.0
        slid, longest = self._slid
        # Without a slide there is no crossing either.
        stuck = now - (slid if slid < inf or not self._parts else self._parts[0].start)
        if self._belt_speed == 0.0 and stuck > longest and stuck >= period:
            steady = True if self._lasts(stuck) else None
            return without_cycles(self._recent_motion(), Regime.STUCK, steady=steady)
        since_turn = now - self._parts[0].start if self._parts else 0.0
        held = self._held(since_turn > STALE_PERIODS * period) if self.within else None
        if held is not None:
            # What rounding leaves of a motion may grow over a few cycles by chance.
            enough = len(self._amplitudes) > 2 * LEAST_CYCLES
            trend = _trend(self._amplitudes, True, STEADY_CHANGE) if enough else None
            return without_cycles(held, Regime.HELD, steady=trend is None, trend=trend)
        if not self._cycles or since_turn > STALE_PERIODS * period:
            recent = self._recent_motion()
            moves = self._belt_speed != 0.0
            if (
                recent is None
                or recent.velocity_amplitude >= self._equilibrium_speed
                or (moves and recent.stick_fraction > 0.0)  # it sticks to a slow belt
            ):
                return without_cycles(None, None)
            steady = True if self._lasts(since_turn) else None
            regime = Regime.EQUILIBRIUM if moves else Regime.STUCK
            return without_cycles(recent, regime, steady=steady)
        means = CycleMeans.over(self._cycles)
        resting = means.cycle.velocity_amplitude < self._equilibrium_speed
        trend = _trend(self._amplitudes, resting, self._steady_share)
        steady = trend is None if len(self._amplitudes) >= LEAST_CYCLES else None
        return means.measures(resting, steady, trend)

    @property
    def repeats(self) -> bool:
        """Whether the amplitudes agree as those of a steady motion, whatever they tend to."""
        return _agree(self._amplitudes, self._steady_share)

    @property
    def _steady_share(self) -> float:
        """Share of the amplitude by which the cycles of a steady motion may differ."""
        if self.drift.resolution == 0.0 or not self._amplitudes:
            return STEADY_CHANGE
        # What the sensor tells differs from cycle to cycle.
        return max(STEADY_CHANGE_UNDER_NOISE, self.drift.resolution / max(self._amplitudes))

    def _held(self, at_rest: bool) -> Cycle | None:
        """Return the motion of three cycles and since, or only since; None beyond `within`."""
        recent = self._recent_motion()
        motions = [] if at_rest else list(self._cycles)[-LEAST_CYCLES:]
        motions += [] if recent is None else [recent]
        if not motions or (not self._cycles and motions[0].stick_fraction > 0.0):
            return None
        highest = max(motion.midpoint + motion.amplitude for motion in motions)
        lowest = min(motion.midpoint - motion.amplitude for motion in motions)
        middle, half = (highest + lowest) / 2.0, (highest - lowest) / 2.0
        fastest = max(motion.velocity_amplitude for motion in motions)
        held = Cycle(half, fastest, middle, 0.0, 0.0, 0.0)
        return held if highest - lowest <= self.within else None

    def _lasts(self, rest: float) -> bool:
        """Return whether a rest of this duration (s) has lasted for a window of the last cycles."""
        window = self._cycles.maxlen or 0
        return not self._cycles or rest >= window * self._cycles[-1].period

    @property
    def _equilibrium_speed(self) -> float:
        if self._belt_speed == 0.0:
            return self.rounding
        return EQUILIBRIUM_SPEED * self._fastest_belt

    def _upward_crossings(self, breakpoints: Breakpoints) -> list[int]:
        """Return the breakpoints at which the velocity changes from negative to positive."""
        speed = np.abs(breakpoints.velocity)
        self._fastest = max(self._fastest, float(speed[speed.argmax()]))
        noise = _NOISE * max(self._fastest, self._fastest_belt)
        if self._belt_speed == 0.0:
            noise = max(noise, self.rounding)
        (moving,) = (speed > noise).nonzero()
        if len(moving) == 0:
            return []
        directions = np.concatenate([[self._direction], np.sign(breakpoints.velocity[moving])])
        self._direction = float(directions[-1])
        rising = moving[(directions[:-1] < 0.0) & (directions[1:] > 0.0)].tolist()
        return [row - (row > 0 and bool(speed[row - 1] <= speed[row])) for row in rising]

    def _follow(self, columns: _Columns, row: int, last: int) -> None:
        """Add the breakpoints from one to another to the stretch since the last crossing.

        Once it is longer than the last cycle, a part begins whenever it has doubled: its last two
        parts are at least its last half.
        """
        if not self._parts:
            self._parts = [_Stretch.between(columns, row, row)]
        start = self._parts[0].start
        earliest = start + (self._cycles[-1].period if self._cycles else 0.0)
        while row < last:
            current = self._parts[-1]
            due = max(2.0 * current.start - start, earliest)
            due -= _TIME_ROUNDING * (due - start)
            find = bisect_left if due > current.start else bisect_right
            doubled = find(columns[0], due, row + 1, last + 1)
            self._parts[-1] = current.followed_by(
                _Stretch.between(columns, row, min(doubled, last))
            )
            if doubled <= last:
                self._parts.append(_Stretch.between(columns, doubled, doubled))
            row = doubled

    def _recent_motion(self) -> Cycle | None:
        """Return the latest part of a stretch without crossings, as if it were a cycle."""
        recent = self._parts[-2:]
        if not recent or recent[0].duration <= 0.0:
            return None
        return reduce(_Stretch.followed_by, recent).as_cycle()


def _trend(amplitudes: Sequence[float], resting: bool, share: float) -> Trend | None:
    """Return the change of the amplitude from cycle to cycle; None without one or with few cycles.

    Around a slide that is `resting` only growth from each cycle to the next counts: otherwise it is
    still settling, or the measured amplitude is noise.
    """
    if len(amplitudes) < LEAST_CYCLES:
        return None
    first, last, largest = amplitudes[0], amplitudes[-1], max(amplitudes)
    grows = last - first > share * first
    to_come = _change_to_come(amplitudes)
    if resting:
        grows |= to_come > STEADY_CHANGE * largest
        monotone = all(before < after for before, after in pairwise(amplitudes))
        return Trend.GROWING if grows and monotone else None
    if _agree(amplitudes, share):
        if abs(to_come) <= STEADY_CHANGE * largest:
            return None
        return Trend.GROWING if to_come > 0.0 else Trend.DECAYING
    if grows:
        return Trend.GROWING
    return Trend.DECAYING if first - last > share * first else Trend.VARYING


def _agree(amplitudes: Sequence[float], share: float) -> bool:
    largest = max(amplitudes, default=0.0)
    return largest - min(amplitudes, default=0.0) <= share * largest


def _change_to_come(amplitudes: Sequence[float]) -> float:
    """Return by how much the amplitude will differ from the mean of these; 0 if that is not known.

    Where the differences d between thirds of the window are a geometric sequence of the ratio q,
    the last amplitude will still change by d q / (1 - q), as in Aitken's extrapolation. Beats,
    disturbances and noise have no such ratio.
    """
    third = (len(amplitudes) - 1) // 3
    if third == 0:
        return 0.0
    ends = [amplitudes[-1 - number * third] for number in (3, 2, 1, 0)]
    first, second, last = (after - before for before, after in pairwise(ends))
    if not first * second > 0.0 or not second * last > 0.0:
        return 0.0
    ratio = last / second
    if abs(ratio - second / first) > _RATIO_ERROR * abs(1.0 - ratio):
        return 0.0
    most = _CYCLES_TO_COME / third
    left = last * (min(ratio / (1.0 - ratio), most) if ratio < 1.0 else most)
    return amplitudes[-1] + left - sum(amplitudes) / len(amplitudes)
