"""The position controller of an axis, found from its record, and the loop that it closes."""

from dataclasses import dataclass
from math import inf

import numpy as np

from stickslip_ros.arrays import FloatArray, rms
from stickslip_ros.identification.filtered import START
from stickslip_ros.identification.predictor import Predictor
from stickslip_ros.identification.record import FEWEST, Record
from stickslip_ros.model.drive import Drive
from stickslip_ros.motion.motion import Motion
from stickslip_ros.motion.sampled_loop import LOCKSTEP_START, SampledLoop

_LONGEST_DIFFERENCE = 8
"""Most samples over which the controller's velocity may be a difference."""
_LARGEST_ERROR = 0.02
"""Largest error of a controller that is believed, as a share of its force."""
_LIMIT_SAMPLES = 5
"""Samples at the largest force from which on it counts as a limit."""
_FREE_SHARE = 0.98
"""Share of the largest force up to which forces are those of the gains."""
_TRIMS = 10
"""Number of fits, each without the outliers of the one before."""
_INLIER_SHARE, _OUTLIER_RATIO = 0.7, 4.0
"""This share of the samples at least must be no outliers. An outlier has an error that is larger by
this factor than the errors of so many samples."""
_ADDED_FORCE_RATIO = 10.0
"""Size of a force that was added to the command, in largest errors of the controller."""


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
    error: float = 0.0
    """Largest difference from the forces of its record, N, apart from forces added to them."""

    def added(self, record: Record) -> FloatArray:
        """Return what was added to the command of the controller, as taps are; N, zero elsewhere.

        It is what the recorded force has beyond the controller's own, where it is clearly more than
        the controller leaves unexplained. Another controller would leave such forces, too.
        """
        assert record.force is not None
        assert record.reference is not None
        speed = _differences(record, self.difference_samples)
        wanted = self.position_gain * (record.reference - record.position)
        command = np.clip(wanted - self.velocity_gain * speed, -self.limit, self.limit)
        rest = record.force - command
        rest[: self.difference_samples] = 0.0
        return np.where(np.abs(rest) > _ADDED_FORCE_RATIO * self.error, rest, 0.0)


def servo_of(record: Record) -> Servo | None:
    """Return the controller whose forces a record has; None if it has no such controller.

    Gains are from linear least squares, for the difference that explains most, over the samples
    with a finite reference. Samples far from the fit are left out and it is made again, up to ten
    times: a least trimmed squares (P. J. Rousseeuw, Journal of the American Statistical
    Association 79, 1984) whose share is not given but follows from the errors.
    """
    if record.reference is None or record.force is None or not record.force.any():
        return None
    known = np.isfinite(record.reference)
    if np.count_nonzero(known) < FEWEST:
        return None
    force, error = record.force, record.reference - record.position
    largest = float(np.abs(force).max())
    at_limit = np.count_nonzero(np.abs(force) >= (1.0 - 1e-9) * largest)
    limit = largest if at_limit >= _LIMIT_SAMPLES else inf
    free = known & (np.abs(force) < _FREE_SHARE * largest)
    free[:START] = False
    best: tuple[float, Servo] | None = None
    for span in range(1, _LONGEST_DIFFERENCE + 1):
        terms = np.column_stack([error, -_differences(record, span)])
        used, gains, left = free, np.zeros(2), np.zeros_like(force)
        for _ in range(_TRIMS):
            gains = np.linalg.lstsq(terms[used], force[used], rcond=None)[0]
            left = np.abs(force - terms @ gains)
            # Forces that were added to the command are none of the controller's.
            used = free & (left <= _OUTLIER_RATIO * float(np.quantile(left[free], _INLIER_SHARE)))
        left = left[used]
        share = rms(left) / rms(force[used])
        if np.count_nonzero(used) > _INLIER_SHARE * np.count_nonzero(free) and (
            best is None or share < best[0]
        ):
            servo = Servo(float(gains[0]), float(gains[1]), span, limit, float(left.max()))
            best = share, servo
    return best[1] if best is not None and best[0] < _LARGEST_ERROR else None


def _differences(record: Record, span: int) -> FloatArray:
    """Return the velocity as the difference of positions over some samples."""
    position = record.position
    speed = np.zeros_like(position)
    speed[span:] = (position[span:] - position[:-span]) / (span * record.period)
    return speed


def closed_loop(
    record: Record, drive: Drive, servo: Servo, delay: float
) -> tuple[FloatArray, FloatArray]:
    """Return positions, m, and forces, N, of a drive that the servo leads along the reference.

    It starts from the measured state of the record and has the record's belt. `delay` is the time
    from a sample until its force acts, s; a force cannot act before it, and a disturbance is never
    late.
    """
    assert record.reference is not None
    span, period = servo.difference_samples, record.period
    position = record.position
    velocity = float(position[span] - position[0]) / (span * period)
    belt = Predictor(record).with_belt(drive)
    motion = Motion(belt, float(position[0]), velocity)
    loop = SampledLoop(motion, 1.0 / period, LOCKSTEP_START, force_delay=max(delay, 0.0))
    # Before the record the slide moves as at its start.
    positions = [float(position[0]) - velocity * period * number for number in range(span, 0, -1)]
    added = np.zeros(len(position)) if record.force is None else servo.added(record)
    _, disturbance = record.held_forces
    loop.disturbance = float(disturbance[0])
    forces: list[float] = []
    sample = loop.sample
    inputs = zip(record.reference.tolist(), added.tolist(), strict=True)
    for number, (wanted, more) in enumerate(inputs):
        positions.append(sample.position)
        speed = (positions[-1] - positions[-1 - span]) / (span * period)
        force = servo.position_gain * (wanted - sample.position) - servo.velocity_gain * speed
        force = min(max(force, -servo.limit), servo.limit) + more
        forces.append(force)
        if number == len(position) - 1 or motion.unbounded:
            break
        loop.offer(sample.stamp, force)
        loop.disturb(float(disturbance[number + 1]))
        sample = loop.advance()
    predicted = np.full((2, len(position)), np.nan)
    predicted[0, : len(forces)], predicted[1, : len(forces)] = positions[span:], forces
    return predicted[0], predicted[1]
