"""Design of a controller: gains by the rule of `tuning`, simulated before they are proposed.

A proposal keeps its limits in theory, and holds the drive, sampled, held and delayed as between the
nodes, under disturbances. The washout law also catches the vibration without control.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, sqrt
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import ControlLaw, Washout
from stickslip_ros.model.drive import Drive, number_text
from stickslip_ros.progress import Progress
from stickslip_ros.scenarios.files import Scenario, parameter_file
from stickslip_ros.scenarios.sections import BASE_SECTION
from stickslip_ros.studies.case_outcome import Disturbance
from stickslip_ros.studies.controller_trial import FILTER_SETTLED, Vibration
from stickslip_ros.studies.design_trial import Check, Task, Trial
from stickslip_ros.studies.drive_loops import Tuned
from stickslip_ros.studies.spread import drawn, held_interval
from stickslip_ros.studies.tuning import NEAR, RESERVE, Tuning, rounded
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop, why_no_linear_loop
from stickslip_ros.theory.stability_map import StabilityMap

_KINDS = ("step", "impulse")
"""Disturbances of a design."""
_ATTEMPTS, _MORE_CAUTION = 6, 0.95
"""Searches until the simulation holds, with smaller shares of the limits in ever larger steps."""
_ENOUGH = 0.8
"""Share of a larger decay rate, of gains that fail or without a reserve, that is enough."""
_SEARCHED, _TRIED = 20, 40
"""Drives that a spread draws for the search, and others on which a proposal is tried."""


@dataclass(frozen=True)
class Drawn:
    """A proposal on drives that a spread draws, other ones than in the search."""

    drives: int
    """Number of drives."""
    held: int
    """Number of those that it holds, at the belt speed at which a deviation decays most slowly."""
    held_interval: tuple[float, float]
    """95 % interval of the share that it holds."""
    worst: Mapping[str, float]
    """Constants of the worst drive: of one that is not held, or else with the slowest decay."""
    check: Check
    """Check of the worst drive."""

    def sentence(self, drive: Drive) -> str:
        """Return what the drives came to, in words."""
        what = self.check.reason or (
            f"a deviation decays with {number_text(drive, self.check.decay_rate, '1/s')}, "
            f"and the force reaches {number_text(drive, self.check.disturbed_force or 0.0, 'N')}"
        )
        return (
            f"holds {self.held} of {self.drives} drawn drives (95 % interval from "
            f"{self.held_interval[0]:.1%}); the worst: {_constants_text(self.worst)}: {what}"
        )


@dataclass(frozen=True)
class Design:
    """The proposed controller of a task, or the reason why there is none."""

    task: Task
    """The task."""
    controller: ControlLaw | None = None
    """The proposed controller; None if no gains meet the task."""
    remark: str | None = None
    """Why there is no proposal, or a caution about it."""
    checks: Sequence[Check] = ()
    """Simulations of the proposal, in order of belt speed."""
    tuned: Tuned | None = None
    """The gains, or the nearest ones, and their margins; None where there is no linear loop."""
    slowest: LinearSampledLoop | None = None
    """The loop at the belt speed at which a small deviation decays most slowly."""
    vibrations: Sequence[Vibration] = field(default=(), compare=False, repr=False)
    """Vibrations without control that the washout law catches, in order of belt speed."""
    drawn: Drawn | None = None
    """The proposal on drives that the spread of the task draws; None without a spread."""

    @cached_property
    def scenario(self) -> Scenario | None:
        """The task's scenario with the proposal, see `Task.with_law`; None without one."""
        return None if self.controller is None else self.task.with_law(self.controller)

    @property
    def parameter_file(self) -> str | None:
        """Text of a parameter file with the complete `scenario`; None without a proposal."""
        return None if self.scenario is None else gains_file(self.scenario)

    def map_around(self) -> StabilityMap | None:
        """Return the stability map of the slowest loop around a washout; None without one."""
        if self.slowest is None or not isinstance(self.controller, Washout):
            return None
        return StabilityMap.around(self.slowest, self.controller)

    def peak_forces(self, around: StabilityMap) -> FloatArray:
        """Return the largest force over the gains of a map.

        It is the force of a controller with the proposed cubic gain that is activated at the worst
        phase of the vibration without control, at the worst belt speed.

        Parameters
        ----------
        around : StabilityMap
            Map of m cutoff frequencies and n linear gains.

        Returns
        -------
        ndarray
            Force in N, shape (m, n); zero where nothing vibrates.
        """
        linear = around.linear_gains[:, np.newaxis]
        forces = np.zeros((len(around.corner_frequencies), len(around.linear_gains)))
        for row, corner_frequency in enumerate(around.corner_frequencies.tolist()):
            for vibration in self.vibrations:
                outputs = np.abs(vibration.filtered(corner_frequency))
                speeds = np.linspace(0.0, outputs.max(initial=0.0), 50)
                gains = Washout(corner_frequency, linear, around.gains.cubic_gain)
                force = np.abs(gains.force(speeds)).max(axis=1)
                forces[row] = np.maximum(forces[row], force)
        return forces


