"""Comparison of control laws: cases of law, parameters, disturbance and seed, and the ranking."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np
from typing_extensions import override

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.errors import InvalidInputError, StickslipError
from stickslip_ros.progress import Progress
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.scenarios.parameters import known_law
from stickslip_ros.studies.case_outcome import (
    FOLLOWING,
    Disturbance,
    Outcome,
    is_positioning,
    simulate_case,
)
from stickslip_ros.studies.design import Task, design
from stickslip_ros.studies.drive_loops import DriveLoops, Tuned, with_law
from stickslip_ros.studies.goal import Goal
from stickslip_ros.studies.options import FEED_TOLERANCE, POSITION_TOLERANCE
from stickslip_ros.studies.plan import Axis, Grid
from stickslip_ros.studies.settling import MotionState, check_reference
from stickslip_ros.studies.spread import Spread, check_spread, drawn, held_interval
from stickslip_ros.studies.study import PointStudy
from stickslip_ros.studies.tuning import Tuning
from stickslip_ros.text import must_be_one_of, shown

DISTURBANCES = ("step", "impulse", "sine")
"""Default disturbances."""
_MEANS = {
    False: ("rms_velocity", "rms_force", "settling_time", "peak_force", "mean_force", "set_point"),
    True: (
        *("final_error", "rms_force", "settling_time", "peak_force", "hunting_amplitude"),
        *FOLLOWING,
    ),
}
"""What the table has means of, by whether the task is positioning, the second criterion first; of
how the slide follows, what is known of any law."""


class Outcomes:
    """The outcomes of all cases as columns, and which are known."""

    def __init__(self, size: int) -> None:
        self.done: BoolArray = np.zeros(size, dtype=bool)
        """Whether the case is simulated."""
        self.rows: list[Outcome] = [Outcome(number) for number in range(size)]
        """The outcomes, in the order of the cases."""

    def enter(self, outcomes: Iterable[Outcome]) -> None:
        """Enter the outcomes of cases that were simulated."""
        for outcome in outcomes:
            self.rows[outcome.number] = outcome
            self.done[outcome.number] = True

    def column(self, name: str) -> FloatArray:
        """Return a column of numbers; NaN for what does not exist."""
        values = [getattr(row, name) for row in self.rows]
        return np.array([np.nan if value is None else float(value) for value in values])

    def of_law(self, plan: "Cases", law: str, name: str) -> FloatArray:
        """Return a column of the cases of a law, shape (points, disturbances, seeds)."""
        return self.column(name).reshape(plan.shape)[[*plan.laws].index(law)]


class Case(NamedTuple):
    """Places of a case in the lists of a plan."""

    law: int
    point: int
    disturbance: int
    seed: int


@dataclass(frozen=True)
class Cases:
    """All combinations of laws, points of a grid, disturbances and seeds; the seed varies fastest.

    A seed is that of the sensor's noise and of the jitter, and draws the constants of the drive;
    these are the same for all laws.
    """

    kind: ClassVar[str] = "comparison"
    """Name of this kind of plan in journals."""
    continuation: ClassVar[None] = None
    """None: the cases are independent."""
    laws: Mapping[str, Mapping[str, Any]]
    """Constants of each law, by name of the law."""
    grid: Grid | None
    """Values of parameters that vary; None for those of the scenario."""
    disturbances: tuple[Disturbance, ...]
    seeds: int = 1
    spread: Spread = 0.0
    """Largest deviation of a constant of the drive, as a share, or `FIT`."""
    duration: float = 6.0
    """Duration of a case, s."""
    tolerance: float = FEED_TOLERANCE
    """What a law that holds may leave, as a share; see `FEED_TOLERANCE`."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of laws, points, disturbances and seeds."""
        points = 1 if self.grid is None else self.grid.size
        return len(self.laws), points, len(self.disturbances), self.seeds

    @property
    def size(self) -> int:
        """Number of cases."""
        return int(np.prod(self.shape))

    @property
    def parameters(self) -> tuple[str, ...]:
        """NODE.PARAMETER of the values that vary."""
        return () if self.grid is None else self.grid.parameters

    def case(self, number: int) -> Case:
        """Return the places of a case."""
        return Case(*map(int, np.unravel_index(number, self.shape)))

    def chains(self) -> Iterator[range]:
        """Yield all numbers together."""
        yield range(self.size)


