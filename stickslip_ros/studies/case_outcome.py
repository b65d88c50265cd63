"""One case of a comparison: a law holds a drive against a disturbance, or positions it."""

from dataclasses import dataclass, replace
from math import inf, pi
from typing import Annotated, Any

import numpy as np

from stickslip_ros.arrays import FloatArray, rms
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.following import Following, followed
from stickslip_ros.measures.noise import rises
from stickslip_ros.motion import Motion
from stickslip_ros.motion.controller import answer
from stickslip_ros.quantities import Quantity, number_of, quantities_of
from stickslip_ros.scenarios.files import Scenario

KINDS = ("none", "step", "impulse", "sine")
"""Kinds of disturbances."""
_START, _END, _JUDGED = 1.0 / 3.0, 1.0 / 2.0, 2.0 / 3.0
"""Start and end of the disturbance, and start of the time that is judged, of a case's duration."""
_FRICTION_SHARE = 0.1
"""Default amplitude of a disturbance, as a share of the static friction."""


@dataclass(frozen=True)
class Disturbance:
    """A disturbance force on the slide; it starts after a third of a case.

    A step lasts a sixth of it, an impulse one sample, and a sine to the end.
    """

    kind: str
    """One of `KINDS`."""
    amplitude: float = 0.0
    """Amplitude, N."""
    frequency: float = 1.0
    """Frequency of a sine, Hz."""

    def __str__(self) -> str:
        text = self.kind if self.kind == "none" else f"{self.kind}={self.amplitude:.4g}N"
        return f"{text}@{self.frequency:.4g}Hz" if self.kind == "sine" else text

    @classmethod
    def parse(cls, text: str, scenario: Scenario) -> "Disturbance":
        """Return the disturbance of a text KIND, KIND=AMPLITUDE or sine=AMPLITUDE@FREQUENCY.

        By default the amplitude is a tenth of the static friction; of an impulse it has the
        momentum that moves the slide as far as a step of it. A sine has half the natural frequency,
        or 1 Hz without a spring.
        """
        plant, drive = scenario.plant, scenario.plant.as_drive()
        kind, _, size = text.partition("=")
        amplitude, _, frequency = size.partition("@")
        if kind not in KINDS or (frequency and kind != "sine") or (size and kind == "none"):
            raise InvalidInputError(
                f"disturbance {text:.80}: must be {', '.join(KINDS)}, with =AMPLITUDE, or "
                "sine=AMPLITUDE@FREQUENCY"
            )
        natural = drive.angular_frequency if drive.has_spring else 4.0 * pi
        usual = _FRICTION_SHARE * max(drive.friction.limits) * drive.normal_force
        if kind == "impulse":
            usual *= max(plant.rate / natural, 1.0)
        return cls(
            kind,
            number_of(text, amplitude, "N") if amplitude else float(f"{usual:.3g}"),
            number_of(text, frequency, "Hz") if frequency else float(f"{natural / 4.0 / pi:.3g}"),
        )

    def parameters(self, duration: float) -> dict[str, Any]:
        """Return the parameters of the plant for a case of some duration (s), by name."""
        values: dict[str, Any] = {"kind": self.kind}
        if self.kind != "none":
            values |= {"amplitude": self.amplitude, "start": _START * duration}
        if self.kind == "step":
            values["duration"] = (_END - _START) * duration
        elif self.kind == "sine":
            values |= {"duration": inf, "frequency": self.frequency}
        return {f"plant.disturbance.{name}": value for name, value in values.items()}


FOLLOWING = {
    name: quantity
    for name, quantity in quantities_of(Following).items()
    if name not in ("reversals", "reversal_height_error")
}
"""What an outcome has of how the slide follows its reference."""


