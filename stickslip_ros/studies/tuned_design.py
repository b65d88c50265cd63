"""Design of any control law by the rule of `tuning`, simulated before it is called good."""

from dataclasses import dataclass

import numpy as np

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.progress import Progress
from stickslip_ros.scenarios.files import Scenario, parameter_file
from stickslip_ros.studies.case_outcome import Disturbance, Outcome, is_positioning, simulate_case
from stickslip_ros.studies.comparison import FEED_TOLERANCE
from stickslip_ros.studies.options import OWN_SPEED_RANGE
from stickslip_ros.studies.tuning import Goal, Tuned, tune, with_law

_KINDS = ("step", "impulse")
_PERIODS, _SHORTEST = 100.0, 2.0
"""Duration of a check, in natural periods, and at least so many seconds."""


@dataclass(frozen=True)
class TunedCheck:
    """A proposal, simulated at one belt speed under one disturbance."""

    belt_speed: float
    """Belt speed, m/s."""
    disturbance: Disturbance
    """The disturbance."""
    outcome: Outcome
    """What the simulation came to."""


@dataclass(frozen=True)
class TunedDesign:
    """Gains by the rule, with checks by simulation."""

    scenario: Scenario
    """The scenario with the proposed gains."""
    belt_speeds: tuple[float, float]
    """Lowest and highest belt speed, m/s."""
    tuned: Tuned
    """The gains and their margins."""
    checks: tuple[TunedCheck, ...]
    """The checks, in order of belt speed."""

    @property
    def remark(self) -> str | None:
        """What of the goal is missed, and where the simulation does not hold, or None."""
        failed = [
            f"at {check.belt_speed:g} m/s, {check.disturbance}"
            for check in self.checks
            if not check.outcome.held
        ]
        said = f"the simulated drive is not held {'; '.join(failed)}" if failed else None
        return "; ".join(filter(None, (self.tuned.remark, said))) or None

    @property
    def parameter_file(self) -> str:
        """Text of a parameter file of the scenario with the gains."""
        nodes = self.scenario.as_dict()
        del nodes["analyzer"]["bag"]
        return parameter_file(nodes)


def design_by_rule(
    scenario: Scenario,
    belt_speeds: tuple[float, float] | None = None,
    progress: Progress = lambda _: None,
) -> TunedDesign:
    """Return gains of the scenario's control law for a range of belt speeds.

    Parameters
    ----------
    scenario : Scenario
        Scenario whose law gets the gains; its own are not used.
    belt_speeds : tuple of float, optional
        Lowest and highest belt speed, m/s; by default 10 % below and above the scenario's.
    progress : callable
        Receives the share of the checks that are done, 0 to 1.

    Raises
    ------
    InvalidInputError
        If the law has no gains to tune, no gains make all loops stable, or the belt is at rest.
    """
    if is_positioning(scenario):
        raise InvalidInputError("plant.belt_speed = 0: gains are for a moving belt")
    own, law = scenario.plant.belt_speed, scenario.controller.law
    low, high = belt_speeds or tuple(abs(own) * (1.0 + OWN_SPEED_RANGE * s) for s in (-1, 1))
    if not 0.0 < low <= high:
        raise InvalidInputError(f"belt speeds {low:g} to {high:g} m/s: must be above 0, in order")
    sign = 1.0 if own > 0.0 else -1.0
    speeds = (sign * np.linspace(low, high, 5 if low < high else 1)).tolist()
    disturbances = [Disturbance.parse(kind, scenario) for kind in _KINDS]
    limit = scenario.controller.control_law.force_limit
    goal = Goal.from_scenario(scenario, speeds, disturbances[0].amplitude, limit)
    tuned = tune(scenario, law, goal)
    constants = {name: getattr(tuned.law, name) for name in tuned.law.constants()}
    proposed = with_law(scenario, law, constants)
    duration = max(_PERIODS * scenario.plant.as_drive().natural_period, _SHORTEST)
    checks: list[TunedCheck] = []
    for speed in speeds:
        for each in disturbances:
            values = {"plant.belt_speed": speed, **each.parameters(duration)}
            outcome = simulate_case(proposed.changed(values), duration, each, FEED_TOLERANCE)
            checks.append(TunedCheck(speed, each, outcome))
            progress(len(checks) / len(speeds) / len(disturbances))
    return TunedDesign(proposed, (low, high), tuned, tuple(checks))
