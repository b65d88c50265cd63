"""A study: many points of one scenario, each simulated until its motion has settled."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from hashlib import sha256
from typing import Any, Generic, NamedTuple, TypeVar

from typing_extensions import override

from stickslip_ros.errors import InvalidInputError, StickslipError
from stickslip_ros.measures.cycle_measures import EQUILIBRIUM_SPEED, Regime, trend_text
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.columns import COLUMNS, Point
from stickslip_ros.studies.plan import Axis, Continuation, Grid, Plan
from stickslip_ros.studies.settling import ControlledDrive, MotionState, SettlingOptions, settle

_NUDGE = EQUILIBRIUM_SPEED / 2.0
"""Share of the belt speed by which a slide at rest is pushed before the next point: rounding alone
would leave an unstable equilibrium very late or never."""


class Piece(NamedTuple):
    """Points of a study that one task has computed, in the order of the task."""

    points: list[Any]
    end: MotionState | None
    """State in which the point after the last one starts; None: its own initial state, because the
    last one diverged or failed, or the plan has no continuation."""


_Plan = TypeVar("_Plan")


@dataclass(frozen=True)
class PointStudy(ABC, Generic[_Plan]):
    """The points of a plan, with all other parameters from a scenario."""

    scenario: Scenario
    plan: _Plan

    @abstractmethod
    def compute_point(
        self, index: int, start: MotionState | None
    ) -> tuple[Any, MotionState | None]:
        """Return a computed point, and the state in which the next one of a chain starts."""

    @abstractmethod
    def row(self, values: Sequence[Any]) -> Any:
        """Return the point of a list that went through JSON."""

    @abstractmethod
    def cost(self) -> float:
        """Return the approximate time that a point takes, s."""

    @abstractmethod
    def as_dict(self) -> dict[str, Any]:
        """Return everything that the result depends on but `contents`, ready for JSON."""

    def contents(self) -> dict[str, str]:
        """Return a digest of the numbers in each file that the scenario names."""
        return {
            f"the content of {path}": sha256(repr(pairs).encode()).hexdigest()[:16]
            for node in self.scenario.nodes
            for path, pairs in getattr(self.scenario, node).curves().items()
        }


@dataclass(frozen=True)
class Study(PointStudy[Plan]):
    """Motions that settle at the points of a plan.

    A motion starts in the scenario's initial state. With a continuation it starts in the
    state in which its neighbour ended, filter included; delayed forces are then dropped, and
    `start_after` applies to the first point of a chain only. A motion that ended at rest gets a
    push that is smaller than the limit of rest.
    """

    settling: SettlingOptions = field(default_factory=SettlingOptions)
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
            unused += ("plant.rate", "plant.answer_every")
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

    @override
    def compute_point(
        self, index: int, start: MotionState | None
    ) -> tuple[Point, MotionState | None]:
        try:
            case, initial = self.case(index)
            if start is not None and case.law is not None:
                case = replace(case, law=replace(case.law, start_after=0.0))
            settled = settle(case, start or initial, self.settling)
        except (StickslipError, ArithmeticError) as error:
            return Point(index, reason=" ".join(str(error).split())), None
        measures, end = settled.measures, settled.end
        reason = trend_text(vars(measures)) if measures.drift else None
        match measures.regime:
            case Regime.UNBOUNDED:
                end, reason = None, "the motion diverges"
            case Regime.EQUILIBRIUM | Regime.HELD:
                end = replace(end, velocity=end.velocity - _NUDGE * case.drive.belt_speed)
            case None:
                reason = "no whole cycle in the measured time"
            case _:
                pass
        columns = {name: getattr(measures, name) for name in COLUMNS if hasattr(measures, name)}
        columns |= {"steady": settled.steady, "reason": reason}
        columns["turning_points"] = tuple(settled.turning_points.tolist())
        return Point(index, **columns), end

    @override
    def row(self, values: Sequence[Any]) -> Point:
        return Point.from_json(values)

    @override
    def cost(self) -> float:  # of a sampled loop the longest one
        for index in (self.plan.size // 2, 0, self.plan.size - 1):
            with suppress(StickslipError):
                case, _ = self.case(index)
                break
        else:
            case = ControlledDrive.from_scenario(self.scenario, continuous=self.continuous)
        periods = self.settling.transient + self.settling.cycles + 2
        if case.sampled is None:
            return periods * 2e-5
        return self.settling.patience * periods * case.period * case.sampled.rate * 1e-5

    @override
    def as_dict(self) -> dict[str, Any]:
        plan = asdict(self.plan)
        if "continuation" in plan:
            plan["carry"] = plan.pop("continuation")
        return {
            "scenario": self.scenario.as_dict(),
            "plan": {"kind": self.plan.kind, **plan},
            "course": asdict(self.settling),
            "continuous_control": self.continuous,
        }


def sweep_study(
    scenario: Scenario,
    axes: Sequence[Axis],
    *,
    continuation: Continuation | None = None,
    settling: SettlingOptions | None = None,
    continuous: bool = False,
) -> Study:
    """Return the study of a scenario over the values of one or two parameters.

    Compute it with `compute_columns`. For a sweep without control, set
    `plant.expects_control` to false in the scenario.

    Parameters
    ----------
    scenario : Scenario
        The scenario; it supplies all other parameters.
    axes : Sequence[Axis]
        One or two axes; the study has every combination of their values.
    continuation : Continuation, optional
        Direction along the last axis in which each point starts from the end of its neighbour. By
        default every point starts in the scenario's initial state.
    settling : SettlingOptions, optional
        How long each motion is simulated; by default a transient of 200 natural periods, then 4
        cycles.
    continuous : bool
        Whether the control acts without sampling (eq. 19).

    Raises
    ------
    InvalidInputError
        If there are not one or two axes, an axis is of a controller that the scenario does not
        have, or no point is valid.
    """
    if not 1 <= len(axes) <= 2:
        raise InvalidInputError(f"{len(axes)} parameters: a sweep is over one or two")
    without = [axis for axis in axes if not axis.parameter.startswith("plant.")]
    if without and not scenario.plant.expects_control:
        raise InvalidInputError(f"{without[0]}: without control there is no controller")
    study = Study(
        scenario, Grid(tuple(axes), continuation), settling or SettlingOptions(), continuous
    )
    study.check()
    return study


def compute(study: PointStudy[Any], points: Sequence[int], start: MotionState | None) -> Piece:
    """Compute some points in their order; a pure function, for any process.

    With a continuation the first point starts in `start`. With None it starts in its
    initial state, as does the point after one that failed or diverged.
    """
    continuation, end = study.plan.continuation, start
    computed: list[Any] = []
    for index in points:
        point, end = study.compute_point(index, end if continuation else None)
        computed.append(point)
    return Piece(computed, end if continuation else None)


def pieces_of(points: range, size: int) -> Iterator[range]:
    """Yield the points in pieces of `size`."""
    for first in range(0, len(points), size):
        yield points[first : first + size]
