"""Checks of gains by simulation: they suppress vibrations, and hold after fast starts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.theory.linear_sampled_loop import settling_time
from stickslip_ros.progress import Progress
from stickslip_ros.studies.controller_trial import FILTER_SETTLED, Bench, Rest
from stickslip_ros.studies.design_search import Candidates
from stickslip_ros.studies.design_task import DesignedLaw, Task

_PERIODS_AT_REST = 100.0
"""Natural periods over which the loop is observed at its equilibrium."""


@dataclass(frozen=True)
class Check:
    """Predicted and simulated behaviour of a proposal at one belt speed; SI units."""

    belt_speed: float
    """Belt speed, m/s."""
    vibrates: bool
    """Whether the drive vibrates without control."""
    decay_rate: float
    """Decay rate of a small deviation, 1/s."""
    predicted_settling_time: float
    """Predicted 1 % settling time of a small deviation, s."""
    settling_time: float | None
    """Simulated 1 % settling time of the vibration at the worst phase, s; None without it."""
    predicted_peak_force: float
    """Predicted peak force when the control is activated at the worst phase, N."""
    peak_force: float | None
    """Simulated peak force at the worst phase, N; None without vibration."""
    rest: Rest | None = None
    """What noise and rounding leave at the equilibrium, simulated; None without them."""


def check_at_speed(
    bench: Bench, candidates: Candidates, index: int, controller: DesignedLaw
) -> Check:
    """Return the check of the controller at one of the belt speeds."""
    loop, vibration = candidates.loops[index], candidates.vibrations[index]
    gains = controller.gains
    decay_rate = loop.decay_rate(gains)
    predicted = settling_time(decay_rate)
    assert predicted is not None
    slowest: float | None = None
    peaks: list[float] = []
    settling = FILTER_SETTLED / controller.corner_frequency
    if vibration.vibrates:
        patience = 5.0 * predicted + 20.0 * loop.drive.natural_period
        worst = vibration.worst_sample(gains)
        for outcome in bench.catch(vibration, controller, settling, worst, 4, patience):
            peaks.append(outcome.peak_force)
            if outcome.settling_time is None:
                slowest = None
                break
            slowest = max(slowest or 0.0, outcome.settling_time)
    rest: Rest | None = None
    if candidates.task.rough:
        settled, periods = max(predicted, settling), _PERIODS_AT_REST * loop.drive.natural_period
        rest = bench.rest(loop.drive, controller, settled, periods)
    return Check(
        belt_speed=loop.drive.belt_speed,
        vibrates=vibration.vibrates,
        decay_rate=decay_rate,
        predicted_settling_time=predicted,
        settling_time=slowest,
        predicted_peak_force=vibration.peak_force(gains),
        peak_force=max(peaks, default=None),
        rest=rest,
    )


def failure_of(task: Task, check: Check) -> str | None:
    """Return how the simulated control fails; None if it does not."""
    speed = f"at a belt speed of {task.shown(check.belt_speed, 'm/s')}"
    if check.vibrates and check.settling_time is None:
        if task.rough:
            return (
                f"{speed} the vibration does not decay to 1 % with the noise and rounding of "
                "sensor and actuator"
            )
        return f"{speed} the vibration does not decay, although a small one would"
    if check.peak_force is not None and check.peak_force > task.force_limit:
        return (
            f"{speed} the force reaches {task.shown(check.peak_force, 'N')}, above the limit of "
            f"{task.shown(task.force_limit, 'N')}"
        )
    return None


def throw_from_high_speeds(
    task: Task, bench: Bench, drives: Sequence[Drive], controller: DesignedLaw, done: Progress
) -> tuple[str | None, str | None]:
    """Return a remark on motions with a fast start, and how the controller fails, if it does."""

    def escapes(drive: Drive, speed: float, controller: DesignedLaw) -> bool:
        patience = 20.0 * drive.natural_period
        return any(outcome.grows for outcome in bench.throw(drive, controller, speed, patience))

    remark: str | None = None
    unlimited = replace(controller, force_limit=inf)
    dimensionless = 3.0, 30.0, 300.0
    throws = [(drive, speed * drive.speed_scale) for drive in drives for speed in dimensionless]
    for number, (drive, speed) in enumerate(throws, 1):
        if escapes(drive, speed, controller):
            slide = (
                f"started at {task.shown(speed, 'm/s')} on a belt at "
                f"{task.shown(drive.belt_speed, 'm/s')}, the slide"
            )
            if controller.cubic_gain != 0.0 or escapes(drive, speed, unlimited):
                return None, f"{slide} does not return to equilibrium"
            remark = remark or f"{slide} needs more force than the limit"
        done(number / len(throws))
    return remark, None
