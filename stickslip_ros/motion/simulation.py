"""Simulation of the closed loop without ROS, sampled or continuous as in the paper."""

from collections.abc import Iterator
from itertools import islice
from math import ceil, inf

import numpy as np

from stickslip_ros.measures.cycle_measures import Measures
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.measures.run_meter import RunObserver
from stickslip_ros.measures.sample_meter import MeasuredMotion, MotionObserver, SampleMeter
from stickslip_ros.model.control import ControlLaw
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.motion.controller import Controller, answer
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.motion.tick_blocks import LEAST_TICKS, TickBlocks
from stickslip_ros.motion.trajectory import SampleRecorder
from stickslip_ros.progress import Progress
from stickslip_ros.samples import Sample, SampleColumns

_BLOCK = 1000
"""Number of samples after which meters and observers receive the motion."""

_STEPS_PER_PERIOD = 60
"""Least number of steps in a natural period: a line through their ends then shows the motion."""


_ROUNDING = 1e-12
"""Rounding of the motion, in length and speed scales, with a few digits to spare."""


class MotionTracer:
    """Advances a motion in short steps, and passes its forces and the motion to an observer."""

    def __init__(
        self, motion: RecordedMotion, observer: RunObserver, longest_period: float = inf
    ) -> None:
        """Trace a motion; the steps are parts of its natural period, of at most this one (s)."""
        self._motion, self._observer, self._longest_period = motion, observer, longest_period
        self._now = 0.0
        self._forces: list[tuple[float, float, float, float]] = []
        """Time (s) and force (N) from then on; time, and friction force (N) up to then."""
        self._motor: list[tuple[float, ...]] = []
        """The same times, and the states of slide and motor, if it has a mass."""

    def advance_under(self, control: float, disturbance: float, duration: float) -> None:
        """Set the forces (N), and advance; see `Motion.advance_under`."""
        self._motion.set_forces(control, disturbance)
        self.advance(duration)

    def advance(self, duration: float) -> None:
        """Advance the motion by `duration` (s), or until it is unbounded."""
        motion = self._motion
        period = min(motion.drive.natural_period, self._longest_period)
        steps = max(1, ceil(duration / period * _STEPS_PER_PERIOD))
        for number in range(steps):
            if motion.unbounded:
                break
            if number > 0:
                motion.divide()
            start, force = self._now, motion.applied_force
            motion.advance(duration / steps)
            self._now += duration / steps
            self._forces.append((start, force, self._now, motion.friction_force))
            if (motor := motion.motor) is not None:
                self._motor.append((self._now, motion.position, motion.velocity, *motor))

    def take_motion(self, motion: MeasuredMotion) -> None:
        """Pass the motion to the observer, and the forces up to its end."""
        start, force, end, friction = np.array(self._forces).reshape(-1, 4).T
        self._forces.clear()
        self._observer.take_motion(motion)
        self._observer.take_control(start, force, np.ones(len(force), dtype=bool))
        self._observer.take_friction(end, friction)
        if self._motor:
            time, *states = np.array(self._motor).T
            self._observer.take_motor(time, np.array(states))
            self._motor.clear()


def measure_block(
    motion: RecordedMotion, meter: CycleMeter, observer: MotionObserver | None
) -> None:
    """Feed a meter, and an observer, with what `motion` has recorded since the last call.

    The meter does not receive the breakpoints that only divide an advance: what it measures does
    not depend on whether the motion is drawn, or its samples are taken.
    """
    drive, divisions = motion.drive, motion.recorder.take_divisions()
    breakpoints = motion.take_breakpoints()
    meter.rounding = _ROUNDING * drive.speed_scale
    meter.drift.rounding = _ROUNDING * drive.length_scale
    measured = breakpoints
    if divisions:
        measured = breakpoints[np.delete(np.arange(len(breakpoints)), divisions)]
    cycles = meter.feed(measured, motion.belt_speed, drive.fastest_belt)
    meter.drift.position.feed(measured.time, measured.position)
    meter.drift.feed_cycles(meter.ends, cycles)
    if observer is not None:
        belt_velocity = np.full(len(breakpoints), drive.belt_speed)
        if drive.belt.pieces:
            belt_velocity += [drive.belt.at(t) for t in motion.clock.signal_times(breakpoints.time)]
        observer.take_motion(MeasuredMotion(breakpoints, belt_velocity, cycles, meter.ends))


def _ticks(
    loop: SampledLoop,
    controller: Controller | None,
    recorder: SampleRecorder | None = None,
    seen: list[Sample] | None = None,
) -> Iterator[float]:
    """Answer each sample and advance to the next, without end; yield the forces.

    A recorder takes each sample, and the next is added to `seen`.
    """
    while True:
        force = answer(loop, controller)
        if recorder is not None:
            recorder.take(loop.true_sample, force, loop.sample)
        loop.advance()
        if seen is not None:
            seen.append(loop.sample)
        yield force


