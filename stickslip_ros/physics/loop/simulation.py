"""The closed loop without ROS, sampled or continuous as in the paper, and its measures."""

import numpy as np

from stickslip_ros.physics.loop.motion_tracer import MotionTracer
from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.loop.trajectory import TrajectoryRecorder
from stickslip_ros.physics.loop.washout import Washout, WashoutParameters
from stickslip_ros.physics.measures.cycle_measures import CycleMeter, Measures
from stickslip_ros.physics.measures.observer import MeasuredMotion, MotionObserver, RunObserver
from stickslip_ros.physics.motion.motion import Motion
from stickslip_ros.progress import Progress


def measure_block(motion: Motion, meter: CycleMeter, observer: MotionObserver | None) -> None:
    """Feed a meter, and show an observer, what `motion` has recorded since the last time."""
    breakpoints, belt_speed = motion.take_breakpoints(), motion.drive.belt_speed
    cycles = meter.feed(breakpoints, belt_speed)
    if observer is not None:
        belt_velocity = np.full(len(breakpoints), belt_speed)
        observer.take_motion(MeasuredMotion(breakpoints, belt_velocity, cycles, meter.ends))


def simulate_sampled(
    loop: SampledLoop,
    motion: Motion,
    washout: Washout | None,
    duration: float,
    meter: CycleMeter,
    progress: Progress = lambda _: None,
    observer: MotionObserver | None = None,
    recorder: TrajectoryRecorder | None = None,
) -> Measures:
    """Run `loop` over `motion` for `duration` (s), rounded to whole samples, and measure it.

    `motion` must record its breakpoints; `washout` None leaves the loop without control. An
    `observer` sees the motion in blocks; a `recorder` takes each sample with its answer, except
    for the last one, which is not answered here.
    """
    samples = round(duration / loop.period)
    sample = loop.sample
    for number in range(1, samples + 1):
        force = None
        if washout is not None:
            force = washout.answer(sample.stamp, sample.velocity)
            if force is not None:
                loop.offer(sample.stamp, force)
        if recorder is not None:
            recorder.take(sample, force or 0.0)
        sample = loop.advance()
        if number % 1000 == 0 or number == samples or motion.unbounded:
            measure_block(motion, meter, observer)
            progress(number / samples)
            if motion.unbounded:
                meter.report_run_away()
                break
    return meter.measures()


def simulate_continuous(
    motion: Motion,
    washout: WashoutParameters | None,
    duration: float,
    meter: CycleMeter,
    progress: Progress = lambda _: None,
    observer: RunObserver | None = None,
    recorder: TrajectoryRecorder | None = None,
) -> Measures:
    """Run `motion` under the washout law acting without sampling (eq. 19) and measure it.

    `motion` must record its breakpoints and have been made for continuous control. The filter runs
    from the start, the gains act after `start_after` (s). An `observer` sees motion and forces, in
    blocks; a `recorder` takes samples at its rate.
    """
    tracer = None if observer is None else MotionTracer(motion, observer)
    advance = motion.advance if tracer is None else tracer.advance
    if recorder is not None:
        advance = recorder.sampling(motion, advance)
    free = duration if washout is None else min(washout.start_after, duration)
    block = 10.0 * motion.drive.natural_period
    done = 0.0
    for length, share in ((free, 0.0), (duration - free, 1.0)):
        if washout is not None:
            motion.set_gains(
                washout.corner_frequency, share * washout.linear_gain, share * washout.cubic_gain
            )
        end = done + length
        while done < end and not motion.unbounded:
            step = min(block, end - done)
            advance(step)
            done += step
            measure_block(motion, meter, tracer)
            progress(done / duration)
    if recorder is not None:
        recorder.take_due(motion)
    if motion.unbounded:
        meter.report_run_away()
    return meter.measures()
