"""Trials of a control law: simulated vibrations while the control is switched on."""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, hypot, inf, nan
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.loop.controller import Controller, answer
from stickslip_ros.physics.loop.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.physics.measures.cycle_measures import CycleMeter, Measures, Regime
from stickslip_ros.physics.model.control import ControlLaw, WashoutGains
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.sensor import EXACT_SENSOR, Measure, Sensor
from stickslip_ros.physics.motion import Motion, RecordedMotion
from stickslip_ros.physics.theory.cycle_bounds import loading_time, release_position
from stickslip_ros.physics.theory.linear_sampled_loop import SETTLED
from stickslip_ros.samples import Sample
from stickslip_ros.stamps import NANOSECONDS

FILTER_SETTLED = 5.0
"""Time after which the start of the filter of eq. 17 no longer matters, in 1/d."""


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

    def filtered(self, corner_frequency: float) -> FloatArray:
        """Return the output of a settled filter of eq. 17 for the velocity, m/s.

        `corner_frequency` is in rad/s. The whole cycles are treated as a periodic sequence, and
        the filter's response is applied to each harmonic.
        """
        count = len(self.velocity)
        if count == 0:
            return self.velocity
        forward, differences = self._harmonics
        return np.fft.irfft(differences / (forward - np.exp(-corner_frequency / self.rate)), count)

    def peak_force(self, gains: WashoutGains) -> float:
        """Return the largest force, N, of a controller activated at the worst phase."""
        return float(np.abs(self._force(gains)).max(initial=0.0))

    def worst_sample(self, gains: WashoutGains) -> int:
        """Return the row of the sample at which that force is largest."""
        return int(np.argmax(np.abs(self._force(gains))))

    def _force(self, gains: WashoutGains) -> FloatArray:
        return gains.force(self.filtered(gains.corner_frequency))

    @cached_property
    def _harmonics(self) -> tuple[Any, Any]:
        """Factor of each harmonic from sample to sample, and its velocity difference."""
        count = len(self.velocity)
        forward = np.exp(2j * np.pi * np.arange(count // 2 + 1) / count)
        return forward, (forward - 1.0) * np.fft.rfft(self.velocity)


@dataclass(frozen=True)
class Outcome:
    """The result of a trial; SI units."""

    peak_force: float
    """Largest force, N."""
    settling_time: float | None
    """1 % settling time of the distance from the equilibrium, s; None if it does not settle."""
    grows: bool
    """Whether the motion diverged, or ended no nearer to the equilibrium than it started."""


@dataclass(frozen=True)
class Rest:
    """What noise and rounding leave at the equilibrium under control; SI units."""

    amplitude: float
    """Half the range of the displacement, m."""
    peak_force: float
    """Largest force, N."""
    rms_force: float
    """Root mean square of the force, N."""


@dataclass(frozen=True)
class _Going(Sensor):
    """A sensor that measures already."""

    measure: Measure | None = None

    def start(self, period: float) -> Measure | None:
        return self.measure


class Bench:
    """Trials at one sampling rate with one delay of the force."""

    def __init__(self, rate: float, force_delay: float, sensor: Sensor = EXACT_SENSOR) -> None:
        """Prepare trials at `rate` (Hz) with `force_delay` (s)."""
        self._rate = rate
        self._force_delay = force_delay
        self._sensor = sensor

    def vibration(self, drive: Drive) -> Vibration:
        """Return the vibration of `drive`, the largest if there are several.

        The motion starts at the point of release, where the slip phase of a stick-slip cycle
        starts too.
        """
        motion = RecordedMotion(drive, release_position(drive), drive.belt_speed)
        # On a slow belt a cycle is mostly the time in which the belt loads the spring.
        loading = loading_time(drive)
        found, before = _measured(motion, loading), inf
        for _ in range(6):
            amplitude = found.velocity_amplitude
            if found.period is None or amplitude is None or abs(amplitude / before - 1.0) < 1e-4:
                break
            motion.advance(300 * drive.natural_period)
            found, before = _measured(motion, loading), amplitude
        if found.period is None:
            return Vibration(drive, self._rate, found.regime, None, np.empty(0), np.empty(0))
        # The fewest cycles that last nearly a whole number of samples, or else the nearest of all.
        lengths = np.arange(1, 13) * (found.period * self._rate)
        counts = np.maximum(np.rint(lengths), 1.0)
        misses = np.abs(counts / lengths - 1.0)
        samples = int(counts[np.argmax(misses <= max(1e-4, misses.min()))])
        states: list[tuple[float, float]] = []
        for _ in range(samples):
            states.append((motion.position, motion.velocity))
            motion.advance(1.0 / self._rate)
        motion.take_breakpoints()
        position, velocity = np.array(states).T
        return Vibration(drive, self._rate, found.regime, found.period, position, velocity)

    def catch(
        self,
        vibration: Vibration,
        law: ControlLaw,
        settling: float,
        worst: int,
        phases: int,
        patience: float,
    ) -> Iterator[Outcome]:
        """Activate the control, its state settled, at `phases` phases of a vibration.

        The state settles in `settling` (s). One more trial activates the control at the sample
        `worst` of the vibration, for example where this gives the largest force. The vibration has
        `patience` (s) to settle. The force is not limited.
        """
        count = len(vibration.velocity)
        assert vibration.period is not None
        controller = Controller(replace(law, force_limit=inf, start_after=0.0))
        settled = ceil(settling * self._rate / count) * count
        cycle = vibration.period * self._rate
        rows = {int(phase * cycle / phases) for phase in range(phases)}
        due = {settled + row for row in rows | {worst}}
        columns = zip(vibration.position.tolist(), vibration.velocity.tolist(), strict=True)
        states, drive = list(columns), vibration.drive
        measure = self._measure([])
        for number in range(max(due) + 1):
            row = number % count
            stamp, start = self._stamp(number), states[row]
            if number in due:
                before = [states[(row - back) % count] for back in range(self._sensor.spans, 0, -1)]
                trial = copy(controller), self._measure(before)
                yield self._run(drive, *trial, stamp, start, patience, vibration.size)
            told = start if measure is None else measure(number, *start)
            controller.answer(_sample(drive, stamp, *told))

    def throw(self, drive: Drive, law: ControlLaw, speed: float, patience: float) -> list[Outcome]:
        """Start the slide from its equilibrium at `speed` (m/s) in either direction.

        Each start is tried with a law that saw the slide at rest before, and with one that starts
        with the slide.
        """
        outcomes: list[Outcome] = []
        rest = drive.equilibrium_position
        for velocity in (speed, -speed):
            for resting in (True, False):
                controller = Controller(replace(law, start_after=0.0))
                if resting:
                    controller.answer(_sample(drive, self._stamp(0), rest, 0.0))
                start = rest, velocity
                trial = controller, self._measure([(rest, 0.0)] * self._sensor.spans * resting)
                stamp = self._stamp(1)
                outcomes.append(self._run(drive, *trial, stamp, start, patience, speed))
        return outcomes

    def rest(self, drive: Drive, law: ControlLaw, settling: float, duration: float) -> Rest:
        """Return what is left at the equilibrium over `duration` (s), after `settling` (s)."""
        # Exactly at the equilibrium rounding would hide that it is unstable without control.
        offset = SETTLED * abs(drive.belt_speed) / drive.angular_frequency
        motion = Motion(drive, drive.equilibrium_position + offset, 0.0)
        loop = self._loop(motion, self._sensor, self._stamp(0))
        controller = Controller(replace(law, start_after=0.0))
        settled, samples = ceil(settling * self._rate), ceil(duration * self._rate)
        rows: list[tuple[float, float]] = []
        for number in range(settled + samples):
            force = answer(loop, controller)
            if number >= settled:
                rows.append((loop.true_sample.position, force))
            loop.advance()
        position, force = np.array(rows).T
        rms = float(np.sqrt(np.mean(force**2)))
        return Rest(float(np.ptp(position)) / 2.0, float(np.abs(force).max()), rms)

    def _measure(self, before: Sequence[tuple[float, float]]) -> Measure | None:
        """Return what measures, after it has measured these positions and velocities."""
        measure = self._sensor.start(1.0 / self._rate)
        if measure is not None:
            for number, state in enumerate(before):
                measure(number, *state)
        return measure

    def _loop(self, motion: Motion, sensor: Sensor, stamp: int) -> SampledLoop:
        delay = self._force_delay
        return SampledLoop(motion, self._rate, stamp, force_delay=delay, sensor=sensor)

    def _stamp(self, number: int) -> int:
        return LOCKSTEP_START + round(number * NANOSECONDS / self._rate)

    def _run(
        self,
        drive: Drive,
        controller: Controller,
        measure: Measure | None,
        stamp: int,
        start: tuple[float, float],
        patience: float,
        size: float,
    ) -> Outcome:
        """Run the loop until the distance has stayed small for a natural period, or `patience`."""
        motion = Motion(drive, *start)
        loop = self._loop(motion, _Going(measure=measure), stamp)
        omega, equilibrium = drive.angular_frequency, drive.equilibrium_position
        calm = ceil((drive.natural_period + self._force_delay) * self._rate)
        peak, last, recent = 0.0, 0, 0.0
        samples = max(ceil(patience * self._rate), calm)
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
        settled = loop.sample_number - last > calm and not loop.unbounded
        return Outcome(
            peak,
            last / self._rate if settled else None,
            loop.unbounded or (not settled and recent >= size),
        )


def _measured(motion: RecordedMotion, loading: float) -> Measures:
    """Measure the next ten cycles of a motion, each of a natural period and `loading` (s)."""
    motion.take_breakpoints()
    motion.advance((10 + 2) * (motion.drive.natural_period + loading))
    meter = CycleMeter(10)
    meter.feed(motion.take_breakpoints(), motion.drive.belt_speed)
    if motion.unbounded:
        meter.report_run_away()
    return meter.measures()


def _sample(drive: Drive, stamp: int, position: float, velocity: float) -> Sample:
    """Return a sample without what a controller does not use."""
    return Sample(stamp, position, velocity, nan, nan, drive.belt_speed)
