"""The motion that a model predicts for a record: its forces and its belt in, positions out."""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from itertools import chain
from math import copysign, expm1
from typing import Any, Self

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.identification.record import Record, lagged
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.signals import table
from stickslip_ros.motion.motion import Motion
from stickslip_ros.motion.variational import VariationalMotion

_LAG_STEPS = 3
"""Steps of a sample in which a force that lags is held: one alone moves the slide otherwise."""
_FIRST = 20
"""Samples from which the velocity at the start is found."""
_UNBOUNDED_LOSS = 1e300
"""Squared error of a motion that is not bounded, m^2."""
_SPEED_TOLERANCE = 1e-3
"""Tolerance of the velocity at the start, as a share of the range in which it is sought."""
_TOLERANCE = 1e-6
"""Largest error of the belt velocity between corners, as a share of its largest value."""


def steady_memory(drive: Drive, velocity: float, belt_speed: float) -> Sequence[float]:
    """Return the memory of the friction law in steady slip at these speeds, SI units."""
    relative = velocity - belt_speed
    return drive.friction.memory_at(relative, copysign(1.0, relative))


class Predictor:
    """Simulates parts of a record, each from a state of its own."""

    def __init__(self, record: Record) -> None:
        self.record = record
        self._force, self._disturbance = record.held_forces
        self._steps = 1
        self._corners = _corners(record.belt_velocity)

    @cached_property
    def measured(self) -> FloatArray:
        """Positions, m, and velocities, m/s, if they have a weight; shape (outputs, samples)."""
        position, velocity = self.record.position, self.record.velocity
        if velocity is None or self.record.velocity_weight == 0.0:
            return position[np.newaxis]
        return np.array([position, velocity])

    @cached_property
    def weight(self) -> FloatArray:
        """Weight of the errors of `measured`; that of velocities in s."""
        of_velocity = np.where(self.record.lost, 0.0, self.record.velocity_weight)
        return np.array([self.record.weight, of_velocity])[: len(self.measured)]

    def lagging(self, time_constant: float) -> Self:
        """Return the same with the force behind a lag of first order, s."""
        if self.record.force is None or not time_constant > 0.0:
            return self
        other, periods = copy(self), self.record.period / _LAG_STEPS / time_constant
        command, disturbance = (np.repeat(column, _LAG_STEPS) for column in self.record.held_forces)
        force = lagged(command, periods)
        # A mean force gives the right velocity at the end of a step, and not the right position.
        missing = (force - command) * (-1.0 / expm1(-periods) - 1.0 / periods - 0.5)
        force, missing = (column.reshape(-1, _LAG_STEPS) for column in (force, missing))
        moved = missing.sum(axis=1) / (_LAG_STEPS - 1)
        force[:, 0] += moved
        force[:, -1] -= moved
        other._force, other._disturbance, other._steps = force.ravel(), disturbance, _LAG_STEPS
        return other

    def positions(self, drive: Drive, velocity: float) -> FloatArray:
        """Return positions, m, from the measured one at a velocity, m/s; NaN once unbounded."""
        count = len(self.record.position)
        start = np.array([[self.record.position[0], velocity]])
        ((outputs, _),) = self.followed(drive, [slice(0, count)], start, 0.0)
        return outputs[:count]

    def free_run(self, drive: Drive) -> tuple[float, FloatArray]:
        """Return the motion of a drive through the whole record, with its force, without feedback.

        It starts at the measured position with the velocity that fits best, m/s, which is returned
        before the positions, m. The velocity is found by bounded minimization (R. P. Brent,
        Algorithms for Minimization Without Derivatives, 1973) around that of the first samples.
        """
        from scipy.optimize import minimize_scalar  # takes long to import

        record, first = self.record, self.record.position[:_FIRST]
        slope = float(np.polyfit(np.arange(len(first)) * record.period, first, 1)[0])
        # The range also makes up for the friction over the first stroke.
        spread = 3.0 * abs(slope) + float(np.std(np.diff(first))) / record.period

        def loss(velocity: float) -> float:
            error = self.positions(drive, float(velocity)) - record.position
            return float(np.mean(error * error)) if np.isfinite(error).all() else _UNBOUNDED_LOSS

        solve: Any = minimize_scalar  # its types know no bounds
        bounds, options = (slope - spread, slope + spread), {"xatol": _SPEED_TOLERANCE * spread}
        velocity = float(solve(loss, bounds=bounds, method="bounded", options=options).x)
        return velocity, self.positions(drive, velocity)

    def followed(
        self,
        drive: Drive,
        parts: Sequence[slice],
        starts: FloatArray,
        delay: float,
        kind: type[Motion] = Motion,
    ) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Yield the outputs of parts, each from a state (position, velocity), and derivatives.

        Outputs are the positions, m, and then the velocities, m/s, if the record has some with a
        weight; NaN from where the motion is unbounded. The memory of the friction law is that of
        steady slip at the start of a part. `delay` is the time from a sample until its force
        acts, s, from minus one to several periods; a disturbance is never late.

        A `VariationalMotion` of a `ScaledDrive` has derivatives of shape (rows, arguments): by the
        state at the start of the part, then by the free constants of the drive, all
        dimensionless; another motion has none, shape (rows, 0).
        """
        record, count = self.record, len(self.measured)
        units = np.array([drive.length_scale, drive.speed_scale])[:count, np.newaxis, np.newaxis]
        motion = kind(self.with_belt(drive), *starts[0].tolist())
        varied = motion if isinstance(motion, VariationalMotion) else None
        forces, durations = self._held(delay)
        for part, (position, velocity) in zip(parts, starts.tolist(), strict=True):
            memory = None
            if drive.friction.states:
                memory = steady_memory(drive, velocity, float(record.belt_velocity[part.start]))
            motion.clock.time = part.start * record.period
            motion.restart(position, velocity, memory)
            length = part.stop - part.start
            outputs = np.full((count, length), np.nan)
            by = np.zeros((length, *(varied.derivatives.shape if varied else (count, 0))))
            held = chain(((),), forces[part.start : part.stop - 1])
            for number, changes in enumerate(held):  # what is done for each sample takes most time
                for force, duration in zip(changes, durations, strict=False):
                    motion.advance_under(force, 0.0, duration)
                if motion.unbounded:
                    break
                outputs[0, number] = motion.position
                if count > 1:
                    outputs[1, number] = motion.velocity
                if varied:
                    by[number] = varied.derivatives
            derivatives = by[:, :count].swapaxes(0, 1) * units
            yield outputs.ravel(), derivatives.reshape(outputs.size, -1)

    def _held(self, delay: float) -> tuple[Sequence[Sequence[float]], Sequence[float]]:
        """Return the forces on the slide from each sample on, N, and how long each acts, s."""
        period, last = self.record.period / self._steps, len(self._force) - 1
        whole, rest = divmod(delay / period, 1.0)
        place, rest = np.arange(last + 1) - int(whole), rest * period
        held = [
            (self._force[np.clip(place - late, 0, last)] + self._disturbance, duration)
            for late, duration in ((1, rest), (0, period - rest))
            if duration > 0.0
        ]
        columns, durations = zip(*held, strict=True)
        forces = np.column_stack(columns).reshape(len(self.record.position), -1)
        return forces.tolist(), durations * self._steps

    def with_belt(self, drive: Drive) -> Drive:
        """Return the drive with the belt of the record."""
        belt, corners = self.record.belt_velocity, self._corners
        if len(corners) == 2 and belt[0] == belt[-1]:
            return replace(drive, belt_speed=float(belt[0]))
        times = (corners * self.record.period).tolist()
        points = list(zip(times, belt[corners].tolist(), strict=True))
        return replace(drive, belt_speed=0.0, belt=table(points))


def _corners(values: FloatArray) -> IntArray:
    """Return the indices between which straight lines describe the values (Douglas, Peucker)."""
    tolerance = _TOLERANCE * float(np.abs(values).max())
    kept, open_ends = {0, len(values) - 1}, [(0, len(values) - 1)]
    while open_ends:
        low, high = open_ends.pop()
        if high - low < 2:
            continue
        between = np.arange(low, high + 1)
        line = np.interp(between, [low, high], [values[low], values[high]])
        errors = np.abs(values[between] - line)
        worst = int(np.argmax(errors))
        if errors[worst] > tolerance:
            kept.add(low + worst)
            open_ends += [(low, low + worst), (low + worst, high)]
    return np.array(sorted(kept))
