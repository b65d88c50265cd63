"""The belt speed at which vibration starts, extrapolated from the decay of ring-downs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, inf, sqrt
from typing import Annotated, NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.ring_down import RingDown
from stickslip_ros.model.friction import Exponential, FrictionLaw, Stribeck
from stickslip_ros.quantities import Quantity
from stickslip_ros.text import quantity

_SAME_SPEED, _LEAST_RANGE = 1.005, 1.03
"""Largest ratio of belt speeds that are one feed; least ratio of the fastest to the slowest."""
_SYSTEMATIC, _SCATTER = 0.003, 4.0
"""Systematic error of a decay rate, as a share of it; chi^2 by degrees of freedom up to which decay
rates may have larger errors."""
_INTERVAL, _RISES, _REJECTED, _UNLIKELY = 3.84, 10.8, 0.01, 0.05
"""Chi^2 of the ends of a 95 % interval beyond the least, and by which a constant decay must be
worse (0.1 %); probability below which a family is rejected, and of the likeliest one below which
the errors are too small."""
_ONSETS = np.append(0.0, np.geomspace(0.1, 1.0 - 1e-4, 1000))
_SHAPES = np.geomspace(0.1, 5.0, 120)
"""Onsets, and speeds in a friction law, that are tried, in slowest feeds. Zero is a curve without
an onset: what is compatible with it, or with the lowest onset, has no lower limit."""
_WIDE, _AWAY = 0.1, 1.05
"""Length of an interval, in onsets, from which another run is advised; its feed, in upper limits,
at least."""
_FAMILIES: Mapping[str, tuple[Callable[[FloatArray], FrictionLaw], int]] = {
    "stribeck": (lambda _: Stribeck(1.0, 0.0, 1.0), 2),
    "exponential, exponent 1": (lambda speed: Exponential(1.0, 0.0, speed), 3),
    "exponential, exponent 2": (lambda speed: Exponential(1.0, 0.0, speed, exponent=2.0), 3),
}
"""Families of friction laws: the law for speeds, m/s, any multiple of which is in it; number of
constants of the decay rate, of which viscous damping is one."""


@dataclass(frozen=True)
class FeedDecay:
    """Decay rate and frequency at one belt speed: means of ring-downs, with standard errors; SI."""

    belt_speed: Annotated[float, Quantity("belt speed", "m/s")]
    decay_rate: Annotated[float, Quantity("decay rate", "1/s")]
    decay_error: Annotated[float, Quantity("standard error", "1/s")]
    frequency: Annotated[float, Quantity("frequency", "Hz")]
    frequency_error: Annotated[float, Quantity("standard error", "Hz")]
    ring_downs: Annotated[int, Quantity("ring-downs")]


class FamilyOnset(NamedTuple):
    """The fit of one family of friction laws; the onset is infinite without one, m/s.

    It is, too, where the curve that fits best has none. A family is rejected where the probability
    of a chi^2 as large is below 1 %. `decay_rate` returns that at belt speeds, 1/s and m/s.
    """

    onset_speed: float
    chi_square: float
    probability: float
    rejected: bool
    decay_rate: Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Onset:
    """The belt speed at which the equilibrium becomes unstable, and what it was found from."""

    feeds: Sequence[FeedDecay]
    """Decay by belt speed, in order."""
    families: Mapping[str, FamilyOnset]
    """Families of friction that were fitted, by name; empty where nothing can be told."""
    speed: float | None = None
    """Onset, m/s: mean of the families that are not rejected, by their likelihood (Akaike 1974)."""
    lower: float | None = None
    upper: float | None = None
    """Ends of the 95 % interval, the union over these families, m/s; there may be only `upper`."""
    advice: str = ""
    """What cannot be told, and which run would tell it; empty if there is nothing to say."""


def mean_decays(ring_downs: Sequence[RingDown]) -> list[FeedDecay]:
    """Return the mean decay of ring-downs at equal belt speeds, in order of the belt speed.

    It is weighted by the inverse squares of the errors. Where three or more scatter less than these
    errors, the rest is common to all, as the rounding of equal taps is, and no mean reduces it.
    """
    groups: list[list[RingDown]] = []
    for ring_down in sorted(ring_downs, key=lambda ring_down: ring_down.belt_speed):
        if not groups or ring_down.belt_speed > _SAME_SPEED * groups[-1][0].belt_speed:
            groups.append([])
        groups[-1].append(ring_down)
    decays: list[FeedDecay] = []
    for group in groups:
        decay = _mean([(ring_down.decay_rate, ring_down.decay_error) for ring_down in group])
        frequency = _mean([(ring_down.frequency, ring_down.frequency_error) for ring_down in group])
        speed = float(np.mean([ring_down.belt_speed for ring_down in group]))
        decays.append(FeedDecay(speed, *decay, *frequency, len(group)))
    return decays


def _mean(values: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the weighted mean of values with errors, and its error; see `mean_decays`."""
    value, error = np.array(values).T
    weight, count = error**-2.0, len(value)
    total = float(weight.sum())
    mean, variance = float(weight @ value) / total, count / total
    if count < 3:
        return mean, sqrt(variance)
    scatter = float(weight @ (value - mean) ** 2) / total * count / (count - 1.0)
    share = float(weight @ weight) / total**2
    return mean, sqrt(max(variance - scatter, 0.0) + scatter * share * (1.0 + 2.0 / count))


