"""Cycles and measures of positions with noise, in bounded memory."""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from math import inf
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.cycle_fit import MeanCycle, fit_mean_cycle
from stickslip_ros.physics.measures.cycle_measures import (
    EQUILIBRIUM_SPEED,
    LEAST_CYCLES,
    STALE_PERIODS,
    Cycle,
    CycleMeans,
    Measures,
    Regime,
    without_cycles,
)
from stickslip_ros.physics.measures.drift import resolved
from stickslip_ros.physics.measures.noise import (
    FEW_SAMPLES,
    FEWEST_SAMPLES,
    LEAST_SAMPLES,
    PRECISION,
    REVERSAL,
    Extremes,
    NoisySamples,
    Point,
    cycle_between,
    fit_reach,
    impulses,
    rest,
    strongest_line,
    trend_under_noise,
    vertex,
    white_noise,
)
from stickslip_ros.physics.measures.slips import regime_by_slips

_FEW_STEPS = 25.0
"""Amplitude, in steps of an encoder without noise, below which the errors are not known."""
_REVERSAL_SHARE = 0.1
"""Least size of a reversal, as a share of the last cycle."""
_BATCH = 32
"""Number of samples after which cycles are looked for."""
_LOOK_INTERVAL = 512
"""Number of samples after which the noise is estimated again."""
_FIRST_LOOK = 128
"""Number of samples after which the noise is estimated first."""
_LOOK_LENGTH = 2048
"""Number of samples from which the noise is estimated."""
_MOST_SAMPLES = 400_000
"""Number of samples up to which the cycles of a window are kept."""
_MARGIN = 64
"""Number of samples that are kept before the window, for the fits at its start."""
_ROUNDING_SHARE = 1e-7
"""Noise below this share of the motion is rounding, or an imperfection of the estimate."""
_STEP_DEVIATION = 1e-3
"""Largest deviation of whole numbers of steps."""

_NO_SAMPLES = NoisySamples(*(np.empty(0),) * 5)


class _Columns:
    """Samples as columns that grow at the end and are cut at the start."""

    def __init__(self) -> None:
        self._table = np.empty((5, 1024))
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def samples(self) -> NoisySamples:
        return NoisySamples(*self._table[:, : self._count])

    def append(self, samples: NoisySamples) -> None:
        end = self._count + len(samples)
        if end > self._table.shape[1]:
            larger = np.empty((5, 2 * end))
            larger[:, : self._count] = self._table[:, : self._count]
            self._table = larger
        self._table[:, self._count : end] = list(vars(samples).values())
        self._count = end

    def cut(self, row: int) -> None:
        self._table[:, : self._count - row] = self._table[:, row : self._count].copy()
        self._count -= row


class _Window(NamedTuple):
    """Cycles to average over, with their samples and the instants between them."""

    samples: NoisySamples
    cycles: Sequence[Cycle]
    starts: Sequence[float]


