"""Stability margins of sampled loops."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from stickslip_ros.physics.model.control import WashoutGains
from stickslip_ros.physics.theory.linear_sampled_loop import LinearSampledLoop, why_no_linear_loop
from stickslip_ros.physics.theory.roots import zero_between
from stickslip_ros.studies.design_task import Task


@dataclass(frozen=True)
class Margins:
    """Smallest gain and delay margins of a set of stable loops."""

    gain_down: float | None
    """Largest factor below one of the linear gain at which a loop is unstable; None: no such."""
    gain_up: float | None
    """Smallest factor above one of the linear gain at which a loop is unstable; None: no such."""
    delay: float | None
    """Delay margin: smallest additional delay of the force at which a loop is unstable, s; None: no
    such within half a natural period, or within the range of the theory."""


def margins(loops: Sequence[LinearSampledLoop], gains: WashoutGains) -> Margins:
    """Return the margins of loops that are stable with these gains (SI units)."""
    factors = [
        end / gains.linear
        for loop in loops
        for interval in loop.stable_linear_gains(gains.corner_frequency)
        if interval.low < gains.linear < interval.high
        for end in interval
    ]
    delays = [delay for loop in loops if (delay := _delay_margin(loop, gains)) is not None]
    return Margins(
        gain_down=max((factor for factor in factors if 0.0 < factor < 1.0), default=None),
        gain_up=min((factor for factor in factors if factor > 1.0), default=None),
        delay=min(delays, default=None),
    )


def _delay_margin(loop: LinearSampledLoop, gains: WashoutGains) -> float | None:
    def decay_rate(further: float) -> float:
        return replace(loop, force_delay=loop.force_delay + further).decay_rate(gains)

    further = np.linspace(0.0, loop.drive.natural_period / 2.0, 33).tolist()
    for shorter, longer in pairwise(further):
        if why_no_linear_loop(loop.drive, loop.rate, loop.force_delay + longer) is not None:
            return None
        if decay_rate(longer) < 0.0:
            return zero_between(decay_rate, shorter, longer)
    return None


def little_margin(task: Task, found: Margins) -> str | None:
    """Return a remark on loops with a small margin; None if all margins are large enough."""
    little = [
        f"{factor:.3g} times the linear gain is unstable"
        for factor in (found.gain_down, found.gain_up)
        if factor is not None and 1.0 / 1.1 < factor < 1.1
    ]
    if found.delay is not None and found.delay < 0.02 * task.drive.natural_period:
        little.append(f"an additional delay of {task.shown(found.delay, 's')} makes it unstable")
    return f"the margin is very small: {', '.join(little)}" if little else None
