"""Theory and design: the stability of a scenario, and gains for it."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np
from typing_extensions import override

from stickslip_ros.api.results import (
    Parts,
    Result,
    Summary,
    Table,
    TabularResult,
    attributes,
    optional,
)
from stickslip_ros.api.scenarios import ScenarioLike, as_scenario
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.physics.model.control import Washout
from stickslip_ros.physics.theory.linear_system import LinearSystem
from stickslip_ros.progress import Progress
from stickslip_ros.quantities import number_of
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.show.parameter_tables import scenario_tables
from stickslip_ros.show.quantities import Units
from stickslip_ros.show.study_tables import (
    CHECKS,
    CONTROLLER,
    MARGINS,
    design_tables,
    stability_tables,
)
from stickslip_ros.studies import design as designing
from stickslip_ros.studies import stability as stabilities
from stickslip_ros.text import shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip_ros.api.tuned_design import TunedProposal
    from stickslip_ros.show.style import FigureStyle


@dataclass(frozen=True, eq=False, repr=False)
class Stability(Result):
    """Results of theory for a scenario; it prints as tables. SI units; None does not exist.

    The keys are those of `stickslip stability --json`.
    """

    scenario: Scenario
    """The scenario that was analyzed."""
    equilibrium_position: float | None
    """Displacement of a slide at rest, m."""
    open_loop: Mapping[str, Any]
    """Eigenvalues, critical feed speeds (Hopf) and limit cycles without control."""
    sticking: Mapping[str, Any]
    """Belt speeds at which a slide sticks."""
    closed_loop: Mapping[str, Any]
    """Eigenvalues, critical feed speeds, limit cycles and gains with continuous control."""
    sampled_loop: Mapping[str, Any]
    """Stability and settling of the loop as the nodes run it."""
    closed_forms: Mapping[str, Any] | None
    """Closed forms for the cubic Stribeck law; None for other laws."""
    notes: Mapping[str, str]
    """Why a value does not exist, by its place."""

    @property
    def continuous_system(self) -> LinearSystem | None:
        """Matrices of the linear loop with continuous control; None if there is none."""
        return stabilities.linear_systems(self.scenario)[0]

    @property
    def sampled_system(self) -> LinearSystem | None:
        """Matrices of the linear loop as the nodes run it; None if there is none."""
        return stabilities.linear_systems(self.scenario)[1]

    def to_control(self) -> Any:
        """Return the sampled linear loop as a system of python-control.

        Returns
        -------
        control.StateSpace
            System with the matrices, names and sample period of `sampled_system`: from a
            disturbance force, N, to displacement, m, and velocity, m/s.

        Raises
        ------
        InvalidInputError
            If there is no linear sampled loop.
        RunError
            If python-control is not installed.

        Examples
        --------
        >>> import stickslip_ros as ss
        >>> found = ss.stability("feed_drive")
        >>> loop, radius = found.to_control(), found.sampled_loop["spectral_radius"]
        >>> loop.dt, bool(abs(abs(loop.poles()).max() - radius) < 1e-9)
        (0.001, True)
        """
        system = self.sampled_system
        if system is None:
            raise InvalidInputError(
                f"there is no linear sampled loop: {self.notes['sampled_loop']}"
            )
        return optional("control").StateSpace(
            system.A,
            system.B,
            system.C,
            system.D,
            system.sample_period,
            states=[name.replace(".", "_") for name in system.states],  # it allows no dots
            inputs=["disturbance_force"],
            outputs=["position", "velocity"],
        )

    @override
    def draw(self, style: "FigureStyle") -> "Figure":
        reason = stabilities.why_no_figure(self.scenario)
        if reason is not None:
            raise InvalidInputError(f"there is nothing to draw: {reason}")
        from stickslip_ros.show.stability_figure import scenario_stability_figure

        return scenario_stability_figure(self.scenario, style=style)

    @override
    def _entries(self) -> dict[str, Any]:
        found = {name: value for name, value in vars(self).items() if name != "scenario"}
        return {**found, **self.scenario.provenance()}

    @override
    def _summary(self) -> Summary:
        loops = {"without control": self.open_loop, "sampled loop": self.sampled_loop}
        known = {name: loop["stable"] for name, loop in loops.items() if loop["stable"] is not None}
        verdict = "; ".join(
            f"{name}: {'stable' if stable else 'unstable'}" for name, stable in known.items()
        )
        parameters = scenario_tables(self.scenario, used=True)
        return Summary("Stability", self.scenario.name, verdict, parameters)

    @override
    def parts(self) -> Parts:
        return stability_tables(self.scenario, vars(self), dict(self.notes))


def stability(scenario: ScenarioLike) -> Stability:
    """Return equilibrium, critical speeds and gains, and limit cycles of a scenario.

    Parameters
    ----------
    scenario : Scenario, str or Path
        The scenario, its name or its path.

    Returns
    -------
    Stability
        Results by section.

    Raises
    ------
    InvalidInputError
        If the scenario is not allowed.

    Examples
    --------
    >>> import stickslip_ros as ss
    >>> found = ss.stability("paper")
    >>> found.open_loop["stable"], found.closed_loop["stable"]
    (False, True)
    """
    chosen = as_scenario(scenario)
    found, notes = stabilities.stability(chosen)
    return Stability(chosen, **found, notes=notes)


@dataclass(frozen=True, eq=False, repr=False)
class Proposal(TabularResult):
    """Gains for a range of belt speeds; it prints as tables."""

    design: designing.Design
    """The task, the proposal and its checks."""

    @property
    def controller(self) -> Washout | None:
        """The proposed constants of the controller; None if there are none."""
        return self.design.controller

    @property
    def remark(self) -> str | None:
        """Why there is no proposal, or a caution about it."""
        return self.design.remark

    @property
    def margins(self) -> designing.Margins | None:
        """Stability margins of gain and delay; None without control."""
        return self.design.margins

    @property
    def checks(self) -> tuple[designing.Check, ...]:
        """Checks of the proposal at each belt speed, predicted and simulated."""
        return self.design.checks

    @property
    def scenario(self) -> Scenario:
        """The scenario with the proposed gains, ready to be simulated.

        Its belt speed is that of the scenario, or the nearest one in the range.

        Raises
        ------
        RunError
            If there is nothing to propose.
        """
        scenario = self.design.scenario
        if scenario is None:
            raise RunError(self._nothing)
        return scenario

    @override
    def draw(self, style: "FigureStyle") -> "Figure":
        if self.design.map_around() is None:
            raise RunError(self._nothing)
        from stickslip_ros.show.stability_figure import design_figure

        return design_figure(self.design, style=style)

    def _table(self) -> Table:
        task = self.design.task
        checks = [
            {name: nan if value is None else value for name, value in vars(check).items()}
            for check in self.checks
        ]
        columns = {name: np.array([check[name] for check in checks]) for name in CHECKS}
        speeds = {"belt_speed": columns["belt_speed"]}
        source = attributes(task.scenario) if task.scenario else {}
        return Table(columns, CHECKS, Units.for_drive(task.drive), speeds, source)

    @override
    def _entries(self) -> dict[str, Any]:
        found, task = self.design, self.design.task
        checks = [asdict(check) for check in found.checks]
        return {
            "belt_speeds": list(task.belt_speeds),
            **{name: getattr(found.controller, name, None) for name in CONTROLLER},
            "force_limit": task.force_limit,
            "worst_belt_speed": found.slowest.drive.belt_speed if found.slowest else None,
            "decay_rate": min((check.decay_rate for check in found.checks), default=None),
            **{name: _largest(check[name] for check in checks) for name in [*CHECKS][2:]},
            "margins": asdict(found.margins) if found.margins else dict.fromkeys(MARGINS),
            "checks": checks,
            "parameter_file": found.parameter_file,
            "remark": found.remark,
            **(task.scenario.provenance() if task.scenario else {}),
        }

    @property
    def _nothing(self) -> str:
        return f"there is nothing to propose: {self.remark}"

    @override
    def _summary(self) -> Summary:
        task, units = self.design.task, Units.for_drive(self.design.task.drive)
        controller = {} if self.controller is None else asdict(self.controller)
        gains = [
            f"{label} {units.text(controller[name], unit)}"
            for name, (label, unit, _) in CONTROLLER.items()
            if name in controller
        ]
        return Summary(
            "Controller design",
            self._name,
            ", ".join(gains) or "nothing to propose",
            scenario_tables(task.scenario, used=True) if task.scenario else (),
        )

    @property
    def _name(self) -> str:
        return self.design.task.scenario.name if self.design.task.scenario else ""

    @override
    def parts(self) -> Parts:
        return design_tables(self._name, self.design)


def design(
    scenario: ScenarioLike,
    belt_speed: float | str | tuple[float | str, float | str] | None = None,
    *,
    force_limit: float | None = None,
    progress: Progress = lambda _: None,
) -> "Proposal | TunedProposal":
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
    law = chosen.control_law
    if law is not None and not isinstance(law, Washout):
        from stickslip_ros.api.tuned_design import TunedProposal
        from stickslip_ros.studies.tuned_design import design_by_rule

        return TunedProposal(design_by_rule(chosen, _range(belt_speed), progress))
    task = designing.Task.from_scenario(chosen, _range(belt_speed))
    return Proposal(designing.design(task, progress))


def _largest(values: Iterable[float | None]) -> float | None:
    return max((value for value in values if value is not None), default=None)


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
