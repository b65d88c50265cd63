"""A window of the last cycles of positions with noise, kept as the samples come."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import LEAST_CYCLES, STALE_PERIODS, Cycle
from stickslip_ros.measures.noise import (
    NOISE_SHARE,
    PRECISION,
    ROUNDING,
    encoder_step,
    impulses,
    medians,
    white_noise,
)
from stickslip_ros.measures.single_cycles import (
    NoisySamples,
    Point,
    cycle_between,
    extreme_near,
    reach_beside,
    reversals,
)

REVERSAL, _REVERSAL_STEPS, _REVERSAL_SHARE = 8.0, 1.5, 0.1
"""Least size of a reversal, in standard deviations of the noise, in steps of the encoder, and as a
share of the last cycle."""
_BATCH, _LOOK_INTERVAL, _FIRST_LOOK, _LOOK_LENGTH = 32, 512, 128, 2048
"""Number of samples after which cycles are looked for, after which, and first, the noise is
estimated and cycles are looked for in long ones, and from which the noise is estimated."""
_HELD, _MOST_SAMPLES, _WITHOUT_CYCLES = 131_072, 400_000, 8192
"""Number of samples that are kept at least, as cycles with long rests show no reversals; up to
which the cycles of a window are kept; in which the first cycle is looked for."""
_MARGIN, _UNKNOWN = 64, 2
"""Number of samples that are kept before the window, for the fits at its start; of the last ones
that may still be impulses."""


@dataclass(frozen=True)
class Window:
    """The last cycles of a run without a gap, and what is known of its sensor; SI units."""

    samples: NoisySamples
    """Those of the cycles, and since."""
    cycles: Sequence[Cycle]
    lows: Sequence[Point]
    """Lowest points: the start of each cycle, and the end of the last."""
    before: "Window | None"
    """That before a gap, which counts until there are enough other cycles; None without."""
    most_cycles: int
    """Number of cycles that it has if the run is long enough."""
    run: int
    """Number of samples of the run so far."""
    noise: float
    """Standard deviation of the noise of the positions, m."""
    step: float
    """Their step, m; 0 without one."""

    @property
    def resting(self) -> bool:
        """Whether no reversal has come for several periods."""
        if not self.cycles:
            return False
        since = float(self.samples.time[-1]) - self.lows[-1].time
        return since > STALE_PERIODS * self.cycles[-1].period


class WindowMeter:
    """Keeps a window of positions with noise, fed in blocks of samples of any length.

    The noise is found from the positions. Velocities are used for one purpose: to tell whether they
    have noise.
    """

    def __init__(self, most_cycles: int) -> None:
        self.noisy = False
        """Whether positions or velocities have noise."""
        self.noise = self.step = 0.0
        """Standard deviation of the noise of the positions, m, and their step; 0 without one."""
        self.ends: list[float] = []
        """Time, s, at which each cycle ended that `feed` returned last."""
        self._most_cycles, self._run = most_cycles, 0
        self._before: Window | None = None
        self._begin()

    def _begin(self) -> None:
        self._cycles = deque[Cycle](maxlen=self._most_cycles)
        self._lows = deque[Point](maxlen=self._most_cycles + 1)
        self._table, self._rows = np.empty((4, 0)), slice(0, 0)  # room to grow, and what is held

    def interrupt(self) -> None:
        """Start a part of the run after a gap."""
        if len(self._cycles) >= (1 if self._before is None else LEAST_CYCLES):
            self._before = self.window(alone=True)
        self._begin()

    def window(self, *, alone: bool = False) -> Window:
        """Return the window as it is; `alone` without that before a gap."""
        return Window(
            self._held[:-_UNKNOWN],
            tuple(self._cycles),
            tuple(self._lows),
            None if alone else self._before,
            self._most_cycles,
            self._run,
            self.noise,
            self.step,
        )

    def feed(
        self, time: FloatArray, position: FloatArray, velocity: FloatArray, belt: FloatArray
    ) -> list[Cycle]:
        """Add the samples that follow (s, m, m/s); return the cycles that they complete."""
        self.ends = []
        completed: list[Cycle] = []
        new, end = np.array([time, position, velocity, belt]), 0
        while end < len(time):
            start, end = end, min(end + _BATCH - self._run % _BATCH, len(time))
            self._run += end - start
            self._add(new[:, start:end])
            if self._run % _LOOK_INTERVAL == 0 or self._run == _FIRST_LOOK:
                self._look()
            # Always at the same samples: what is found must not depend on the blocks.
            if self._run % _BATCH == 0 and self._run >= _FIRST_LOOK:
                completed += self._advance()
        return completed

    @property
    def _held(self) -> NoisySamples:
        """Samples so far; the last two may still be impulses."""
        return NoisySamples(*self._table[:, self._rows])

    def _add(self, columns: FloatArray) -> None:
        """Add samples, and drop impulses, which the samples beside them tell."""
        self._replace_last(0, columns)
        if self.noise > 0.0:
            last = self._table[:, self._rows][:, -columns.shape[1] - 2 * _UNKNOWN :]
            is_impulse = impulses(NoisySamples(*last).position, self.noise)
            if is_impulse.any():
                self._replace_last(len(is_impulse), last[:, ~is_impulse])

    def _replace_last(self, rows: int, columns: FloatArray) -> None:
        start, stop = self._rows.start, max(self._rows.stop - rows, self._rows.start)
        end = stop + columns.shape[1]
        if end > self._table.shape[1]:
            table = np.empty((4, 2 * (end - start) + 1024))
            table[:, : stop - start] = self._table[:, start:stop]
            self._table, start, stop, end = table, 0, stop - start, end - start
        self._table[:, stop:end] = columns
        self._rows = slice(start, end)

    def _look(self) -> None:
        """Estimate the noise, and the step of an encoder, from the last samples."""
        recent = self._held[:-_UNKNOWN][-_LOOK_LENGTH:]
        position, belt, count = recent.position, recent.belt, len(recent)
        if count < 3:
            return
        noise, step = white_noise(position), encoder_step(position)
        # One step from each sample to the next is a uniform motion, as of a slide that sticks.
        if np.ptp(position) > (count - 1.5) * step and np.abs(np.diff(position)).max() < 1.5 * step:
            step = 0.0
        if belt.any():  # the encoder may be that of a guide at rest
            course = position - float(belt[-1]) * (recent.time - recent.time[0])
            step = max(step, encoder_step(course, ROUNDING))
        moved = float(np.ptp(medians(position)))
        if noise > max(NOISE_SHARE * moved, PRECISION * float(np.abs(position).max())):
            self.noise, self.noisy = noise, True
        if step > 0.0:
            self.step = min(self.step or inf, step)
            # Steps that divide the travel of a sample leave no noise where it is looked for.
            self.noisy |= self.step > NOISE_SHARE * moved
        if not self.noisy:
            fastest = float(np.abs(recent.velocity).max())
            least = max(NOISE_SHARE * fastest, PRECISION * float(np.abs(belt).max()))
            self.noisy = white_noise(recent.velocity) > least

    def _advance(self) -> list[Cycle]:
        """Return the cycles that the samples since the last one complete."""
        held, lows, window = self._held, self._lows, self.window(alone=True)
        samples = window.samples
        first = samples.row(lows[-1].time) if lows else max(len(samples) - _WITHOUT_CYCLES, 0)
        if len(samples) - first >= _WITHOUT_CYCLES and self._run % _LOOK_INTERVAL:
            return []
        moves = self._cycles and not window.resting
        size = 2.0 * self._cycles[-1].amplitude if moves else 0.0
        completed: list[Cycle] = []
        # The median of the last position takes one more.
        least = max(REVERSAL * self.noise, _REVERSAL_STEPS * self.step, _REVERSAL_SHARE * size)
        for rows in reversals(held.position[first:-1], least):
            high, low = (first + row for row in rows)
            reach = reach_beside(low, high)
            if low + reach >= len(samples):
                break  # samples for the fit are missing
            end = extreme_near(samples, low, reach)
            sensor = self.noise, self.step
            cycle = cycle_between(samples, lows[-1], end, high, *sensor) if lows else None
            if cycle is not None:
                self._cycles.append(cycle)
                self.ends.append(end.time)
                completed.append(cycle)
            elif lows:
                lows.pop()
            lows.append(end)
        row = samples.row(lows[0].time) if lows else len(samples)
        row = max(min(row - _MARGIN, len(samples) - _HELD), len(samples) - _MOST_SAMPLES)
        if row > 0:
            self._rows = slice(self._rows.start + row, self._rows.stop)
            while len(lows) > 1 and lows[0].time < self._table[0, self._rows.start]:
                lows.popleft()
                self._cycles.popleft()
        return completed
