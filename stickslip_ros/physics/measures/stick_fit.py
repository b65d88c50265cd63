"""Stick edges from positions with noise: the motion near the speed of the belt, fitted."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray

_STEPS = 24
"""Steps of the integration on each side of the stick."""
_MARGIN = 0.5
"""Part of the reach of the data by which the integration reaches further: edges move."""
_LARGEST_SPEED = 10.0
"""Largest velocity of the fit, in belt speeds."""
_CURVATURE = 1.0
"""Prior standard deviation of the friction's second and third power, in natural units."""
_JUMP_LEVEL = 25.0
"""Gain in squared residuals, in variances, that shows a drop of the friction at departure."""


@dataclass(frozen=True)
class StickFit:
    """Fitted motion on both sides of a stick, or of the highest speed of a motion without one.

    Near the belt's speed the displacement r relative to the belt obeys

        r'' = g r' + g2 r'^2 + g3 r'^3 - w0^2 r - w0^2 v_b (t - t_departure) - j

    on both sides of the stick, from r = r' = 0 at its edges: the spring has reached the limit of
    the friction at departure, and is short of it by k v_b t_stick at landing. g is the slope of the
    kinetic curve less the damping, over the mass, and j the drop of the friction at departure. A
    motion without a stick obeys it, too, with r' < 0 where r'' = 0.
    """

    centre: float
    """Middle of the stick, or instant of the highest speed, s."""
    stick_time: float
    """Duration of the stick, s; 0 without."""
    offset: float
    """Displacement relative to the belt during the stick, m."""
    residual: FloatArray
    """Differences between positions and fit, m; shape (n,)."""
    jacobian: FloatArray
    """Derivatives of the fit by its free parameters, the second by the stick time; shape (n, p)."""
    squares: float
    """Sum of the squared residuals, m^2."""

    @property
    def landing(self) -> float:
        """Instant at which the slide starts to stick, s."""
        return self.centre - self.stick_time / 2.0

    @property
    def departure(self) -> float:
        """Instant at which the slide stops to stick, s."""
        return self.centre + self.stick_time / 2.0


def fit_stick(
    time: FloatArray,
    relative: FloatArray,
    belt_speed: float,
    frequency: float,
    stick_time: float,
    *,
    sticks: bool = True,
) -> StickFit:
    """Fit the motion around a stick at time 0, with a drop of the friction where the data show one.

    Nonlinear least squares, with the motion integrated from its edges (single shooting). `relative`
    is the displacement relative to the belt, x - v_b t, m, at each `time`, s. The scale
    of the fit is the angular `frequency` of the cycle, rad/s, and `stick_time`, s, the first guess.
    Without `sticks` the highest speed is below that of the belt, which is above 0 m/s.
    """
    reach = float(np.abs(time).max()) - stick_time / 2.0
    problem = _Problem(
        time * frequency, relative * frequency / belt_speed, sticks, reach * frequency
    )
    start = np.zeros(len(_LOWER_BOUNDS))
    start[_SIZE] = max(stick_time * frequency, 0.05) if sticks else 0.02
    start[_STIFFNESS], start[_OFFSET] = 1.2, float(np.median(problem.relative))
    best, free = problem.solve(start, _SMOOTH_PARAMETERS), _SMOOTH_PARAMETERS
    if sticks:
        start = best.copy()
        start[_JUMP] = 0.1
        dropping = problem.solve(start, _ALL_PARAMETERS)
        gain = problem.squares(best) - problem.squares(dropping)
        if gain > _JUMP_LEVEL * problem.squares(best) / max(len(time) - len(_ALL_PARAMETERS), 1):
            best, free = dropping, _ALL_PARAMETERS
    length = belt_speed / frequency
    units = np.array([1.0 / frequency, 1.0 / frequency, *([1.0] * (len(free) - 2))])
    return StickFit(
        centre=float(best[_CENTRE]) / frequency,
        stick_time=float(best[_SIZE]) / frequency if sticks else 0.0,
        offset=float(best[_OFFSET]) * length,
        residual=-problem.residual(best) * length,
        jacobian=problem.jacobian(best, free) * length / units,
        squares=problem.squares(best) * length**2,
    )


_CENTRE, _SIZE, _STIFFNESS, _SLOPE, _SECOND, _THIRD, _OFFSET, _JUMP = range(8)
_SMOOTH_PARAMETERS = [_CENTRE, _SIZE, _STIFFNESS, _SLOPE, _SECOND, _THIRD, _OFFSET]
_ALL_PARAMETERS = [*_SMOOTH_PARAMETERS, _JUMP]
_LOWER_BOUNDS = np.array([-np.inf, 0.0, 0.0, -20.0, -20.0, -20.0, -np.inf, 0.0])
_UPPER_BOUNDS = np.array([np.inf, np.inf, 20.0, 20.0, 20.0, 20.0, np.inf, 2.0])


