"""The closed loop without ROS, sampled or continuous as in the paper, and its measures."""

from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.loop.washout import Washout, WashoutParameters
from stickslip_ros.physics.measures.cycles import CycleMeter, Measures
from stickslip_ros.physics.motion.motion import Motion
from stickslip_ros.progress import Progress

BLOCK_SAMPLES = 1000


def simulate_sampled(
    loop: SampledLoop,
    motion: Motion,
    washout: Washout | None,
    duration: float,
    meter: CycleMeter,
    progress: Progress = lambda _: None,
) -> Measures:
    """Run `loop` over `motion` for `duration` (s), rounded to whole samples, and measure it.

    `motion` must record its breakpoints; `washout` None leaves the loop without control.
    """
    samples = round(duration / loop.period)
    sample = loop.sample
    for number in range(1, samples + 1):
        if washout is not None:
            force = washout.answer(sample.stamp, sample.velocity)
            if force is not None:
                loop.offer(sample.stamp, force)
        sample = loop.advance()
        if number % BLOCK_SAMPLES == 0 or number == samples or motion.unbounded:
            meter.feed(motion.take_breakpoints(), motion.drive.belt_speed)
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
) -> Measures:
    """Run `motion` under the washout law acting without sampling (eq. 19) and measure it.

    `motion` must record its breakpoints and have been made for continuous control. The filter runs
    from the start, the gains act after `start_after` (s).
    """
    parts = [(duration, False)]
    if washout is not None:
        free = min(washout.start_after, duration)
        parts = [(free, False), (duration - free, True)]
    block = 10.0 * motion.drive.natural_period
    done = 0.0
    for length, controlled in parts:
        if washout is not None:
            share = 1.0 if controlled else 0.0
            motion.set_gains(
                washout.corner_frequency, share * washout.linear_gain, share * washout.cubic_gain
            )
        end = done + length
        while done < end and not motion.unbounded:
            step = min(block, end - done)
            motion.advance(step)
            done += step
            meter.feed(motion.take_breakpoints(), motion.drive.belt_speed)
            progress(done / duration)
    if motion.unbounded:
        meter.report_run_away()
    return meter.measures()
