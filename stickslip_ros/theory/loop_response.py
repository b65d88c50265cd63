"""Frequency response of the sampled loop: margins, sensitivity, and the force that it needs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import ceil, log2, pi, sqrt
from typing import Self

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import LinearFeedback, VelocityFeedback
from stickslip_ros.model.control.base import MOTOR, TABLE
from stickslip_ros.model.drive_layout import POSITION, SPEED
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop, decay_rate

_PERIODS = 40.0
"""Natural periods that the response to a step covers, at least."""

ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class PlantResponse:
    """Response of drive, hold, delay and sensor to force, at the n frequencies of a step."""

    loop: LinearSampledLoop
    """The loop without its law."""
    frequency: FloatArray
    """Angular frequencies, rad/s, equally spaced up to that of half the rate; shape (n,)."""
    by_control: ComplexArray
    """Displacement, m/N, and velocity, m/(N s), that a law sees by control force; those of a motor
    follow; shape (n, 2) or (n, 4)."""
    by_disturbance: ComplexArray
    """The same by a disturbance force on the slide."""

    @classmethod
    def of_loop(cls, loop: LinearSampledLoop) -> Self:
        """Return the response of a loop."""
        drive = loop.drive
        whole, rest = loop.delay
        short = replace(loop, force_delay=rest / loop.rate)  # whole periods are a factor
        count = 1 << max(ceil(log2(_PERIODS * min(drive.natural_period, 0.2) * loop.rate)), 11)
        turns = (np.arange(count // 2) + 0.5) / count  # no frequency 0: a free motor drifts
        z = np.exp(2j * pi * turns)
        body = TABLE if drive.motor is None else MOTOR
        once, twice = (
            short.transition_matrix(VelocityFeedback(0.0, gain, feedback=body))
            for gain in (1.0, 2.0)
        )
        open_loop, effect = 2.0 * once - twice, twice - once
        order = len(open_loop)
        seen = POSITION if drive.motor is None else len(loop.jacobian) - 2
        # What a newton does to the state until the next sample.
        forces = np.zeros((order, 2))
        forces[:, 0] = effect[:, seen] / drive.length_scale
        forces[: len(loop.disturbed), 1] = loop.disturbed / drive.force_scale
        responses = np.linalg.solve(z[:, None, None] * np.eye(order) - open_loop, forces)
        states: ComplexArray = responses.astype(np.complex128)
        rows: list[ComplexArray] = []
        places = [POSITION] if drive.motor is None else [POSITION, seen]
        for place, spans in zip(places, loop.spans, strict=False):
            rows.append(states[:, place] * drive.length_scale)
            speed = states[:, place + SPEED] * drive.speed_scale
            rows.append(rows[-1] * _rate(spans, loop.rate, z)[:, None] if spans else speed)
        stacked = np.stack(rows, axis=1)
        delayed = stacked[..., 0] * (z**-whole)[:, None]
        return cls(loop, 2.0 * pi * turns * loop.rate, delayed, stacked[..., 1])

    @cached_property
    def z(self) -> ComplexArray:
        """Factor of a period, e^(j w T); shape (n,)."""
        return np.exp(1j * self.frequency / self.loop.rate)

    def by_law(self, form: LinearFeedback) -> ComplexArray:
        """Return the force of a law by what it sees, N/m and N s/m; shape (n, 2) or (n, 4)."""
        z = self.z
        response = np.broadcast_to(form.direct.astype(complex), (len(z), len(form.direct)))
        if len(form.state):
            states = z[:, None, None] * np.eye(len(form.state)) - form.state
            response = response + form.output @ np.linalg.solve(states, form.input.astype(complex))
        count = self.by_control.shape[1]  # two for each body that there is
        padded = np.pad(response, ((0, 0), (0, max(count - response.shape[1], 0))))
        return padded[:, :count].astype(np.complex128)


@dataclass(frozen=True, eq=False)
class LoopResponse:
    """Response of a stable loop with a law; arrays of shape (n,)."""

    plant: PlantResponse
    """Response without the law."""
    feedback: LinearFeedback
    """The law, linear."""
    law: ComplexArray
    """Force by what the law sees, N/m and N s/m; shape (n, 2) or (n, 4)."""

    @classmethod
    def of_plants(cls, plants: Sequence[PlantResponse], law: LinearFeedback) -> tuple[Self, ...]:
        """Return the responses of plants at the same frequencies with a law."""
        response = plants[0].by_law(law)
        return tuple(cls(plant, law, response) for plant in plants)

    @cached_property
    def transitions(self) -> FloatArray:
        """Matrix from the state at one sample to the next, see `LinearSampledLoop`; (m, m)."""
        return self.plant.loop.transition_matrix(self.feedback)

    @property
    def decay_rate(self) -> float:
        """Rate at which a small deviation decays, 1/s."""
        return decay_rate(self.transitions, self.plant.loop.rate)

    @cached_property
    def open_loop(self) -> ComplexArray:
        """Loop transfer function L, which is unstable at -1."""
        return -(self.law * self.plant.by_control).sum(axis=1)

    @cached_property
    def sensitivity(self) -> ComplexArray:
        """Sensitivity S = 1/(1 + L)."""
        return 1.0 / (1.0 + self.open_loop)

    @property
    def sensitivity_peak(self) -> float:
        """Largest magnitude of the sensitivity."""
        return float(np.abs(self.sensitivity).max())

    @property
    def phase_margin(self) -> float | None:
        """Smallest angle between L and -1 where |L| = 1, rad; None if |L| never is."""
        angles = [abs(margin) for margin, _ in self._crossings]
        return min(angles, default=None)

    @property
    def delay_margin(self) -> float | None:
        """Smallest delay, s, that turns L to -1 where |L| = 1; None if there is none."""
        delays = [margin % (2.0 * pi) / frequency for margin, frequency in self._crossings]
        return min(delays, default=None)

    @property
    def gain_margins(self) -> tuple[float | None, float | None]:
        """Largest factor below 1 and smallest above 1 of the force that make L = -1, or None."""
        values = self.open_loop
        imaginary, real = values.imag, values.real
        rows = np.flatnonzero((imaginary[1:] * imaginary[:-1] <= 0.0) & (real[1:] < 0.0))
        share = imaginary[rows] / (imaginary[rows] - imaginary[rows + 1] + 1e-300)
        crossed = real[rows] + share * (real[rows + 1] - real[rows])
        factors = [*(-1.0 / crossed[crossed < 0.0]).tolist()]
        below = [factor for factor in factors if factor < 1.0]
        above = [factor for factor in factors if factor > 1.0]
        return max(below, default=None), min(above, default=None)

    @cached_property
    def _crossings(self) -> list[tuple[float, float]]:
        """Sums pi + arg L, rad, and the frequency, rad/s, wherever |L| = 1."""
        size, frequency = np.log(np.abs(self.open_loop) + 1e-300), self.plant.frequency
        rows = np.flatnonzero(size[1:] * size[:-1] < 0.0)
        share = size[rows] / (size[rows] - size[rows + 1])
        angle = np.unwrap(np.angle(self.open_loop))
        angles = angle[rows] + share * (angle[rows + 1] - angle[rows])
        frequencies = frequency[rows] + share * (frequency[rows + 1] - frequency[rows])
        margins = (angles + 2.0 * pi) % (2.0 * pi) - pi
        return list(zip(margins.tolist(), frequencies.tolist(), strict=True))

    def step_response(self) -> FloatArray:
        """Return the control force after a step of 1 N of the disturbance, at the samples."""
        by_step = self.sensitivity * (self.law * self.plant.by_disturbance).sum(axis=1)
        count = 2 * len(by_step)
        spectrum = np.zeros(count + 1, dtype=complex)
        spectrum[1::2] = by_step * _step_spectrum(count)
        response = np.fft.irfft(spectrum, 2 * count)[:count]
        return (response + response[-1]) / 2.0

    def noise_force(self, *noises: float) -> float:
        """Return the rms force, N, by white noise of these rms, m, of the measured positions.

        The first is that of the slide, a second that of a motor.
        """
        loop, total = self.plant.loop, 0.0
        for body, (noise, spans) in enumerate(zip(noises, loop.spans, strict=False)):
            if noise == 0.0 or 2 * body >= self.law.shape[1]:
                continue
            by_noise = self.law[:, 2 * body].copy()
            if spans:
                by_noise += self.law[:, 2 * body + 1] * _rate(spans, loop.rate, self.plant.z)
            total += noise**2 * float(np.mean(np.abs(by_noise * self.sensitivity) ** 2))
        return sqrt(total)


@cache
def _step_spectrum(count: int) -> ComplexArray:
    """Return the odd lines of a step that is that of a square wave of so many samples."""
    return np.fft.rfft(np.repeat([1.0, -1.0], count))[1::2]


def _rate(spans: int, rate: float, z: ComplexArray) -> ComplexArray:
    """Return the response, 1/s, of a difference over samples."""
    return (1.0 - z**-spans) * rate / spans