class _Problem:
    """Least squares in natural units: time 1 / frequency, length belt speed / frequency."""

    def __init__(self, time: FloatArray, relative: FloatArray, sticks: bool, reach: float) -> None:
        self.time, self.relative, self._sticks = time, relative, sticks
        self._reach = (1.0 + _MARGIN) * reach

    def solve(self, start: FloatArray, free: list[int]) -> FloatArray:
        """Return the parameters with the least squares of those that are free."""
        from scipy.optimize import least_squares  # takes long to import

        values = start.copy()

        def whole(part: FloatArray) -> FloatArray:
            values[free] = part
            return values

        # The prior on the powers of the friction is weighed by the noise that the fit leaves.
        def residual(part: FloatArray) -> FloatArray:
            every = whole(part)
            return np.append(self.residual(every), self._weight * every[[_SECOND, _THIRD]])

        def jacobian(part: FloatArray) -> FloatArray:
            prior = self._weight * np.eye(len(start))[np.ix_([_SECOND, _THIRD], free)]
            return np.concatenate([self.jacobian(whole(part), free), prior])

        self._weight = 0.0
        inside = np.clip(start, _LOWER_BOUNDS + 1e-9, _UPPER_BOUNDS - 1e-9)[free]
        for _ in range(2):
            found: Any = least_squares(
                residual,
                inside,
                jac=jacobian,  # pyright: ignore[reportArgumentType]
                bounds=(_LOWER_BOUNDS[free], _UPPER_BOUNDS[free]),
                x_scale="jac",
                ftol=1e-8,
                xtol=1e-7,
                max_nfev=40,
            )
            inside = found.x
            self._weight = float(np.sqrt(np.mean(np.square(found.fun)))) / _CURVATURE
        return whole(inside).copy()

    def squares(self, values: FloatArray) -> float:
        """Return the sum of the squared residuals."""
        residual = self.residual(values)
        return float(residual @ residual)

    def residual(self, values: FloatArray) -> FloatArray:
        """Return fit less data."""
        return self._fitted(values[None, :])[0] - self.relative

    def jacobian(self, values: FloatArray, free: list[int]) -> FloatArray:
        """Return the derivatives of the fit by the free parameters, by differences."""
        step = 1e-6
        trials = np.tile(values, (len(free) + 1, 1))
        trials[np.arange(len(free)), free] += step
        fitted = self._fitted(trials)
        return (fitted[:-1] - fitted[-1]).T / step

    def _fitted(self, trials: FloatArray) -> FloatArray:
        """Return the fit for k sets of parameters, shape (k, n)."""
        half = trials[:, _SIZE] / 2.0 if self._sticks else np.zeros(len(trials))
        positions, velocities = self._integrate(trials)
        step, since_centre = self._reach / _STEPS, self.time - trials[:, _CENTRE, None]
        fitted = np.repeat(trials[:, _OFFSET, None], len(self.time), axis=1)
        for side, columns in ((-1.0, slice(None, len(trials))), (1.0, slice(len(trials), None))):
            since = np.clip(side * since_centre - half[:, None], 0.0, self._reach)
            fitted += _interpolate(
                positions[:, columns], side * velocities[:, columns], step, since
            )
        return fitted

    def _integrate(self, trials: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return displacement and derivative before the landing and after the departure.

        Shape (steps + 1, 2 k), from the edges outwards.
        """
        size, stiffness, slope, second, third, jump = np.tile(
            trials[:, [_SIZE, _STIFFNESS, _SLOPE, _SECOND, _THIRD, _JUMP]].T, 2
        )
        side = np.repeat([-1.0, 1.0], len(trials))
        if self._sticks:
            # At the landing the spring is short of the limit by the time of the stick.
            early, gap, limit = np.where(side < 0.0, size, 0.0), np.zeros_like(size), -jump
        else:
            early, gap = np.zeros_like(size), size
            limit = gap * (slope + gap * (-second + gap * third))
        step = side * (self._reach / _STEPS)
        position, velocity = np.zeros_like(size), -gap

        def rate(position: FloatArray, velocity: FloatArray, time: FloatArray) -> FloatArray:
            # Far from the solution the motion diverges within reach.
            velocity = np.maximum(np.minimum(velocity, _LARGEST_SPEED), -_LARGEST_SPEED)
            friction = velocity * (slope + velocity * (second + velocity * third))
            return friction + limit - stiffness * (position + time - early)

        positions, velocities = [position], [velocity]
        for row in range(_STEPS):
            time, middle = row * step, (row + 0.5) * step
            a1 = rate(position, velocity, time)
            v2 = velocity + step / 2.0 * a1
            a2 = rate(position + step / 2.0 * velocity, v2, middle)
            v3 = velocity + step / 2.0 * a2
            a3 = rate(position + step / 2.0 * v2, v3, middle)
            v4 = velocity + step * a3
            a4 = rate(position + step * v3, v4, time + step)
            position = position + step / 6.0 * (velocity + 2.0 * v2 + 2.0 * v3 + v4)
            velocity = velocity + step / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            positions.append(position)
            velocities.append(velocity)
        return np.array(positions), np.array(velocities)


def _interpolate(
    position: FloatArray, velocity: FloatArray, step: float, at: FloatArray
) -> FloatArray:
    """Return the cubic interpolation of columns at times `at`, shape (k, n), since their start."""
    row = np.minimum((at / step).astype(np.intp), len(position) - 2)
    u = at / step - row
    k = np.arange(len(at))[:, None]
    p0, p1 = position[row, k], position[row + 1, k]
    m0, m1 = velocity[row, k] * step, velocity[row + 1, k] * step
    return p0 + u * (m0 + u * (3.0 * (p1 - p0) - 2.0 * m0 - m1 + u * (2.0 * (p0 - p1) + m0 + m1)))