def _forces(
    ticks: Iterator[float], blocks: TickBlocks | None, motion: RecordedMotion, count: int
) -> list[float]:
    """Return the forces of so many ticks, or until the motion is unbounded."""
    forces = list[float]()
    while len(forces) < count and not motion.unbounded:
        left = count - len(forces)
        if blocks is not None:
            forces += blocks.advance(left)
            left = min(count - len(forces), blocks.left)
        for force in islice(ticks, left):
            forces.append(force)
            if motion.unbounded:
                break
    return forces


def simulate_sampled(
    loop: SampledLoop,
    motion: RecordedMotion,
    controller: Controller | None,
    duration: float,
    meter: CycleMeter,
    progress: Progress = lambda _: None,
    observer: MotionObserver | None = None,
    recorder: SampleRecorder | None = None,
    measured: SampleMeter | None = None,
) -> Measures:
    """Simulate the sampled loop and measure its motion.

    Parameters
    ----------
    loop, motion : SampledLoop, RecordedMotion
        Loop to advance, and its motion.
    controller : Controller or None
        Controller that answers the samples; None for no control.
    duration : float
        Simulated time, s; rounded to whole samples.
    meter : CycleMeter
        Meter that receives the motion.
    progress : callable, optional
        Called with the completed share, 0 to 1, every 1000 samples.
    observer : MotionObserver, optional
        Receives the motion in blocks.
    recorder : SampleRecorder, optional
        Takes each sample with the control force that answers it.
    measured : SampleMeter, optional
        Receives the samples as the sensor measures them.

    Raises
    ------
    RunError
        If the motion is so stiff that it would take too many steps.
    """
    samples, done = round(duration / loop.period), 0
    seen, blocks = [loop.sample], None
    if recorder is not None or measured is not None:
        ticks = _ticks(loop, controller, recorder, seen)
    else:
        ticks = _ticks(loop, controller)
        if samples >= LEAST_TICKS:
            blocks = TickBlocks.for_loop(loop, motion, controller)
    while done < samples and not motion.unbounded:
        forces = _forces(ticks, blocks, motion, min(_BLOCK, samples - done))
        measure_block(motion, meter, observer)
        times = loop.period * np.arange(done, done + len(forces))
        meter.drift.force.feed(times, forces)
        if measured is not None:
            measured.feed(SampleColumns.from_samples(seen))
            measured.drift.force.feed(times, forces)
        seen.clear()
        done += len(forces)
        progress(done / samples)
    meter.unbounded |= motion.unbounded
    if recorder is not None:
        recorder.take(loop.true_sample, answer(loop, controller), loop.sample)
    return meter.measures()


def simulate_continuous(
    motion: RecordedMotion,
    law: ControlLaw | None,
    duration: float,
    meter: CycleMeter,
    progress: Progress = lambda _: None,
    observer: RunObserver | None = None,
    recorder: SampleRecorder | None = None,
) -> Measures:
    """Simulate a motion with a control law acting without sampling (eq. 19), and measure it.

    The states of the law run from the start, and the force acts after `law.start_after`.

    Parameters
    ----------
    motion : RecordedMotion
        Motion, with continuous control unless `law` is None.
    law : ControlLaw or None
        Control law that has equations; None for no control. `force_limit` is not used.
    duration : float
        Simulated time, s.
    meter : CycleMeter
        Meter that receives the motion.
    progress : callable, optional
        Called with the completed share, 0 to 1, every ten natural periods; without a spring twenty
        times in all.
    observer : RunObserver, optional
        Receives motion and forces in blocks.
    recorder : SampleRecorder, optional
        Takes samples at its rate.

    Raises
    ------
    RunError
        If the motion is so stiff that it would take too many steps.
    """
    drive = motion.drive
    # Without a spring as many blocks and steps as in 200 natural periods.
    period = drive.natural_period if drive.has_spring else duration / 200.0
    tracer = None if observer is None else MotionTracer(motion, observer, period)
    advance = motion.advance if tracer is None else tracer.advance
    if recorder is not None:
        advance = recorder.sampling(motion, advance)
    control = None if law is None else law.continuous
    free = duration if law is None else min(law.start_after, duration)
    block, done = 10.0 * period, 0.0
    for length, acts in ((free, False), (duration - free, True)):
        if control is not None:
            motion.control = control if acts else control.silenced()
        end = done + length
        while done < end and not motion.unbounded:
            step = min(block, end - done)
            advance(step)
            done += step
            measure_block(motion, meter, tracer)
            progress(done / duration)
    if recorder is not None:
        recorder.take_due(motion)
    meter.unbounded |= motion.unbounded
    return meter.measures()
