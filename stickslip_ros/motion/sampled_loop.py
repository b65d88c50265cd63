"""The sampled loop: samples out, forces in, with hold, delay and time-outs, as a state machine.

It knows no clock and no messages: its user decides when to advance. The plant node and `simulate`
run this same loop.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from enum import StrEnum
from fractions import Fraction
from math import isfinite
from typing import TYPE_CHECKING

from stickslip_ros.model.drive import Drive
from stickslip_ros.model.sensor import EXACT_SENSOR, Sensor
from stickslip_ros.model.signals import NO_SIGNAL, Signal
from stickslip_ros.motion.forces_under_way import ForcesUnderWay
from stickslip_ros.samples import MotorSample, Sample
from stickslip_ros.stamps import NANOSECONDS

if TYPE_CHECKING:  # a node without a motion needs no heyoka
    from stickslip_ros.motion.motion import Motion

LOCKSTEP_START = NANOSECONDS
"""Stamp of the first sample if no clock gives one, ns; ROS uses zero for "not set"."""


class Verdict(StrEnum):
    """Result of offering a force to the loop."""

    ACCEPTED = "accepted"
    NOT_FINITE = "not finite"
    NO_STAMP = "zero stamp"
    UNKNOWN_STAMP = "stamp of no sample"
    ANSWERED = "already answered stamp"
    TOO_LATE = "answers a sample that has passed"
    OVERTAKEN = "overtaken by a newer one"
    """The force was accepted, and a newer one came before it could act."""
    SUPERSEDED = "came after the command that answers the sample"


_ACCEPTED = Verdict.ACCEPTED  # in Python 3.11 looking it up takes a thirtieth of a sample


class SampledLoop:
    """Motion that is sampled at a fixed rate, and driven by forces that answer the samples.

    Force n, the answer to sample n, arrives at n T + delay, T = 1/rate, and acts until the next
    force arrives. If it is missing when the loop advances, the newest force is held if `hold_late`
    is set (as in real time) and the force is not older than `force_timeout`; otherwise the force is
    zero. This replacement arrives when force n would have arrived.

    The delay of force n is `force_delay` plus a share of `force_jitter`, uniformly distributed and
    independent from sample to sample; it depends only on n and `force_jitter_seed`. Forces with
    jitter therefore arrive at uneven intervals, and may overtake one another: then the newer force
    acts, and the older one, which arrives after it, is lost. Without jitter the delay is constant:
    force n acts from n T + delay to (n + 1) T + delay. The actuator of the drive limits a force
    when it arrives.

    A `command` is a force that names no sample, as controllers of other machines send it.

    Parameters
    ----------
    motion : Motion
        Motion to sample and to drive; sample 0 is its present state, and the signals of belt and
        load start with it.
    rate : float
        Samples per second, Hz.
    start : int
        Stamp of sample 0, ns.
    force_delay : float, optional
        Shortest delay from a sample to its force, s.
    force_jitter : float, optional
        Longest additional delay, s.
    force_jitter_seed : int, optional
        Seed of the additional delays.
    force_timeout : float, optional
        Age up to which a force is held, s.
    hold_late : bool, optional
        Whether the newest force is held while a force is missing. By default the force is zero.
    expects_control : bool, optional
        Whether a controller is expected: then missing forces count as late.
    disturbance : Signal, optional
        Disturbance force of the scenario. By default there is none.
    sensor : Sensor, optional
        Sensor that measures the samples. By default it is exact.
    motor_sensor : Sensor, optional
        Sensor of a motor of finite mass. By default it is exact.
    overtaken : callable, optional
        Called as overtaken(stamp, force) for each force that was accepted and will never act,
        because a newer one came or arrived before it: the stamp (ns) of the sample that it answers,
        and the force (N).
    advance : callable, optional
        Replaces the `advance_under` of `motion`, see `MotionTracer`.
    """

    def __init__(
        self,
        motion: "Motion",
        rate: float,
        start: int,
        *,
        force_delay: float = 0.0,
        force_jitter: float = 0.0,
        force_jitter_seed: int = 0,
        force_timeout: float = float("inf"),
        hold_late: bool = False,
        expects_control: bool = True,
        disturbance: Signal = NO_SIGNAL,
        sensor: Sensor = EXACT_SENSOR,
        motor_sensor: Sensor = EXACT_SENSOR,
        overtaken: Callable[[int, float], None] = lambda stamp, force: None,
        advance: Callable[[float, float, float], None] | None = None,
    ) -> None:
        self.period = 1.0 / rate
        """Sample period T, s."""
        self.late_forces = 0
        """Number of samples whose force was missing when it was due."""
        self.dropped: Counter[Verdict] = Counter()
        """Number of forces that did not act, by reason."""
        self.silent_samples = 0
        """Number of samples for which `hold` took the last command again."""
        self.controller_present = expects_control
        """Whether an answer to the present sample can be expected: one came since the last gap."""
        self._motion = motion
        self._advance = advance or motion.advance_under
        self._start = start
        # Sample period in ns, as an exact ratio.
        self._nanoseconds, self._samples = (NANOSECONDS / Fraction(rate)).as_integer_ratio()
        self._under_way = ForcesUnderWay(
            force_delay / self.period, force_jitter / self.period, force_jitter_seed
        )
        self._immediate = self._under_way.immediate
        self._force_timeout = force_timeout
        self._hold_late = hold_late
        self._expects_control = expects_control
        self._acting = 0.0
        self._newest: tuple[int, float] = (-1, 0.0)
        self._sent_number = -1
        self._overtaken = overtaken
        self._by_arrival = False
        self.follow_disturbance(disturbance)
        self.asked_disturbance = 0.0
        """Disturbance force set by `disturb`, N; acts from the next sample on."""
        self.disturbance = 0.0
        """Disturbance force from the present sample to the next, N."""
        self._next_drive: Drive | None = None
        self._next_start: tuple[float, float] | None = None
        self._changes = False
        self._take_drive()
        self._sensor, self._motor_sensor = sensor, motor_sensor
        self._start_sensors()
        motion.restart_signals()
        self.sample_number = 0
        """Number of the present sample."""
        self.sample = self._take_sample(0.0)
        """The present sample, as the sensor measures it."""

    @property
    def true_sample(self) -> Sample:
        """State of slide and belt at the present sample."""
        if not self._measures:
            return self.sample
        position, velocity, motor = self._true
        return self.sample._replace(position=position, velocity=velocity, motor=motor)

    @property
    def answered(self) -> bool:
        """Whether the force for the present sample has arrived."""
        return self._newest[0] == self.sample_number

    @property
    def is_ideal(self) -> bool:
        """Whether exact samples are answered at once, and only the answers act on the slide."""
        return (
            self._immediate
            and self._samples == 1
            and self._limiter is self._moving_belt is self._scenario_disturbance is None
            and self.disturbance == self.asked_disturbance == 0.0
            and not (self._measures or self._changes)
            and self._advance == self._motion.advance_under
        )

    @property
    def unbounded(self) -> bool:
        """Whether the motion is unbounded."""
        return self._motion.unbounded

    @property
    def applied_force(self) -> float:
        """Force of the actuator on the slide, N, held up to the present sample or lagging."""
        motion = self._motion
        if motion.drive.actuator.states:
            return motion.applied_force - motion.disturbance
        return self._acting

    def stamp(self, number: int) -> int:
        """Return the stamp of a sample.

        Parameters
        ----------
        number : int
            Number of the sample, from 0.

        Returns
        -------
        int
            Stamp, ns.
        """
        since = number * self._nanoseconds
        return self._start + (since if self._samples == 1 else _rounded(since, self._samples))

    def offer(self, stamp: int, force: float) -> Verdict:
        """Offer a force as the answer to a sample.

        Parameters
        ----------
        stamp : int
            Stamp of the sample that the force answers, ns.
        force : float
            Control force, N.

        Returns
        -------
        Verdict
            ACCEPTED, or the reason why the force will not act.
        """
        present, newest = self.sample_number, self._newest[0]
        is_present = stamp == self.sample.stamp
        number = present if is_present else self.number(stamp)
        if not isfinite(force):
            refusal = Verdict.NOT_FINITE
        elif stamp == 0:
            refusal = Verdict.NO_STAMP
        elif not (is_present or (0 <= number < present and self.stamp(number) == stamp)):
            refusal = Verdict.UNKNOWN_STAMP
        elif number <= newest:
            refusal = Verdict.ANSWERED
        elif number < present and not self._hold_late:
            refusal = Verdict.TOO_LATE
        else:
            self._accept(number, force)
            return _ACCEPTED
        self.dropped[refusal] += 1
        if refusal is Verdict.TOO_LATE:
            self.controller_present = self._expects_control
        return refusal

    def command(self, force: float, instant: float | None = None) -> Verdict:
        """Offer a force that names no sample.

        Parameters
        ----------
        force : float
            Control force, N.
        instant : float, optional
            When it arrives, periods after the present sample: from then on, plus `force_delay`, it
            acts until the next command. By default it answers the present sample, if it is the
            first command that does.

        Returns
        -------
        Verdict
            ACCEPTED, SUPERSEDED for a command after the first one, or NOT_FINITE.
        """
        if instant is None:
            if isfinite(force) and self.answered:
                return Verdict.SUPERSEDED
            return self.offer(self.sample.stamp, force)
        if not isfinite(force):
            self.dropped[Verdict.NOT_FINITE] += 1
            return Verdict.NOT_FINITE
        self._under_way.send_late(self.sample_number, max(instant, 0.0), force)
        self._by_arrival, self._immediate = True, False
        self.controller_present = self._expects_control
        return Verdict.ACCEPTED

    def hold(self) -> None:
        """Answer the present sample with the last force: no command comes for it."""
        self._newest = (self.sample_number, self._newest[1])
        self.silent_samples += 1

    def follow_disturbance(self, signal: Signal) -> None:
        """Take another disturbance of the scenario from the next sample on.

        Parameters
        ----------
        signal : Signal
            Disturbance force, N, held from sample to sample.
        """
        self._scenario_disturbance = signal.held(self.period) if signal.pieces else None

    def disturb(self, force: float) -> None:
        """Add a disturbance force from the next sample on, until you set it again.

        Parameters
        ----------
        force : float
            Disturbance force, N; added to that of the scenario.
        """
        self.asked_disturbance = force

    def change_drive(self, drive: Drive) -> None:
        """Replace the drive from the next sample on.

        Parameters
        ----------
        drive : Drive
            New drive; the slide keeps its position and velocity, and its actuator its state.
        """
        self._next_drive, self._changes = drive, True

    def reset(self, position: float, velocity: float) -> None:
        """Set the state of the slide at the next sample.

        Parameters
        ----------
        position : float
            Displacement of the slide, m.
        velocity : float
            Velocity of the slide, m/s.
        """
        self._next_start, self._changes = (position, velocity), True

    def advance(self) -> Sample:
        """Advance to the next sample with the forces that have arrived.

        Returns
        -------
        Sample
            State of slide and belt at the next sample, as the sensor measures it.

        Raises
        ------
        RunError
            If the motion is so stiff that it would take too many steps.
        """
        present, period, left = self.sample_number, self.period, self.period
        if not self._by_arrival:
            number, force = self._newest
            if number != present:
                number, force = self._stand_in()
            if number > self._sent_number:
                self._sent_number = number
            if self._immediate:
                self._acting = force if self._limiter is None else self._limiter(force)
            else:
                for lost in self._under_way.send(present, number, force):
                    self._lose(*lost)
        if not self._immediate:
            left = (1.0 - self._deliver()) * period
        self._advance(self._acting, self.disturbance, left)
        belt_position = self.sample[4] + self._travel
        if self._moving_belt is not None:
            belt_position += self._moving_belt.integral(present * period, (present + 1) * period)
        self.sample_number = present + 1
        self.sample = sample = self._take_sample(belt_position)
        return sample

    def skip(self, samples: int, force: float) -> None:
        """Continue after samples that were answered elsewhere.

        Parameters
        ----------
        samples : int
            Their number.
        force : float
            Answer to the last one, N.
        """
        belt_position = self.sample.belt_position
        for _ in range(samples):  # with the rounding of single ones
            belt_position += self._travel
        self.sample_number += samples
        self._accept(self.sample_number - 1, force)
        self._sent_number, self._acting = self.sample_number - 1, force
        self.sample = self._take_sample(belt_position)

    def run(self, answer: Callable[[Sample], float | None]) -> Iterator[float]:
        """Answer each sample immediately and advance to the next one, without end.

        Parameters
        ----------
        answer : callable
            Returns the control force (N, finite) for a sample, or None for no answer.

        Yields
        ------
        float
            Control force for the sample before the present one, N; 0 for no answer.
        """
        while True:
            force = answer(self.sample)
            if force is not None:
                self._accept(self.sample_number, force)
            self.advance()
            yield 0.0 if force is None else force

    def _accept(self, number: int, force: float) -> None:
        if self._newest[0] > self._sent_number:
            self._lose(*self._newest)
        self._newest = (number, force)
        self.controller_present = self._expects_control

    def _deliver(self) -> float:
        """Apply the forces that arrive in the present period; return when the newest one does.

        In periods from the present sample on.
        """
        now = 0.0
        for instant, force in self._under_way.arriving(self.sample_number):
            if instant > now:
                self._advance(self._acting, self.disturbance, (instant - now) * self.period)
                now = instant
            self._acting = force if self._limiter is None else self._limiter(force)
        return now

    def _lose(self, number: int, force: float) -> None:
        self.dropped[Verdict.OVERTAKEN] += 1
        self._overtaken(self.stamp(number), force)

    def _take_sample(self, belt_position: float) -> Sample:
        number = self.sample_number
        position, velocity, friction_force, belt_speed, motor = self._motion.reading()
        if self._changes:
            friction_force = self._change(friction_force)
            position, velocity, _, belt_speed, motor = self._motion.reading()
        disturbance = 0.0
        if self._scenario_disturbance is not None:
            disturbance = self._scenario_disturbance.at(number * self.period)
        self.disturbance = disturbance + self.asked_disturbance
        if self._measures:
            self._true = position, velocity, motor
            if self._measure is not None:
                position, velocity = self._measure(number, position, velocity)
            if motor is not None and self._measure_motor is not None:
                motor = MotorSample(*self._measure_motor(number, *motor))
        stamp = self.stamp(number)
        values = stamp, position, velocity, friction_force, belt_position, belt_speed, motor
        return tuple.__new__(Sample, values)  # half as long as the constructor

    def _change(self, friction_force: float) -> float:
        """Take the drive and the state that were set since the last sample; return the friction."""
        motion, self._changes = self._motion, False
        if self._next_drive is not None:
            motion.drive, self._next_drive = self._next_drive, None
            self._take_drive()
        if self._next_start is not None:
            start, self._next_start = self._next_start, None
            motion.restart(*start)
            self._start_sensors()
            return motion.friction_force
        return friction_force

    def _take_drive(self) -> None:
        drive = self._motion.drive
        self._limiter = drive.actuator.limiter
        self._travel = drive.belt_speed * self.period
        self._moving_belt = drive.belt if drive.belt.pieces else None

    def _start_sensors(self) -> None:
        self._measure = self._sensor.start(self.period)
        self._measure_motor = self._motor_sensor.start(self.period)
        self._measures = self._measure is not None or self._measure_motor is not None

    def _stand_in(self) -> tuple[int, float]:
        """Return the replacement for the missing force of the present sample.

        The first value is the number of the sample that it answers, -1 for no force.
        """
        if self._expects_control:
            self.late_forces += 1
        number, force = self._newest
        age = (self.sample_number - number) * self.period
        if self._hold_late and age <= self._force_timeout:
            return number, force
        self.controller_present = False
        return -1, 0.0

    def number(self, stamp: int) -> int:
        """Return the number of the sample whose stamp is nearest.

        Parameters
        ----------
        stamp : int
            Stamp, ns.

        Returns
        -------
        int
            Number of the sample; negative before sample 0.
        """
        if stamp == self.sample.stamp:
            return self.sample_number
        return _rounded((stamp - self._start) * self._samples, self._nanoseconds)


def _rounded(numerator: int, denominator: int) -> int:
    """Return the quotient rounded to the nearest whole number; a half is rounded to even."""
    whole, rest = divmod(numerator, denominator)
    excess = 2 * rest - denominator
    return whole + (excess > 0 or (excess == 0 and whole % 2))
