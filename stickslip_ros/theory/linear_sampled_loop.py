"""The loop of the nodes, linear near its equilibrium: sampled, held, controlled and delayed.

It is exactly the loop of `SampledLoop` and `Controller`: between samples the force is constant, so
that the matrix exponential gives the motion from one sample to the next. The lag of the actuator
and a velocity that is a difference of positions are linear, and have their part in it. Noise,
rounding and limits are not, and are left out.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise
from math import frexp, inf, log
from typing import Any, Self

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import scaled
from stickslip_ros.model.control import ControlLaw, LinearFeedback, Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_layout import POSITION, SPEED
from stickslip_ros.model.sensor import EXACT_SENSOR, Sensor
from stickslip_ros.motion.force_line import whole_and_rest
from stickslip_ros.theory.gain_intervals import (
    GainBoundary,
    GainInterval,
    feedback_family,
    nearest_to_zero,
)
from stickslip_ros.theory.linear import jacobians
from stickslip_ros.theory.requirements import (
    AUTONOMOUS,
    ONE_MASS,
    SPRING,
    NotCoveredError,
    no_position_loop,
    require,
)

LONGEST_DELAY = 300
"""Largest delay, in whole periods, for which the matrix is built; its order grows with it."""

SETTLED = 0.01
"""Share of its first size that a deviation has at the 1 % settling time."""


def why_no_linear_loop(
    drive: Drive,
    rate: float,
    force_delay: float = 0.0,
    sensor: Sensor = EXACT_SENSOR,
    motor_sensor: Sensor = EXACT_SENSOR,
    answer_every: int = 1,
) -> str | None:
    """Return a sentence that says why `LinearSampledLoop.from_drive` returns None, or None."""
    rate /= answer_every
    if drive.belt_speed == 0.0:
        return "the belt rests: friction holds the slide, and the motion near it is not linear"
    if force_delay * rate > LONGEST_DELAY:
        return (
            f"the force comes {force_delay * rate:g} periods late; the theory of the sampled loop "
            f"covers at most {LONGEST_DELAY}"
        )
    sensors = (sensor, motor_sensor)[: 1 if drive.motor is None else 2]
    if not all(encoder.every(answer_every) for encoder in sensors):
        spans = " and ".join(str(encoder.spans) for encoder in sensors)
        return (
            f"the velocity is a difference over {spans} samples, which must be a multiple of the "
            f"{answer_every} from answer to answer for the theory of the sampled loop"
        )
    return None


@dataclass(frozen=True)
class LinearSampledLoop:
    """Drive at its equilibrium under sampled control, linearised; for any linear control law.

    With the period T, force n = C z_n + D (x_n, y_n) of the law (see `LinearFeedback`) is held from
    n T + delay to (n + 1) T + delay. y_n is the velocity, or with m samples of difference
    (x_n - x_(n-m)) / (m T). The state is X, Y, the memory of the friction law, displacement and
    velocity of a motor of finite mass, on which the force then acts, the states of the
    actuator, the states z of the control law, the forces under way, the newest first, and the
    earlier positions that a difference needs, the newest first.
    """

    drive: Drive
    """Drive in SI units."""
    rate: float
    """Samples per second, Hz."""
    force_delay: float
    """Delay from a sample to the start of its force, s."""
    jacobian: FloatArray
    """Jacobian of the open loop, dimensionless (see `Expansion.jacobian`); shape (n, n)."""
    difference_samples: int = 0
    """Samples that a difference for the velocity spans; 0 if the velocity is exact."""
    motor_difference_samples: int = 0
    """The same of the velocity of a motor."""

    @classmethod
    def from_drive(
        cls,
        drive: Drive,
        rate: float,
        force_delay: float = 0.0,
        sensor: Sensor = EXACT_SENSOR,
        motor_sensor: Sensor = EXACT_SENSOR,
        answer_every: int = 1,
    ) -> Self | None:
        """Return the linear loop of a drive.

        Parameters
        ----------
        drive : Drive
            Drive in SI units.
        rate : float
            Samples per second, Hz.
        force_delay : float, optional
            Delay from a sample to the start of its force, s.
        sensor : Sensor, optional
            Sensor, of which only the difference for the velocity is used.
        motor_sensor : Sensor, optional
            The same of a motor of finite mass.
        answer_every : int, optional
            Samples from one that is answered to the next: the loop is that of the answers.

        Returns
        -------
        LinearSampledLoop or None
            Loop; None if the belt is at rest, if the delay is longer than 300 periods, or if a
            difference spans no multiple of `answer_every`.

        Raises
        ------
        InvalidInputError
            If belt or load follow a signal, or the drive has no spring.
        """
        require("the theory of the sampled loop", drive, SPRING, AUTONOMOUS)
        sampling = rate, force_delay, sensor, motor_sensor, answer_every
        if why_no_linear_loop(drive, *sampling):
            return None
        (jacobian,) = jacobians(drive, None, np.array([drive.belt_speed / drive.speed_scale]))
        spans = sensor.spans, motor_sensor.spans if drive.motor is not None else 0
        differences = (span // answer_every for span in spans)
        return cls(drive, rate / answer_every, force_delay, jacobian, *differences)

    def transition_matrix(self, law: ControlLaw | LinearFeedback) -> FloatArray:
        """Return the matrix from the state at one sample to the state at the next.

        Parameters
        ----------
        law : ControlLaw or LinearFeedback
            Control law in SI units, of which only the linear part is used, or that part.

        Returns
        -------
        ndarray
            Matrix for the dimensionless state, shape (m, m); m is the order of the open loop with
            its actuator, plus the number of states of the law, the periods of the delay, rounded
            up, and the samples of a difference.

        Raises
        ------
        InvalidInputError
            If the law is not linear near the equilibrium.
        """
        if isinstance(law, LinearFeedback):
            name, feedback = "linear feedback", law
        else:
            name, feedback = law.name, law.linear_feedback(1.0 / self.rate)
        if feedback is None:
            raise InvalidInputError(f"the theory of the sampled loop: {not_linear(name)}")
        if self.drive.motor is None and np.any(feedback.direct[..., 2:]):
            raise NotCoveredError(f"the law {name} feeds back a motor: the motor is ideal")
        if self.drive.motor is not None and not feedback.holds_position:
            raise NotCoveredError(no_position_loop("the theory of the sampled loop", name))
        return self._transitions(feedback)

    def spectral_radius(self, law: ControlLaw | LinearFeedback) -> float:
        """Return the factor by which a small deviation grows per sample, in the long run.

        Parameters
        ----------
        law : ControlLaw or LinearFeedback
            Control law in SI units, linear near the equilibrium.

        Returns
        -------
        float
            Spectral radius of the transition matrix; the loop is stable below 1.
        """
        return float(_spectral_radius(self.transition_matrix(law)))

    def decay_rate(self, law: ControlLaw | LinearFeedback) -> float:
        """Return the rate at which a small deviation decays.

        Parameters
        ----------
        law : ControlLaw or LinearFeedback
            Control law in SI units, linear near the equilibrium.

        Returns
        -------
        float
            Decay rate, 1/s; below zero the deviation grows.
        """
        return decay_rate(self.transition_matrix(law), self.rate)

    def decay_rates(self, corner_frequencies: FloatArray, linear_gains: FloatArray) -> FloatArray:
        """Return the decay rates over cutoff frequencies and linear gains.

        Parameters
        ----------
        corner_frequencies : ndarray
            Cutoff frequencies, rad/s; shape (m,).
        linear_gains : ndarray
            Linear gains, N s/m; shape (n,) for all cutoff frequencies, or (m, n).

        Returns
        -------
        ndarray
            Decay rates, 1/s; shape (m, n).
        """
        shape = (len(corner_frequencies), linear_gains.shape[-1])
        rows = zip(corner_frequencies, np.broadcast_to(linear_gains, shape), strict=True)
        families = (feedback_family(*row, 1.0 / self.rate) for row in rows)
        return np.array([*map(self.decay_rates_of, families)]).reshape(shape)

    def decay_rates_of(self, laws: LinearFeedback) -> FloatArray:
        """Return the decay rates of many laws.

        Parameters
        ----------
        laws : LinearFeedback
            Linear parts of the laws, stacked along the first axis.

        Returns
        -------
        ndarray
            Decay rates, 1/s; shape (m,).
        """
        with np.errstate(divide="ignore"):
            return -np.log(_spectral_radius(self.transition_matrix(laws))) * self.rate

    def stable_linear_gains(self, corner_frequency: float) -> list[GainInterval]:
        """Return all linear gains of eq. 18 with which the loop is stable.

        Parameters
        ----------
        corner_frequency : float
            Cutoff frequency, rad/s.

        Returns
        -------
        list of GainInterval
            Stable intervals in ascending order; empty if no gain is stable.
        """
        require("the search for stable gains", self.drive, ONE_MASS)
        corner = corner_frequency / self.drive.angular_frequency
        boundary = GainBoundary(
            self.plant[0], self.held, self.delay[0], self.period, corner, self.difference_samples
        )
        return boundary.stable_intervals(
            self.drive.force_scale / self.drive.speed_scale,
            lambda gain: self.spectral_radius(Washout(corner_frequency, gain, 0.0)),
        )

    def critical_linear_gain(self, corner_frequency: float) -> float | None:
        """Return the linear gain that the loop needs, or that it allows, to be stable.

        It is the critical end of the stable interval nearest to zero. At a high rate and without
        delay it is k1* of the continuous loop, which is stable below it.

        Parameters
        ----------
        corner_frequency : float
            Cutoff frequency, rad/s.

        Returns
        -------
        float or None
            Critical linear gain, N s/m; None if no gain stabilises the loop.
        """
        intervals = self.stable_linear_gains(corner_frequency)
        return nearest_to_zero(intervals).critical if intervals else None

    def coarsened(self) -> Self:
        """Return a similar loop at a rate at which even a long delay is few periods, for searches.

        To hold the force also delays it, by half a period on average, and so does a difference, by
        half of what it spans; the sum is kept. A loop of small order is returned as it is.
        """
        spans = self.difference_samples
        # Searching many gains is quick with a small order.
        if self.motor_difference_samples or self.under_way + spans <= 21:
            return self
        latest = self.force_delay + spans / self.rate
        rate = min(self.rate, max(20.0 / latest, 5.0 * self.drive.angular_frequency))
        coarse = max(round(spans * rate / self.rate), 1) if spans else 0
        mean_delay = self.force_delay + 0.5 * (1 + spans) / self.rate
        delay = max(mean_delay - 0.5 * (1 + coarse) / rate, 0.0)
        return replace(self, rate=rate, force_delay=delay, difference_samples=coarse)

    @property
    def spans(self) -> tuple[int, int]:
        """Samples that the velocities of slide and motor span as differences, 0 if exact."""
        return self.difference_samples, self.motor_difference_samples

    @property
    def under_way(self) -> int:
        """Number of forces that are under way at a sample."""
        whole, rest = self.delay
        return whole + (rest > 0.0)

    @cached_property
    def period(self) -> float:
        """Sample period T, dimensionless."""
        return self.drive.angular_frequency / self.rate

    @cached_property
    def delay(self) -> tuple[int, float]:
        """Delay in whole periods, and the remainder in periods, below one."""
        return whole_and_rest(self.force_delay * self.rate)

    @cached_property
    def plant(self) -> tuple[FloatArray, FloatArray]:
        """Jacobian of the open loop with its actuator, and the rates by a held force of one.

        Shapes (n, n), (n,); dimensionless.
        """
        actuator, order = scaled(self.drive.actuator, self.drive.scales), len(self.jacobian)
        count = len(actuator.states)
        rest, units = [0.0] * count, np.eye(count).tolist()
        matrix, force = np.zeros((order + count, order + count)), np.zeros(order + count)
        matrix[:order, :order] = self.jacobian
        motor = self.drive.dimensionless.motor
        driven, mass = (SPEED, 1.0) if motor is None else (order - 1, motor.mass)
        for column, unit in enumerate(units, order):
            matrix[driven, column] = actuator.force(0.0, unit) / mass
            matrix[order:, column] = actuator.state_rates(0.0, unit)
        force[driven] = actuator.force(1.0, rest) / mass
        force[order:] = actuator.state_rates(1.0, rest)
        return matrix, force

    @cached_property
    def held(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Effect of one period: transition of the slide, and the effects of two unit forces.

        The first force starts during the period (or with it), and the second ends in it. Shapes (n,
        n), (n,), (n,).
        """
        split = self.delay[1]
        before, ending = self._slide(split)
        after, starting = self._slide(1.0 - split)
        return after @ before, starting, after @ ending

    @cached_property
    def disturbed(self) -> FloatArray:
        """Effect of a disturbance force of one on the slide and its actuator in a period; (n,)."""
        matrix, _ = self.plant
        return self._slide(1.0, np.eye(len(matrix))[SPEED])[1]

    def _slide(
        self, periods: float, force: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the transition of the slide over some periods, and the effect of a unit force.

        `force` are the rates by that force; by default it is the actuator's.
        """
        matrix, held = self.plant
        force = held if force is None else force
        order = len(force)
        block = np.zeros((order + 1, order + 1))
        block[:order, :order], block[:order, order] = matrix, force
        transition = _exponential(block * (periods * self.period))
        return transition[:order, :order], transition[:order, order]

    def _transitions(self, feedback: LinearFeedback) -> FloatArray:
        """Return the transition matrix, or those of laws that are stacked, (..., n, n).

        The unit of the law's states is that of the speed: no eigenvalue depends on it.
        """
        (whole, split), drive = self.delay, self.drive
        stacked, states = feedback.output.shape[:-1], feedback.output.shape[-1]
        sizes = len(self.plant[1]), states, self.under_way, *self.spans
        slots = (slice(*ends) for ends in pairwise(accumulate(sizes, initial=0)))
        plant, law, under_way, earlier, earlier_motor = slots
        size, (slide, starting, ending) = sum(sizes), self.held
        matrix = np.zeros((*stacked, size, size))
        bodies = ((POSITION, earlier), (len(self.jacobian) - 2, earlier_motor))
        seen = np.vstack([self._seen(*body, size) for body in bodies])[: feedback.direct.shape[-1]]
        units = np.resize([drive.length_scale, drive.speed_scale], len(seen))
        forces = np.zeros((*stacked, 1 + self.under_way, size))
        forces[..., 0, :] = (feedback.direct * units / drive.force_scale) @ seen
        forces[..., 0, law] = feedback.output * drive.speed_scale / drive.force_scale
        forces[..., 1:, under_way] = np.eye(self.under_way)
        matrix[..., plant, plant] = slide
        matrix[..., plant, :] += starting[:, None] * forces[..., whole, None, :]
        if split > 0.0:
            matrix[..., plant, :] += ending[:, None] * forces[..., whole + 1, None, :]
        matrix[..., law, :] += (feedback.input * (units / drive.speed_scale)) @ seen
        matrix[..., law, law] += feedback.state
        matrix[..., under_way, :] = forces[..., :-1, :]
        for position, before in bodies:  # the newest becomes that of now
            matrix[..., before, :] = np.eye(size)[np.r_[position, before][:-1]]
        return matrix

    def _seen(self, position: int, earlier: slice, size: int) -> FloatArray:
        """Return displacement and velocity of a body, as the controller sees them, by the state.

        The velocity is a difference where there are `earlier` positions.
        """
        seen = np.eye(2, size, position)
        spans = earlier.stop - earlier.start
        if spans:
            seen[1, position + 1] = 0.0
            seen[1, position] = 1.0 / (spans * self.period)
            seen[1, earlier.stop - 1] = -seen[1, position]
        return seen


def not_linear(law: str) -> str:
    """Return a clause that says that the control law of this name has no linear form."""
    return f"the control law {law} is not linear near the equilibrium"


def decay_rate(transitions: FloatArray, rate: float) -> float:
    """Return the decay rate (1/s) of a loop with this transition matrix at a rate (Hz)."""
    radius = float(_spectral_radius(transitions))
    return -log(radius) * rate if radius > 0.0 else inf


def settling_time(decay_rate: float) -> float | None:
    """Return the time (s) in which a deviation with this decay rate (1/s) falls to a hundredth."""
    return -log(SETTLED) / decay_rate if decay_rate > 0.0 else None


def _exponential(matrix: FloatArray) -> FloatArray:
    """Return the exponential of a small matrix: the series of a part of it, squared repeatedly.

    scipy's version divides each one among threads, which takes hundreds of times as long.
    """
    squarings = max(frexp(float(np.abs(matrix).sum(axis=0).max()))[1] + 1, 0)
    part, one = matrix * 0.5**squarings, np.eye(len(matrix))
    exponential = one
    # With a norm of one half the remaining terms are below rounding.
    for order in range(16, 0, -1):
        exponential = one + part @ exponential / order
    for _ in range(squarings):
        exponential = exponential @ exponential
    return exponential


def _spectral_radius(matrices: FloatArray) -> Any:
    return np.abs(np.linalg.eigvals(matrices)).max(axis=-1)