@dataclass(frozen=True)
class LoopOutcome:
    """What a loop came to; SI units, None for what is not known.

    The time that is judged is its last third: after the disturbance, or under a sine.
    """

    number: int
    """Number of the case, from 0."""
    held: Annotated[bool | None, Quantity("held")] = None
    """Whether the law did its task."""
    sticking: Annotated[float | None, Quantity("share of time sticking")] = None
    """Share of the samples that are judged at which the slide stuck."""
    rms_velocity: Annotated[float | None, Quantity("rms velocity", "m/s")] = None
    """Root mean square of the velocity, from there on."""
    set_point: Annotated[float | None, Quantity("set point", "m")] = None
    """Mean displacement there."""
    mean_force: Annotated[float | None, Quantity("mean force", "N")] = None
    """Mean control force there: the friction that a law with a position loop carries."""
    rms_force: Annotated[float | None, Quantity("rms force beyond the mean", "N")] = None
    """Root mean square of the force beyond its mean there."""
    peak_force: Annotated[float | None, Quantity("peak force", "N")] = None
    """Largest force from the first sample on."""
    disturbed_force: Annotated[float | None, Quantity("peak force, disturbed", "N")] = None
    """Largest force from the disturbance on."""
    settling_time: Annotated[float | None, Quantity("settling time", "s")] = None
    """Time from the end of the disturbance, or of the reference's motion, until it is held."""
    at_limit: Annotated[float | None, Quantity("share of time at the limit")] = None
    """Share of all samples at which the force had its limit."""


@dataclass(frozen=True)
class Outcome(LoopOutcome):
    """What a case came to; None for what its task, regulation or positioning, does not have."""

    final_error: Annotated[float | None, Quantity("final error", "m")] = None
    """Largest distance from the reference in the time that is judged; of positioning."""
    hunting_amplitude: Annotated[float | None, Quantity("hunting amplitude", "m")] = None
    """Amplitude of the vibration about the reference; of positioning, 0 without one."""
    hunting_period: Annotated[float | None, Quantity("hunting period", "s")] = None
    """Its mean period; of positioning."""
    reason: Annotated[str | None, Quantity("reason")] = None
    """Why the case failed, in words."""
    rms_following_error: Annotated[float | None, FOLLOWING["rms_following_error"]] = None
    """Those of `Following`, over the whole case; of positioning."""
    peak_following_error: Annotated[float | None, FOLLOWING["peak_following_error"]] = None
    reversal_height: Annotated[float | None, FOLLOWING["reversal_height"]] = None
    reversal_duration: Annotated[float | None, FOLLOWING["reversal_duration"]] = None
    reversal_rest: Annotated[float | None, FOLLOWING["reversal_rest"]] = None


OUTCOMES = quantities_of(Outcome)
"""Columns of the outcomes, with labels and units."""


def is_positioning(scenario: Scenario) -> bool:
    """Return whether the task is positioning on a guide at rest, not regulation at a feed."""
    return scenario.plant.as_drive().fastest_belt == 0.0