@dataclass(frozen=True)
class Comparison(PointStudy[Cases]):
    """The cases of a comparison, with all other parameters from a scenario."""

    def scenario_of(self, number: int) -> Scenario:
        """Return the scenario of a case.

        Raises InvalidInputError if its values are out of bounds, or do not fit together.
        """
        plan, case = self.plan, self.plan.case(number)
        law = [*plan.laws][case.law]
        varied = with_law(self.scenario, law, plan.laws[law])
        values: dict[str, Any] = {"plant.sensor.seed": case.seed}
        values["plant.force_jitter_seed"] = case.seed
        values |= plan.disturbances[case.disturbance].parameters(plan.duration)
        if plan.grid is not None:
            values |= zip(plan.parameters, plan.grid.values(case.point), strict=True)
        varied = varied.changed(values)
        return varied.changed(drawn(varied, case.seed, plan.spread)) if plan.spread else varied

    @override
    def compute_point(
        self, index: int, start: MotionState | None
    ) -> tuple[Outcome, MotionState | None]:
        try:
            plan, case = self.plan, self.plan.case(index)
            outcome = simulate_case(
                self.scenario_of(index),
                plan.duration,
                plan.disturbances[case.disturbance],
                plan.tolerance,
            )
            return replace(outcome, number=index), None
        except (StickslipError, ArithmeticError) as error:
            return Outcome(index, held=False, reason=" ".join(str(error).split())), None

    @override
    def row(self, values: Sequence[Any]) -> Outcome:
        return Outcome(*values)

    @override
    def cost(self) -> float:
        return self.plan.duration * self.scenario.plant.rate * 2e-5

    @override
    def as_dict(self) -> dict[str, Any]:
        plan = asdict(self.plan)
        return {"scenario": self.scenario.as_dict(), "plan": {"kind": self.plan.kind, **plan}}

    def check(self) -> None:
        """Refuse a comparison of which no first case of a law can be simulated."""
        for number in range(0, self.plan.size, self.plan.size // len(self.plan.laws)):
            check_reference(self.scenario_of(number))


def compared(
    scenario: Scenario,
    controllers: str | Sequence[str],
    axes: Sequence[Axis] = (),
    *,
    disturbances: str | Sequence[str] = DISTURBANCES,
    given: str | Sequence[str] = (),
    seeds: int = 1,
    spread: Spread = 0.0,
    duration: float = 6.0,
    tolerance: float | None = None,
    progress: Progress = lambda _: None,
) -> tuple[Comparison, dict[str, Tuned]]:
    """Return the cases of a comparison, with the gains that were found for its laws.

    The arguments are those of `stickslip_ros.compare`; `progress` receives the share of the gains
    that are found, 0 to 1.

    Raises
    ------
    InvalidInputError
        If an argument is not allowed, or a law has no gains that make all loops stable.
    """
    check_spread(spread)
    limits = {"seeds": (seeds, 1, 100_000), "duration": (duration, 0.01, 1e5)}
    for name, (value, low, high) in limits.items():
        if not low <= value <= high:
            raise InvalidInputError(f"{name} {value:g}: must be from {low:g} to {high:g}")
    if tolerance is None:
        tolerance = POSITION_TOLERANCE if is_positioning(scenario) else FEED_TOLERANCE
    laws = [known_law(law) for law in _names("controllers", controllers)]
    fixed = [known_law(law) for law in _names("given", given)] if given else []
    if not {*fixed} <= {*laws}:
        raise InvalidInputError(f"given {shown(fixed)}: must be among {', '.join(laws)}")
    applied = tuple(
        Disturbance.parse(text, scenario) for text in _names("disturbances", disturbances)
    )
    tuned: dict[str, Tuned] = {}
    constants: dict[str, dict[str, Any]] = {}
    for number, law in enumerate(laws):
        as_given = with_law(scenario, law, {}).controller.control_law
        if as_given.tuned and law not in fixed:
            tuned[law] = _tuned(scenario, law, feeds(scenario, axes), applied)
            as_given = tuned[law].law
        constants[law] = {name: getattr(as_given, name) for name in as_given.constants()}
        progress((number + 1) / len(laws))
    grid = Grid(tuple(axes)) if axes else None
    plan = Cases(constants, grid, applied, seeds, spread, duration, tolerance)
    study = Comparison(scenario, plan)
    study.check()
    return study, tuned


def _tuned(
    scenario: Scenario, law: str, speeds: Sequence[float], applied: Sequence[Disturbance]
) -> Tuned:
    """Return the gains of a design for the range of belt speeds, or the nearest ones."""
    with_own = with_law(scenario, law, {})
    limit = min(with_own.controller.control_law.force_limit, scenario.plant.actuator.limit)
    moving = [abs(speed) for speed in speeds if speed]  # at rest there is no loop to tune
    ends = min(moving), max(moving)
    if not is_positioning(scenario):
        proposal = design(Task(with_own, ends, limit), disturbances=applied)
        if proposal.tuned is not None:
            return replace(proposal.tuned, remark=proposal.remark)
    goal = Goal.from_scenario(with_own, ends, applied, limit)
    return Tuning(DriveLoops(with_own, law, goal)).best()


def feeds(scenario: Scenario, axes: Sequence[Axis]) -> list[float]:
    """Return the speeds, m/s, at which the loops of a scenario are to hold.

    At a feed these are the belt speeds. On a guide at rest they are the largest speed of the
    reference and a tenth of it, or without one 10 mm/s and 1 mm/s.
    """
    for axis in axes:
        if axis.parameter == "plant.belt_speed":
            return axis.values().tolist()
    if not is_positioning(scenario):
        return [scenario.plant.belt_speed]
    fastest = scenario.controller.reference.signal(period=1.0 / scenario.plant.rate).steepest
    return [0.1 * (fastest or 0.01), fastest or 0.01]


class Rank(NamedTuple):
    """A law in the ranked table; means over its cases, with standard errors over the seeds."""

    law: str
    """Name of the law."""
    held: float
    """Share of the cases that it holds."""
    held_error: float
    """Its standard error; NaN with one seed."""
    held_interval: tuple[float, float]
    """Its 95 % interval as of independent cases (Clopper, Pearson, Biometrika 26, 1934)."""
    means: Mapping[str, tuple[float, float]]
    """Mean and standard error of columns of `OUTCOMES`, over the cases where they exist."""
    at_limit: float
    """Mean share of samples at the force limit."""
    failures: int
    """Number of cases that diverged or failed."""
    reasons: Sequence[str]
    """Why they failed, in words."""

    @property
    def held_text(self) -> str:
        """Share of the cases that it holds, with its interval."""
        low, high = self.held_interval
        return f"{self.held:.1%} ({low:.1%} to {high:.1%})"


def ranked(study: Comparison, outcomes: Outcomes, rank_by: str | None) -> tuple[Rank, ...]:
    """Return the laws, the best first: by cases held, then error, then force beyond the mean.

    By the mean `rank_by` instead, those first of which no case failed.
    """
    names, plan = _MEANS[is_positioning(study.scenario)], study.plan
    ranks: list[Rank] = []
    for place, law in enumerate(plan.laws):
        columns = {n: outcomes.of_law(plan, law, n) for n in ("held", "at_limit", *names)}
        held, velocity = columns["held"], outcomes.of_law(plan, law, "rms_velocity")
        interval = held_interval(int(np.nansum(held)), held.size)
        means = {name: mean_of_seeds(columns[name]) for name in names}
        at_limit = float(np.nan_to_num(columns["at_limit"]).mean())
        failures, rows = int(np.isnan(velocity).sum()), outcomes.rows[place * held.size :]
        reasons = sorted({row.reason for row in rows[: held.size] if row.reason})
        rank = Rank(law, *mean_of_seeds(held), interval, means, at_limit, failures, reasons)
        ranks.append(rank)
    by = names[:2] if rank_by is None else [rank_by]

    def order(rank: Rank) -> tuple[float, ...]:
        first = -rank.held if rank_by is None else rank.failures
        return first, *(np.nan_to_num(rank.means[name][0], nan=np.inf) for name in by)

    return tuple(sorted(ranks, key=order))


def check_rank(name: str | None, scenario: Scenario) -> None:
    """Refuse to rank by what the task of a scenario has no means of."""
    allowed = _MEANS[is_positioning(scenario)]
    if name is not None and name not in allowed:
        raise InvalidInputError(
            f"rank_by = {shown(name)} is invalid: {must_be_one_of(name, allowed)}"
        )


def mean_of_seeds(values: FloatArray) -> tuple[float, float]:
    """Return the mean over all cases that have a value, and its standard error over the seeds."""
    known = ~np.isnan(values)
    if not known.any():
        return np.nan, np.nan
    counts = known.sum(axis=(0, 1))
    sums = np.where(known, values, 0.0).sum(axis=(0, 1))
    of_seeds = sums[counts > 0] / counts[counts > 0]
    error = of_seeds.std(ddof=1) / np.sqrt(len(of_seeds)) if len(of_seeds) > 1 else np.nan
    return float(values[known].mean()), float(error)


def _names(what: str, text: str | Sequence[str]) -> list[str]:
    names = text.split(",") if isinstance(text, str) else [*text]
    if not names or "" in names or len({*names}) < len(names):
        raise InvalidInputError(f"{what} {shown(text)}: must be different names")
    return names
