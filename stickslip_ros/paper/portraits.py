"""Phase portraits: finely sampled trajectories of motions from rest, and their settled motions."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from stickslip_ros.physics.measures.breakpoints import Breakpoints
from stickslip_ros.physics.measures.cycle_measures import Cycle, CycleMeter, Measures, Regime
from stickslip_ros.physics.model.control import Washout
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.motion import RecordedMotion

PERIODS = 300.0
"""Default duration of a trajectory, in natural periods."""

SAMPLES_PER_PERIOD = 64
"""Samples in a natural period."""

LAST_CYCLES = 5
"""Number of cycles at the end of a trajectory that are measured."""

SETTLED = 0.01
"""Largest deviation of the speed amplitude of a settled cycle, as a share of the belt speed."""


class PortraitCase(NamedTuple):
    """A motion from rest at X = 0."""

    label: str
    """The parameters that distinguish it from the other cases of its panel."""
    drive: Drive
    gains: Washout | None = None
    """Gains of a washout controller, active from the start without sampling (eq. 19); SI units."""
    duration: float | None = None
    """Duration, s; None for `PERIODS` natural periods."""


@dataclass(frozen=True)
class Portrait:
    """The trajectory of a case, and its measures."""

    case: PortraitCase
    trajectory: Breakpoints
    """The motion from rest, finely sampled, to its end or until it diverges."""
    measures: Measures
    """Means of the last cycles, `LAST_CYCLES` at most."""
    settling_time: float | None
    """Start (s) of the first cycle from which on all have the speed amplitude of the last ones,
    within `SETTLED` belt speeds. None if the motion may not have settled: except in equilibrium,
    half of the trajectory must be settled."""

    @property
    def drive(self) -> Drive:
        """The drive of the case."""
        return self.case.drive

    @property
    def runs_away(self) -> bool:
        """Whether the motion diverges."""
        return self.measures.regime is Regime.UNBOUNDED

    @property
    def last_cycles(self) -> Breakpoints:
        """The end of the trajectory: `LAST_CYCLES` cycles, or natural periods if there are none."""
        time = self.trajectory.time
        period = self.measures.period or self.drive.natural_period
        return self.trajectory[time >= time[-1] - LAST_CYCLES * period]

    @property
    def least_relative_speed(self) -> float | None:
        """Smallest |X' - v0| in the last cycles, m/s: 0 if it sticks, None if it diverges."""
        if self.runs_away:
            return None
        return float(np.abs(self.last_cycles.velocity - self.drive.belt_speed).min())

    def time_beyond(self, speed: float) -> float | None:
        """Return the time (s) when |X'| first exceeds `speed` (m/s); None if it does not."""
        speeds = np.abs(self.trajectory.velocity)
        beyond = np.flatnonzero(speeds > speed)
        if len(beyond) == 0:
            return None
        samples = slice(max(int(beyond[0]) - 1, 0), int(beyond[0]) + 1)
        return float(np.interp(speed, speeds[samples], self.trajectory.time[samples]))


def portraits(cases: Iterable[PortraitCase]) -> Iterator[Portrait]:
    """Yield the portraits of the cases in order."""
    return map(_portrait, cases)


def _portrait(case: PortraitCase) -> Portrait:
    drive = case.drive
    motion = RecordedMotion(drive, 0.0, 0.0, case.gains)
    duration = PERIODS * drive.natural_period if case.duration is None else case.duration
    samples = round(duration / drive.natural_period * SAMPLES_PER_PERIOD)
    for _ in range(samples):
        motion.advance(duration / samples)
        if motion.unbounded:
            break
    breakpoints = motion.take_breakpoints()
    trajectory = replace(breakpoints, time=breakpoints.time - breakpoints.time[0])
    meter = CycleMeter(LAST_CYCLES)
    cycles = meter.feed(trajectory, drive.belt_speed)
    if motion.unbounded:
        meter.report_run_away()
    measures = meter.measures()
    settling_time = (
        None if motion.unbounded else _settling_time(trajectory, cycles, measures, drive)
    )
    return Portrait(case, trajectory, measures, settling_time)


def _settling_time(
    trajectory: Breakpoints, cycles: Sequence[Cycle], measures: Measures, drive: Drive
) -> float | None:
    if not cycles:
        return None
    amplitudes = np.array([cycle.velocity_amplitude for cycle in cycles])
    final = amplitudes[-LAST_CYCLES:].mean()
    off = np.flatnonzero(np.abs(amplitudes - final) > SETTLED * abs(drive.belt_speed))
    first = int(off[-1]) + 1 if len(off) > 0 else 0
    time = _first_rise(trajectory) + sum(cycle.period for cycle in cycles[:first])
    at_rest = measures.regime is Regime.EQUILIBRIUM
    return time if at_rest or time <= trajectory.time[-1] / 2.0 else None


def _first_rise(trajectory: Breakpoints) -> float:
    """Return the time when the velocity first rises through zero, the start of the first cycle."""
    falling = int(np.argmax(trajectory.velocity < 0.0))
    rise = falling + int(np.argmax(trajectory.velocity[falling:] >= 0.0))
    return float(trajectory.time[rise])
