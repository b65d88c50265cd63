"""Recordings as identification uses them: evenly spaced samples of the motion and its inputs."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from math import exp, sqrt
from typing import Self

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.noise import white_noise

FEWEST = 500
"""Fewest samples of a record."""
_INDEPENDENT_SPEED = 1.5
"""Steps of the encoder between samples from which rounding errors are independent."""
_TURNING_CHANGE = 0.1
"""Change of the speed in a sample, steps of the encoder per sample, at a turning point."""
_TURNING_SHARE = 0.2
"""Share of samples up to which turning points are left out."""
_SMOOTHED_SAMPLES = 11
"""Samples over which positions are smoothed, and a speed is found."""
_REST_SAMPLES = 20
"""Successive samples of the same position from which the slide is at rest."""
_FEWEST_VALUES = 10
"""Fewest different positions of a slide that moves."""
_DITHER_NOISE = 0.5
"""Noise, in steps of the encoder, from which rounding errors are independent; rounding has 0.29."""


@dataclass(frozen=True, eq=False)
class Record:
    """Evenly spaced samples of a slide and of what acts on it, arrays of shape (samples,)."""

    name: str
    """Name of the recording."""
    period: float
    """Sample period, s."""
    position: FloatArray
    """Measured displacement of the slide, m."""
    belt_velocity: FloatArray
    """Velocity of the belt, m/s."""
    force: FloatArray | None = None
    """Force on the slide, N, held from each sample to the next; None: none is recorded."""
    disturbance: FloatArray | None = None
    """Further known force on the slide, N, held likewise; None: none is recorded."""
    reference: FloatArray | None = None
    """Displacement that a controller followed, m; None: none is recorded."""
    velocity: FloatArray | None = None
    """Measured velocity of the slide, m/s; None: none but differences of positions is recorded."""
    missing: BoolArray | None = None
    """Where no sample is near, so that the motion is interpolated; None: nowhere."""
    left_out: float = 0.0
    """Share of the samples of the recording in parts that are too short for a record."""
    notes: tuple[str, ...] = ()
    """Sentences on how the recording was read."""
    delay: float | None = None
    """Time from a sample until its force acts, s, as far as the recording tells."""

    @property
    def duration(self) -> float:
        """Number of samples times the period, s."""
        return len(self.position) * self.period

    @property
    def held_forces(self) -> tuple[FloatArray, FloatArray]:
        """The force, which may be late, and the disturbance, N; zero if none is recorded."""
        none = np.zeros_like(self.position)
        return (
            none if self.force is None else self.force,
            none if self.disturbance is None else self.disturbance,
        )

    @property
    def held_force(self) -> FloatArray:
        """Total of the known forces, N."""
        return np.add(*self.held_forces)

    @property
    def lost(self) -> BoolArray:
        """Where no sample is near."""
        return np.zeros(len(self.position), bool) if self.missing is None else self.missing

    @cached_property
    def noise(self) -> float:
        """Standard deviation of the error of a position, m: its noise, or rounding."""
        return max(white_noise(self.position), self.resolution / sqrt(12.0))

    @property
    def position_on_belt(self) -> FloatArray:
        """Displacement of the slide over the belt, m, from some place on."""
        return self.position - self.period * np.cumsum(self.belt_velocity)

    def require_motion(self) -> None:
        """Raise InvalidInputError if the position hardly ever changes."""
        count = len(np.unique(self.position))
        if count < _FEWEST_VALUES:
            values = "1 value" if count == 1 else f"{count} different values"
            raise InvalidInputError(
                f"{self.name}: the position has {values} in {len(self.position)} samples: "
                f"identification needs at least {_FEWEST_VALUES} different ones; choose a part in "
                "which the slide moves"
            )

    @cached_property
    def weight(self) -> FloatArray:
        """Weight of the error of each position; positions that are interpolated have none.

        Where the slide moves by less than about a step of the encoder between samples, the rounding
        errors of successive samples are alike. Their weight is less, so that a step counts as one
        sample, however many there are; and all samples at rest in the same position count as one.
        At the turning points of a periodic motion the errors are the same in each cycle: they have
        no weight, if other samples are enough. Of positions whose noise is larger than their steps
        all count alike.
        """
        position, step = self.position, self.resolution
        if step == 0.0 or white_noise(position) > _DITHER_NOISE * step:
            return np.where(self.lost, 0.0, 1.0)
        speed, change = (
            np.abs(self.smoothed(order)) * self.period**order / step for order in (1, 2)
        )
        counts = 1.0 / np.clip(speed / _INDEPENDENT_SPEED, 1e-3, 1.0)
        changes = np.flatnonzero(np.diff(position)) + 1
        lengths = np.diff([0, *changes.tolist(), len(position)])
        resting = np.repeat(lengths >= _REST_SAMPLES, lengths)
        if resting.any():
            _, place, times = np.unique(position[resting], return_inverse=True, return_counts=True)
            counts[resting] = times[place]
        turning = (speed < _INDEPENDENT_SPEED) & (change > _TURNING_CHANGE)
        if np.mean(turning) < _TURNING_SHARE:
            counts[turning] = np.inf
        return np.where(self.lost, 0.0, 1.0 / np.sqrt(counts))

    def smoothed(self, order: int) -> FloatArray:
        """Return the smoothed position, m, or its first or second derivative by time.

        It is that of a cubic through the samples around each (A. Savitzky, M. J. E. Golay,
        Analytical Chemistry 36(8), 1964).
        """
        from scipy.signal import savgol_filter  # takes long to import

        smooth = savgol_filter(self.position, _SMOOTHED_SAMPLES, 3, deriv=order, delta=self.period)
        return np.asarray(smooth)

    @cached_property
    def velocity_weight(self) -> float:
        """Weight of the error of a velocity beside that of a position, s; 0 without velocities.

        It is the ratio of the noise of both. Positions without noise need no velocities.
        """
        if self.velocity is None:
            return 0.0
        of_velocity = white_noise(self.velocity)
        return self.noise / of_velocity if of_velocity > 0.0 else 0.0

    @property
    def resolution(self) -> float:
        """Smallest change of the position, m; 0 if it never changes."""
        sizes = np.abs(np.diff(self.position))
        moving = sizes[sizes > 0.0]
        return float(moving.min()) if len(moving) else 0.0

    @property
    def led(self) -> Self | None:
        """Longest part in which each sample has a reference; None if it is too short."""
        if self.reference is None:
            return None
        edges = np.flatnonzero(np.diff(np.isfinite(self.reference), prepend=False, append=False))
        parts = [(int(low), int(high)) for low, high in edges.reshape(-1, 2)]
        low, high = max(parts, key=lambda ends: ends[1] - ends[0], default=(0, 0))
        return self.part(low, high) if high - low >= FEWEST else None

    def lagging(self, time_constant: float) -> Self:
        """Return the record with the force behind a lag of first order, s; see `lagged`."""
        if self.force is None or not time_constant > 0.0:
            return self
        return replace(self, force=lagged(self.force, self.period / time_constant))

    def delayed(self, delay: float) -> Self:
        """Return the record with the mean of the force, which acts later, s, in each period.

        Half as many steps then simulate a delay that is no whole number of periods, to a change of
        the force within a period.
        """
        return replace(self, force=late(self.held_forces[0], delay / self.period))

    def part(self, start: int, end: int) -> Self:
        """Return the samples from `start` to before `end`."""
        values = {column.name: getattr(self, column.name) for column in fields(self)}
        columns = {name: array for name, array in values.items() if isinstance(array, np.ndarray)}
        return replace(self, **{name: array[start:end] for name, array in columns.items()})


def lagged(command: FloatArray, periods: float) -> FloatArray:
    """Return the mean force from each sample to the next behind a lag of first order.

    `command` is held from sample to sample; `periods` is their period in time constants. The force
    is 0 at the start.
    """
    from scipy.signal import lfilter  # takes long to import

    kept = exp(-periods)
    end: FloatArray = np.asarray(lfilter([1.0 - kept], [1.0, -kept], command))
    return command - (command - np.concatenate([[0.0], end[:-1]])) * (1.0 - kept) / periods


def mean_held(time: FloatArray, held: FloatArray, edges: FloatArray) -> FloatArray:
    """Return the means between edges of values that are held from their times on; 0 before."""
    ends = np.append(time, max(time[-1], edges[-1]))
    total = np.concatenate([[0.0], np.cumsum(held * np.diff(ends))])
    return np.diff(np.interp(edges, ends, total)) / np.diff(edges)


def late(held: FloatArray, periods: float) -> FloatArray:
    """Return the mean from each sample to the next of what is held, some sample periods late."""
    edges = np.arange(len(held) + 1.0)
    return mean_held(edges[:-1], held, edges - periods)
