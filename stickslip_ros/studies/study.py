"""A study: many points of one scenario, each simulated until its motion has settled."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields, replace
from hashlib import sha256
from typing import Any, NamedTuple, Self

from stickslip_ros.errors import InvalidInputError, StickslipError
from stickslip_ros.physics.measures.cycle_measures import (
    EQUILIBRIUM_SPEED,
    Measures,
    Regime,
    trend_text,
)
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.plan import Plan
from stickslip_ros.studies.settling import (
    ControlledDrive,
    MotionState,
    SettlingOptions,
    settle,
)

MEASURES = tuple(
    measure.name
    for measure in fields(Measures)
    if measure.name not in ("steady", "trend", "errors", "drift")
)
"""Names of the measures of a point, which has `steady` as an attribute of its own."""

_NUDGE = EQUILIBRIUM_SPEED / 2.0
"""Share of the belt speed by which a slide at rest is pushed before the next point: rounding alone
would leave an unstable equilibrium very late or never."""


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
    """Why it has no cycle to measure, or how it drifts; None otherwise."""

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
    last one diverged or failed, or the plan has no continuation."""


@dataclass(frozen=True)
class Study:
    """The points of a plan, with all other parameters from a scenario.

    A motion starts in the scenario's initial state. With a continuation it starts in the
    state in which its neighbour ended, filter included; delayed forces are then dropped, and
    `start_after` applies to the first point of a chain only. A motion that ended at rest gets a
    push that is smaller than the limit of rest.
    """

    scenario: Scenario
    plan: Plan
    course: SettlingOptions = field(default_factory=SettlingOptions)
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
        """Refuse a plan without a valid corner or middle, or with an axis that changes none."""
        refusals: list[StickslipError] = []
        for index in (*self.plan.corners(), self.plan.size // 2):
            try:
                case, _ = self.case(index)
                break
            except StickslipError as error:
                refusals.append(error)
        else:
            raise refusals[0]
        unused = ("plant.force_timeout", "plant.reply_timeout", "plant.flow_window")
        if case.drive.has_spring:
            unused += ("plant.duration",)
        if not case.sampled:
            unused += ("plant.rate",)
        if not case.sampled and not self.continuous:  # continuous control refuses these
            unused += ("plant.force_", "plant.sensor.", "plant.actuator.")
        reasons = {
            f"{node}.{name}": why
            for node in self.scenario.nodes
            for name, why in getattr(self.scenario, node).not_used()
        }
        for axis in self.plan.axes:
            name = axis.parameter
            why = reasons.get(name, "in this study" if name.startswith(unused) else None)
            if why is not None:
                raise InvalidInputError(f"{axis}: {name} is not used {why}")

    def cost(self) -> float:
        """Return the approximate time that a point takes, s; the longest one of a sampled loop."""
        for index in (self.plan.size // 2, 0, self.plan.size - 1):
            with suppress(StickslipError):
                case, _ = self.case(index)
                break
        else:
            case = ControlledDrive.from_scenario(self.scenario, continuous=self.continuous)
        periods = self.course.transient + self.course.cycles + 2
        if case.sampled is None:
            return periods * 2e-5
        return self.course.patience * periods * case.period * case.sampled.rate * 1e-5

    def as_dict(self) -> dict[str, Any]:
        """Return everything that the result depends on but `contents`, ready for JSON."""
        plan = asdict(self.plan)
        if "continuation" in plan:
            plan["carry"] = plan.pop("continuation")
        return {
            "scenario": self.scenario.as_dict(),
            "plan": {"kind": self.plan.kind, **plan},
            "course": asdict(self.course),
            "continuous_control": self.continuous,
        }

    def contents(self) -> dict[str, str]:
        """Return a digest of the numbers in each file that the scenario names."""
        return {
            f"the content of {path}": sha256(repr(pairs).encode()).hexdigest()[:16]
            for node in self.scenario.nodes
            for path, pairs in getattr(self.scenario, node).curves().items()
        }


def compute(study: Study, points: Sequence[int], start: MotionState | None) -> Piece:
    """Compute some points in their order; a pure function, for any process.

    With a continuation the first point starts in `start`. With None it starts in its
    initial state, as does the point after one that failed or diverged.
    """
    continuation, end = study.plan.continuation, start
    found: list[Point] = []
    for index in points:
        point, end = _compute_point(study, index, end if continuation else None)
        found.append(point)
    return Piece(found, end if continuation else None)


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
    measures = replace(settled.measures, steady=None, trend=None, drift=None)
    end, reason = settled.end, None
    if settled.measures.drift:
        reason = trend_text(vars(settled.measures))
    match measures.regime:
        case Regime.UNBOUNDED:
            end, reason = None, "the motion diverges"
        case Regime.EQUILIBRIUM | Regime.HELD:
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