def gains_file(scenario: Scenario) -> str:
    """Return the text of a complete parameter file, with what a fit leaves open."""
    nodes = scenario.as_dict() | ({BASE_SECTION: {"fit": scenario.fit}} if scenario.fit else {})
    del nodes["analyzer"]["bag"]
    return parameter_file(nodes)


def design(
    task: Task,
    progress: Progress = lambda _: None,
    *,
    disturbances: Sequence[Disturbance] | None = None,
) -> Design:
    """Find the gains with which the smallest decay rate over the belt speeds is largest.

    Gains that fail in simulation are not proposed: the next attempt is more cautious.

    Parameters
    ----------
    task : Task
        The drive, its loop, the control law, the force limit and the range of belt speeds.
    progress : callable
        Receives the share of the work that is done, 0 to 1.
    disturbances : sequence of Disturbance, optional
        What acts on the drive; by default a step and an impulse.

    Returns
    -------
    Design
        The proposal with its margins and checks, or the reason why there is none, with a sufficient
        force limit if one exists.

    Raises
    ------
    InvalidInputError
        If the law has no gains to tune, or belt or load follow a signal.
    """
    scenario, plant = task.scenario, task.scenario.plant
    reason = why_no_linear_loop(task.drive, *plant.mean_sampling)
    if reason is not None and task.drive.belt_speed:
        return Design(task, remark=reason)
    if disturbances is None:
        disturbances = [Disturbance.parse(kind, scenario) for kind in _KINDS]
    designer = Designer(task, disturbances)
    loops = designer.trial.loops
    if loops.diverges is not None:
        return Design(task, remark=loops.diverges)
    draft = designer.proposed(progress)
    if draft.controller is not None and task.spread:
        draft = replace(draft, drawn=designer.tried(draft.controller))
    progress(1.0)
    if draft.controller is None and draft.tuned is not None and draft.tuned.missed:
        draft = replace(
            draft, remark=joined(draft.remark, _sufficient(task, draft.tuned, disturbances))
        )
    if loops.vibrations and plant.force_jitter:
        no_jitter = (
            "force_jitter is omitted where the vibration is caught: the delay is constant there"
        )
        draft = replace(draft, remark=joined(draft.remark, no_jitter))
    return draft


def _sufficient(task: Task, nearest: Tuned, disturbances: Sequence[Disturbance]) -> str | None:
    """Return which force limit is sufficient, if nothing but the limit is in the way."""
    if [limit.name for limit in nearest.missed] != ["the peak force"]:
        return None
    if (enough := rounded(nearest.missed[0].value / RESERVE, up=True)) <= task.force_limit:
        return None
    larger = Designer(replace(task, force_limit=enough), disturbances)
    if larger.proposed().controller is None:
        return None
    return f"a force limit of about {number_text(task.drive, enough, 'N')} is sufficient"


