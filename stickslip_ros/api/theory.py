"""Theory: the stability of a scenario."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from typing_extensions import override

from stickslip_ros.api.page import Summary
from stickslip_ros.api.results import Drawing, Parts, Result, optional
from stickslip_ros.api.scenarios import ScenarioLike, as_scenario
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.show.parameter_tables import scenario_tables
from stickslip_ros.show.study_tables import stability_tables
from stickslip_ros.studies import stability as stabilities
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.theory.linear_system import LinearSystem, continuous_system, sampled_system


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
        law = self.scenario.control_law
        if law is None or law.continuous is None:
            return None
        return continuous_system(self.scenario.plant.as_drive(), law.continuous)

    @property
    def sampled_system(self) -> LinearSystem | None:
        """Matrices of the linear loop as the nodes run it; None if there is none."""
        plant, law = self.scenario.plant, self.scenario.control_law
        loop = LinearSampledLoop.from_drive(plant.as_drive(), *plant.linear_sampling)
        if loop is None or law is None or law.linear_feedback(1.0 / plant.control_rate) is None:
            return None
        return sampled_system(loop, law)

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
        >>> theory = ss.stability("feed_drive")
        >>> loop, radius = theory.to_control(), theory.sampled_loop["spectral_radius"]
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
    def _drawing(self) -> Drawing:
        from stickslip_ros.show.stability_figure import scenario_stability_figure, why_no_figure

        reason = why_no_figure(self.scenario)
        if reason is not None:
            raise InvalidInputError(f"there is nothing to draw: {reason}")
        return partial(scenario_stability_figure, self.scenario)

    @override
    def _entries(self) -> dict[str, Any]:
        entries = {name: value for name, value in vars(self).items() if name != "scenario"}
        return {**entries, **self.scenario.provenance()}

    @override
    def _summary(self) -> Summary:
        loops = {"without control": self.open_loop, "sampled loop": self.sampled_loop}
        known = {name: loop["stable"] for name, loop in loops.items() if loop["stable"] is not None}
        verdict = "; ".join(
            f"{name}: {'stable' if stable else 'unstable'}" for name, stable in known.items()
        )
        parameters = scenario_tables(self.scenario, unused=())
        return Summary("Stability", self.scenario.name, verdict, parameters)

    @override
    def parts(self) -> Parts:
        return stability_tables(self.scenario, vars(self), dict(self.notes))


def stability(scenario: ScenarioLike, spread: float | str = 0.0) -> Stability:
    """Return equilibrium, critical speeds and gains, and limit cycles of a scenario.

    Parameters
    ----------
    scenario : Scenario, str or Path
        The scenario, its name or its path.
    spread : float or str
        Largest deviation of the constants of the drive, as a share, or `"fit"`, as for `compare`:
        the critical feed speed has an interval for it.

    Returns
    -------
    Stability
        Results by section.

    Raises
    ------
    InvalidInputError
        If the scenario or the spread is not allowed, or theory does not cover the spread.

    Examples
    --------
    >>> import stickslip_ros as ss
    >>> theory = ss.stability("paper")
    >>> theory.open_loop["stable"], theory.closed_loop["stable"]
    (False, True)
    """
    chosen = as_scenario(scenario)
    sections, notes = stabilities.stability(chosen, spread)
    return Stability(chosen, **sections, notes=notes)
