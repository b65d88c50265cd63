"""Design of a controller: the gains that damp fastest within a force limit.

The proposal comes from the linear sampled loop and from the vibration without control. It is then
checked by simulation of the drive, sampled, held and delayed as between the nodes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import copysign, inf, isinf, sqrt

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.physics.model.control import WashoutGains
from stickslip_ros.physics.theory.linear_sampled_loop import LinearSampledLoop, why_no_linear_loop
from stickslip_ros.physics.theory.stability_map import StabilityMap
from stickslip_ros.progress import Progress
from stickslip_ros.scenarios.files import Scenario, parameter_file
from stickslip_ros.scenarios.keywords import override
from stickslip_ros.scenarios.parameters import controller_node
from stickslip_ros.studies.controller_trial import FILTER_SETTLED, Bench, Vibration
from stickslip_ros.studies.design_checks import (
    Check,
    check_at_speed,
    failure_of,
    throw_from_high_speeds,
)
from stickslip_ros.studies.design_margins import Margins, little_margin, margins
from stickslip_ros.studies.design_search import CUBIC_SHARES, RESERVE, Candidates, rounded
from stickslip_ros.studies.design_task import DesignedLaw, Task

_SHARE_OF_VIBRATIONS = 0.1
"""Approximate share of the work that goes into the vibrations without control."""


@dataclass(frozen=True)
class Design:
    """The proposed controller of a task, or the reason why there is none."""

    task: Task
    """The task."""
    controller: DesignedLaw | None = None
    """The proposed controller; None if no gains meet the task."""
    remark: str | None = None
    """Why there is no proposal, or a caution about it."""
    slowest: LinearSampledLoop | None = None
    """The loop at the belt speed at which a small deviation decays most slowly."""
    margins: Margins | None = None
    """Smallest stability margins of the loops at all speeds; None without control."""
    checks: tuple[Check, ...] = ()
    """Checks of the proposal, in order of belt speed."""
    vibrations: tuple[Vibration, ...] = field(default=(), compare=False, repr=False)
    """Vibrations without control that the force was computed from, in order of belt speed."""

    @property
    def scenario(self) -> Scenario | None:
        """The task's scenario with the proposal; None without a proposal or a scenario.

        Its belt speed is that of the scenario, or the nearest one within the range.
        """
        scenario = self.task.scenario
        if self.controller is None or scenario is None:
            return None
        (low, high), own = self.task.belt_speeds, scenario.plant.belt_speed
        proposed = {
            f"{scenario.controller.node}.{name}": value for name, value in self._constants.items()
        }
        proposed["plant.belt_speed"] = copysign(min(max(abs(own), low), high), own)
        return scenario.overridden([override(name, value) for name, value in proposed.items()])

    @property
    def parameter_file(self) -> str | None:
        """Text of a parameter file with the proposal; None without one.

        It contains the complete `scenario`, or the gains alone if the task has no scenario.
        """
        if self.controller is None:
            return None
        if self.scenario is None:
            node = controller_node(self.controller.name)
            return parameter_file({node: self._constants})
        nodes = self.scenario.as_dict()
        del nodes["analyzer"]["bag"]
        return parameter_file(nodes)

    @property
    def _constants(self) -> dict[str, float]:
        """Constants of the proposal by name; none without one."""
        names = self.controller.constants() if self.controller is not None else []
        return {name: getattr(self.controller, name) for name in names}

    def map_around(self) -> StabilityMap | None:
        """Return the stability map of the slowest loop around the proposal.

        Returns
        -------
        StabilityMap or None
            None without a proposal.
        """
        if self.slowest is None or self.controller is None:
            return None
        return StabilityMap.around(self.slowest, self.controller.gains)

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
                speeds = np.linspace(0.0, _largest(vibration.filtered(corner_frequency)), 50)
                gains = WashoutGains(corner_frequency, linear, around.gains.cubic)
                force = np.abs(gains.force(speeds)).max(axis=1)
                forces[row] = np.maximum(forces[row], force)
        return forces


def _largest(values: FloatArray) -> float:
    return float(np.abs(values).max(initial=0.0))


def design(task: Task, progress: Progress = lambda _: None) -> Design:
    """Find the gains with the fastest decay at the slowest belt speed of the range.

    The force stays within the limit when the control, its filter settled, is activated at any phase
    of the vibration. Gains that fail in simulation are not proposed: the next attempt is more
    cautious. If all attempts fail, the remark gives the reason and a sufficient force limit, if
    one exists.

    Parameters
    ----------
    task : Task
        The drive, its loop, the force limit and the range of belt speeds.
    progress : Callable[[float], None]
        Receives the share of the work that is done, 0 to 1.

    Returns
    -------
    Design
        The proposal with its margins and checks, or the reason why there is none.

    Examples
    --------
    >>> from stickslip_ros.scenarios.files import load_scenario
    >>> from stickslip_ros.studies.design import Task, design
    >>> overrides = ["washout_controller.force_limit=200"]
    >>> task = Task.from_scenario(load_scenario("feed_drive", overrides), (0.03, 0.05))
    >>> found = design(task)
    >>> max(check.peak_force or 0.0 for check in found.checks) < 200.0
    True
    """
    found = _design(task, progress)
    if task.scenario is None or task.scenario.plant.force_jitter == 0.0:
        return found
    no_jitter = "force_jitter is omitted: the delay of the force is constant here"
    return replace(found, remark="; ".join(filter(None, (found.remark, no_jitter))))


def _design(task: Task, progress: Progress) -> Design:
    drives = task.drives()
    reason = why_no_linear_loop(drives[0], task.rate, task.force_delay)
    if reason is not None:
        return Design(task, remark=reason)
    bench = Bench(task.rate, task.force_delay, task.sensor)
    vibrations: list[Vibration] = []
    for number, drive in enumerate(drives, 1):
        vibrations.append(bench.vibration(drive))
        progress(_SHARE_OF_VIBRATIONS * number / len(drives))
        if vibrations[-1].regime is Regime.UNBOUNDED:
            speed = task.shown(drive.belt_speed, "m/s")
            reason = f"without control the motion diverges at a belt speed of {speed}"
            return Design(task, remark=f"{reason}, so there is no limit cycle to suppress")
    candidates = Candidates(task, vibrations)
    found = _propose(bench, candidates, progress)
    if found.controller is None and not isinf(task.force_limit):
        enough = _sufficient_limit(bench, candidates)
        if enough is not None:
            limit = f"a force limit of about {task.shown(enough, 'N')}"
            return replace(found, remark=f"{found.remark}; {limit} is sufficient")
    return found


def _propose(bench: Bench, candidates: "Candidates", progress: Progress) -> Design:
    """Return a proposal that was checked by simulation, or the reason why there is none."""
    task, drives = candidates.task, candidates.task.drives()
    strength, shares = RESERVE, CUBIC_SHARES
    failure: str | None = None
    for attempt in range(8):
        gains = candidates.best(strength, shares)
        if gains is None:
            return Design(task, remark=failure or candidates.why_none())
        waits = FILTER_SETTLED / gains.corner_frequency if gains.linear != 0.0 else 0.0
        controller = DesignedLaw(
            corner_frequency=gains.corner_frequency,
            linear_gain=gains.linear,
            cubic_gain=gains.cubic,
            force_limit=task.force_limit,
            start_after=rounded(waits, digits=2, up=True),
        )
        left = (1.0 - _SHARE_OF_VIBRATIONS) * 0.5**attempt

        def done(share: float, left: float = left) -> None:
            progress(1.0 - left * (1.0 - 0.5 * share))

        failure = None
        checks: list[Check] = []
        while failure is None and len(checks) < len(drives):
            checks.append(check_at_speed(bench, candidates, len(checks), controller))
            failure = failure_of(task, checks[-1])
            done(0.5 * len(checks) / len(drives))
        slowest = candidates.slowest(gains)
        remark, found, little = candidates.why_zero(), None, None
        if failure is None and gains.linear != 0.0:
            found = margins(candidates.loops, gains)
            little = little_margin(task, found)
            ends = [drive for drive in drives if drive in (drives[0], drives[-1], slowest.drive)]
            remark, failure = throw_from_high_speeds(
                task, bench, ends, controller, lambda share: done(0.5 + 0.5 * share)
            )
        if failure is None:
            progress(1.0)
            remark = "; ".join(filter(None, (remark, little))) or None
            seen = tuple(candidates.vibrations)
            return Design(task, controller, remark, slowest, found, tuple(checks), seen)
        peak = max((check.peak_force or 0.0 for check in checks), default=0.0)
        if peak > task.force_limit:
            strength *= 0.97 * task.force_limit / peak
        elif gains.cubic != 0.0:
            shares = CUBIC_SHARES[:1]
        else:
            strength *= 0.8
    return Design(task, remark=failure)


def _sufficient_limit(bench: Bench, candidates: "Candidates") -> float | None:
    """Return the lowest force limit (N) for which there is a proposal, to a few per cent.

    None if even a force without limit does not suffice.
    """

    def simulated(limit: float) -> Design:
        return _propose(bench, candidates.limited(limit), lambda _: None)

    def tried(limit: float) -> bool:
        return simulated(limit).controller is not None

    def in_theory(limit: float) -> bool:
        limited = candidates.limited(limit)
        gains = limited.best(RESERVE, CUBIC_SHARES)
        return gains is not None and limited.slowest(gains).decay_rate(gains) > slowest

    def narrowed(does: Callable[[float], bool], low: float, high: float) -> tuple[float, float]:
        low = max(low, 1e-3 * high)
        while high > 1.015 * low:
            middle = sqrt(low * high)
            low, high = (low, middle) if does(middle) else (middle, high)
        return low, rounded(high, up=True)

    # A slower decay takes too long to simulate, and needs hardly less force.
    slowest = 0.01 / candidates.task.drive.natural_period
    limit = least = candidates.task.force_limit
    # One simulated limit takes longer than bisection with the linear theory.
    enough = candidates.free_peak_force() / RESERVE
    if enough > limit:
        least, enough = narrowed(in_theory, limit, enough)
        if tried(enough):
            return enough
    free = simulated(inf)
    enough = max((check.peak_force or 0.0 for check in free.checks), default=0.0) / RESERVE
    if enough <= limit:
        return None
    _, enough = narrowed(tried, least, enough)
    return enough if tried(enough) else None
