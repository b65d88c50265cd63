"""Design of any control law by the rule of `tuning`, simulated before it is called good."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign
from typing import NamedTuple

from stickslip_ros.progress import Progress
from stickslip_ros.studies.case_outcome import Disturbance, Outcome, simulate_case
from stickslip_ros.studies.comparison import FEED_TOLERANCE
from stickslip_ros.studies.design import Design, Task, joined
from stickslip_ros.studies.tuning import Goal, Tuned, tune

_KINDS = ("step", "impulse")
_PERIODS, _SHORTEST, _WITHOUT_SPRING = 100.0, 2.0, 6.0
"""Duration of a check, in natural periods, at least so many seconds, and without a period, s."""


class TunedCheck(NamedTuple):
    """A proposal, simulated at one belt speed under one disturbance."""

    belt_speed: float
    """Belt speed, m/s."""
    disturbance: Disturbance
    """The disturbance."""
    outcome: Outcome
    """What the simulation came to."""


@dataclass(frozen=True, kw_only=True)
class TunedDesign(Design):
    """Gains by the rule, with checks by simulation."""

    tuned: Tuned
    """The gains and their margins."""
    checks: Sequence[TunedCheck] = ()


def design_by_rule(task: Task, progress: Progress = lambda _: None) -> TunedDesign:
    """Return gains of the law of a task for its range of belt speeds.

    Parameters
    ----------
    task : Task
        The task.
    progress : callable
        Receives the share of the checks that are done, 0 to 1.

    Returns
    -------
    TunedDesign
        The gains. The remark says what of the goal is missed, and where the simulation does not
        hold.

    Raises
    ------
    InvalidInputError
        If the law has no gains to tune, or no gains make all loops stable.
    """
    scenario = task.scenario
    speeds = [copysign(speed, scenario.plant.belt_speed) for speed in task.speeds]
    disturbances = [Disturbance.parse(kind, scenario) for kind in _KINDS]
    goal = Goal.from_scenario(scenario, speeds, disturbances[0].amplitude, task.force_limit)
    tuned = tune(scenario, scenario.controller.law, goal)
    proposed = task.with_law(tuned.law)
    duration = _WITHOUT_SPRING
    if task.drive.has_spring:
        duration = max(_PERIODS * task.drive.natural_period, _SHORTEST)
    checks: list[TunedCheck] = []
    for speed in speeds:
        for disturbance in disturbances:
            values = {"plant.belt_speed": speed, **disturbance.parameters(duration)}
            outcome = simulate_case(proposed.changed(values), duration, disturbance, FEED_TOLERANCE)
            checks.append(TunedCheck(speed, disturbance, outcome))
            progress(len(checks) / len(speeds) / len(disturbances))
    failed = [f"at {speed:g} m/s, {kind}" for speed, kind, outcome in checks if not outcome.held]
    said = f"the simulated drive is not held {'; '.join(failed)}" if failed else None
    return TunedDesign(task, tuned.law, joined(tuned.remark, said), checks=checks, tuned=tuned)