class Designer:
    """Searches and simulates in turn."""

    def __init__(self, task: Task, disturbances: Sequence[Disturbance]) -> None:
        self.task, self.trial = task, Trial(task, disturbances)
        self.tuning = Tuning(self.trial.loops)
        self.drawn: dict[str, Trial] = {}
        """Drives that the gains have to hold, too, by what they are called."""

    def proposed(self, progress: Progress = lambda _: None) -> Design:
        """Return a proposal that was checked by simulation, or the reason why there is none."""
        for seed in range(_SEARCHED if self.task.spread else 0):
            _, name, other = self.other(seed)
            self.drawn[name] = other
            if (diverges := other.loops.diverges) is not None:
                return Design(self.task, None, f"of {name}, {diverges}")
        tuned, share, cubic = *self._first(), True
        low, high, enough = 0.0, 1.0, 0.0
        held: Design | None = None
        failed = Design(self.task)
        for attempt in range(_ATTEMPTS):
            if attempt:
                tuned = self._best(share, cubic=cubic)
            if tuned.missed or tuned.decay_rate <= 0.0:
                return held or replace(failed, remark=failed.remark or tuned.remark, tuned=tuned)
            draft = self._attempt(tuned, progress, 0.5**attempt)
            peak = max((check.disturbed_force or 0.0 for check in draft.checks), default=0.0)
            if draft.controller is not None:
                held, low = draft, share
                if tuned.decay_rate >= enough:
                    break
            else:
                failed = replace(draft, checks=())
                if held is None and peak > self.task.force_limit:
                    share *= RESERVE * self.task.force_limit / peak
                    continue
                if held is None and getattr(tuned.law, "cubic_gain", 0.0):
                    cubic = False
                    continue
                high, enough = min(share, self.tuning.used(tuned.law)), _ENOUGH * tuned.decay_rate
            share = high * _MORE_CAUTION**2**attempt if held is None else sqrt(low * high)
        return held or failed

    def _first(self) -> tuple[Tuned, float]:
        """Return gains with a reserve, or without one where it is costly, and their share."""
        tuned = self._best(RESERVE)
        if tuned.decay_rate > 0.0 and NEAR < self.tuning.used(tuned.law) <= 1.0:
            whole = self._best(1.0)
            if not whole.missed and tuned.decay_rate < _ENOUGH * whole.decay_rate:
                return whole, 1.0
        return tuned, RESERVE

    def _attempt(self, tuned: Tuned, progress: Progress, left: float) -> Design:
        """Return a design with these gains, without a controller if they fail in simulation.

        `progress` receives all but the share of the work that is left.
        """
        law: Any = tuned.law
        if self.tuning.loops.vibrations:
            waits = FILTER_SETTLED / law.corner_frequency
            law = replace(law, start_after=rounded(waits, digits=2, up=True))
        checks: list[Check] = []
        failed = Design(self.task, checks=checks, tuned=tuned)
        for check, done in self.trial.checks(law):
            checks.append(check)
            progress(1.0 - left * (1.0 - done))
            if check.reason is not None:
                return replace(failed, remark=check.reason)
        for name, other in self.drawn.items():
            if failure := other.worst(law).reason:
                self.tuning.others[name] = other.loops
                return replace(failed, remark=f"of {name}, {failure}")
        remark = failure = None
        if law.start_after:
            remark, failure = self.trial.throw_from_high_speeds(law)
        if failure is not None:
            return replace(failed, remark=failure)
        return replace(
            failed,
            controller=law,
            remark=joined(tuned.remark, remark),
            slowest=self.tuning.loops.slowest(law),
            vibrations=tuple(self.tuning.loops.vibrations),
        )

    def other(self, seed: int) -> tuple[dict[str, float], str, Trial]:
        """Return the constants of a drive that is drawn, what it is called, and its trial."""
        scenario = self.task.scenario
        constants = drawn(scenario, seed, self.task.spread)
        task = replace(self.task, scenario=scenario.changed(constants))
        name = f"drawn drive {seed} ({_constants_text(constants)})"
        return constants, name, Trial(task, self.trial.disturbances)

    def _best(self, share: float, *, cubic: bool = True) -> Tuned:
        """Return the best gains for the drive and, one after the other, those that miss limits."""
        while True:
            tuned = self.tuning.best(share, cubic=cubic)
            if tuned.missed or tuned.decay_rate <= 0.0:
                return tuned
            excess = {
                name: sum(limit.excess for limit in other.loops.missed(tuned.law))
                if other.loops.decay_rates([tuned.law]) > 0.0
                else inf
                for name, other in self.drawn.items()
                if name not in self.tuning.others
            }
            worst = max(excess, key=lambda name: excess[name], default="")
            if not excess.get(worst):
                return tuned
            self.tuning.others[worst] = self.drawn[worst].loops

    def tried(self, law: ControlLaw) -> Drawn:
        """Return what a law comes to on drives that were not searched for."""
        rows: list[tuple[Check, dict[str, float]]] = []
        for seed in range(_SEARCHED, _SEARCHED + _TRIED):
            constants, _, other = self.other(seed)
            rows.append((other.worst(law), constants))
        held = sum(check.reason is None for check, _ in rows)
        check, constants = min(rows, key=lambda row: (row[0].reason is None, row[0].decay_rate))
        return Drawn(len(rows), held, held_interval(held, len(rows)), constants, check)


def _constants_text(constants: Mapping[str, float]) -> str:
    """Return constants as they are given on a command line."""
    return " ".join(f"{name}={value:.4g}" for name, value in constants.items())


def joined(*remarks: str | None) -> str | None:
    """Return the remarks that there are as one text; None without any."""
    return "; ".join(filter(None, remarks)) or None
