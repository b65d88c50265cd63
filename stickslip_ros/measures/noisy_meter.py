"""Cycles and measures of positions with noise as they come, in bounded memory."""

from math import inf

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import Cycle
from stickslip_ros.measures.noise import (
    PRECISION,
    encoder_step,
    medians,
    white_noise,
)
from stickslip_ros.measures.noisy_samples import NoisySamples
from stickslip_ros.measures.noisy_window import REVERSAL, NoisyWindow
from stickslip_ros.measures.segmentation import ROUNDING
from stickslip_ros.measures.single_cycles import (
    cycle_between,
    fit_reach,
    reversals,
    vertex,
)

_REVERSAL_SHARE = 0.1
"""Least size of a reversal, as a share of the last cycle."""
_BATCH = 32
"""Number of samples after which cycles are looked for; in long ones, after `_LOOK_INTERVAL`."""
_LOOK_INTERVAL = 512
"""Number of samples after which the noise is estimated again."""
_FIRST_LOOK = 128
"""Number of samples after which the noise is estimated first."""
_LOOK_LENGTH = 2048
"""Number of samples from which the noise is estimated."""
_MOST_SAMPLES = 400_000
"""Number of samples up to which the cycles of a window are kept."""
_WITHOUT_CYCLES = 8192
"""Number of samples in which the first cycle is looked for."""
_HELD = 131_072
"""Number of samples that are kept at least: cycles with long rests show no reversals."""
_MARGIN = 64
"""Number of samples that are kept before the window, for the fits at its start."""
_ROUNDING_SHARE = 1e-7
"""Noise below this share of the motion is rounding, or an imperfection of the estimate."""


class NoisyCycleMeter:
    """Measures positions with noise, fed in blocks of samples of any length.

    It keeps a window, the samples of the last cycles at most, and calls functions of it: those of
    `single_cycles` as cycles end, those of `noise` now and then, and `NoisyWindow.measures` when
    the measures are asked for.

    The noise is found from the positions. Velocities are used for one purpose: to tell whether they
    have noise.
    """

    def __init__(self, window: int) -> None:
        self.window = NoisyWindow(window)
        self.noisy = False
        """Whether positions or velocities have noise."""
        self.ends: list[float] = []
        """Time, s, at which each cycle ended that `feed` returned last."""

    def feed(
        self, time: FloatArray, position: FloatArray, velocity: FloatArray, belt: FloatArray
    ) -> list[Cycle]:
        """Add the samples that follow (s, m, m/s); return the cycles that they complete."""
        self.ends = []
        completed: list[Cycle] = []
        window, new = self.window, NoisySamples(time, position, velocity, belt)
        while len(new) > 0:
            due = _BATCH - window.run % _BATCH
            part, new = new[:due], new[due:]
            window.run += len(part)
            window.last.add(part, window.noise)
            if window.run % _LOOK_INTERVAL == 0 or window.run == _FIRST_LOOK:
                self._look()
            # Always at the same samples: what is found must not depend on the blocks.
            if window.run % _BATCH == 0 and window.run >= _FIRST_LOOK:
                completed += self._advance()
        return completed

    def _look(self) -> None:
        """Estimate the noise, and the step of an encoder, from the last samples."""
        window, recent = self.window, self.window.last.samples[-_LOOK_LENGTH:]
        position, belt, count = recent.position, recent.belt, len(recent)
        if count < 3:
            return
        noise, step = white_noise(position), encoder_step(position)
        if belt.any():  # the encoder may be that of a guide at rest
            course = position - float(belt[-1]) * (recent.time - recent.time[0])
            step = max(step, encoder_step(course, ROUNDING))
        moved = float(np.ptp(medians(position)))
        if noise > max(_ROUNDING_SHARE * moved, PRECISION * float(np.abs(position).max())):
            window.noise, self.noisy = noise, True
        if step > 0.0:
            window.step = min(window.step or inf, step)
            # Steps that divide the travel of a sample leave no noise where it is looked for. One
            # step from each sample to the next is a uniform motion, as of a slide that sticks.
            uniform = np.ptp(position) > (count - 1.5) * step
            uniform = uniform and float(np.abs(np.diff(position)).max()) < 1.5 * step
            self.noisy |= window.step > _ROUNDING_SHARE * moved and not uniform
        fastest = float(np.abs(recent.velocity).max())
        of_velocity = white_noise(recent.velocity)
        if of_velocity > max(_ROUNDING_SHARE * fastest, PRECISION * float(np.abs(belt).max())):
            self.noisy = True

    def _advance(self) -> list[Cycle]:
        """Return the cycles that the samples since the last one complete."""
        last, noise = self.window.last, self.window.noise
        samples, cycles, lows = last.samples, last.cycles, last.lows
        first = samples.row(lows[-1].time) if lows else max(len(samples) - _WITHOUT_CYCLES, 0)
        if len(samples) - first >= _WITHOUT_CYCLES and self.window.run % _LOOK_INTERVAL:
            return []
        size = 2.0 * cycles[-1].amplitude if cycles and not last.resting else 0.0
        least = max(REVERSAL * noise, _REVERSAL_SHARE * size)
        completed: list[Cycle] = []
        # The median of the last position takes one more.
        for rows in reversals(last.held.position[first:-1], least):
            high, low = (first + row for row in rows)
            reach = fit_reach(samples, low, high, noise)
            if low + reach >= len(samples):
                break  # samples for the fit are missing
            end = vertex(samples, low, reach)
            cycle = cycle_between(samples, lows[-1], end, high, noise) if lows else None
            if cycle is not None:
                cycles.append(cycle)
                self.ends.append(end.time)
                completed.append(cycle)
            elif lows:
                lows.pop()
            lows.append(end)
        # Drop the samples before the window.
        row = samples.row(lows[0].time) if lows else len(samples)
        row = min(row - _MARGIN, len(samples) - _HELD)
        row = max(row, len(samples) - _MOST_SAMPLES)
        if row > 0:
            last.drop_first(row)
        return completed