def onset_of(ring_downs: Sequence[RingDown], length: str = "m") -> Onset:
    """Return the belt speed at which the decay of ring-downs falls to zero.

    A slide of mass m in steady slip decays at the rate (c + F'(v_b))/(2 m), where F is the friction
    force: each family of laws gives a curve of few constants over the belt speed v_b, which is
    extrapolated. Of all families that the data do not reject the union of the intervals counts.
    Friction may fall too little for an onset: curves without one are hypotheses of each family.
    Where a vibration grows, the onset is above.
    The ring-downs are of one machine and direction; `length` is the unit of their positions.
    """
    means = mean_decays(ring_downs)
    grows = (decay.belt_speed for decay in means if decay.decay_rate < -2.0 * decay.decay_error)
    least_onset = max(grows, default=0.0)
    feeds = [m for m in means if m.decay_rate > 0.0 and m.belt_speed > least_onset]
    if not feeds:
        return Onset(feeds, {}, advice="no ring-down decays: a run at a higher feed would tell one")
    slowest, unit = feeds[0].belt_speed, f"{length}/s"
    if feeds[-1].belt_speed < _LEAST_RANGE * slowest:
        run = f"a run at another feed, such as {quantity(1.1 * slowest, unit)}"
        return Onset(feeds, {}, advice=f"one feed tells no onset: {run}, would tell it")
    values = [(decay.belt_speed, decay.decay_rate, decay.decay_error) for decay in feeds]
    speed, rate, error = np.array(values).T
    weight = 1.0 / (error**2 + (_SYSTEMATIC * rate) ** 2)
    constant = float(weight @ (rate - weight @ rate / weight.sum()) ** 2)
    fits = {n: _fit(speed, rate, weight, least_onset, *f) for n, f in _FAMILIES.items()}
    families = {name: family for name, (family, _) in fits.items()}
    least = min(family.chi_square for family in families.values())
    falls = np.polyfit(speed, rate, 1, w=np.sqrt(weight))[0] < 0.0
    if falls or constant - least < _RISES:
        beyond = falls or least_onset > 0.0
        lowest = f"below {quantity(slowest, unit)}, nearer the onset"
        runs = f"above {quantity(feeds[-1].belt_speed, unit)}" if beyond else lowest
        advice = "the decay does not rise with the feed by more than its errors: runs"
        return Onset(feeds, {}, advice=f"{advice} {runs}, or larger taps would tell")
    if max(family.probability for family in families.values()) < _UNLIKELY:
        excess = least / max(len(feeds) - 3, 1)
        if excess < _SCATTER:
            factor = 1.1 * sqrt(max(excess, 1.0))
            wider = [replace(ring, decay_error=factor * ring.decay_error) for ring in ring_downs]
            return onset_of(wider, length)
        runs = "runs at the same load, temperature and position"
        advice = f"no family of friction fits the decay: {runs} would tell whether friction changes"
        return Onset(feeds, families, advice=advice)
    kept = [name for name, family in families.items() if not family.rejected]
    possible = [fits[name][1] <= families[name].chi_square + _INTERVAL for name in kept]
    rows = np.flatnonzero(np.any(possible, axis=0))  # of _ONSETS
    # The ends are between two of the speeds that are tried.
    ends = max(rows[0] - 1, 0), min(rows[-1] + 1, len(_ONSETS) - 1)
    lower, upper = (float(_ONSETS[row] * slowest) for row in ends)
    following = max(_AWAY * upper, (upper + slowest) / 2.0)
    near = following > 0.97 * slowest
    further = f"larger taps at {quantity(slowest, unit)}, or runs at more feeds above,"
    run = f"{further if near else f'a run at {quantity(following, unit)}'} would tell"
    if rows[0] <= 1:
        advice = f"only an upper limit of the onset is known: {run} the onset"
        return Onset(feeds, families, upper=upper, advice=advice)
    likely = [exp((least - families[n].chi_square) / 2.0 - _FAMILIES[n][1]) for n in kept]
    onset_speed = float(np.average([families[name].onset_speed for name in kept], weights=likely))
    advice = f"{run} it more exactly" if upper - lower > _WIDE * onset_speed else ""
    return Onset(feeds, families, onset_speed, lower, upper, advice)


