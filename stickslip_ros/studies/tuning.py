"""Gains of a control law by one rule, from the sampled loops at all feeds.

The smallest decay rate at these feeds is made as large as it gets within the limits of a goal:
of force, noise, margins and decay. The washout law must also catch the vibration without control.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache, cached_property
from itertools import product
from math import ceil, exp, floor, inf, log, log10
from typing import Any, TypeVar

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.constants import constants_of
from stickslip_ros.model.control import ControlLaw
from stickslip_ros.model.control.base import MOTOR, TABLE
from stickslip_ros.model.drive import number_text
from stickslip_ros.studies.drive_loops import DriveLoops, Tuned, linear_part

_DECADES = 2.5, 1.0
"""Gains are searched from so many decades below the softest scale to so many above the stiffest."""
RESERVE = 0.97
"""Share of the limits that gains use at first."""
NEAR = 0.9
"""Share of a limit from which on it restricts the gains."""
_FIRST = 10.0
"""Weight of margins and decay, next to force and noise."""
_CUBIC_SHARES = 0.125, 0.25, 0.5
"""Cubic gains to try, as shares of the friction law's own cubic coefficient.

With a share of 1 the loop would diverge from high speeds. A positive cubic gain reduces the force
where the vibration is large, so that the force limit allows more linear gain.
"""

_Law = TypeVar("_Law", bound=ControlLaw)
_Value = tuple[float, float]

_SCANNED = 256, 2048, 4096
"""Points of the first scan, with one gain, with two, and with more."""
_VALUED, _REFINED = 60, 4
"""Points of it that are compared with the limits, and those from which the search goes on."""
_FIRST_STEP, _LAST_STEP, _MOVES = 1.0, 0.03, 40
"""Steps of a refinement, as logarithms, and largest number of them."""


class Tuning:
    """The search for the gains of a law."""

    def __init__(self, loops: DriveLoops) -> None:
        self.loops = loops
        """The loops of the drive."""
        self.others: dict[str, DriveLoops] = {}
        """Those of other drives that the gains have to hold, too, by what the drives are called."""

    @property
    def drives(self) -> dict[str, DriveLoops]:
        """Return this drive and the others that the gains have to hold."""
        return {"the drive of the scenario": self.loops, **self.others}

    def best(self, share: float = RESERVE, *, cubic: bool = True) -> Tuned:
        """Return the best gains.

        `share` is the part of each limit that they may use; `cubic` allows a cubic gain. If no
        gains keep all limits, the result has the nearest ones, and `missed` the limits. If the body
        that the scenario feeds back has no gains, another one is fed back.
        """
        first, *others = self.bodies
        value, law = self._searched(first, share)
        for other in others if value[0] < 0.0 else ():
            value, law = max((value, law), self._searched(other, share), key=lambda trial: trial[0])
        coefficient = self.loops.cubic_coefficient if cubic and self.loops.vibrations else 0.0
        chosen: Any = law
        seen = [vibration for drive in self.drives.values() for vibration in drive.vibrations]
        forces = [vibration.peak_force(chosen) for vibration in seen if coefficient]
        if max(forces, default=0.0) > NEAR * share * self.loops.goal.force_limit:
            for part in _CUBIC_SHARES:
                softer = replace(first, cubic_gain=rounded(part * coefficient))
                other = self._searched(softer, share)
                # Less is not worth a larger cubic gain.
                if other[0] > (value[0], 1.05 * value[1]):
                    value, law = other
        return self._with_limits(law, value[1])

    def _with_limits(self, law: ControlLaw, rate: float) -> Tuned:
        """Return gains with the limits that they miss, in words, too; `rate` is the decay rate."""
        loops, drives = self.loops, self.drives
        if rate <= 0.0:
            rates = {name: drive.decay_rates([law])[0] for name, drive in drives.items()}
            worst = min(rates, key=lambda name: rates[name])
            slow = drives[worst].slowest(law)
            remark = (
                "no gains make the loop stable at all these belt speeds: with the nearest ones a "
                f"deviation grows at {number_text(loops.drive, slow.drive.belt_speed, 'm/s')}, "
                f"with {number_text(loops.drive, -rate, '1/s')}{self._named(worst)}"
            )
            return Tuned(law, loops.goal, rate, remark=remark)
        beyond = {name: drive.missed(law) for name, drive in drives.items()}
        worst = max(beyond, key=lambda name: sum(limit.excess for limit in beyond[name]))
        missed = beyond[worst]
        remarks: list[str] = []
        if loops.vibrations and not any(vibration.vibrates for vibration in loops.vibrations):
            remarks.append(loops.calm())
        if missed:
            reasons = " and ".join(limit.sentence(loops.drive) for limit in missed)
            reasons += self._named(worst)
            remarks.append(f"no gains keep all limits: with the nearest ones {reasons}")
        else:
            for name in self._body_names:
                asked, used = getattr(loops.law, name), getattr(law, name)
                if asked != used:
                    remarks.append(f"{name} is {used}: with {asked} there are no gains")
        tuned = loops.judged(law, loops.plants, loops.vibrations)
        return replace(tuned, missed=missed, remark="; ".join(remarks) or None)

    def used(self, law: ControlLaw) -> float:
        """Return the share of its limits that a stable law uses, the largest of all drives."""
        limits = (limit for drive in self.drives.values() for limit in drive.limits(law))
        return exp(max(limit.excess for limit in limits))

    def _named(self, drive: str) -> str:
        """Return an end of a sentence that names a drive, if there are several."""
        return f", of {drive}" if self.others else ""

    @cached_property
    def _body_names(self) -> list[str]:
        """Names of the constants that choose a body."""
        described = constants_of(type(self.loops.law))
        return [name for name in described if described[name].choices == (TABLE, MOTOR)]

    @cached_property
    def bodies(self) -> list[ControlLaw]:
        """The law, and where there is a motor those that feed back other bodies."""
        laws = [self.loops.law]
        if self.loops.drive.motor is not None:
            names = self._body_names
            variants = (
                replace(self.loops.law, **dict(zip(names, chosen, strict=True)))
                for chosen in product((MOTOR, TABLE), repeat=len(names))
            )
            laws += sorted(
                variants,
                key=lambda law: sum(getattr(law, n) != getattr(self.loops.law, n) for n in names),
            )
        forms: dict[bytes, ControlLaw] = {}
        for law in laws:
            form = linear_part(law, self.loops.plants[0].loop)
            padded = np.pad(form.direct, (0, 4 - len(form.direct)))
            forms.setdefault((np.append(form.input, padded) + 0.0).tobytes(), law)
        return [*forms.values()]

    def _searched(self, law: ControlLaw, share: float) -> tuple[tuple[float, float], ControlLaw]:
        """Return the best gains of a law, with a value that is larger for better ones."""
        described = [constants_of(type(law))[name] for name in law.tuned]
        drive, loop = self.loops.drive, self.loops.plants[0].loop
        mass = drive.mass + (drive.motor.mass if drive.motor else 0.0)
        latest = loop.force_delay + (0.5 + loop.difference_samples / 2.0) / loop.rate
        stiff = replace(drive, mass=mass, stiffness=mass / latest**2)
        scales = [
            np.log([1.0 / d.scales.factor(constant.unit) for constant in described])
            for d in (drive, stiff)
        ]
        below, above = (log(10.0) * decades for decades in _DECADES)
        ends = np.minimum(*scales) - below, np.maximum(*scales) + above
        # The sign of the default first: another one serves long delays only.
        usual = [-1.0 if constant.default < 0.0 else 1.0 for constant in described]
        allowed = [
            (sign, -sign) if constant.at_least < 0.0 and not constant.positive else (sign,)
            for sign, constant in zip(usual, described, strict=True)
        ]

        def best_with(signs: Sequence[float]) -> tuple[tuple[float, float], ControlLaw]:
            def with_gains(point: FloatArray) -> ControlLaw:
                values = map(rounded, (np.exp(point) * signs).tolist())
                return replace(law, **dict(zip(law.tuned, values, strict=True)))

            def excess(law: ControlLaw) -> Iterator[float]:
                for drive in self.drives.values():
                    for limit in drive.limits(law, drive.deciding):
                        # What is missing is best told as a force: the others come first.
                        weight = _FIRST if limit.least else 1.0
                        yield weight * max(limit.excess - log(share), 0.0)

            return fastest(self.decay_rates, ends, with_gains, excess)

        first, *others = product(*allowed)
        best = best_with(first)
        for signs in others if best[0][0] < 0.0 else ():
            best = max(best, best_with(signs), key=lambda pair: pair[0])
        return best

    def decay_rates(self, laws: Sequence[ControlLaw]) -> FloatArray:
        """Return the smallest decay rate of all drives with each law, 1/s."""
        return np.min([drive.decay_rates(laws) for drive in self.drives.values()], axis=0)


def fastest(
    decay_rates: Callable[[Sequence[_Law]], FloatArray],
    ends: tuple[FloatArray, FloatArray],
    law_at: Callable[[FloatArray], _Law],
    excess: Callable[[_Law], Iterable[float]],
) -> tuple[_Value, _Law]:
    """Return the law with the smallest total excess over its limits.

    Among laws of equal excess it is that with the largest decay rate.

    Points between the ends are scanned evenly; the best are refined by ever smaller steps.

    Parameters
    ----------
    decay_rates : callable
        Returns the smallest decay rate with each law, 1/s.
    ends : tuple of ndarray
        Lowest and highest points, logarithms of magnitudes, shape (n,) each.
    law_at : callable
        Returns the law that a point stands for.
    excess : callable
        Returns by how much, as logarithms, a stable law exceeds limits.

    Returns
    -------
    tuple
        Its value and the law. A value is the excess in all, less than or equal to zero and
        -infinity of an unstable law, and the smallest decay rate, 1/s.
    """

    @cache
    def exceeded(law: _Law) -> float:
        return -ceil(100.0 * sum(excess(law))) / 100.0  # so that less excess is not too slow

    def valued(law: _Law, rate: float) -> _Value:
        return (exceeded(law) if rate > 0.0 else -inf, rate)

    points = _evenly(*ends)
    laws = [law_at(point) for point in points]
    rates = decay_rates(laws)
    order = np.argsort(-rates)
    stable = int((rates > 0.0).sum())
    places = {*range(_VALUED // 3), *np.linspace(0, max(stable - 1, 0), _VALUED).astype(int)}
    chosen = [order[place] for place in sorted(places)]
    tops = [(valued(laws[row], float(rates[row])), tuple(points[row].tolist())) for row in chosen]
    best = sorted(tops, reverse=True)[:_REFINED]
    refined = (_refined(decay_rates, ends, law_at, valued, *top) for top in best)
    return max(refined, key=lambda pair: pair[0])


def _refined(
    decay_rates: Callable[[Sequence[_Law]], FloatArray],
    ends: tuple[FloatArray, FloatArray],
    law_at: Callable[[FloatArray], _Law],
    valued: Callable[[_Law, float], _Value],
    top: _Value,
    place: tuple[float, ...],
) -> tuple[_Value, _Law]:
    """Return the best value and law near a point of some value, by ever smaller steps."""
    point = np.array(place)
    ways = np.array([*product((-1.0, 0.0, 1.0), repeat=len(point))])
    ways = ways[(np.abs(ways).sum(axis=1) > 0.0) & (np.abs(ways).sum(axis=1) < 4.0)]
    step = _FIRST_STEP
    for _ in range(_MOVES):
        around = np.clip(point + step * ways, *ends)
        laws = [law_at(place) for place in around]
        rates = decay_rates(laws)
        # Beside a law within its limits, only faster ones can be better.
        faster = (row for row in np.argsort(-rates).tolist() if top[0] < 0.0 or rates[row] > top[1])
        values = ((valued(laws[row], float(rates[row])), row) for row in faster)
        if top[0] < 0.0:  # some are better by little: the best
            values = iter([max(values)])
        better = next((trial for trial in values if trial[0] > top), None)
        if better is not None:
            top, point = better[0], around[better[1]]
        elif step < _LAST_STEP:
            break
        else:
            step /= 2.0
    return top, law_at(point)


def _evenly(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return points between ends of shape (n,), spread evenly, shape (m, n)."""
    count = len(low)
    # Powers of the root of x^(n+1) = x + 1 spread points most evenly (Roberts, 2018).
    root = max(np.roots([1.0, *[0.0] * (count - 1), -1.0, -1.0]).real)
    numbers = np.arange(1, _SCANNED[min(count, len(_SCANNED)) - 1] + 1)[:, None]
    return low + (high - low) * ((0.5 + numbers * root ** -np.arange(1.0, count + 1.0)) % 1.0)


def rounded(value: float, digits: int = 3, *, up: bool = False) -> float:
    """Return a value rounded to `digits` significant digits, `up` or to the nearest."""
    if value == 0.0:
        return 0.0
    if up:
        unit = 10.0 ** (floor(log10(value)) + 1 - digits)
        value = ceil(value / unit) * unit
    return float(f"{value:.{digits}g}")