def simulate_case(
    scenario: Scenario, duration: float, disturbance: Disturbance, tolerance: float
) -> Outcome:
    """Return the outcome, with the number 0, of the sampled loop of a scenario over a duration (s).

    The controller of the scenario acts from the first sample on; `disturbance` is the scenario's,
    for its end. A law that holds may leave `tolerance`, as a share of the belt speed or the
    reference's motion. Raises StickslipError if the law fails, or the motion is too stiff to be
    followed.
    """
    plant = scenario.plant
    drive, limit = plant.as_drive(), scenario.controller.control_law.force_limit
    motion = Motion(drive, plant.initial.position, plant.initial.velocity)
    loop, controller = plant.as_loop(motion), scenario.controller.as_controller()
    rows: list[tuple[float, float, float, float, bool]] = []
    slow = 0.0 if drive.friction.sticks else 0.01
    for _ in range(round(duration * plant.rate)):
        answered = answer(loop, controller)
        speed, belt = motion.velocity, motion.belt_speed
        sticks = motion.sticking or abs(speed - belt) < slow * abs(belt)
        aim = controller.reference.position or 0.0
        rows.append((motion.position, speed, answered, aim, sticks))
        loop.advance()
        if loop.unbounded:
            return Outcome(0, held=False, reason="the motion diverges")
    position, velocity, force, target, sticks = np.array(rows).T.copy()
    late = slice(round(_JUDGED * len(rows)), None)
    limit = min(limit, drive.actuator.limit)
    middle, swing = float(position[late].mean()), rms(velocity[late])
    outcome = Outcome(
        0,
        sticking=float(sticks[late].mean()),
        rms_velocity=swing,
        set_point=middle,
        mean_force=float(force[late].mean()),
        rms_force=float(force[late].std()),
        peak_force=float(np.abs(force).max()),
        disturbed_force=float(np.abs(force[round(_START * len(rows)) :]).max()),
        at_limit=float((np.abs(force) >= limit).mean()),
    )
    if is_positioning(scenario):
        return _positioned(outcome, position - target, target, late, tolerance, plant.rate)
    allowed = tolerance * abs(drive.belt_speed)
    if disturbance.kind == "sine":
        return replace(outcome, held=outcome.sticking == 0.0)
    ends = {"step": _END, "none": 0.0}.get(disturbance.kind, _START) * duration
    omega = drive.angular_frequency if drive.has_spring else 0.0
    distance = np.hypot(omega * (position - middle), velocity)
    return replace(
        outcome,
        held=outcome.sticking == 0.0 and swing <= allowed,
        settling_time=settling_time(distance, 2.0 * allowed, ends, plant.rate),
    )


def _positioned(
    outcome: Outcome,
    error: FloatArray,
    target: FloatArray,
    late: slice,
    tolerance: float,
    rate: float,
) -> Outcome:
    """Return an outcome with what positioning on a guide at rest has."""
    allowed = tolerance * (float(np.ptp(target)) or float(np.abs(target).max()) or 1.0)
    moving = np.flatnonzero(np.diff(target))
    ends = (int(moving[-1]) + 1) / rate if len(moving) else 0.0
    amplitude, period = hunting(error[late], allowed, rate)
    final = float(np.abs(error[late]).max())
    following = followed(np.arange(len(error)) / rate, target, target + error)
    values = {} if following is None else vars(following.values)
    return replace(
        outcome,
        **{name: values.get(name) for name in FOLLOWING},
        held=final <= allowed,
        settling_time=settling_time(np.abs(error), allowed, ends, rate),
        final_error=final,
        hunting_amplitude=amplitude,
        hunting_period=period,
    )


def settling_time(distance: FloatArray, allowed: float, start: float, rate: float) -> float | None:
    """Return the time from `start` on, s, until a distance stays at most `allowed`.

    `distance` is that from the rest, shape (samples,), at `rate` samples per second. None if its
    last value is larger.
    """
    beyond = np.flatnonzero(distance > allowed)
    if len(beyond) and beyond[-1] == len(distance) - 1:
        return None
    last = (int(beyond[-1]) + 1) / rate if len(beyond) else 0.0
    return max(last - start, 0.0)


def hunting(error: FloatArray, least: float, rate: float) -> tuple[float, float | None]:
    """Return amplitude (m) and mean period (s) of a vibration about the reference.

    `error` is the displacement from the reference, m, shape (samples,), at `rate` samples per
    second. A swing counts where it passes a third of the amplitude on either side of the middle.
    The amplitude, half the range, is 0 and the period None if it is not above `least` (m), or if
    there are not two whole periods.
    """
    amplitude = float(np.ptp(error)) / 2.0
    middle = error - (error.max() + error.min()) / 2.0
    rows = rises(middle, amplitude / 3.0)
    if amplitude <= least or len(rows) < 3:
        return 0.0, None
    return amplitude, float(rows[-1] - rows[0]) / (len(rows) - 1) / rate
