"""Design of a washout controller: the gains that damp fastest within a force limit.

The proposal comes from the linear sampled loop and from the vibration without control. It is then
checked by simulation of the drive, sampled, held and delayed as between the nodes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import inf, isinf, sqrt
from typing import Annotated

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.progress import Progress
from stickslip_ros.quantities import Quantity
from stickslip_ros.studies.controller_trial import FILTER_SETTLED, Bench, Outcome, Rest, Vibration
from stickslip_ros.studies.design import Design, Task, joined
from stickslip_ros.studies.gain_search import rounded
from stickslip_ros.studies.stability import number_text
from stickslip_ros.studies.washout_search import (
    CUBIC_SHARES,
    RESERVE,
    Candidates,
    Margins,
    little_margin,
    margins,
)
from stickslip_ros.theory.linear_sampled_loop import (
    LinearSampledLoop,
    settling_time,
    why_no_linear_loop,
)
from stickslip_ros.theory.stability_map import StabilityMap

_SHARE_OF_VIBRATIONS = 0.1
"""Approximate share of the work that goes into the vibrations without control."""
_THROWN_SPEEDS = 3.0, 30.0, 300.0
"""Speeds with which the slide must return to equilibrium, in the speed scale of the drive."""


@dataclass(frozen=True)
class Check:
    """Predicted and simulated behaviour of a proposal at one belt speed; SI units."""

    belt_speed: Annotated[float, Quantity("belt speed", "m/s")]
    """Belt speed, m/s."""
    vibrates: Annotated[bool, Quantity("vibrates")]
    """Whether the drive vibrates without control."""
    decay_rate: float
    """Decay rate of a small deviation, 1/s."""
    predicted_settling_time: Annotated[float, Quantity("1 % settling time, predicted", "s")]
    """Predicted 1 % settling time of a small deviation, s."""
    settling_time: Annotated[float | None, Quantity("simulated", "s")]
    """Simulated 1 % settling time of the vibration at the worst phase, s; None without it."""
    predicted_peak_force: Annotated[float, Quantity("peak force, predicted", "N")]
    """Predicted peak force when the control is activated at the worst phase, N."""
    peak_force: Annotated[float | None, Quantity("simulated", "N")]
    """Simulated peak force at the worst phase, N; None without vibration."""
    rest: Rest | None = None
    """Motion and force that noise and rounding leave at rest, simulated; None without them."""


@dataclass(frozen=True)
class WashoutDesign(Design):
    """The proposed washout controller of a task, or the reason why there is none."""

    controller: Washout | None = None
    checks: Sequence[Check] = ()
    slowest: LinearSampledLoop | None = None
    """The loop at the belt speed at which a small deviation decays most slowly."""
    margins: Margins | None = None
    """Smallest stability margins of the loops at all speeds; None without control."""
    vibrations: tuple[Vibration, ...] = field(default=(), compare=False, repr=False)
    """Vibrations without control that the force was computed from, in order of belt speed."""

    def map_around(self) -> StabilityMap | None:
        """Return the stability map of the slowest loop around the proposal; None without one."""
        if self.slowest is None or self.controller is None:
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
                speeds = np.linspace(0.0, vibration.peak_speed(corner_frequency), 50)
                gains = Washout(corner_frequency, linear, around.gains.cubic_gain)
                force = np.abs(gains.force(speeds)).max(axis=1)
                forces[row] = np.maximum(forces[row], force)
        return forces


def design_washout(task: Task, progress: Progress = lambda _: None) -> WashoutDesign:
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
    WashoutDesign
        The proposal with its margins and checks, or the reason why there is none.
    """
    design = _design(task, progress)
    if task.scenario.plant.force_jitter == 0.0:
        return design
    no_jitter = "force_jitter is omitted: the delay of the force is constant here"
    return replace(design, remark=joined(design.remark, no_jitter))


def _design(task: Task, progress: Progress) -> WashoutDesign:
    drives, plant = task.drives, task.scenario.plant
    reason = why_no_linear_loop(drives[0], plant.rate, plant.force_delay)
    if reason is not None:
        return WashoutDesign(task, remark=reason)
    bench = Bench(plant.rate, plant.force_delay, plant.sensor)
    vibrations: list[Vibration] = []
    for number, drive in enumerate(drives, 1):
        vibrations.append(bench.vibration(drive))
        progress(_SHARE_OF_VIBRATIONS * number / len(drives))
        if vibrations[-1].regime is Regime.UNBOUNDED:
            speed = number_text(drive, drive.belt_speed, "m/s")
            reason = f"without control the motion diverges at a belt speed of {speed}"
            return WashoutDesign(task, remark=f"{reason}, so there is no limit cycle to suppress")
    candidates = Candidates(task, vibrations)
    proposed = _propose(bench, candidates, progress)
    if proposed.controller is None and not isinf(task.force_limit):
        enough = _sufficient_limit(bench, candidates)
        if enough is not None:
            limit = f"a force limit of about {number_text(task.drive, enough, 'N')}"
            return replace(proposed, remark=f"{proposed.remark}; {limit} is sufficient")
    return proposed


