"""The samples of a loop: their stamps, and the motion at each, as sensors measure it."""

from fractions import Fraction
from typing import TYPE_CHECKING

from stickslip_ros.model.sensor import Sensor
from stickslip_ros.samples import MotorSample, Sample
from stickslip_ros.stamps import NANOSECONDS

if TYPE_CHECKING:  # a node without a motion needs no heyoka
    from stickslip_ros.motion.motion import Motion


class SampleStamps:
    """Stamps of samples at a fixed rate: the whole nanoseconds nearest to the instants n/rate."""

    def __init__(self, start: int, rate: float) -> None:
        """Start at a stamp, ns, with `rate` samples per second."""
        self._start = start
        self.period = NANOSECONDS / Fraction(rate)
        """Sample period, ns, exactly."""
        self._nanoseconds, self._samples = self.period.as_integer_ratio()

    def stamp(self, number: int) -> int:
        """Return the stamp (ns) of a sample, by its number from 0."""
        since = number * self._nanoseconds
        return self._start + (since if self._samples == 1 else _rounded(since, self._samples))

    def number(self, stamp: int) -> int:
        """Return the number of the sample whose stamp (ns) is nearest; negative before sample 0."""
        return _rounded((stamp - self._start) * self._samples, self._nanoseconds)


class Sampler:
    """Takes samples of a motion, with a sensor of the slide and one of the motor."""

    def __init__(
        self, motion: "Motion", period: float, sensor: Sensor, motor_sensor: Sensor
    ) -> None:
        """Take samples `period` (s) apart."""
        self._motion, self._period = motion, period
        self._sensor, self._motor_sensor = sensor, motor_sensor
        self._true: tuple[float, float, MotorSample | None] = (0.0, 0.0, None)
        self.restart_sensors(0)
        self.follow_drive()

    def restart_sensors(self, number: int) -> None:
        """Start the sensors again at a sample: it does not continue the motion so far."""
        self._measure = self._sensor.start(self._period, number)
        self._measure_motor = self._motor_sensor.start(self._period, number)
        self._measures = self._measure is not None or self._measure_motor is not None

    def follow_drive(self) -> None:
        """Follow the belt of the drive that the motion has now."""
        drive = self._motion.drive
        self.travel = drive.belt_speed * self._period
        """Travel of the belt in a period, m, without that of its signal."""
        self.belt = drive.belt if drive.belt.pieces else None
        """That signal, if there is one."""

    @property
    def is_plain(self) -> bool:
        """Whether samples are exact, and the speed of the belt is constant."""
        return self.belt is None and not self._measures

    def take(self, stamp: int, belt_position: float, friction_force: float | None) -> Sample:
        """Return the sample of a stamp; the friction force (N) is that of the motion if None."""
        position, velocity, friction, belt_speed, motor = self._motion.reading()
        if friction_force is not None:
            friction = friction_force
        if self._measures:
            self._true = position, velocity, motor
            if self._measure is not None:
                position, velocity = self._measure(position, velocity)
            if motor is not None and self._measure_motor is not None:
                motor = MotorSample(*self._measure_motor(*motor))
        values = stamp, position, velocity, friction, belt_position, belt_speed, motor
        return tuple.__new__(Sample, values)  # half as long as the constructor

    def true_sample(self, sample: Sample) -> Sample:
        """Return the newest sample without what the sensors make of it."""
        if not self._measures:
            return sample
        position, velocity, motor = self._true
        return sample._replace(position=position, velocity=velocity, motor=motor)


def _rounded(numerator: int, denominator: int) -> int:
    """Return the quotient rounded to the nearest whole number; a half is rounded to even."""
    whole, rest = divmod(numerator, denominator)
    excess = 2 * rest - denominator
    return whole + (excess > 0 or (excess == 0 and whole % 2))
