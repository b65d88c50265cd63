"""The belt speed at which vibration starts, extrapolated from the decay of ring-downs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, inf, sqrt
from typing import Any, NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.ring_down import RingDown
from stickslip_ros.physics.model.friction import Exponential, FrictionLaw, RateState, Stribeck
from stickslip_ros.text import quantity

_SAME_SPEED = 0.005
"""Share by which belt speeds differ at most that are one feed."""
_SYSTEMATIC = 0.003
"""Systematic error of a decay rate, as a share of it."""
_INTERVAL, _REJECTED = 3.84, 0.01
"""Increase of chi^2 up to the ends of a 95 % interval; probability below which a fit is rejected.
"""
_RISES = 10.8
"""Chi^2 by which a decay that rises with the belt speed must fit better than a constant one: 0.1 %.
"""
_LEAST_RANGE = 1.03
"""Ratio of the fastest feed to the slowest one, at least."""
_LOWEST = 0.1
"""Lowest onset that is tried, in slowest feeds; what is compatible with it has no lower limit."""
_ONSETS, _SHAPES = 1000, 120
_SLOWEST_SHAPE, _FASTEST_SHAPE = 0.1, 5.0
"""Speeds in a friction law that are tried, in slowest feeds."""
_WIDE = 0.1
"""Length of an interval, as a share of the onset, from which a run is named that shortens it."""
_AWAY = 1.05
"""Belt speed of that run, in upper limits of the onset, at least."""


class _Family(NamedTuple):
    """A family of friction laws: any multiple of a law, of any shape."""

    constants: int
    """Number of constants of the decay rate: of size, shape and viscous damping."""
    law: FrictionLaw
    shape: str | None = None
    """Name of the constant that is the shape, a speed."""

    def of_shape(self, shape: Any) -> FrictionLaw:
        """Return the law of a shape, m/s, or of several."""
        return self.law if self.shape is None else replace(self.law, **{self.shape: shape})


_FAMILIES: Mapping[str, _Family] = {
    "stribeck": _Family(2, Stribeck(1.0, 0.0, 1.0)),
    "exponential, exponent 1": _Family(3, Exponential(1.0, 0.0), "decay_speed"),
    "exponential, exponent 2": _Family(3, Exponential(1.0, 0.0, exponent=2.0), "decay_speed"),
    "rate_state": _Family(2, RateState(1.0, 1.0, 2.0)),
}


@dataclass(frozen=True)
class FeedDecay:
    """Decay rate and frequency at one belt speed, with standard errors; SI units."""

    belt_speed: float
    decay_rate: float
    decay_error: float
    frequency: float
    frequency_error: float
    ring_downs: int
    """Number of ring-downs of which these are the means."""


@dataclass(frozen=True, eq=False)
class FamilyOnset:
    """What one family of friction laws says of the onset: its fit with the least chi^2."""

    onset_speed: float
    """Belt speed of zero decay, m/s; infinite without a fit."""
    chi_square: float
    probability: float
    """Probability of a chi^2 as large."""
    law: FrictionLaw
    """The law, of a size of its own."""
    factor: float
    """Decay rate by the change of the coefficient with the speed, m/s^2."""

    @property
    def rejected(self) -> bool:
        """Whether the data reject the family, at a level of 1 %."""
        return self.probability < _REJECTED

    def decay_rate(self, belt_speed: FloatArray) -> FloatArray:
        """Return the decay rate, 1/s, at belt speeds, m/s."""
        onset = np.array([self.onset_speed])
        return self.factor * (_slope(self.law, belt_speed) - _slope(self.law, onset))


@dataclass(frozen=True)
class Onset:
    """The belt speed at which the equilibrium becomes unstable, and what it was found from."""

    feeds: Sequence[FeedDecay]
    """Decay by belt speed, in order."""
    families: Mapping[str, FamilyOnset]
    """Families of friction that were fitted, by name; empty where nothing can be told."""
    onset_speed: float | None = None
    """Onset, m/s, the mean of the families that are not rejected by their likelihood, corrected
    for the number of constants (Akaike 1974); None where it cannot be told."""
    lower: float | None = None
    """Lower end of the 95 % interval, the union over these families, m/s; None without one."""
    upper: float | None = None
    """Upper end, m/s, also where only an upper limit can be told."""
    advice: Sequence[str] = ()
    """Sentences on what cannot be told, and which run would tell it."""

    def least_feed(self, margin: float) -> float | None:
        """Return the least belt speed, m/s, whose share `margin` is above the upper limit."""
        return None if self.upper is None else self.upper / (1.0 - margin)


def mean_decays(ring_downs: Sequence[RingDown]) -> list[FeedDecay]:
    """Return the mean decay of ring-downs at equal belt speeds, in order of the belt speed."""
    groups: list[list[RingDown]] = []
    for each in sorted(ring_downs, key=lambda found: found.belt_speed):
        same = groups and each.belt_speed <= (1.0 + _SAME_SPEED) * groups[-1][0].belt_speed
        if same:
            groups[-1].append(each)
        else:
            groups.append([each])
    return [
        FeedDecay(
            float(np.mean([each.belt_speed for each in group])),
            *_mean([(each.decay_rate, each.decay_error) for each in group]),
            *_mean([(each.frequency, each.frequency_error) for each in group]),
            len(group),
        )
        for group in groups
    ]


def _mean(values: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the weighted mean of values with errors, and its error.

    Equal taps have equal errors of rounding, which no mean reduces: what the values scatter less
    than by their errors is common to all.
    """
    value, error = np.array(values).T
    weight = error**-2.0
    total, count = float(weight.sum()), len(value)
    mean = float(weight @ value) / total
    variance = count / total
    if count < 3:
        return mean, sqrt(variance)
    scatter = float(weight @ (value - mean) ** 2) / total * count / (count - 1.0)
    effective = total**2 / float(weight @ weight)
    common = max(variance - scatter, 0.0)
    return mean, sqrt(common + scatter / effective * (1.0 + 2.0 / count))


