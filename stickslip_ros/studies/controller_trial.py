"""Trials of a controller: simulated vibrations while the control is switched on."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, hypot, inf, nan
from typing import Annotated, Any

import numpy as np

from stickslip_ros.arrays import FloatArray, rms
from stickslip_ros.measures.cycle_measures import Measures, Regime
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.sensor import EXACT_SENSOR, Measure, Sensor
from stickslip_ros.motion import Motion, RecordedMotion
from stickslip_ros.motion.controller import Controller, answer
from stickslip_ros.motion.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.quantities import Quantity
from stickslip_ros.samples import Sample
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.theory.cycle_bounds import loading_time, release_position
from stickslip_ros.theory.linear_sampled_loop import SETTLED

FILTER_SETTLED = 5.0
"""Time after which the start of the filter of eq. 17 no longer matters, in 1/d."""
_PHASES = 4
"""Phases of a vibration at which the control is switched on, besides the worst one."""
_PERIODS_AT_REST = 100.0
"""Natural periods over which the loop is observed at its equilibrium."""


@dataclass(frozen=True)
class Vibration:
    """The vibration of a drive without control at one belt speed, sampled; SI units."""

    drive: Drive
    rate: float
    """Samples per second, Hz."""
    regime: Regime | None
    period: float | None
    """Period, s; None unless the drive vibrates."""
    position: FloatArray
    """Displacement at the samples of some whole cycles, m; empty unless the drive vibrates."""
    velocity: FloatArray
    """Velocity at the same samples, m/s."""

    @property
    def size(self) -> float:
        """Largest distance from the equilibrium, m/s; 0 if it does not vibrate."""
        omega = self.drive.angular_frequency
        distances = np.hypot(
            omega * (self.position - self.drive.equilibrium_position), self.velocity
        )
        return float(distances.max(initial=0.0))

    @property
    def vibrates(self) -> bool:
        """Whether the drive vibrates without control."""
        return self.period is not None

    def peak_force(self, gains: Washout) -> float:
        """Return the largest force, N, of a controller activated at the worst phase."""
        return float(self.forces(gains).max(initial=0.0))

    def forces(self, gains: Washout) -> FloatArray:
        """Return the size of the force, N, of a controller activated at each sample."""
        return np.abs(gains.force(self.filtered(gains.corner_frequency)))

    def filtered(self, corner_frequency: float) -> FloatArray:
        """Return the output of a settled filter of eq. 17 (rad/s) for the velocity, m/s.

        The whole cycles are treated as a periodic sequence, and the filter's response is applied
        to each harmonic.
        """
        count = len(self.velocity)
        if count == 0:
            return self.velocity
        forward, differences = self._harmonics
        return np.fft.irfft(differences / (forward - np.exp(-corner_frequency / self.rate)), count)

    @cached_property
    def _harmonics(self) -> tuple[Any, Any]:
        """Factor of each harmonic from sample to sample, and its velocity difference."""
        count = len(self.velocity)
        forward = np.exp(2j * np.pi * np.arange(count // 2 + 1) / count)
        return forward, (forward - 1.0) * np.fft.rfft(self.velocity)


@dataclass(frozen=True)
class Caught:
    """What came of a vibration, or of a start, under control; SI units."""

    peak_force: float
    """Largest force, N."""
    settling_time: float | None
    """1 % settling time of the distance from the equilibrium, s; None if it does not settle."""
    grows: bool
    """Whether the motion diverged, or ended no nearer to the equilibrium than it started."""


@dataclass(frozen=True)
class Rest:
    """Motion and force that noise and rounding leave at the equilibrium; SI units."""

    amplitude: Annotated[float, Quantity("amplitude", "m")]
    """Half the range of the displacement, m."""
    peak_force: Annotated[float, Quantity("peak force", "N")]
    """Largest force, N."""
    rms_force: Annotated[float, Quantity("rms force", "N")]
    """Root mean square of the force, N."""


@dataclass(frozen=True)
class _Started(Sensor):
    """A sensor whose measurement began before the trial."""

    measure: Measure | None = None

    def start(self, period: float, number: int = 0) -> Measure | None:
        return self.measure


@dataclass(frozen=True)
class Bench:
    """Trials at one sampling rate (Hz) with one delay of the force (s)."""

    rate: float
    force_delay: float
    sensor: Sensor = EXACT_SENSOR

    def vibration(self, drive: Drive) -> Vibration:
        """Return the vibration of `drive`, the largest if there are several.

        The motion starts at the point of release, where the slip phase of a stick-slip cycle
        starts too.
        """
        motion = RecordedMotion(drive, release_position(drive), drive.belt_speed)
        # On a slow belt a cycle is mostly the time in which the belt loads the spring.
        loading = loading_time(drive)
        cycle, before = _measured(motion, loading), inf
        for _ in range(6):
            amplitude = cycle.velocity_amplitude
            if cycle.period is None or amplitude is None or abs(amplitude / before - 1.0) < 1e-4:
                break
            motion.advance(300 * drive.natural_period)
            cycle, before = _measured(motion, loading), amplitude
        if cycle.period is None:
            return Vibration(drive, self.rate, cycle.regime, None, np.empty(0), np.empty(0))
        # The fewest cycles that last nearly a whole number of samples, or else the nearest of all.
        lengths = np.arange(1, 13) * (cycle.period * self.rate)
        counts = np.maximum(np.rint(lengths), 1.0)
        misses = np.abs(counts / lengths - 1.0)
        states: list[tuple[float, float]] = []
        for _ in range(int(counts[np.argmax(misses <= max(1e-4, misses.min()))])):
            states.append((motion.position, motion.velocity))
            motion.advance(1.0 / self.rate)
        position, velocity = np.array(states).T
        return Vibration(drive, self.rate, cycle.regime, cycle.period, position, velocity)

    def catch(self, vibration: Vibration, law: Washout, patience: float) -> Caught:
        """Return the worst outcome of control, its filter settled, that catches a vibration.

        It is activated at several phases, and where its force is largest. The vibration has
        `patience` (s) to settle. The force is not limited.
        """
        assert vibration.period is not None
        drive, count = vibration.drive, len(vibration.velocity)
        controller = Controller(replace(law, force_limit=inf, start_after=0.0))
        settled = ceil(FILTER_SETTLED / law.corner_frequency * self.rate / count) * count
        cycle = vibration.period * self.rate
        rows = {int(phase * cycle / _PHASES) for phase in range(_PHASES)}
        due = {settled + row for row in rows | {int(vibration.forces(law).argmax())}}
        columns = zip(vibration.position.tolist(), vibration.velocity.tolist(), strict=True)
        states, measure = list(columns), self._measure([])
        peak = slowest = 0.0
        for number in range(max(due) + 1):
            row = number % count
            stamp, start = self._stamp(number), states[row]
            if number in due:
                before = [states[(row - back) % count] for back in range(self.sensor.spans, 0, -1)]
                trial = copy(controller), self._measure(before)
                caught = self._run(Motion(drive, *start), *trial, stamp, patience, vibration.size)
                peak = max(peak, caught.peak_force)
                if caught.settling_time is None:
                    return replace(caught, peak_force=peak)
                slowest = max(slowest, caught.settling_time)
            measured = start if measure is None else measure(*start)
            controller.answer(_sample(drive, stamp, *measured))
        return Caught(peak, slowest, grows=False)

    def returns(self, drive: Drive, law: Washout, speed: float) -> bool:
        """Return whether the slide returns when it starts from its equilibrium at `speed` (m/s).

        It starts in either direction, with a law that saw it at rest before, and with one that
        starts with it.
        """
        rest, patience = drive.equilibrium_position, 20.0 * drive.natural_period
        for velocity in (speed, -speed):
            for resting in (True, False):
                controller = Controller(replace(law, start_after=0.0))
                if resting:
                    controller.answer(_sample(drive, self._stamp(0), rest, 0.0))
                measure = self._measure([(rest, 0.0)] * self.sensor.spans * resting)
                motion = Motion(drive, rest, velocity)
                if self._run(motion, controller, measure, self._stamp(1), patience, speed).grows:
                    return False
        return True

    def rest(self, drive: Drive, law: Washout, settling: float) -> Rest:
        """Return what is left at the equilibrium after `settling` (s)."""
        # Exactly at the equilibrium rounding would hide that it is unstable without control.
        offset = SETTLED * abs(drive.belt_speed) / drive.angular_frequency
        motion = Motion(drive, drive.equilibrium_position + offset, 0.0)
        loop = self._loop(motion, self.sensor, self._stamp(0))
        controller = Controller(replace(law, start_after=0.0))
        settled = ceil(settling * self.rate)
        rows: list[tuple[float, float]] = []
        for number in range(settled + ceil(_PERIODS_AT_REST * drive.natural_period * self.rate)):
            force = answer(loop, controller)
            if number >= settled:
                rows.append((loop.true_sample.position, force))
            loop.advance()
        position, force = np.array(rows).T
        return Rest(float(np.ptp(position)) / 2.0, float(np.abs(force).max()), rms(force))

    def _measure(self, before: Sequence[tuple[float, float]]) -> Measure | None:
        """Return what measures, after it has measured these positions and velocities."""
        measure = self.sensor.start(1.0 / self.rate)
        if measure is not None:
            for state in before:
                measure(*state)
        return measure

    def _loop(self, motion: Motion, sensor: Sensor, stamp: int) -> SampledLoop:
        delay = self.force_delay
        return SampledLoop(motion, self.rate, stamp, force_delay=delay, sensor=sensor)

    def _stamp(self, number: int) -> int:
        return LOCKSTEP_START + round(number * NANOSECONDS / self.rate)

    def _run(
        self,
        motion: Motion,
        controller: Controller,
        measure: Measure | None,
        stamp: int,
        patience: float,
        size: float,
    ) -> Caught:
        """Run the loop until the distance has stayed small for a natural period, or `patience`."""
        loop, drive = self._loop(motion, _Started(measure=measure), stamp), motion.drive
        omega, equilibrium = drive.angular_frequency, drive.equilibrium_position
        calm = ceil((drive.natural_period + self.force_delay) * self.rate)
        peak, last, recent = 0.0, 0, 0.0
        samples = max(ceil(patience * self.rate), calm)
        while True:
            sample, number = loop.true_sample, loop.sample_number
            distance = hypot(omega * (sample.position - equilibrium), sample.velocity)
            if distance > SETTLED * size:
                last = number
            if number > samples - calm:
                recent = max(recent, distance)
            if loop.unbounded or number - last > calm or number >= samples:
                break
            peak = max(peak, abs(answer(loop, controller)))
            loop.advance()
        settled = number - last > calm and not loop.unbounded
        grows = loop.unbounded or (not settled and recent >= size)
        return Caught(peak, last / self.rate if settled else None, grows)


def _measured(motion: RecordedMotion, loading: float) -> Measures:
    """Measure the next ten cycles of a motion, each of a natural period and `loading` (s)."""
    motion.take_breakpoints()
    motion.advance((10 + 2) * (motion.drive.natural_period + loading))
    meter = CycleMeter(10)
    meter.feed(motion.take_breakpoints(), motion.drive.belt_speed)
    if motion.unbounded:
        meter.unbounded = True
    return meter.measures()


def _sample(drive: Drive, stamp: int, position: float, velocity: float) -> Sample:
    """Return a sample without what a controller does not use."""
    return Sample(stamp, position, velocity, nan, nan, drive.belt_speed)
