"""The sampled loop: samples out, forces in, with hold, delay and time-outs, as a state machine.

It knows no clock and no messages: its user decides when to advance. The plant node and `simulate`
run this same loop.
"""

from collections.abc import Callable
from math import isfinite
from typing import TYPE_CHECKING

from stickslip_ros.model.drive import Drive
from stickslip_ros.model.sensor import EXACT_SENSOR, Sensor
from stickslip_ros.model.signals import NO_SIGNAL, Signal
from stickslip_ros.motion.force_answers import Answers, Verdict
from stickslip_ros.motion.force_line import ForceLine
from stickslip_ros.motion.sampler import Sampler, SampleStamps
from stickslip_ros.samples import Sample
from stickslip_ros.stamps import NANOSECONDS

if TYPE_CHECKING:  # a node without a motion needs no heyoka
    from stickslip_ros.motion.motion import Motion

LOCKSTEP_START = NANOSECONDS
"""Stamp of the first sample if no clock gives one, ns; ROS uses zero for "not set"."""


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

    With `answer_every` only each n-th sample asks for a force, from sample 0 on: a controller that
    is slower than the sampling. The last force is held at the samples between, and what answers
    them is refused. After a gap the first force to any sample counts from there.

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
    answer_every : int, optional
        Number of samples from one that asks for a force to the next.
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
        answer_every: int = 1,
        expects_control: bool = True,
        disturbance: Signal = NO_SIGNAL,
        sensor: Sensor = EXACT_SENSOR,
        motor_sensor: Sensor = EXACT_SENSOR,
        overtaken: Callable[[int, float], None] = lambda stamp, force: None,
        advance: Callable[[float, float, float], None] | None = None,
    ) -> None:
        self.period = 1.0 / rate
        """Sample period T, s."""
        self.stamps = SampleStamps(start, rate)
        """Stamps of the samples."""
        self.answers = Answers(
            self.stamps,
            self.period,
            force_timeout=force_timeout,
            hold_late=hold_late,
            expects_control=expects_control,
            overtaken=overtaken,
            every=answer_every,
        )
        """Forces that have answered samples, with counts of those that were late or dropped."""
        self._motion = motion
        self._advance = advance or motion.advance_under
        self._line = ForceLine(
            force_delay / self.period, force_jitter / self.period, force_jitter_seed
        )
        self._line.limiter = motion.drive.actuator.limiter
        self._sampler = Sampler(motion, self.period, sensor, motor_sensor)
        # What the next sample takes: a drive, and position (m) and velocity (m/s) of the slide.
        self._next_drive: Drive | None = None
        self._next_start: tuple[float, float] | None = None
        self.follow_disturbance(disturbance)
        self.asked_disturbance = 0.0
        """Disturbance force set by `disturb`, N; acts from the next sample on."""
        self.disturbance = 0.0
        """Disturbance force from the present sample to the next, N."""
        motion.restart_signals()
        self.sample_number = 0
        """Number of the present sample."""
        self.sample = self._take_sample(0.0)
        """The present sample, as the sensor measures it."""

    @property
    def true_sample(self) -> Sample:
        """State of slide and belt at the present sample."""
        return self._sampler.true_sample(self.sample)

    @property
    def asks(self) -> bool:
        """Whether the present sample asks for a force: otherwise the last one is held."""
        return self.answers.asks(self.sample_number)

    @property
    def answered(self) -> bool:
        """Whether the force for the present sample has arrived, or it asks for none."""
        return self.answers.newest == self.sample_number or not self.asks

    @property
    def is_ideal(self) -> bool:
        """Whether exact samples are answered at once, and only the answers act on the slide."""
        return (
            self._line.immediate
            and self.answers.every == 1
            and self._line.limiter is None
            and self._scenario_disturbance is None
            and self.disturbance == self.asked_disturbance == 0.0
            and self._sampler.is_plain
            and self.stamps.period.denominator == 1
            and self._next_drive is None
            and self._next_start is None
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
        return self._line.acting

    def offer(self, stamp: int, force: float) -> Verdict:
        """Offer a force as the answer to a sample; return ACCEPTED, or why it will not act.

        Parameters
        ----------
        stamp : int
            Stamp of the sample that the force answers, ns.
        force : float
            Control force, N.
        """
        return self.answers.offer(stamp, force, self.sample_number, self.sample.stamp)

    def command(self, force: float, instant: float | None = None) -> Verdict:
        """Offer a force that names no sample.

        Return ACCEPTED, SUPERSEDED for a command after the one that answers, or NOT_FINITE.

        Parameters
        ----------
        force : float
            Control force, N.
        instant : float, optional
            When it arrives, periods after the present sample: from then on, plus `force_delay`, it
            acts until the next command. By default it answers the present sample, if it is the
            first command that does.
        """
        if not isfinite(force):
            return self.answers.refuse(Verdict.NOT_FINITE)
        if instant is None:
            return Verdict.SUPERSEDED if self.answered else self.offer(self.sample.stamp, force)
        self._line.command(self.sample_number, max(instant, 0.0), force)
        self.answers.note_controller()
        return Verdict.ACCEPTED

    def hold(self) -> None:
        """Answer the present sample with the last force: no command comes for it."""
        self.answers.hold(self.sample_number)

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
        self._next_drive = drive

    def reset(self, position: float, velocity: float) -> None:
        """Set the state of the slide at the next sample.

        Parameters
        ----------
        position : float
            Displacement of the slide, m.
        velocity : float
            Velocity of the slide, m/s.
        """
        self._next_start = position, velocity

    def advance(self) -> Sample:
        """Advance with the forces that have arrived; return the next sample, as it is measured.

        Raises RunError if the motion is so stiff that it would take too many steps.
        """
        present, line, left = self.sample_number, self._line, self.period
        if not line.by_arrival and (due := self.answers.due(present)) is not None:
            for lost in line.send(present, *due):
                self.answers.lose(*lost)
        if not line.immediate:
            now = 0.0
            for instant in line.arrivals(present):
                if instant > now:
                    self._advance(line.acting, self.disturbance, (instant - now) * self.period)
                    now = instant
            left = (1.0 - now) * self.period
        self._advance(line.acting, self.disturbance, left)
        belt_position, belt = self.sample.belt_position + self._sampler.travel, self._sampler.belt
        if belt is not None:
            belt_position += belt.integral(present * self.period, (present + 1) * self.period)
        self.sample_number = present + 1
        self.sample = sample = self._take_sample(belt_position)
        return sample

    def skip(self, samples: int, force: float) -> None:
        """Continue an ideal loop after samples that were answered elsewhere.

        Parameters
        ----------
        samples : int
            Their number.
        force : float
            Answer to the last one, N.
        """
        belt_position, travel = self.sample.belt_position, self._sampler.travel
        for _ in range(samples):  # with the rounding of single ones
            belt_position += travel
        self.sample_number += samples
        last = self.sample_number - 1
        self.answers.accept(last, force)
        due = self.answers.due(last)
        assert due is not None  # an ideal loop asks for a force at each sample
        self._line.send(last, *due)
        self.sample = self._take_sample(belt_position)

    def _take_sample(self, belt_position: float) -> Sample:
        number, friction_force = self.sample_number, None
        if self._next_drive is not None or self._next_start is not None:
            friction_force = self._change()
        disturbance = 0.0
        if self._scenario_disturbance is not None:
            disturbance = self._scenario_disturbance.at(number * self.period)
        self.disturbance = disturbance + self.asked_disturbance
        return self._sampler.take(self.stamps.stamp(number), belt_position, friction_force)

    def _change(self) -> float:
        """Take the drive and the state that were set since the last sample.

        Return the friction force (N) under the force held so far: that of the old drive, unless the
        state is new.
        """
        motion, friction_force = self._motion, self._motion.friction_force
        drive, start = self._next_drive, self._next_start
        self._next_drive = self._next_start = None
        if drive is not None:
            motion.drive = drive
            self._line.limiter = drive.actuator.limiter
            self._sampler.follow_drive()
        if start is not None:
            motion.restart(*start)
            self._sampler.restart_sensors(self.sample_number)
            friction_force = motion.friction_force
        return friction_force
