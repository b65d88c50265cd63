"""Design: gains of a control law, with their margins, and checked by simulation."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from typing_extensions import override

from stickslip_ros.api.page import Summary
from stickslip_ros.api.results import Parts, Table, TabularResult, attributes, column
from stickslip_ros.api.scenarios import ScenarioLike, as_scenario
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.model.constants import constants_of
from stickslip_ros.model.control import ControlLaw, Washout
from stickslip_ros.progress import Progress
from stickslip_ros.quantities import Quantity, number_of, quantities_of
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.show.parameter_tables import scenario_tables
from stickslip_ros.show.quantities import Units, plain_name
from stickslip_ros.show.study_tables import one_below_another, side_by_side
from stickslip_ros.studies.case_outcome import OUTCOMES
from stickslip_ros.studies.controller_trial import Rest
from stickslip_ros.studies.design import Design, Task
from stickslip_ros.studies.tuned_design import TunedDesign, design_by_rule
from stickslip_ros.studies.tuning import LINEAR
from stickslip_ros.studies.washout_design import Check, WashoutDesign, design_washout
from stickslip_ros.studies.washout_search import Margins
from stickslip_ros.tables import TextTable
from stickslip_ros.text import finite, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip_ros.show.style import FigureStyle

_Design = TypeVar("_Design", bound=Design)

_CHECKS, _MARGINS = quantities_of(Check), quantities_of(Margins)
_WASHOUT = {
    name: Quantity(plain_name(f"washout_controller.{name}"), unit)
    for name in Washout.constants()
    if (unit := constants_of(Washout)[name].unit)
}
_OUTCOMES = ("held", "rms_velocity", "mean_force", "rms_force", "peak_force", "settling_time")
_TUNED_CHECKS = {
    "belt_speed": _CHECKS["belt_speed"],
    "disturbance": Quantity("disturbance"),
    **{name: OUTCOMES[name] for name in _OUTCOMES},
}


@dataclass(frozen=True, eq=False, repr=False)
class Proposed(TabularResult, Generic[_Design]):
    """Gains for a range of belt speeds; it prints as tables."""

    design: _Design
    """The task, the proposal and its checks."""

    @property
    def controller(self) -> ControlLaw | None:
        """The proposed constants of the controller; None if there are none."""
        return self.design.controller

    @property
    def remark(self) -> str | None:
        """Why there is no proposal, or a caution about it."""
        return self.design.remark

    @property
    def scenario(self) -> Scenario:
        """The scenario with the proposed gains, ready to be simulated.

        Its belt speed is that of the scenario, or the nearest one in the range.

        Raises
        ------
        RunError
            If there is nothing to propose.
        """
        if self.design.scenario is None:
            raise RunError(self._nothing)
        return self.design.scenario

    @property
    @abstractmethod
    def _gains(self) -> Mapping[str, Quantity]:
        """Constants of the law that are proposed."""

    @abstractmethod
    def _checks(self) -> Sequence[Mapping[str, Any]]:
        """Return the checks as rows."""

    @abstractmethod
    def _found(self) -> dict[str, Any]:
        """Return the entries of `to_dict` that the designs of other laws do not have."""

    @abstractmethod
    def _tables(self) -> Iterator[TextTable]:
        """Yield the tables that follow the proposal."""

    @property
    def _nothing(self) -> str:
        return f"there is nothing to propose: {self.remark}"

    @property
    def _subject(self) -> str:
        return self.design.task.scenario.name

    @property
    def _units(self) -> Units:
        return Units.for_drive(self.design.task.drive)

    @override
    def _entries(self) -> dict[str, Any]:
        return {
            "belt_speeds": list(self.design.task.belt_speeds),
            **self._found(),
            "checks": self._checks(),
            "parameter_file": self.design.parameter_file,
            "remark": self.remark,
            **self.design.task.scenario.provenance(),
        }

    def _table_of(self, quantities: Mapping[str, Quantity], dimension: str | None) -> Table:
        """Return the checks; without a dimension of its own each has its number."""
        rows = self._checks()
        columns = {name: column([row[name] for row in rows]) for name in quantities}
        dimensions = (
            {"check": range(len(rows))} if dimension is None else {dimension: columns[dimension]}
        )
        source = attributes(self.design.task.scenario)
        return Table(columns, quantities, self._units, dimensions, source)

    @override
    def _summary(self) -> Summary:
        scenario = self.design.task.scenario
        parameters = scenario_tables(scenario, used=True)
        return Summary("Controller design", scenario.name, self._verdict(), parameters)

    def _verdict(self) -> str:
        if self.controller is None:
            return "nothing to propose"
        return ", ".join(
            f"{label} {self._units.text(getattr(self.controller, name), unit)}"
            for name, (label, unit, _) in self._gains.items()
        )

    @override
    def parts(self) -> Parts:
        task = self.design.task
        speeds = self._units.texts(sorted({*task.belt_speeds}), "m/s")
        title = f"{self._subject}, belt speed {' to '.join(speeds)}"
        if self.controller is None:
            yield f"{title}: nothing to propose"
        else:
            values = {name: finite(getattr(self.controller, name)) for name in self._gains}
            yield one_below_another(f"{title}: proposal", self._gains, values, self._units)
            yield from self._tables()
        if self.remark is not None:
            yield self.remark


@dataclass(frozen=True, eq=False, repr=False)
class Proposal(Proposed[WashoutDesign]):
    """Gains of the washout law for a range of belt speeds; it prints as tables."""

    @property
    def margins(self) -> Margins | None:
        """Stability margins of gain and delay; None without control."""
        return self.design.margins

    @property
    def checks(self) -> Sequence[Check]:
        """Checks of the proposal at each belt speed, predicted and simulated."""
        return self.design.checks

    @override
    def draw(self, style: "FigureStyle") -> "Figure":
        from stickslip_ros.show.stability_figure import design_figure

        if self.controller is None:
            raise RunError(self._nothing)
        return design_figure(self.design, style=style)

    @property
    @override
    def _gains(self) -> Mapping[str, Quantity]:
        return _WASHOUT

    @override
    def _checks(self) -> Sequence[Mapping[str, Any]]:
        return [asdict(check) for check in self.checks]

    @override
    def _table(self) -> Table:
        return self._table_of(_CHECKS, "belt_speed")

    @override
    def _found(self) -> dict[str, Any]:
        design, checks = self.design, self._checks()
        return {
            **{name: getattr(design.controller, name, None) for name in _WASHOUT},
            "force_limit": design.task.force_limit,
            "worst_belt_speed": design.slowest.drive.belt_speed if design.slowest else None,
            "decay_rate": min((check["decay_rate"] for check in checks), default=None),
            **{
                name: max((row[name] for row in checks if row[name] is not None), default=None)
                for name in [*_CHECKS][2:]
            },
            "margins": asdict(design.margins) if design.margins else dict.fromkeys(_MARGINS),
        }

    @override
    def _tables(self) -> Iterator[TextTable]:
        units, checks = self._units, self._checks()
        if self.margins is not None:
            title = "margins at the worst of these belt speeds"
            yield one_below_another(title, _MARGINS, asdict(self.margins), units)
        yield side_by_side("verification", _CHECKS, checks, units)
        at_rest = [check | check["rest"] for check in checks if check["rest"] is not None]
        if at_rest:
            columns = {"belt_speed": _CHECKS["belt_speed"], **quantities_of(Rest)}
            yield side_by_side("at rest, by noise and rounding", columns, at_rest, units)


@dataclass(frozen=True, eq=False, repr=False)
class TunedProposal(Proposed[TunedDesign]):
    """Gains by the rule; it prints as tables, and draws the loop transfer function."""

    @property
    def poles(self) -> Mapping[float, Any]:
        """Poles of the linear part of the loop per sample, by belt speed; complex arrays."""
        return self.design.tuned.poles

    @override
    def draw(self, style: "FigureStyle") -> "Figure":
        from stickslip_ros.show.comparison_figure import bode_figure

        return bode_figure(self.design, style=style)

    @property
    @override
    def _subject(self) -> str:
        return f"{super()._subject}, {self.design.tuned.law.name}"

    @property
    @override
    def _gains(self) -> Mapping[str, Quantity]:
        law = self.design.tuned.law
        described = constants_of(type(law))
        return {name: Quantity(name, described[name].unit or "") for name in law.tuned}

    @override
    def _checks(self) -> Sequence[Mapping[str, Any]]:
        return [
            {
                "belt_speed": check.belt_speed,
                "disturbance": str(check.disturbance),
                **{name: getattr(check.outcome, name) for name in (*_OUTCOMES, "reason")},
            }
            for check in self.design.checks
        ]

    @override
    def _table(self) -> Table:
        return self._table_of(_TUNED_CHECKS, None)

    @override
    def _found(self) -> dict[str, Any]:
        tuned = self.design.tuned
        linear = {name: getattr(tuned, name) for name in LINEAR}
        return {"law": tuned.law.name, "constants": asdict(tuned.law), "linear": linear}

    @override
    def _tables(self) -> Iterator[TextTable]:
        title = "linear loop, at the worst of these belt speeds"
        yield one_below_another(title, LINEAR, vars(self.design.tuned), self._units)
        yield side_by_side("simulated", _TUNED_CHECKS, self._checks(), self._units)

    @override
    def _verdict(self) -> str:
        held = sum(bool(check.outcome.held) for check in self.design.checks)
        return f"{held} of {len(self.design.checks)} simulated checks hold"


def proposal(task: Task, progress: Progress = lambda _: None) -> Proposal | TunedProposal:
    """Return the gains for a task: of the washout law from its vibration, of others by the rule."""
    if isinstance(task.scenario.control_law, Washout):
        return Proposal(design_washout(task, progress))
    return TunedProposal(design_by_rule(task, progress))


def design(
    scenario: ScenarioLike,
    belt_speed: float | str | tuple[float | str, float | str] | None = None,
    *,
    force_limit: float | None = None,
    progress: Progress = lambda _: None,
) -> Proposal | TunedProposal:
    """Propose gains that damp the vibration within a force limit, checked by simulation.

    Parameters
    ----------
    scenario : Scenario, str or Path
        The scenario, its name or its path; its gains are not used.
    belt_speed : float, str or tuple, optional
        One belt speed, or lowest and highest, m/s. By default within 10 % of the scenario's.
    force_limit : float, optional
        Largest force, N. By default this is the scenario's.
    progress : callable, optional
        Receives the share that is done, 0 to 1.

    Returns
    -------
    Proposal or TunedProposal
        The gains with their margins and checks, or the reason why there are none; of another law
        than the washout by the rule of `ss.compare`.

    Raises
    ------
    InvalidInputError
        If an argument is not allowed, or if the scenario's control law has no gains to tune.

    Examples
    --------
    >>> import stickslip_ros as ss
    >>> found = ss.design("feed_drive", belt_speed=0.04, force_limit=200)
    >>> found.scenario.washout_controller.force_limit
    200.0
    """
    chosen = as_scenario(scenario)
    if force_limit is not None:
        chosen = chosen.overridden([], {f"{chosen.controller.node}.force_limit": force_limit})
    return proposal(Task.from_scenario(chosen, _range(belt_speed)), progress)


def _range(belt_speed: Any) -> tuple[float, float] | None:
    if belt_speed is None:
        return None
    try:
        low, high = belt_speed if isinstance(belt_speed, tuple | list) else (belt_speed, belt_speed)
        return number_of("belt_speed", low, "m/s"), number_of("belt_speed", high, "m/s")
    except (TypeError, ValueError):
        raise InvalidInputError(
            f"belt_speed = {shown(belt_speed)} is invalid: must be one speed or (lowest, highest)"
        ) from None