def _propose(bench: Bench, candidates: Candidates, progress: Progress) -> WashoutDesign:
    """Return a proposal that was checked by simulation, or the reason why there is none."""
    task, loops = candidates.task, candidates.loops.all
    strength, shares = RESERVE, CUBIC_SHARES
    failure: str | None = None
    for attempt in range(8):
        gains = candidates.best(strength, shares)
        if gains is None:
            return WashoutDesign(task, remark=failure or candidates.why_none())
        waits = FILTER_SETTLED / gains.corner_frequency if gains.linear_gain != 0.0 else 0.0
        controller = replace(
            gains,
            force_limit=task.force_limit,
            start_after=rounded(waits, digits=2, up=True),
        )
        left = (1.0 - _SHARE_OF_VIBRATIONS) * 0.5**attempt
        checks: list[Check] = []
        for loop, vibration in zip(loops, candidates.vibrations, strict=True):
            checks.append(_check(task, bench, loop, vibration, controller))
            progress(1.0 - left * (1.0 - 0.25 * len(checks) / len(loops)))
            failure = _failure_of(task, checks[-1])
            if failure is not None:
                break
        slowest = candidates.loops.slowest(gains)
        remark, robustness, little = candidates.why_zero(), None, None
        if failure is None and gains.linear_gain != 0.0:
            robustness = margins(loops, gains)
            little = little_margin(task, robustness)
            ends = [loop.drive for loop in loops if loop in (loops[0], loops[-1], slowest)]
            remark, failure = _throw_from_high_speeds(bench, ends, controller)
        if failure is None:
            progress(1.0)
            seen = tuple(candidates.vibrations)
            remark = joined(remark, little)
            return WashoutDesign(task, controller, remark, checks, slowest, robustness, seen)
        peak = max((check.peak_force or 0.0 for check in checks), default=0.0)
        if peak > task.force_limit:
            strength *= 0.97 * task.force_limit / peak
        elif gains.cubic_gain != 0.0:
            shares = CUBIC_SHARES[:1]
        else:
            strength *= 0.8
    return WashoutDesign(task, remark=failure)


def _check(
    task: Task, bench: Bench, loop: LinearSampledLoop, vibration: Vibration, controller: Washout
) -> Check:
    """Return the check of the controller at one belt speed."""
    drive, decay_rate = loop.drive, loop.decay_rate(controller)
    predicted = settling_time(decay_rate)
    assert predicted is not None
    caught: Outcome | None = None
    if vibration.vibrates:
        patience = 5.0 * predicted + 20.0 * drive.natural_period
        caught = bench.catch(vibration, controller, patience)
    rest: Rest | None = None
    if _is_rough(task):
        settled = max(predicted, FILTER_SETTLED / controller.corner_frequency)
        rest = bench.rest(drive, controller, settled)
    return Check(
        belt_speed=drive.belt_speed,
        vibrates=vibration.vibrates,
        decay_rate=decay_rate,
        predicted_settling_time=predicted,
        settling_time=None if caught is None else caught.settling_time,
        predicted_peak_force=vibration.peak_force(controller),
        peak_force=None if caught is None else caught.peak_force,
        rest=rest,
    )


def _is_rough(task: Task) -> bool:
    """Return whether noise or rounding keep the loop from resting."""
    sensor, actuator = task.scenario.plant.sensor, task.drive.actuator
    rounds = sensor.position_resolution or actuator.resolution
    return bool(rounds or sensor.position_noise or sensor.velocity_noise)


def _failure_of(task: Task, check: Check) -> str | None:
    """Return how the simulated control fails; None if it does not."""
    speed = f"at a belt speed of {number_text(task.drive, check.belt_speed, 'm/s')}"
    if check.vibrates and check.settling_time is None:
        if _is_rough(task):
            return (
                f"{speed} the vibration does not decay to 1 % with the noise and rounding of "
                "sensor and actuator"
            )
        return f"{speed} the vibration does not decay, although a small one would"
    if check.peak_force is not None and check.peak_force > task.force_limit:
        peak, limit = (
            number_text(task.drive, n, "N") for n in (check.peak_force, task.force_limit)
        )
        return f"{speed} the force reaches {peak}, above the limit of {limit}"
    return None


def _throw_from_high_speeds(
    bench: Bench, drives: Sequence[Drive], controller: Washout
) -> tuple[str | None, str | None]:
    """Return a remark on motions with a fast start, and how the controller fails, if it does."""
    remark: str | None = None
    unlimited = replace(controller, force_limit=inf)
    for drive in drives:
        for speed in (thrown * drive.speed_scale for thrown in _THROWN_SPEEDS):
            if bench.returns(drive, controller, speed):
                continue
            slide = (
                f"started at {number_text(drive, speed, 'm/s')} on a belt at "
                f"{number_text(drive, drive.belt_speed, 'm/s')}, the slide"
            )
            if controller.cubic_gain != 0.0 or not bench.returns(drive, unlimited, speed):
                return None, f"{slide} does not return to equilibrium"
            remark = remark or f"{slide} needs more force than the limit"
    return remark, None


def _sufficient_limit(bench: Bench, candidates: Candidates) -> float | None:
    """Return the lowest force limit (N) for which there is a proposal, to a few per cent.

    None if even a force without limit does not suffice.
    """

    def simulated(limit: float) -> WashoutDesign:
        return _propose(bench, candidates.limited(limit), lambda _: None)

    def tried(limit: float) -> bool:
        return simulated(limit).controller is not None

    def in_theory(limit: float) -> bool:
        limited = candidates.limited(limit)
        gains = limited.best(RESERVE, CUBIC_SHARES)
        return gains is not None and limited.loops.slowest(gains).decay_rate(gains) > slowest

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
