"""The sensor between the motion and its samples."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import chain, count, islice
from typing import Any, Self

import numpy as np

from stickslip_ros.model.constants import MOST_STEPS, at_rest, constants_of

Measure = Callable[[float, float], tuple[float, float]]
"""Returns the measured position (m) and velocity (m/s) for the true ones. It is called once for
each sample, in order."""

LONGEST_DIFFERENCE = 300
"""Largest number of samples of a difference; the order of the sampled loop grows with it."""

_BLOCK = 1024
"""Number of deviates that are made at once."""
_WORD = 2**32


class MeasuredVelocity(StrEnum):
    """Source of the measured velocity."""

    EXACT = "exact"
    DIFFERENCE = "difference"


@dataclass(frozen=True)
class Sensor:
    """The sensor of the slide: an encoder, and the source of the velocity. By default it is exact.

    The measured position is the true one with noise, rounded to the resolution, half to even. The
    velocity is exact, with noise if asked, or the difference of measured positions over n samples,
    (p_k - p_(k-n)) / (n T); over fewer at the start and after a reset, and 0 at the first sample.
    Noise is normally distributed and independent from sample to sample; that of sample n depends on
    seed and n only. The state of the belt is known.
    """

    position_resolution: float = at_rest(
        0.0, "Step of the measured position; 0 for none.", "m", at_least=0.0
    )
    position_noise: float = at_rest(
        0.0, "Standard deviation of the noise of the position.", "m", at_least=0.0
    )
    velocity: MeasuredVelocity = at_rest(
        MeasuredVelocity.EXACT, "Velocity: the true one, or the difference of measured positions."
    )
    difference_samples: int = at_rest(
        1,
        "Number of samples that a difference spans.",
        at_least=1,
        at_most=LONGEST_DIFFERENCE,
        whole=True,
    )
    velocity_noise: float = at_rest(
        0.0, "Standard deviation of the noise of an exact velocity.", "m/s", at_least=0.0
    )
    seed: int = at_rest(0, "Seed of the noise.", at_least=0, whole=True)

    @property
    def exact(self) -> bool:
        """Whether measured samples are the true ones."""
        rough = self.position_resolution or self.position_noise or self.velocity_noise
        return not rough and not self.spans

    @property
    def spans(self) -> int:
        """Number of samples that the difference for the velocity spans; 0 without one."""
        return self.difference_samples if self.velocity is MeasuredVelocity.DIFFERENCE else 0

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> Self:
        """Return a sensor from values by name, as a recording or a scenario has them.

        Parameters
        ----------
        values : mapping
            Values of some constants; those of others are ignored.

        Returns
        -------
        Sensor
            Sensor with the defaults for what is not given.
        """
        known = {name: values[name] for name in constants_of(cls) if name in values}
        if "velocity" in known:
            known["velocity"] = MeasuredVelocity(known["velocity"])
        return cls(**known)

    def every(self, samples: int) -> Self | None:
        """Return the sensor as a controller has it that takes each n-th sample.

        Parameters
        ----------
        samples : int
            Samples from one that it takes to the next, n.

        Returns
        -------
        Sensor or None
            Sensor at the lower rate; None if a difference spans no multiple of n samples.
        """
        if self.spans % samples:
            return None
        return replace(self, difference_samples=max(self.difference_samples // samples, 1))

    def refusal(self) -> str | None:
        """Return why the constants do not fit together, as a sentence, or None."""
        if self.spans and self.velocity_noise:
            return (
                f"velocity_noise = {self.velocity_noise} m/s must be 0 with velocity = "
                f"{self.velocity}, which has the noise of the positions"
            )
        return None

    def start(self, period: float, number: int = 0) -> Measure | None:
        """Return what measures a segment of samples, or what follows a reset.

        Parameters
        ----------
        period : float
            Sample period, s.
        number : int, optional
            Number of the first sample.

        Returns
        -------
        callable or None
            See `Measure`; None for an exact sensor.
        """
        if self.exact:
            return None
        resolution = self.position_resolution
        of_position = _deviates(self.position_noise, self.seed, 0, number)
        of_velocity = _deviates(self.velocity_noise, self.seed, 1, number)
        earlier = deque[float](maxlen=self.spans) if self.spans else None

        # Without calls or objects that could be avoided: it is a part of each sample.
        def measure(position: float, velocity: float) -> tuple[float, float]:
            if of_position is not None:
                position += next(of_position)
            if resolution:
                steps = position / resolution
                if -MOST_STEPS < steps < MOST_STEPS:
                    position = round(steps) * resolution
            if earlier is not None:
                velocity = (position - earlier[0]) / (len(earlier) * period) if earlier else 0.0
                earlier.append(position)
            elif of_velocity is not None:
                velocity += next(of_velocity)
            return position, velocity

        return measure


def _deviates(deviation: float, seed: int, kind: int, number: int) -> Iterator[float] | None:
    """Return normal deviates from the number of a sample on; None without a deviation.

    Each of them depends on the seed and the number of its sample only.
    """
    if not deviation:
        return None
    # The only normal deviates of numpy with a guarantee that they stay the same. It takes ten times
    # as long to make as to seed.
    random, (first, place) = np.random.RandomState(), divmod(number, _BLOCK)

    def deviates(block: int) -> list[float]:
        random.seed([seed % _WORD, seed // _WORD, kind, block % _WORD, block // _WORD])
        return (deviation * random.standard_normal(_BLOCK)).tolist()

    return islice(chain.from_iterable(map(deviates, count(first))), place, None)


EXACT_SENSOR = Sensor()
"""The sensor that measures exactly."""
