"""A study: many points of one scenario, each simulated until its motion has settled."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, NamedTuple, Self

from stickslip_ros.errors import StickslipError
from stickslip_ros.physics.measures.cycle_measures import EQUILIBRIUM_SPEED, Measures, Regime
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.plan import Plan
from stickslip_ros.studies.settling import (
    ControlledDrive,
    MotionState,
    SettlingCourse,
    settle,
)

MEASURES = tuple(
    measure.name
    for measure in fields(Measures)
    if measure.name not in ("steady", "trend", "errors")
)
"""Names of the measures of a point, which has `steady` as an attribute of its own."""

_NUDGE = EQUILIBRIUM_SPEED / 2.0
"""Share of the belt speed by which a slide at rest is pushed before it is carried on: rounding
alone would leave an unstable equilibrium very late or never."""


class Point(NamedTuple):
    """The result of one point."""

    number: int
    """Index in the plan, from 0."""
    measures: Measures
    steady: bool
    """Whether it has settled (see `Settled`)."""
    turning_points: tuple[float, ...]
    """Poincare section x' = 0, m (see `Settled`)."""
    reason: str | None
    """Why it has no cycle to measure; None if it has one or is at rest."""

    def as_json(self) -> list[Any]:
        """Return values from which `from_json` makes the same point, to the last bit."""
        measures = [getattr(self.measures, name) for name in MEASURES]
        return [self.number, *measures, self.steady, list(self.turning_points), self.reason]

    @classmethod
    def from_json(cls, values: Sequence[Any]) -> Self:
        """Return the point of the values that `as_json` returned."""
        number, *measures, steady, turning_points, reason = values
        named: dict[str, Any] = dict(zip(MEASURES, measures, strict=True))
        named["regime"] = None if named["regime"] is None else Regime(named["regime"])
        return cls(number, Measures(**named), steady, tuple(turning_points), reason)


class Piece(NamedTuple):
    """Points of a study that one task has computed, in the order of the task."""

    points: list[Point]
    end: MotionState | None
    """State in which the point after the last one starts; None: its own initial state, because the
    last one diverged or failed, or the plan is not carried on."""


@dataclass(frozen=True)
class Study:
    """The points of a plan, with all other parameters from a scenario.

    A motion starts in the scenario's initial state. If the plan is carried on, it starts in the
    state in which its neighbour ended, filter included; delayed forces are then dropped, and
    `start_after` applies to the first point of a chain only. A motion that ended at rest gets a
    push that is smaller than the limit of rest.
    """

    scenario: Scenario
    plan: Plan
    course: SettlingCourse = field(default_factory=SettlingCourse)
    continuous: bool = False
    """Whether control acts without sampling (eq. 19)."""

    def case(self, index: int) -> tuple[ControlledDrive, MotionState]:
        """Return the drive and loop of a point, and its initial state.

        Raises InvalidInputError if its values are out of bounds or not compatible.
        """
        values = dict(zip(self.plan.parameters, self.plan.values(index), strict=True))
        scenario = self.scenario.changed(values)
        initial = scenario.plant.initial
        return ControlledDrive.from_scenario(scenario, continuous=self.continuous), MotionState(
            initial.position, initial.velocity
        )

    def check(self) -> None:
        """Raise InvalidInputError if neither a corner of the plan nor its middle is valid."""
        refusals: list[StickslipError] = []
        for index in (*self.plan.corners(), self.plan.size // 2):
            try:
                self.case(index)
            except StickslipError as error:
                refusals.append(error)
            else:
                return
        raise refusals[0]

    def cost(self) -> float:
        """Return the approximate time that a point takes, s."""
        for index in (self.plan.size // 2, 0, self.plan.size - 1):
            with suppress(StickslipError):
                case, _ = self.case(index)
                break
        else:
            case = ControlledDrive.from_scenario(self.scenario, continuous=self.continuous)
        periods = self.course.transient + self.course.cycles + 2
        if case.sampled is None:
            return periods * 2e-5
        return periods * case.period * case.sampled.rate * 1e-5

    def as_dict(self) -> dict[str, Any]:
        """Return everything that the result depends on, ready for JSON."""
        plan: Any = self.plan
        return {
            "scenario": self.scenario.as_dict(),
            "plan": {"kind": plan.kind, **asdict(plan)},
            "course": asdict(self.course),
            "continuous_control": self.continuous,
        }


def compute(study: Study, points: Sequence[int], start: MotionState | None) -> Piece:
    """Compute some points in their order; a pure function, for any process.

    If the plan is carried on, the first point starts in `start`. With None it starts in its
    initial state, as does the point after one that failed or diverged.
    """
    carried, end = study.plan.carried, start
    found: list[Point] = []
    for index in points:
        point, end = _compute_point(study, index, end if carried else None)
        found.append(point)
    return Piece(found, end if carried else None)


def _compute_point(
    study: Study, index: int, start: MotionState | None
) -> tuple[Point, MotionState | None]:
    """Return a computed point, and the state in which the next one of a chain starts."""
    try:
        case, initial = study.case(index)
        if start is not None and case.law is not None:
            case = replace(case, law=replace(case.law, start_after=0.0))
        settled = settle(case, start or initial, study.course)
    except (StickslipError, ArithmeticError) as error:
        nothing = Measures(None, None, None, None, None, None, 0, None)
        return Point(index, nothing, False, (), " ".join(str(error).split())), None
    measures, end, reason = replace(settled.measures, steady=None, trend=None), settled.end, None
    match measures.regime:
        case Regime.UNBOUNDED:
            end, reason = None, "the motion diverges"
        case Regime.EQUILIBRIUM:
            end = replace(end, velocity=end.velocity - _NUDGE * case.drive.belt_speed)
        case None:
            reason = "no whole cycle in the measured time"
        case _:
            pass
    turning_points = tuple(settled.turning_points.tolist())
    return Point(index, measures, settled.steady, turning_points, reason), end


def pieces_of(points: range, size: int) -> Iterator[range]:
    """Yield the points in pieces of `size`."""
    for first in range(0, len(points), size):
        yield points[first : first + size]
