"""Cycles and measures of positions with noise, in bounded memory."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, pi, sqrt
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.physics.measures.cycle_fit import MeanCycle, fit_mean_cycle
from stickslip_ros.physics.measures.cycle_measures import (
    EQUILIBRIUM_SPEED,
    LEAST_CYCLES,
    STALE_PERIODS,
    STEADY_UNDER_NOISE,
    Cycle,
    Measures,
    Regime,
    Trend,
    errors_of_means,
    without_cycles,
)
from stickslip_ros.physics.measures.drift import resolved
from stickslip_ros.physics.measures.noise import (
    FEW_SAMPLES,
    FEWEST,
    LEAST_SAMPLES,
    impulses,
    strongest_line,
    white_noise,
)

_FEW_STEPS = 25.0
"""Amplitude, in steps of an encoder without noise, below which the errors are not known."""
_PASSING_SHARE = 1.15
"""Share of the belt speed beyond which a slide has passed the belt; calibrations err by less."""
LEAST_STICK = 0.03
"""Stick fraction up to which a single cycle counts as one without a stick."""

_REVERSAL = 8.0
"""Least size of a reversal, in standard deviations of the noise."""
_REVERSAL_SHARE = 0.1
"""Least size of a reversal, as a share of the last cycle."""
_QUANTUM = 1.73
"""Resolution of an encoder with a noise of half of it, in standard deviations of the two."""
_STEP = 32
"""Number of samples after which cycles are looked for."""
_LOOKS = 512
"""Number of samples after which the noise is estimated again."""
_FIRST_LOOK = 128
"""Number of samples after which the noise is estimated first."""
_LOOKED_AT = 2048
"""Number of samples from which the noise is estimated."""
_MOST = 400_000
"""Number of samples up to which the cycles of a window are kept."""
_MARGIN = 64
"""Number of samples that are kept before the window, for the fits at its start."""
_ROUNDING = 1e-7
"""Noise below this share of the motion is rounding, or an imperfection of the estimate."""
_STEP_DEVIATION = 1e-3
"""Largest deviation of whole numbers of steps."""
_PRECISION = 1e-12
"""Noise below this share of the largest values is rounding of the numbers, not of a sensor."""
_SLIP_SHARE = 0.1
"""Share of the belt speed by which a slide at rest may seem to move."""


@dataclass(frozen=True)
class _Turn:
    """A reversal of the position, fitted."""

    time: float
    position: float


class _Samples(NamedTuple):
    """Columns of samples."""

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    belt: FloatArray
    median: FloatArray
    """Median of each position and those beside it, m."""

    def part(self, rows: slice | IntArray) -> "_Samples":
        return _Samples(*(column[rows] for column in self))


_NO_SAMPLES = _Samples(*(np.empty(0),) * 5)


class _Held:
    """Samples that are held, as columns that grow at the end and are cut at the start."""

    def __init__(self) -> None:
        self._table = np.empty((5, 1024))
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def samples(self) -> _Samples:
        return _Samples(*self._table[:, : self._count])

    def append(self, samples: _Samples) -> None:
        end = self._count + len(samples.time)
        if end > self._table.shape[1]:
            larger = np.empty((5, 2 * end))
            larger[:, : self._count] = self._table[:, : self._count]
            self._table = larger
        self._table[:, self._count : end] = samples
        self._count = end

    def cut(self, row: int) -> None:
        self._table[:, : self._count - row] = self._table[:, row : self._count].copy()
        self._count -= row


class _Window(NamedTuple):
    """Cycles to average over, with their samples and the instants between them."""

    samples: _Samples
    cycles: Sequence[Cycle]
    starts: Sequence[float]


class NoisyCycleMeter:
    """Measures positions with noise, fed in blocks of samples of any length.

    A cycle lasts from one lowest position to the next, each fitted by a parabola; reversals within
    the noise are none. The measures are those of the mean cycle, see `MeanCycle`, as long as the
    cycles are alike; otherwise they are means over the cycles, the last `window` at most.

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
        self.ends: list[float] = []
        """Time, s, at which each cycle ended that `feed` returned last."""
        self._count = 0
        self._fastest_belt = 0.0
        self._held, self._before = _Held(), _Window(_NO_SAMPLES, (), ())
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
        self._held, self._raw = _Held(), _NO_SAMPLES
        self._cycles.clear()
        self._starts.clear()
        self._scanned = self._extreme = 0
        self._rising: bool | None = None
        self._high: int | None = None
        self._waiting: deque[tuple[int, int | None]] = deque()
        self._last_turn: _Turn | None = None
        self._size = 0.0

    def feed(
        self, time: FloatArray, position: FloatArray, velocity: FloatArray, belt: FloatArray
    ) -> list[Cycle]:
        """Add the samples that follow (s, m, m/s); return the cycles that they complete."""
        self.ends = []
        completed: list[Cycle] = []
        new = _Samples(time, position, velocity, belt, position)
        self._fastest_belt = max(self._fastest_belt, float(np.abs(belt).max(initial=0.0)))
        while len(new.time) > 0:
            due = _STEP - self._count % _STEP
            part, new = new.part(slice(due)), new.part(slice(due, None))
            self._count += len(part.time)
            self._take(part)
            if self._count % _LOOKS == 0 or self._count == _FIRST_LOOK:
                self._look()
            # Always at the same samples: what is found must not depend on the blocks.
            if self._count % _STEP == 0:
                completed += self._advance()
        return completed

    @property
    def line(self) -> float | None:
        """Frequency of the line in the spectrum of the last positions, see `strongest_line`."""
        position = self._recent().position
        # An encoder that rounds a steady motion has lines, too.
        if len(position) < FEWEST:
            return None
        flat = position - np.linspace(position[0], position[-1], len(position))
        least = max(self._resolved, _PRECISION * float(np.abs(position).max()))
        return strongest_line(flat) if np.ptp(flat) > least else None

    def measures(self, *, quick: bool = False) -> tuple[Measures, MeanCycle | None]:
        """Return the measures of the last whole cycles, and the mean cycle if they are alike.

        With `quick`, means over single cycles will do.
        """
        recent = self._recent()
        # Few samples after a gap tell less than the cycles before it.
        enough = len(recent.time) >= (FEWEST if self._before.cycles else 1)
        if enough and 0.0 < self._resolved >= float(np.ptp(recent.position)):
            return self._rest(recent, Regime.HELD), None
        held, cycles, starts = self._held.samples, tuple(self._cycles), tuple(self._starts)
        resting = not cycles or self._resting()
        if len(cycles) < LEAST_CYCLES and self._before.cycles and not self._resting():
            (held, cycles, starts), resting = self._before, False
        line = self.line
        if line is not None and (resting or line * FEW_SAMPLES > 1.0):
            return self._by_line(recent, line)
        if resting:
            return self._rest(self._since_cycles()), None
        fit = None if quick else self._fit(held, starts)
        if fit is not None:
            errors = None if self._coarse(fit.noise, fit.cycle) else fit.errors._asdict()
            return self._found(held, fit.cycle, fit.amplitudes, fit.sticks, errors), fit
        mean = Cycle(*np.mean(cycles, axis=0).tolist())
        # Half of the cycles: a single one may seem to stick for a moment.
        sticks = 2 * sum(cycle.stick_fraction > 0.0 for cycle in cycles) > len(cycles)
        amplitudes = np.array([cycle.amplitude for cycle in cycles])
        errors = None if self._coarse(self.noise, mean) else errors_of_means(cycles)
        return self._found(held, mean, amplitudes, sticks, errors), None

    def _by_line(self, samples: _Samples, line: float) -> tuple[Measures, MeanCycle | None]:
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
        errors = None if self._coarse(fit.noise, fit.cycle) else fit.errors._asdict()
        return self._found(samples, fit.cycle, fit.amplitudes, fit.sticks, errors), fit

    def _found(
        self,
        samples: _Samples,
        mean: Cycle,
        amplitudes: FloatArray,
        sticks: bool,
        errors: dict[str, float] | None,
    ) -> Measures:
        """Return the measures of cycles in samples."""
        enough, count = len(amplitudes) >= LEAST_CYCLES, len(amplitudes)
        trend = self._trend(amplitudes) if enough else None
        steady = trend is None if enough else None
        moving = float(samples.belt[-1]) != 0.0
        if moving and mean.velocity_amplitude < EQUILIBRIUM_SPEED * self._fastest_belt:
            return without_cycles(mean, Regime.EQUILIBRIUM, count, steady=steady, trend=trend)
        return Measures(
            **mean._asdict(),
            cycles=count,
            regime=Regime.STICK_SLIP if sticks else Regime.PURE_SLIP,
            steady=steady,
            trend=trend,
            errors=errors,
        )

    def _coarse(self, noise: float, mean: Cycle) -> bool:
        """Return whether an encoder without noise has too few steps for standard errors."""
        return noise < self.step / 2.0 and mean.amplitude < _FEW_STEPS * self.step

    @property
    def _resolved(self) -> float:
        """Range of positions, m, within which the sensor or the actuator resolves no motion."""
        return max(resolved(self.step, self.noise), self.within)

    def _recent(self) -> _Samples:
        """Return the samples of the last part of the run, of several cycles if there are any."""
        samples = self._held.samples
        row = len(samples.time) - min(max(self._count // 4, _FIRST_LOOK), _LOOKED_AT)
        if self._cycles and 2.0 * self._cycles[-1].amplitude > self._resolved:
            # What seems to be a last cycle may have ended by noise, long after.
            period = min(cycle.period for cycle in self._cycles)
            since = samples.time[-1] - LEAST_CYCLES * period
            row = min(row, int(np.searchsorted(samples.time, since)))
        return samples.part(slice(max(row, 0), None))

    def _since_cycles(self) -> _Samples:
        """Return the second half of the samples since the last cycle."""
        samples = self._held.samples
        first = np.searchsorted(samples.time, self._starts[-1]) if self._cycles else 0
        return samples.part(slice((int(first) + len(samples.time)) // 2, None))

    @property
    def _least(self) -> float:
        """Least size of a reversal, m."""
        return max(_REVERSAL * self.noise, _REVERSAL_SHARE * self._size)

    def _take(self, part: _Samples) -> None:
        """Hold samples without impulses; the last two wait for those that follow."""
        waiting = len(self._raw.time)
        raw = _Samples(*(np.concatenate(pair) for pair in zip(self._raw, part, strict=True)))
        first, last = min(waiting, 2), len(raw.time) - 2
        if last <= first:
            self._raw = raw
            return
        self._raw = raw.part(slice(last - 2 if last > 2 else 0, None))
        position = raw.position
        middle = np.sort([position[:-2], position[1:-1], position[2:]], axis=0)[1]
        raw = raw._replace(median=np.concatenate([position[:1], middle, position[-1:]]))
        rows = np.arange(first, last)
        if self.noise > 0.0:
            rows = rows[~impulses(position, self.noise)[first:last]]
        self._held.append(raw.part(rows))

    def _look(self) -> None:
        """Estimate the noise from the last samples."""
        recent = self._held.samples.part(slice(-_LOOKED_AT, None))
        noise = white_noise(recent.position)
        moved = float(np.ptp(recent.median)) if len(self._held) > 0 else 0.0
        farthest = float(np.abs(recent.position).max(initial=0.0))
        if noise > max(_ROUNDING * moved, _PRECISION * farthest):
            self.noise, self.noisy = noise, True
        levels = np.diff(np.unique(recent.position))
        if len(levels) > 0 and levels.min() > _PRECISION * farthest:
            steps = levels / levels.min()
            if np.abs(steps - np.rint(steps)).max() < _STEP_DEVIATION:
                self.step = min(self.step or inf, float(levels.min()))
        fastest = float(np.abs(recent.velocity).max(initial=0.0))
        if white_noise(recent.velocity) > max(_ROUNDING * fastest, _PRECISION * self._fastest_belt):
            self.noisy = True

    def _advance(self) -> list[Cycle]:
        """Follow the reversals of the samples that are new; return the cycles completed."""
        self._scan()
        completed: list[Cycle] = []
        while self._waiting:
            low, high = self._waiting[0]
            turn = self._turn(low, high)
            if turn is None:
                break
            self._waiting.popleft()
            if self._last_turn is not None and high is not None:
                cycle = self._cycle(self._last_turn, turn, high)
                if cycle is not None:
                    if not self._cycles:
                        self._starts.append(self._last_turn.time)
                    self._cycles.append(cycle)
                    self._starts.append(turn.time)
                    self._size = 2.0 * cycle.amplitude
                    self.ends.append(turn.time)
                    completed.append(cycle)
            self._last_turn = turn
        if self._resting():
            self._size = 0.0
        self._trim()
        return completed

    def _scan(self) -> None:
        """Find the reversals: the position has gone back by more than noise from an extreme."""
        position = self._held.samples.median
        if self._count < _FIRST_LOOK:
            return
        while self._scanned < len(position):
            new = position[self._scanned :]
            extreme = position[self._extreme]
            if self._rising is None:
                far = np.abs(new - extreme) > self._least
                if not far.any() or (self._least == 0.0 and not np.ptp(new) > 0.0):
                    self._scanned = len(position)
                    break
                first = int(np.argmax(far))
                self._rising = bool(new[first] > extreme)
                self._extreme = self._scanned + first
                self._scanned = self._extreme + 1
                continue
            sign = 1.0 if self._rising else -1.0
            running = np.maximum.accumulate(np.append(sign * extreme, sign * new))
            back = running[1:] - sign * new > self._least
            found = bool(back.any())
            last = int(np.argmax(back)) if found else len(new)
            if last > 0:
                best = int(np.argmax(sign * new[:last]))
                if sign * new[best] > sign * extreme:
                    self._extreme = self._scanned + best
            if not found:
                self._scanned = len(position)
                break
            if self._rising:
                self._high = self._extreme
            else:
                self._waiting.append((self._extreme, self._high))
                self._high = None
            self._rising = not self._rising
            self._extreme = self._scanned + last
            self._scanned = self._extreme + 1

    def _turn(self, low: int, high: int | None) -> _Turn | None:
        """Return the lowest position, fitted; None as long as samples for the fit are missing."""
        reach = self._fit_reach(low, high)
        if low + reach >= len(self._held):
            return None
        return self._vertex(low, reach)

    def _fit_reach(self, low: int, high: int | None) -> int:
        """Return the number of samples on each side of an extreme to which a parabola is fitted."""
        if high is None or high == low:
            return 2
        size = abs(float(self._held.samples.position[high] - self._held.samples.position[low]))
        share = np.clip(1.2 * (2.0 * self.noise / size) ** 0.2, 0.1, 0.6) if size > 0.0 else 0.1
        return max(int(share * abs(high - low) / pi), 2)

    def _vertex(self, at: int, reach: int) -> _Turn:
        rows = slice(max(at - reach, 0), at + reach + 1)
        time, position = self._held.samples.time[rows], self._held.samples.position[rows]
        centre, scale = float(self._held.samples.time[at]), float(time[-1] - time[0])
        if len(time) < 5 or scale <= 0.0:
            return _Turn(centre, float(self._held.samples.position[at]))
        u = (time - centre) / scale
        base = float(position[0])
        bend, slope, level = np.polyfit(u, position - base, 2)
        if bend == 0.0:
            return _Turn(centre, float(self._held.samples.position[at]))
        vertex = float(np.clip(-slope / (2.0 * bend), u[0], u[-1]))
        return _Turn(
            centre + vertex * scale, base + float(level + vertex * (slope + vertex * bend))
        )

    def _cycle(self, start: _Turn, end: _Turn, high: int) -> Cycle | None:
        first, last = np.searchsorted(self._held.samples.time, [start.time, end.time])
        period = end.time - start.time
        if period <= 0.0:
            return None
        lowest = (start.position + end.position) / 2.0
        reach = self._fit_reach(int(first), high)
        highest = self._vertex(high, reach).position
        around = slice(max(int(first) - reach, 0), int(last) + reach)
        samples = self._held.samples.part(around)
        slowest, fastest, stick_time = _velocities(samples, reach, self.noise)
        return Cycle(
            amplitude=(highest - lowest) / 2.0,
            velocity_amplitude=(fastest - slowest) / 2.0,
            midpoint=(highest + lowest) / 2.0,
            period=period,
            frequency=1.0 / period,
            stick_fraction=stick_time / period if stick_time > LEAST_STICK * period else 0.0,
        )

    def _trim(self) -> None:
        """Drop the samples before the window."""
        needed = self._starts[0] if self._starts else None
        if needed is None and self._last_turn is not None:
            needed = self._last_turn.time
        row = 0 if needed is None else int(np.searchsorted(self._held.samples.time, needed))
        row = max(row, len(self._held) - _MOST)
        if needed is None:
            row = max(row, len(self._held) - 2 * _LOOKED_AT)
        known = [self._scanned, self._extreme, *(low for low, _ in self._waiting)]
        known += [high for _, high in self._waiting if high is not None]
        known += [] if self._high is None else [self._high]
        row = min(row, *known) if len(self._held) <= _MOST else row
        row -= _MARGIN
        # Now and then, not with every block: the columns are copied.
        if row < max(len(self._held) // 2, 512):
            return
        self._held.cut(row)
        self._scanned, self._extreme = max(self._scanned - row, 0), max(self._extreme - row, 0)
        self._waiting = deque(
            (max(low - row, 0), None if high is None else max(high - row, 0))
            for low, high in self._waiting
        )
        self._high = None if self._high is None else max(self._high - row, 0)
        while self._starts and self._starts[0] < self._held.samples.time[0]:
            self._starts.popleft()
            if self._cycles:
                self._cycles.popleft()

    def _resting(self) -> bool:
        """Return whether no reversal has come for several periods."""
        if not self._cycles or len(self._held) == 0:
            return False
        since = float(self._held.samples.time[-1]) - self._starts[-1]
        return since > STALE_PERIODS * self._cycles[-1].period

    def _rest(self, samples: _Samples, regime: Regime = Regime.EQUILIBRIUM) -> Measures:
        """Return the measures of a motion without cycles."""
        none = without_cycles(None, None)
        if len(samples.time) < 8:
            return none
        time = samples.time - samples.time[0]
        belt_speed = abs(float(samples.belt[-1]))
        slope = float(np.polyfit(time, samples.position - samples.position[0], 1)[0])
        spread = float(np.std(samples.position))
        far = max(self._resolved, _REVERSAL * self.noise, _PRECISION * abs(samples.position[0]))
        if abs(slope) > _SLIP_SHARE * belt_speed and abs(slope) * float(time[-1]) > far:
            return none
        window = self._cycles.maxlen or 0
        lasts = not self._cycles or float(time[-1]) * 2.0 >= window * self._cycles[-1].period
        rest = Cycle(
            amplitude=sqrt(2.0 * max(spread**2 - self.noise**2, 0.0)),
            velocity_amplitude=0.0,
            midpoint=float(np.mean(samples.position)),
            period=0.0,
            frequency=0.0,
            stick_fraction=0.0 if belt_speed > 0.0 else 1.0,
        )
        regime = regime if belt_speed > 0.0 else Regime.STUCK
        found = without_cycles(rest, regime, steady=lasts or regime is Regime.HELD or None)
        return replace(found, velocity_amplitude=None)  # the positions do not tell it

    def _fit(self, held: _Samples, starts: Sequence[float]) -> MeanCycle | None:
        if len(starts) <= LEAST_CYCLES:
            return None
        first, last = np.searchsorted(held.time, [starts[0], starts[-1]])
        part = held.part(slice(int(first), int(last)))
        belt = float(np.median(part.belt))
        if float(np.ptp(part.belt)) > 1e-6 * abs(belt):
            return None
        with np.errstate(over="ignore", invalid="ignore"):  # squares of very large positions
            return fit_mean_cycle(
                part.time, part.position, belt, np.array(starts), self.noise, self.step
            )

    def _trend(self, amplitudes: FloatArray) -> Trend | None:
        """Return the change of the amplitude over the window; None without one."""
        mean = float(np.mean(amplitudes))
        least = max(STEADY_UNDER_NOISE * mean, _QUANTUM * self.noise, self.step)
        order = np.linspace(-0.5, 0.5, len(amplitudes))
        change = float(order @ (amplitudes - mean) / (order @ order))
        # Half of the change that is never to be called steady: the estimate has noise, too.
        if abs(change) > least / 2.0:
            return Trend.GROWING if change > 0.0 else Trend.DECAYING
        return Trend.VARYING if float(np.ptp(amplitudes)) > 0.8 * least else None


def _velocities(samples: _Samples, reach: int, noise: float) -> tuple[float, float, float]:
    """Return lowest and highest velocity, m/s, of one cycle, and its stick time, s."""
    time, position = samples.time, samples.position
    if len(time) < 2 * reach + 3:
        if len(time) == 0:
            return 0.0, 0.0, 0.0
        return float(samples.velocity.min()), float(samples.velocity.max()), 0.0
    # The slope of the parabola through the samples within reach.
    lags = np.arange(-reach, reach + 1)
    step = float(time[-1] - time[0]) / (len(time) - 1)
    slopes = np.convolve(position, -lags / (lags @ lags), "valid") / step
    at = time[reach : len(time) - reach]
    belt = float(np.median(samples.belt))
    sign = -1.0 if belt < 0.0 else 1.0
    error = noise / (step * sqrt(lags @ lags))
    stick_time = _stick_time(at, sign * slopes, abs(belt), error)
    return float(slopes.min()), float(slopes.max()), stick_time


def _stick_time(time: FloatArray, velocity: FloatArray, belt_speed: float, error: float) -> float:
    """Return for how long the velocity is that of the belt, s, from crossings below it.

    The relative speed is linear in time before the landing and quadratic after the departure: the
    edges follow from the crossings of two thresholds each. `error` is the standard error of the
    velocities.
    """
    margin = max(0.1 * belt_speed, 4.0 * error)
    if 4.0 * margin >= belt_speed + abs(float(velocity.min())):
        return 0.0
    # A slide that passes the belt and moves on does not stick.
    riding = np.flatnonzero(np.abs(velocity - belt_speed) < margin)
    highest = float(velocity.max())
    near = belt_speed - margin / 2.0 <= highest <= _PASSING_SHARE * belt_speed + 2.0 * error
    if not near or len(riding) == 0:
        return 0.0
    first, last = int(riding[0]), int(riding[-1])

    def before(threshold: float) -> float | None:
        rows = np.flatnonzero(velocity[:first] < threshold)
        return None if len(rows) == 0 else _crossing(time, velocity, int(rows[-1]), threshold)

    def after(threshold: float) -> float | None:
        rows = np.flatnonzero(velocity[last + 1 :] < threshold)
        return None if len(rows) == 0 else _crossing(time, velocity, last + int(rows[0]), threshold)

    landed, landing = before(belt_speed - margin), before(belt_speed - 2.0 * margin)
    departing, departed = after(belt_speed - margin), after(belt_speed - 4.0 * margin)
    if landed is None or landing is None or departing is None or departed is None:
        return 0.0
    return max((2.0 * departing - departed) - (2.0 * landed - landing), 0.0)


def _crossing(time: FloatArray, velocity: FloatArray, row: int, threshold: float) -> float:
    """Return when the velocity crosses a threshold between a row and the next."""
    before, after = velocity[row], velocity[row + 1]
    share = (threshold - before) / (after - before) if after != before else 0.0
    return float(time[row] + share * (time[row + 1] - time[row]))