def onset_of(ring_downs: Sequence[RingDown], length: str = "m") -> Onset:
    """Return the belt speed at which the decay of ring-downs falls to zero.

    A slide of mass m in steady slip decays at the rate (c + F'(v_b))/(2 m), where F is the friction
    force: each family of laws gives a curve of few constants over the belt speed v_b, which is
    extrapolated. Of all families that the data do not reject the union of the intervals counts.
    Friction that follows its curve with a delay that is short against the period shifts the curve
    by little; the study in benchmarks/onset.py tells by how much.

    Parameters
    ----------
    ring_downs : sequence of RingDown
        Ring-downs of one machine, in one direction of the belt.
    length : str, optional
        Unit of the positions, "m" or "rad".

    Returns
    -------
    Onset
        Onset with its interval, or sentences that say why there is none.
    """
    feeds = [each for each in mean_decays(ring_downs) if each.decay_rate > 0.0]
    unit = f"{length}/s"
    if len(feeds) < 2 or feeds[-1].belt_speed < _LEAST_RANGE * feeds[0].belt_speed:
        return Onset(feeds, {}, advice=[_one_feed(feeds, unit)])
    speed, rate = (np.array([getattr(each, name) for each in feeds]) for name in _FITTED)
    error = np.hypot([each.decay_error for each in feeds], _SYSTEMATIC * rate)
    onsets = np.geomspace(_LOWEST, 1.0 - 1e-4, _ONSETS) * speed[0]
    decays = _Decays(speed, rate, error**-2.0)
    families: dict[str, FamilyOnset] = {}
    profiles: dict[str, FloatArray] = {}
    for name, family in _FAMILIES.items():
        families[name], profiles[name] = decays.fit(family, onsets)
    least = min(each.chi_square for each in families.values())
    if decays.constant - least < _RISES:
        return Onset(feeds, {}, advice=[_constant(feeds, unit)])
    kept = [name for name, each in families.items() if not each.rejected]
    if not kept:
        return Onset(feeds, families, advice=[_ALL_REJECTED])
    possible = [profiles[name] <= families[name].chi_square + _INTERVAL for name in kept]
    rows = np.flatnonzero(np.any(possible, axis=0))
    # The ends are between two of the speeds that are tried.
    lower = float(onsets[max(rows[0] - 1, 0)])
    upper = float(onsets[min(rows[-1] + 1, _ONSETS - 1)])
    if rows[0] == 0:
        return Onset(feeds, families, upper=upper, advice=[_no_lower(feeds, upper, unit)])
    likelihood = {
        name: exp((least - families[name].chi_square) / 2.0 - _FAMILIES[name].constants)
        for name in kept
    }
    mean = sum(likelihood[name] * families[name].onset_speed for name in kept)
    found = mean / sum(likelihood.values())
    wide = upper - lower > _WIDE * found
    advice = [_nearer(feeds, upper, unit, "would shorten the interval")] if wide else []
    return Onset(feeds, families, found, lower, upper, advice)


