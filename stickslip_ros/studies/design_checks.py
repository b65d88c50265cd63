"""What gains do, simulated: they catch vibrations, and bring back what was thrown."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

from stickslip_ros.physics.loop.washout import WashoutParameters
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.theory.linear_sampled_loop import settling_time
from stickslip_ros.progress import Progress
from stickslip_ros.studies.controller_trial import Bench
from stickslip_ros.studies.design_search import Candidates
from stickslip_ros.studies.design_task import Task


@dataclass(frozen=True)
class Check:
    """What a proposal does at one belt speed, predicted and simulated; SI units."""

    belt_speed: float
    vibrates: bool
    """Whether there is a vibration without control, to be caught."""
    decay_rate: float
    """At which a small deviation dies out, 1/s."""
    predicted_settling_time: float
    """In which a small deviation falls to a hundredth, s."""
    settling_time: float | None
    """Simulated, until a hundredth of the vibration is left, at the worst phase; None without."""
    predicted_peak_force: float
    """When the control comes on at the worst phase of the vibration, N."""
    peak_force: float | None
    """Simulated, at the worst phase, N; None without vibration."""


def check_at_speed(
    bench: Bench, candidates: Candidates, index: int, controller: WashoutParameters
) -> Check:
    """Return what the controller does at one of the speeds."""
    loop, vibration = candidates.loops[index], candidates.vibrations[index]
    gains = controller.gains
    decay_rate = loop.decay_rate(gains)
    predicted = settling_time(decay_rate)
    assert predicted is not None
    slowest: float | None = None
    peaks: list[float] = []
    if vibration.vibrates:
        patience = 5.0 * predicted + 20.0 * loop.drive.natural_period
        for outcome in bench.catch(vibration, controller, 4, patience):
            peaks.append(outcome.peak_force)
            if outcome.settling_time is None:
                slowest = None
                break
            slowest = max(slowest or 0.0, outcome.settling_time)
    return Check(
        belt_speed=loop.drive.belt_speed,
        vibrates=vibration.vibrates,
        decay_rate=decay_rate,
        predicted_settling_time=predicted,
        settling_time=slowest,
        predicted_peak_force=vibration.peak_force(gains),
        peak_force=max(peaks, default=None),
    )


def failure_of(task: Task, check: Check) -> str | None:
    """Return in what the simulated control fails, if it does."""
    speed = f"at a belt speed of {task.shown(check.belt_speed, 'm/s')}"
    if check.vibrates and check.settling_time is None:
        return f"{speed} the vibration does not die out, though a small one would"
    if check.peak_force is not None and check.peak_force > task.force_limit:
        return (
            f"{speed} the force reaches {task.shown(check.peak_force, 'N')}, above the limit of "
            f"{task.shown(task.force_limit, 'N')}"
        )
    return None


def throw_from_high_speeds(
    task: Task, bench: Bench, drives: Sequence[Drive], controller: WashoutParameters, done: Progress
) -> tuple[str | None, str | None]:
    """Return what is to be said of motions that begin fast, and in what the controller fails."""

    def escapes(drive: Drive, speed: float, controller: WashoutParameters) -> bool:
        patience = 20.0 * drive.natural_period
        return any(outcome.grows for outcome in bench.throw(drive, controller, speed, patience))

    remark: str | None = None
    unlimited = replace(controller, force_limit=inf)
    dimensionless = 3.0, 30.0, 300.0
    throws = [(drive, speed * drive.speed_scale) for drive in drives for speed in dimensionless]
    for number, (drive, speed) in enumerate(throws, 1):
        if escapes(drive, speed, controller):
            slide = (
                f"thrown to {task.shown(speed, 'm/s')} off a belt at "
                f"{task.shown(drive.belt_speed, 'm/s')} the slide"
            )
            if controller.cubic_gain != 0.0 or escapes(drive, speed, unlimited):
                return None, f"{slide} does not come back"
            remark = remark or f"{slide} needs more force than the limit"
        done(number / len(throws))
    return remark, None
