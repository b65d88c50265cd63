"""The position controller of an axis, found from its record, and the loop that it closes."""

from dataclasses import dataclass
from math import inf

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.filtered import START
from stickslip_ros.identification.record import Record
from stickslip_ros.physics.loop.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.motion.motion import Motion

_LONGEST_DIFFERENCE = 8
_EXPLAINED = 0.02
"""Largest error of a controller that is believed, as a share of its force."""
_SATURATED = 5
"""Samples at the largest force from which on it counts as a limit."""
_BELOW_LIMIT = 0.98


@dataclass(frozen=True)
class Servo:
    """Position controller u = -P (x - r) - D dx, with dx the difference over some samples."""

    position_gain: float
    """Gain P, N/m."""
    velocity_gain: float
    """Gain D, N s/m."""
    difference_samples: int
    """Number of samples of the difference."""
    limit: float
    """Largest force, N; infinite if the record does not reach it."""


def servo_of(record: Record) -> Servo | None:
    """Return the controller whose forces a record has; None if it has no such controller.

    Parameters
    ----------
    record : Record
        Positions, references and forces.

    Returns
    -------
    Servo or None
        Gains from linear least squares, for the difference that explains most.
    """
    if record.reference is None or record.force is None or not record.force.any():
        return None
    if not np.isfinite(record.reference).all():
        return None
    force, position, error = record.force, record.position, record.reference - record.position
    largest = float(np.abs(force).max())
    at_limit = np.count_nonzero(np.abs(force) >= (1.0 - 1e-9) * largest)
    limit = largest if at_limit >= _SATURATED else inf
    free = np.abs(force) < _BELOW_LIMIT * largest
    free[:START] = False
    best: tuple[float, Servo] | None = None
    for span in range(1, _LONGEST_DIFFERENCE + 1):
        speed = np.zeros_like(position)
        speed[span:] = (position[span:] - position[:-span]) / (span * record.period)
        terms = np.column_stack([error, -speed])[free]
        gains, *_ = np.linalg.lstsq(terms, force[free], rcond=None)
        left = force[free] - terms @ gains
        share = float(np.sqrt(np.mean(left**2) / np.mean(force[free] ** 2)))
        if best is None or share < best[0]:
            best = share, Servo(float(gains[0]), float(gains[1]), span, limit)
    return best[1] if best is not None and best[0] < _EXPLAINED else None


def closed_loop(
    record: Record, drive: Drive, servo: Servo, delay: float
) -> tuple[FloatArray, FloatArray]:
    """Return positions and forces of a drive that the controller leads along the reference.

    It starts from the measured state of the record.

    Parameters
    ----------
    record : Record
        Reference, and the first samples.
    drive : Drive
        The model.
    servo : Servo
        The controller.
    delay : float
        Time from a sample until its force acts, s; a force cannot act before it.

    Returns
    -------
    tuple of array of shape (samples,)
        Positions, m, and control forces, N.
    """
    assert record.reference is not None
    span, period = servo.difference_samples, record.period
    position = record.position
    velocity = float(position[span] - position[0]) / (span * period)
    motion = Motion(drive, float(position[0]), velocity)
    loop = SampledLoop(motion, 1.0 / period, LOCKSTEP_START, force_delay=max(delay, 0.0))
    # Before the record the slide moves as at its start.
    positions = [float(position[0]) - velocity * period * number for number in range(span, 0, -1)]
    disturbance = np.zeros(len(position)) if record.disturbance is None else record.disturbance
    forces: list[float] = []
    sample = loop.sample
    references = zip(record.reference.tolist(), disturbance.tolist(), strict=True)
    for number, (wanted, other) in enumerate(references):
        positions.append(sample.position)
        speed = (positions[-1] - positions[-1 - span]) / (span * period)
        force = servo.position_gain * (wanted - sample.position) - servo.velocity_gain * speed
        force = min(max(force, -servo.limit), servo.limit)
        forces.append(force)
        if number == len(position) - 1 or motion.unbounded:
            break
        loop.offer(sample.stamp, force + other)
        sample = loop.advance()
    found = np.full((2, len(position)), np.nan)
    found[0, : len(forces)], found[1, : len(forces)] = positions[span:], forces
    return found[0], found[1]