_FITTED = "belt_speed", "decay_rate"
_ALL_REJECTED = (
    "no family of friction fits the decay rates: the onset cannot be extrapolated. Runs with the "
    "same load, temperature and position at all feeds would tell whether the friction changes"
)


class _Decays(NamedTuple):
    """Decay rates over the belt speed, to be fitted; SI units."""

    speed: FloatArray
    rate: FloatArray
    weight: FloatArray

    @property
    def constant(self) -> float:
        """Chi^2 of a decay rate that is the same at all speeds."""
        mean = self.weight @ self.rate / self.weight.sum()
        return float(self.weight @ (self.rate - mean) ** 2)

    def fit(self, family: _Family, onsets: FloatArray) -> tuple[FamilyOnset, FloatArray]:
        """Return the best fit of a family, and the least chi^2 for each onset.

        The decay rate is B (F'(v) - F'(onset)) with B > 0. F' must rise from the onset on, which is
        the highest belt speed of zero decay.
        """
        weight, rate = self.weight, self.rate
        shapes = np.geomspace(_SLOWEST_SHAPE, _FASTEST_SHAPE, _SHAPES) * self.speed[0]
        law = family.of_shape(shapes[:, np.newaxis])
        at_speed, at_onset = (np.atleast_2d(_slope(law, each)) for each in (self.speed, onsets))
        later = np.minimum.accumulate(at_onset[:, ::-1], axis=1)[:, ::-1]
        allowed = (at_onset <= later) & (at_onset < at_speed.min(axis=1, keepdims=True))
        own, onset = at_speed - at_speed[:, :1], at_onset - at_speed[:, :1]
        squares = (own**2 @ weight)[:, np.newaxis] - 2.0 * onset * (own @ weight)[:, np.newaxis]
        squares += onset**2 * float(weight.sum())
        projected = (own @ (weight * rate))[:, np.newaxis] - onset * float(weight @ rate)
        usable = allowed & (projected > 0.0) & (squares > 0.0)
        factor = np.divide(projected, squares, out=np.zeros_like(squares), where=usable)
        left = np.maximum(float(weight @ rate**2) - factor * projected, 0.0)
        chi_square = np.where(usable, left, inf)
        row, column = np.unravel_index(int(np.argmin(chi_square)), chi_square.shape)
        least = float(chi_square[row, column])
        found = FamilyOnset(
            float(onsets[column]) if usable.any() else inf,
            least,
            _probability(least, len(rate) - family.constants),
            family.of_shape(shapes[row]),
            float(factor[row, column]),
        )
        return found, chi_square.min(axis=0)


def _slope(law: FrictionLaw, speed: FloatArray) -> FloatArray:
    """Return the change of steady friction with the belt speed, s/m."""
    step = 1e-4 * speed
    found: FloatArray = (law.at_rest(speed + step) - law.at_rest(speed - step)) / (2.0 * step)
    return found


def _probability(chi_square: float, degrees: int) -> float:
    if degrees <= 0 or chi_square == inf:
        return float(chi_square < inf)
    from scipy.special import gammaincc  # takes long to import

    found: Any = gammaincc(degrees / 2.0, chi_square / 2.0)
    return float(found)


def _one_feed(feeds: Sequence[FeedDecay], unit: str) -> str:
    if not feeds:
        return "no ring-down decays: there is nothing to extrapolate"
    slowest = feeds[0].belt_speed
    return (
        f"all ring-downs are at {quantity(slowest, unit)}: a run at another feed, nearer the "
        f"onset, such as {quantity(0.9 * slowest, unit)}, would tell how the decay changes"
    )


def _constant(feeds: Sequence[FeedDecay], unit: str) -> str:
    return (
        "the decay does not rise with the feed by more than its errors: runs nearer the onset, "
        f"below {quantity(feeds[0].belt_speed, unit)}, or larger taps would tell the onset"
    )


def _no_lower(feeds: Sequence[FeedDecay], upper: float, unit: str) -> str:
    return (
        f"only an upper limit of the onset is known, {quantity(upper, unit)}: "
        f"{_nearer(feeds, upper, unit, 'would tell the onset')}"
    )


def _nearer(feeds: Sequence[FeedDecay], upper: float, unit: str, use: str) -> str:
    """Return which run is next: as near the onset as is safe, or with larger taps."""
    next_feed = max(_AWAY * upper, (upper + feeds[0].belt_speed) / 2.0)
    if next_feed < 0.97 * feeds[0].belt_speed:
        return f"a run at {quantity(next_feed, unit)} {use}"
    return f"larger or more taps at {quantity(feeds[0].belt_speed, unit)} {use}"
