"""Design: gains of a control law, with their margins, and checked by simulation."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, NamedTuple

from typing_extensions import override

from stickslip_ros.api.page import Summary
from stickslip_ros.api.results import Drawing, Parts, Table, TabularResult, attributes, column
from stickslip_ros.api.scenarios import ScenarioLike, as_scenario
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.model.constants import constants_of
from stickslip_ros.model.control import CONTROL_LAWS, ControlLaw, Washout
from stickslip_ros.progress import Progress
from stickslip_ros.quantities import Quantity, number_of, quantities_of
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.show.parameter_tables import scenario_tables
from stickslip_ros.show.quantities import Units, plain_name
from stickslip_ros.show.study_tables import one_below_another, side_by_side
from stickslip_ros.studies.controller_trial import Rest
from stickslip_ros.studies.design import Check, Design, Task
from stickslip_ros.studies.design import design as designed
from stickslip_ros.studies.drive_loops import LINEAR
from stickslip_ros.text import finite, shown

_CHECKS, _REST = quantities_of(Check), quantities_of(Rest)
_WORST = ("predicted_settling_time", "settling_time", "predicted_peak_force", "peak_force")


class Margins(NamedTuple):
    """Stability margins at the worst of the belt speeds; None where there is no such margin."""

    gain_down: float | None
    """Largest factor below one of the force at which a loop is unstable."""
    gain_up: float | None
    """Smallest factor above one."""
    delay: float | None
    """Smallest additional delay, s, at which a loop is unstable."""


@dataclass(frozen=True, eq=False, repr=False)
class Proposal(TabularResult):
    """Gains for a range of belt speeds; it prints as tables."""

    design: Design
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
    def margins(self) -> Margins:
        """Stability margins of gain and delay."""
        return Margins(*map(self._linear.get, ("gain_down", "gain_up", "delay_margin")))

    @property
    def checks(self) -> Sequence[Check]:
        """Checks of the proposal at each belt speed, predicted and simulated."""
        return self.design.checks

    @property
    def poles(self) -> Mapping[float, Any]:
        """Poles of the linear part of the loop per sample, by belt speed; complex arrays."""
        return {} if self.design.tuned is None else self.design.tuned.poles

    @override
    def _drawing(self) -> Drawing:
        from stickslip_ros.show.comparison_figure import bode_figure
        from stickslip_ros.show.stability_figure import design_figure

        if self.controller is None:
            raise RunError(self._nothing)
        washout = isinstance(self.controller, Washout) and self.design.vibrations
        return partial(design_figure if washout else bode_figure, self.design)

    @property
    def _nothing(self) -> str:
        return f"there is nothing to propose: {self.remark}"

    @property
    def _linear(self) -> dict[str, Any]:
        return {name: getattr(self.design.tuned, name, None) for name in LINEAR}

    @property
    def _units(self) -> Units:
        return Units.for_drive(self.design.task.drive)

    @override
    def _entries(self) -> dict[str, Any]:
        design, scenario = self.design, self.design.task.scenario
        law, checks = scenario.controller.law, [asdict(check) for check in self.checks]
        constants = CONTROL_LAWS[law].constants() if law == Washout.name else ("start_after",)
        slowest = design.slowest
        return {
            "law": law,
            "belt_speeds": list(design.task.belt_speeds),
            "constants": None if self.controller is None else asdict(self.controller),
            "gains": gains(self.controller),
            **{name: getattr(self.controller, name, None) for name in constants},
            "force_limit": design.task.force_limit,
            "worst_belt_speed": slowest.drive.belt_speed if slowest else None,
            "decay_rate": min((check["decay_rate"] for check in checks), default=None),
            **{
                name: max((row[name] for row in checks if row[name] is not None), default=None)
                for name in _WORST
            },
            "linear": self._linear,
            "margins": self.margins._asdict(),
            "checks": checks,
            "parameter_file": design.parameter_file,
            "remark": self.remark,
            **({"spread": design.task.spread} if design.task.spread else {}),
            **({"drawn": asdict(design.drawn)} if design.drawn is not None else {}),
            **scenario.provenance(),
        }

    @override
    def _table(self) -> Table:
        rows = [asdict(check) for check in self.checks]
        columns = {name: column([row[name] for row in rows]) for name in _CHECKS}
        source = attributes(self.design.task.scenario)
        return Table(columns, _CHECKS, self._units, {"check": range(len(rows))}, source)

    @override
    def _summary(self) -> Summary:
        scenario = self.design.task.scenario
        chosen, node = scenario.controller.control_law.tuned, scenario.controller.node
        parameters = scenario_tables(scenario, unused=[f"{node}.{name}" for name in chosen])
        law, verdict = self.controller, "nothing to propose"
        verdict = verdict if law is None else gains_text(law, self._units)
        return Summary("Controller design", scenario.name, verdict, parameters)

    @override
    def parts(self) -> Parts:
        task, tuned, units = self.design.task, self.design.tuned, self._units
        speeds = units.texts(sorted({*task.belt_speeds}), "m/s")
        subject = f"{task.scenario.name}, {task.scenario.controller.law}"
        title = f"{subject}, belt speed {' to '.join(speeds)}"
        law, linear = self.controller, "linear loop, at the worst of these belt speeds"
        if law is None:
            yield f"{title}: nothing to propose: {self.remark}"
            title, linear = "the nearest gains", "their linear loop"
            law = tuned.law if tuned is not None and tuned.responses else None
        if law is not None:
            values = {name: finite(getattr(law, name)) for name in described(law)}
            name = title if self.controller is None else f"{title}: proposal"
            yield one_below_another(name, described(law), values, units)
            yield one_below_another(linear, LINEAR, self._linear, units)
        rows = [asdict(check) for check in self.checks]
        if rows:
            yield side_by_side("simulated", _CHECKS, rows, units)
        at_rest = [row | row["rest"] for row in rows if row["rest"] is not None]
        if at_rest:
            columns = {"belt_speed": _CHECKS["belt_speed"], **_REST}
            yield side_by_side("at rest, by noise and rounding", columns, at_rest, units)
        if self.design.drawn is not None:
            yield self.design.drawn.sentence(task.drive)
        if self.controller is not None and self.remark is not None:
            yield self.remark


def described(law: ControlLaw) -> dict[str, Quantity]:
    """Return the constants of a law that a design chooses, as quantities, by name."""
    bodies = law.of_motor
    names = [*law.tuned, *("cubic_gain", "start_after") * isinstance(law, Washout), *bodies]
    constants = constants_of(type(law))
    node = f"{law.name}_controller"
    return {
        name: Quantity(
            plain_name(f"{node}.{name}") if isinstance(law, Washout) else name,
            constants[name].unit or "",
        )
        for name in [*names, "force_limit"]
    }


def gains(law: ControlLaw | None) -> dict[str, Any] | None:
    """Return these constants with their units and all digits; None without a law."""
    if law is None:
        return None
    return {
        name: {"value": getattr(law, name), "unit": quantity.unit}
        for name, quantity in described(law).items()
    }


def gains_text(law: ControlLaw, units: Units) -> str:
    """Return the gains with their units, for a sentence."""
    return ", ".join(
        f"{described(law)[name].label} {units.text(getattr(law, name), described(law)[name].unit)}"
        for name in law.tuned
    )


def design(
    scenario: ScenarioLike,
    belt_speed: float | str | tuple[float | str, float | str] | None = None,
    *,
    force_limit: float | None = None,
    spread: float | str = 0.0,
    progress: Progress = lambda _: None,
) -> Proposal:
    """Propose gains that damp the vibration within a force limit, checked by simulation.

    Parameters
    ----------
    scenario : Scenario, str or Path
        The scenario, its name or its path; its gains are not used.
    belt_speed : float, str or tuple, optional
        One belt speed, or lowest and highest, m/s. By default within 10 % of the scenario's.
    force_limit : float, optional
        Largest force, N. By default this is the scenario's.
    spread : float or str
        Largest deviation of a constant of the drive, as a share, or `fit`: as the fit leaves them
        open. The gains must hold 20 drawn drives; 40 others then judge them.
    progress : callable, optional
        Receives the share that is done, 0 to 1.

    Returns
    -------
    Proposal
        The gains with their margins and checks, by the rule of `ss.compare`, or the reason why
        there are none.

    Raises
    ------
    InvalidInputError
        If an argument is not allowed, or if the scenario's control law has no gains to tune.

    Examples
    --------
    >>> import stickslip_ros as ss
    >>> proposal = ss.design("feed_drive", belt_speed=0.04, force_limit=200)
    >>> proposal.scenario.washout_controller.force_limit
    200.0
    """
    chosen = as_scenario(scenario)
    if force_limit is not None:
        chosen = chosen.overridden([], {f"{chosen.controller.node}.force_limit": force_limit})
    return Proposal(designed(Task.from_scenario(chosen, _range(belt_speed), spread), progress))


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
