"""Equilibria and limit cycles over the belt speed, stable and unstable, joined to branches.

This is the bifurcation diagram of the theory. That of `studies/study.py` shows the motions
that a simulation settles on, which are stable.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from math import copysign
from typing import NamedTuple, Self

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.drive import Drive
from stickslip_ros.theory.hopf import HopfPoint, hopf_points
from stickslip_ros.theory.limit_cycles import limit_cycles
from stickslip_ros.theory.linear import hurwitz_determinants, jacobians
from stickslip_ros.theory.requirements import ONE_DEGREE, STATIC, SYMMETRIC, require
from stickslip_ros.theory.shooting import LimitCycle
from stickslip_ros.theory.sticking import StickingOnset, sticking_onset

_CURVE = 400
"""Number of belt speeds at which the equilibrium is computed."""

_NEAR_HOPF = (1.5, 0.8, 0.4, 0.15, 0.03)
"""Distances from a Hopf point, in steps of the belt speed there: a cycle grows as their root."""

_BELOW_ONSET = 1e-6
"""Relative distance from the stick-slip onset speed at which the slide sticks long enough."""

_HALVINGS = 5
"""How often the interval is halved in which two cycles meet."""

_EXTENSIONS = 4
"""How often the range of belt speeds is extended while there are cycles at its upper end."""

_AtSpeed = tuple[float, list[LimitCycle]]
"""Belt speed, m/s, and the cycles there, the smallest first."""


@dataclass(frozen=True, eq=False)
class Branch:
    """Equilibria, or limit cycles, that follow from each other as the belt speed changes."""

    belt_speeds: FloatArray
    """m/s, ascending; shape (n,)."""
    least: FloatArray
    """Least displacement, m; shape (n,)."""
    greatest: FloatArray
    """Greatest displacement, m; shape (n,). At an equilibrium it is the least, too."""
    sticks: BoolArray
    """Whether the slide sticks once a cycle; shape (n,)."""
    stable: bool
    """Whether motions that start nearby return to it."""


@dataclass(frozen=True, eq=False)
class BifurcationBranches:
    """Equilibria and limit cycles of a drive without control over the belt speed; SI units."""

    drive: Drive
    """The drive."""
    belt_speeds: FloatArray
    """Belt speeds at which the cycles were searched for, m/s; some may be added to those given."""
    equilibria: tuple[Branch, ...]
    """Branches of the equilibrium; one ends, and the next one starts, where stability changes."""
    cycles: tuple[Branch, ...]
    """Branches of limit cycles.

    A branch that starts at a Hopf point has this point as its end, and two that meet in a fold have
    the same end.
    """
    hopf_points: tuple[HopfPoint, ...]
    """Hopf points in the range; the belt speed of each has the sign of the range."""
    sticking_onset: float | None
    """Highest belt speed with a cycle that sticks, m/s; see `StickingOnset.exact`.

    None if there is none within the range, and for friction with a memory.
    """

    @property
    def folds(self) -> list[float]:
        """Belt speeds at which a stable and an unstable limit cycle meet, m/s, ascending."""
        ends = Counter(
            (float(branch.belt_speeds[end]), float(branch.greatest[end]))
            for branch in self.cycles
            for end in (0, -1)
        )
        return sorted(speed for (speed, _), count in ends.items() if count == 2)

    @classmethod
    def over(cls, drive: Drive, belt_speeds: FloatArray) -> Self:
        """Return the branches over a range of belt speeds.

        The cycles are those of `limit_cycles`. Belt speeds are added near Hopf points and between
        two speeds where cycles appear.

        Parameters
        ----------
        drive : Drive
            Drive in SI units; its belt speed is not used.
        belt_speeds : ndarray
            Belt speeds in m/s, ascending and of one sign, at least two.

        Raises
        ------
        InvalidInputError
            If friction differs between the directions, belt or load follow a signal, the drive has
            no spring, or the belt speeds are not as described.
        RunError
            If the motion is too stiff to follow.
        """
        require_branches(drive)
        ascending = len(belt_speeds) > 1 and np.all(np.diff(belt_speeds) > 0.0)
        one_sign = ascending and belt_speeds[0] * belt_speeds[-1] > 0.0
        if not (one_sign and np.all(np.isfinite(belt_speeds))):
            raise InvalidInputError(
                "the bifurcation diagram needs at least two belt speeds, ascending and of one sign"
            )
        return cls._found(drive, belt_speeds, hopf_points(drive), _onset(drive))

    @classmethod
    def around(cls, drive: Drive, points: int = 40) -> Self:
        """Return the branches over the belt speeds that tell most about a drive.

        The range goes from near zero to beyond Hopf points, stick-slip onset, the drive's own belt
        speed, and the cycles. It has the direction of the drive's belt.

        Parameters
        ----------
        drive : Drive
            Drive in SI units.
        points : int, optional
            Number of belt speeds at which cycles are searched for first.

        Raises
        ------
        InvalidInputError
            See `over`.
        RunError
            If the motion is too stiff to follow.
        """
        require_branches(drive)
        hopf, onset = hopf_points(drive), _onset(drive)
        known = [abs(point.belt_speed) for point in hopf]
        known += [abs(drive.belt_speed)] if drive.belt_speed else []
        known += [onset.exact] if onset is not None and onset.exact is not None else []
        top = 1.3 * max(known, default=drive.speed_scale)
        for _ in range(_EXTENSIONS):
            if not limit_cycles(replace(drive, belt_speed=copysign(top, drive.belt_speed))):
                break
            top *= 1.5
        speeds = np.sort(copysign(1.0, drive.belt_speed) * np.linspace(top / points, top, points))
        return cls._found(drive, speeds, hopf, onset)

    @classmethod
    def _found(
        cls,
        drive: Drive,
        belt_speeds: FloatArray,
        hopf: Sequence[HopfPoint],
        onset: StickingOnset | None,
    ) -> Self:
        low, high = belt_speeds[[0, -1]].tolist()
        side = copysign(1.0, high)
        points = [replace(point, belt_speed=side * abs(point.belt_speed)) for point in hopf]
        points = [point for point in points if low < point.belt_speed < high]
        sticking = None if onset is None or onset.exact is None else side * onset.exact
        at_points = [point.belt_speed for point in points]
        added = [] if sticking is None else [sticking * (1.0 - _BELOW_ONSET), sticking]
        rows = _searched(drive, belt_speeds, at_points, added)
        return cls(
            drive=drive,
            belt_speeds=np.array([speed for speed, _ in rows]),
            equilibria=tuple(_equilibria(drive, low, high, at_points)),
            cycles=tuple(_joined(drive, rows, at_points)),
            hopf_points=tuple(points),
            sticking_onset=sticking if sticking is not None and low < sticking < high else None,
        )


def require_branches(drive: Drive) -> None:
    """Raise NotCoveredError for a drive that has no `BifurcationBranches`."""
    require("the bifurcation diagram", drive, *ONE_DEGREE, SYMMETRIC)


def _onset(drive: Drive) -> StickingOnset | None:
    return sticking_onset(drive) if STATIC.lack(drive) is None else None


def _equilibria(drive: Drive, low: float, high: float, hopf: Sequence[float]) -> Iterator[Branch]:
    """Yield the equilibrium between neighbouring Hopf points."""
    edges = [low, *sorted(hopf), high]
    for start, end in pairwise(edges):
        share = (end - start) / (high - low)
        speeds = np.linspace(start, end, max(2, round(_CURVE * share)))
        inside = np.array([(start + end) / 2.0 / drive.speed_scale])
        stable = bool(np.all(hurwitz_determinants(jacobians(drive, None, inside)) > 0.0))
        rest = [replace(drive, belt_speed=speed).equilibrium_position for speed in speeds.tolist()]
        position = np.array(rest)
        yield Branch(speeds, position, position, np.zeros(len(speeds), dtype=bool), stable)


def _searched(
    drive: Drive, belt_speeds: FloatArray, hopf: Sequence[float], added: Sequence[float]
) -> list[_AtSpeed]:
    """Return the cycles at all belt speeds, at those `added`, and at more where cycles appear."""

    def cycles_at(speed: float) -> _AtSpeed:
        return speed, limit_cycles(replace(drive, belt_speed=speed))

    low, high = belt_speeds[[0, -1]].tolist()
    near = [
        point + side * part * (right - left)
        for left, right in pairwise(belt_speeds.tolist())
        for point in hopf
        if left < point < right
        for side in (-1.0, 1.0)
        for part in _NEAR_HOPF
    ]
    inside = [speed for speed in (*near, *added) if low < speed < high]
    rows = [cycles_at(speed) for speed in np.union1d(belt_speeds, inside).tolist()]
    refined = rows[:1]
    for before, after in pairwise(rows):
        if not any(before[0] < point < after[0] for point in hopf):
            refined += _narrowed(before, after, cycles_at)
        refined.append(after)
    return refined


def _narrowed(
    before: _AtSpeed, after: _AtSpeed, cycles_at: Callable[[float], _AtSpeed]
) -> list[_AtSpeed]:
    """Return belt speeds between two, and their cycles, ever closer to where cycles appear."""
    low, high = [before], [after]
    for _ in range(_HALVINGS):
        if _kinds(low[-1]) == _kinds(high[0]):
            break
        middle = cycles_at((low[-1][0] + high[0][0]) / 2.0)
        if _kinds(middle) == _kinds(low[-1]):
            low.append(middle)
        else:
            high.insert(0, middle)
    return low[1:] + high[:-1]


def _kinds(at_speed: _AtSpeed) -> list[bool]:
    return [cycle.stable for cycle in at_speed[1]]


class _Point(NamedTuple):
    """Limit cycle as a point of a branch; SI units."""

    belt_speed: float
    least: float
    greatest: float
    sticks: bool

    @classmethod
    def of_cycle(cls, drive: Drive, belt_speed: float, cycle: LimitCycle) -> Self:
        middle, half = cycle.measures.midpoint, cycle.measures.amplitude
        if middle is None or half is None:  # it is too small to be measured
            middle = cls.at_rest(drive, belt_speed).least
            half = middle - cycle.position
        sticks = cycle.measures.regime is Regime.STICK_SLIP
        return cls(belt_speed, middle - half, middle + half, sticks)

    @classmethod
    def at_rest(cls, drive: Drive, belt_speed: float) -> Self:
        """Return the equilibrium, where a cycle starts at a Hopf point."""
        rest = replace(drive, belt_speed=belt_speed).equilibrium_position
        return cls(belt_speed, rest, rest, False)


def _joined(drive: Drive, rows: Sequence[_AtSpeed], hopf: Sequence[float]) -> list[Branch]:
    """Return the branches of limit cycles, from one belt speed to the next."""
    finished: list[Branch] = []
    growing: list[list[_Point]] = [[] for _ in rows[0][1]]
    previous = rows[0]
    for row in rows:
        speed, cycles = row
        points = [_Point.of_cycle(drive, speed, cycle) for cycle in cycles]
        if row is not previous:
            kept = _matches(previous[1], cycles)
            births = [point for point in hopf if previous[0] < point < speed]
            birth = _Point.at_rest(drive, births[0]) if births else None
            last = [branch[-1] for branch in growing]
            for number, end in _ends(previous, last, set(kept), birth, speed).items():
                branch = [*growing[number], *end]
                finished.append(_branch(branch, stable=previous[1][number].stable))
            starts = _ends(row, points, set(kept.values()), birth, previous[0])
            continued = {new: growing[old] for old, new in kept.items()}
            growing = [continued.get(new) or starts[new] for new in range(len(cycles))]
        for branch, point in zip(growing, points, strict=True):
            branch.append(point)
        previous = row
    for branch, cycle in zip(growing, previous[1], strict=True):
        finished.append(_branch(branch, stable=cycle.stable))
    return finished


def _matches(before: Sequence[LimitCycle], after: Sequence[LimitCycle]) -> dict[int, int]:
    """Return which cycles continue each other: as many as possible, then the most similar.

    Cycles surround each other: their order does not change. Nor does stability along a branch.
    """
    for size in range(min(len(before), len(after)), 0, -1):
        pairs = [
            (old, new)
            for old in combinations(range(len(before)), size)
            for new in combinations(range(len(after)), size)
            if all(before[i].stable == after[j].stable for i, j in zip(old, new, strict=True))
        ]
        if pairs:
            chosen = min(
                pairs,
                key=lambda pair: sum(
                    abs(before[i].position - after[j].position) for i, j in zip(*pair, strict=True)
                ),
            )
            return dict(zip(*chosen, strict=True))
    return {}


def _ends(
    at_speed: _AtSpeed,
    points: Sequence[_Point],
    matched: Collection[int],
    birth: _Point | None,
    other_speed: float,
) -> dict[int, list[_Point]]:
    """Return, by the number of each cycle without a match, where its branch ends.

    That is the equilibrium at a Hopf point, the fold in which two neighbours meet, or unknown.
    """
    alone = [number for number in range(len(points)) if number not in matched]
    ends: dict[int, list[_Point]] = {number: [] for number in alone}
    if birth is not None and alone[:1] == [0]:
        ends[alone.pop(0)] = [birth]
    cycles = at_speed[1]
    for inner, outer in zip(alone[::2], alone[1::2], strict=False):
        if outer == inner + 1 and cycles[inner].stable != cycles[outer].stable:
            a, b = points[inner], points[outer]
            least, greatest = (a.least + b.least) / 2.0, (a.greatest + b.greatest) / 2.0
            fold_speed = (a.belt_speed + other_speed) / 2.0
            ends[inner] = [_Point(fold_speed, least, greatest, a.sticks)]
            ends[outer] = [_Point(fold_speed, least, greatest, b.sticks)]
    return ends


def _branch(points: Sequence[_Point], *, stable: bool) -> Branch:
    belt_speeds, least, greatest, sticks = map(np.array, zip(*points, strict=True))
    return Branch(belt_speeds, least, greatest, sticks, stable)