class NoisyCycleMeter:
    """Measures positions with noise, fed in blocks of samples of any length.

    It keeps the samples of the last `window` cycles at most, and calls functions of them: those of
    `noise` as cycles end, and for the measures `fit_mean_cycle`, as long as the cycles are alike;
    otherwise the measures are means over the cycles.

    The noise is found from the positions. Velocities are used for one purpose: to tell whether they
    have noise.
    """

    def __init__(self, window: int) -> None:
        self._cycles: deque[Cycle] = deque(maxlen=window)
        self._starts: deque[float] = deque(maxlen=window + 1)
        self.noise = 0.0
        """Standard deviation of the noise of the positions, m, as far as it is known."""
        self.noisy = False
        """Whether positions or velocities have noise."""
        self.step = 0.0
        """Step of the positions, m, that they are multiples of; 0 as long as none is found."""
        self.within = 0.0
        """Range, m, in which a slide is held as far as its actuator can."""
        self.stick_speed = 0.0
        """Relative speed, m/s, up to which a slide sticks whose friction has a memory."""
        self.ends: list[float] = []
        """Time, s, at which each cycle ended that `feed` returned last."""
        self._count = 0
        self._fastest_belt = 0.0
        self._held, self._before = _Columns(), _Window(_NO_SAMPLES, (), ())
        self.interrupt()

    @property
    def held(self) -> int:
        """Number of samples that are held."""
        return len(self._held)

    def interrupt(self) -> None:
        """Drop the current cycle: the next sample does not continue the motion so far."""
        if len(self._cycles) >= LEAST_CYCLES or not self._before.cycles:
            # The cycles so far are the window until there are enough others.
            self._before = _Window(self._held.samples, tuple(self._cycles), tuple(self._starts))
        self._held, self._raw = _Columns(), _NO_SAMPLES
        self._cycles.clear()
        self._starts.clear()
        self._extremes, self._scanned = Extremes(), -inf
        self._high: float | None = None
        self._lows: deque[tuple[float, float | None]] = deque()
        """Times of the lowest samples that are not fitted yet, and of the highest before each."""
        self._last_turn: Point | None = None
        self._size = 0.0

    def feed(
        self, time: FloatArray, position: FloatArray, velocity: FloatArray, belt: FloatArray
    ) -> list[Cycle]:
        """Add the samples that follow (s, m, m/s); return the cycles that they complete."""
        self.ends = []
        completed: list[Cycle] = []
        new = NoisySamples(time, position, velocity, belt, position)
        self._fastest_belt = max(self._fastest_belt, float(np.abs(belt).max(initial=0.0)))
        while len(new) > 0:
            due = _BATCH - self._count % _BATCH
            part, new = new[:due], new[due:]
            self._count += len(part)
            self._take(part)
            if self._count % _LOOK_INTERVAL == 0 or self._count == _FIRST_LOOK:
                self._look()
            # Always at the same samples: what is found must not depend on the blocks.
            if self._count % _BATCH == 0:
                completed += self._advance()
        return completed

    @property
    def line(self) -> float | None:
        """Frequency of the line in the spectrum of the last positions, see `strongest_line`."""
        position = self._recent().position
        # An encoder that rounds a steady motion has lines, too.
        if len(position) < FEWEST_SAMPLES:
            return None
        flat = position - np.linspace(position[0], position[-1], len(position))
        least = max(self._resolved, PRECISION * float(np.abs(position).max()))
        return strongest_line(flat) if np.ptp(flat) > least else None

    def measures(self, *, quick: bool = False) -> tuple[Measures, MeanCycle | None]:
        """Return the measures of the last whole cycles, and the mean cycle if they are alike.

        With `quick`, means over single cycles will do.
        """
        recent, resting = self._recent(), self._resting()
        # Few samples after a gap tell less than the cycles before it.
        enough = len(recent) >= (FEWEST_SAMPLES if self._before.cycles else 1)
        if enough and 0.0 < self._resolved >= float(np.ptp(recent.position)):
            return self._rest(recent, Regime.HELD), None
        window = _Window(self._held.samples, self._cycles, self._starts)
        if len(self._cycles) < LEAST_CYCLES and self._before.cycles and not resting:
            window = self._before
        resting |= not window.cycles
        line = self.line
        if line is not None and (resting or line * FEW_SAMPLES > 1.0):
            return self._by_line(recent, line)
        if resting:
            # The second half of what has come since the last cycle.
            samples = window.samples
            first = samples.row(self._starts[-1]) if self._cycles else 0
            return self._rest(samples[(first + len(samples)) // 2 :]), None
        fit = None if quick else self._fit(window.samples, window.starts)
        if fit is not None:
            return self._found(window.samples, fit, fit.noise), fit
        return self._unlike(window, by_slips=not quick), None

    def _unlike(self, window: _Window, *, by_slips: bool) -> Measures:
        """Return the measures of cycles that are not alike, whose slips tell whether it sticks."""
        # Half of the cycles: a single one may seem to stick for a moment.
        means = CycleMeans.over(window.cycles, 0.5)
        found = self._found(window.samples, means, self.noise)
        if not by_slips or found.regime not in (Regime.STICK_SLIP, Regime.PURE_SLIP):
            return found
        part = window.samples[window.samples.row(window.starts[0]) :]
        sign = -1.0 if float(part.belt[-1]) < 0.0 else 1.0
        size = max(means.cycle.amplitude / 2.0, REVERSAL * max(self.noise, self.step))
        regime = regime_by_slips(part.time, sign * part.position, size, means.cycle.period)
        if regime in (None, found.regime):
            return found
        share = None if regime is Regime.STICK_SLIP else 0.0
        return replace(found, regime=regime, stick_fraction=share)

    def _by_line(self, samples: NoisySamples, line: float) -> tuple[Measures, MeanCycle | None]:
        """Return the measures of the cycles that a line of the spectrum shows."""
        if line * LEAST_SAMPLES > 1.0:
            return without_cycles(None, Regime.UNDERSAMPLED), None
        time, window = samples.time, self._cycles.maxlen or 0
        period = float(time[-1] - time[0]) / (len(time) - 1) / line
        cycles = min(int(float(time[-1] - time[0]) / period), window)
        fit = self._fit(samples, (time[-1] - period * np.arange(cycles, -1.0, -1.0)).tolist())
        if fit is None:
            few = line * FEW_SAMPLES > 1.0
            return without_cycles(None, Regime.UNDERSAMPLED if few else None), None
        return self._found(samples, fit, fit.noise), fit

    def _found(self, samples: NoisySamples, means: CycleMeans, noise: float) -> Measures:
        """Return the measures of cycles in samples with this noise, m."""
        enough, size = len(means.amplitudes) >= LEAST_CYCLES, means.cycle.amplitude
        trend = trend_under_noise(means.amplitudes, self.noise, self.step) if enough else None
        if noise < self.step / 2.0 and size < _FEW_STEPS * self.step:
            means = replace(means, errors=None)
        moving = float(samples.belt[-1]) != 0.0
        slow = means.cycle.velocity_amplitude < EQUILIBRIUM_SPEED * self._fastest_belt
        return means.measures(moving and slow, trend is None if enough else None, trend)

    def _rest(self, samples: NoisySamples, regime: Regime = Regime.EQUILIBRIUM) -> Measures:
        window = self._cycles.maxlen or 0
        needed = window * self._cycles[-1].period if self._cycles else 0.0
        return rest(samples, self.noise, self._resolved, needed, regime)

    def _fit(self, held: NoisySamples, starts: Sequence[float]) -> MeanCycle | None:
        if len(starts) <= LEAST_CYCLES:
            return None
        part = held[held.row(starts[0]) : held.row(starts[-1])]
        belt = float(np.median(part.belt))
        if float(np.ptp(part.belt)) > 1e-6 * abs(belt):
            return None
        with np.errstate(over="ignore", invalid="ignore"):  # squares of very large positions
            return fit_mean_cycle(
                part.time,
                part.position,
                belt,
                np.array(starts),
                self.noise,
                self.step,
                self.stick_speed,
            )

    @property
    def _resolved(self) -> float:
        """Range of positions, m, within which the sensor or the actuator resolves no motion."""
        return max(resolved(self.step, self.noise), self.within)

    def _recent(self) -> NoisySamples:
        """Return the samples of the last part of the run, of several cycles if there are any."""
        samples = self._held.samples
        row = len(samples) - min(max(self._count // 4, _FIRST_LOOK), _LOOK_LENGTH)
        if self._cycles and 2.0 * self._cycles[-1].amplitude > self._resolved:
            # What seems to be a last cycle may have ended by noise, long after.
            period = min(cycle.period for cycle in self._cycles)
            row = min(row, samples.row(float(samples.time[-1]) - LEAST_CYCLES * period))
        return samples[max(row, 0) :]

    def _resting(self) -> bool:
        """Return whether no reversal has come for several periods."""
        if not self._cycles or len(self._held) == 0:
            return False
        since = float(self._held.samples.time[-1]) - self._starts[-1]
        return since > STALE_PERIODS * self._cycles[-1].period

    def _take(self, part: NoisySamples) -> None:
        """Hold samples without impulses; the last two wait for those that follow."""
        raw = self._raw.followed_by(part)
        first, last = min(len(self._raw), 2), len(raw) - 2
        if last <= first:
            self._raw = raw
            return
        self._raw = raw[max(last - 2, 0) :]
        position = raw.position
        middle = np.sort([position[:-2], position[1:-1], position[2:]], axis=0)[1]
        raw = replace(raw, median=np.concatenate([position[:1], middle, position[-1:]]))
        rows = np.arange(first, last)
        if self.noise > 0.0:
            rows = rows[~impulses(position, self.noise)[first:last]]
        self._held.append(raw[rows])

    def _look(self) -> None:
        """Estimate the noise, and the step of an encoder, from the last samples."""
        recent = self._held.samples[-_LOOK_LENGTH:]
        noise = white_noise(recent.position)
        moved = float(np.ptp(recent.median)) if len(self._held) > 0 else 0.0
        farthest = float(np.abs(recent.position).max(initial=0.0))
        if noise > max(_ROUNDING_SHARE * moved, PRECISION * farthest):
            self.noise, self.noisy = noise, True
        levels = np.diff(np.unique(recent.position))
        if len(levels) > 0 and levels.min() > PRECISION * farthest:
            steps = levels / levels.min()
            if np.abs(steps - np.rint(steps)).max() < _STEP_DEVIATION:
                self.step = min(self.step or inf, float(levels.min()))
                # Steps that divide the travel of a sample leave no noise where it is looked for.
                # Equal steps from sample to sample are a uniform motion, as of a slide that sticks.
                uniform = len(levels) + 1 == len(recent) and steps.max() < 1.5
                self.noisy |= self.step > _ROUNDING_SHARE * moved and not uniform
        fastest = float(np.abs(recent.velocity).max(initial=0.0))
        of_velocity = white_noise(recent.velocity)
        if of_velocity > max(_ROUNDING_SHARE * fastest, PRECISION * self._fastest_belt):
            self.noisy = True

    def _advance(self) -> list[Cycle]:
        """Follow the reversals of the samples that are new; return the cycles completed."""
        samples = self._held.samples
        if self._count >= _FIRST_LOOK and len(self._held) > 0:
            self._scan(samples)
        completed: list[Cycle] = []
        while self._lows:
            low, high = self._lows[0]
            at, reach = samples.row(low), fit_reach(samples, low, high, self.noise)
            if at + reach >= len(self._held):
                break  # samples for the fit are missing
            self._lows.popleft()
            turn, start = vertex(samples, at, reach), self._last_turn
            self._last_turn = turn
            if start is None or high is None:
                continue
            cycle = cycle_between(samples, start, turn, high, self.noise)
            if cycle is not None:
                if not self._cycles:
                    self._starts.append(start.time)
                self._cycles.append(cycle)
                self._starts.append(turn.time)
                self._size = 2.0 * cycle.amplitude
                self.ends.append(turn.time)
                completed.append(cycle)
        if self._resting():
            self._size = 0.0
        self._trim(samples.time)
        return completed

    def _scan(self, samples: NoisySamples) -> None:
        """Look for extremes in the samples that are new."""
        rows = slice(int(np.searchsorted(samples.time, self._scanned, "right")), None)
        self._scanned = float(samples.time[-1])
        new = zip(samples.time[rows].tolist(), samples.median[rows].tolist(), strict=True)
        least = max(REVERSAL * self.noise, _REVERSAL_SHARE * self._size)
        for extreme, highest in self._extremes.feed(list(map(Point._make, new)), least):
            if highest:
                self._high = extreme.time
            else:
                self._lows.append((extreme.time, self._high))
                self._high = None

    def _trim(self, time: FloatArray) -> None:
        """Drop the samples before the window."""
        starts = [self._starts[0]] if self._starts else []
        if not starts and self._last_turn is not None:
            starts.append(self._last_turn.time)
        last = self._extremes.last
        needed = [*starts, *(each for each in (self._high, last and last.time) if each is not None)]
        needed += [each for pair in self._lows for each in pair if each is not None]
        row = int(np.searchsorted(time, min(needed, default=-inf)))
        if not starts:
            row = min(row, len(time) - 2 * _LOOK_LENGTH)
        row = max(row, len(time) - _MOST_SAMPLES) - _MARGIN
        # Now and then, not with every block: the columns are copied.
        if row < max(len(time) // 2, 512):
            return
        self._held.cut(row)
        while self._starts and self._starts[0] < self._held.samples.time[0]:
            self._starts.popleft()
            if self._cycles:
                self._cycles.popleft()