def _fit(
    speed: FloatArray,
    rate: FloatArray,
    weight: FloatArray,
    least_onset: float,
    family: Callable[[FloatArray], FrictionLaw],
    count: int,
) -> tuple[FamilyOnset, FloatArray]:
    """Return the best fit of a family, and the least chi^2 for each onset.

    The decay rate is B (F'(v) - F'(onset)) with B > 0. F' must rise from the onset on, which is the
    highest belt speed of zero decay. Without an onset it is B (F'(v) - L) with L below all F'.
    """
    from scipy.special import gammaincc  # takes long to import

    onsets, shapes = _ONSETS * speed[0], _SHAPES[:, np.newaxis] * speed[0]
    at_speed = np.atleast_2d(_slope(family(shapes), speed))
    at_onset = np.atleast_2d(_slope(family(shapes), onsets[1:]))
    total, mean_rate = float(weight.sum()), float(np.average(rate, weights=weight))
    mean = at_speed @ weight[:, np.newaxis] / total
    centred = at_speed - mean
    squares, projected = centred**2 @ weight, centred @ (weight * rate)
    # Without an onset: the best line over F' if it has no zero, else the nearest that has none.
    gain = np.maximum(projected / np.maximum(squares, 1e-300), 1e-9 * mean_rate)
    lowest = np.minimum(at_onset.min(axis=1), at_speed.min(axis=1))
    without = np.minimum(mean[:, 0] - mean_rate / gain, (1.0 + 1e-9) * lowest)
    at_onset = np.column_stack([without, at_onset])
    later = np.minimum.accumulate(at_onset[:, ::-1], axis=1)[:, ::-1]
    allowed = (at_onset <= later) & (at_onset < at_speed.min(axis=1, keepdims=True))
    allowed &= onsets >= least_onset
    squares = squares[:, np.newaxis] + (at_onset - mean) ** 2 * total
    projected = projected[:, np.newaxis] - (at_onset - mean) * total * mean_rate
    usable = allowed & (projected > 0.0) & (squares > 0.0)
    factor = np.divide(projected, squares, out=np.zeros_like(squares), where=usable)
    left = np.maximum(float(weight @ rate**2) - factor * projected, 0.0)
    chi_square = np.where(usable, left, inf)
    row, column = np.unravel_index(int(np.argmin(chi_square)), chi_square.shape)
    least, size = float(chi_square[row, column]), float(factor[row, column])
    best, level = family(shapes[row]), at_onset[row, column]
    degrees, known = len(rate) - count, least < inf
    chance = float(gammaincc(degrees / 2.0, least / 2.0)) if degrees > 0 else float(known)

    def decay_rate(belt_speed: FloatArray) -> FloatArray:
        return size * (_slope(best, belt_speed) - level)

    at = float(onsets[column]) if known and column else inf
    return FamilyOnset(at, least, chance, chance < _REJECTED, decay_rate), chi_square.min(axis=0)


def _slope(law: FrictionLaw, speed: FloatArray) -> FloatArray:
    """Return the change of steady friction with the belt speed, s/m."""
    step = 1e-4 * speed
    slope: FloatArray = (law.at_rest(speed + step) - law.at_rest(speed - step)) / (2.0 * step)
    return slope
