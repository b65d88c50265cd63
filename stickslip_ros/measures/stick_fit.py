"""Stick edges from positions with noise: the motion near the speed of the belt, fitted.

A slide on a spring with some forms of friction is integrated from its edges (single shooting) and
fitted by nonlinear least squares. Where the data do not tell one form from another, the edges are
means over the forms with the weights of their information criteria (K. P. Burnham and D. R.
Anderson, Model selection and multimodel inference, 2002).
"""

from dataclasses import dataclass
from math import inf
from typing import Any, NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray, rms

_STEPS = 24
"""Steps of the integration on each side of the stick."""
_MARGIN = 0.5
"""Part of the reach of the data by which the integration reaches further: edges move."""
_LARGEST_SPEED = 10.0
"""Largest velocity of the fit, in belt speeds."""
_STEP = 1e-6
"""Step of the differences by the parameters."""
_CURVATURE, _CALIBRATION = 1.0, 0.05
"""Prior standard deviations of the friction's second and third power, in natural units, and of the
belt speed, as a share of it."""
_JUMP_LEVEL = 25.0
"""Gain in squared residuals, in variances, of a jump of the friction over a form with as many
parameters but one: a small one makes the edge at the departure uncertain, and laws have none."""


@dataclass(frozen=True)
class StickFit:
    """Fitted motion on both sides of a stick.

    Near the belt's speed the displacement r relative to the belt obeys

        r'' = g r' + g2 r'^2 + g3 r'^3 - w0^2 r - w0^2 v_b (t - t_departure) - j (1 - e^-|r'/s|^n)

    on both sides of the stick, from r = r' = 0 at its edges: the spring has reached the limit of
    the friction at departure, and is short of it by k v_b t_stick at landing. The powers of r' and
    the fall j of the friction, at once or with n = 1 or 2, are the kinetic curve less the damping,
    over the mass.
    """

    centre: float
    """Middle of the stick, s."""
    stick_time: float
    """Duration of the stick, s."""
    belt_speed: float
    """Speed during the stick, m/s."""
    offset: float
    """Position of a slide that sticks, at time 0, m."""
    residual: FloatArray
    """Differences between positions and fit, m; shape (n,)."""
    jacobian: FloatArray
    """Derivatives of the fit by its free parameters: the centre, the stick time, the belt speed,
    and others; shape (n, p)."""
    spread: FloatArray
    """Covariance of centre, stick time and belt speed by the form of the friction, shape (3, 3)."""

    @property
    def landing(self) -> float:
        """Instant at which the slide starts to stick, s."""
        return self.centre - self.stick_time / 2.0

    @property
    def departure(self) -> float:
        """Instant at which the slide stops to stick, s."""
        return self.centre + self.stick_time / 2.0

    @property
    def squares(self) -> float:
        """Sum of the squared residuals, m^2."""
        return float(self.residual @ self.residual)


def fit_stick(
    time: FloatArray,
    position: FloatArray,
    belt_speed: float,
    frequency: float,
    stick_time: float,
    *,
    may_fall: bool = True,
) -> StickFit:
    """Fit the motion around a stick at time 0, and the belt speed, to positions, m, at times, s.

    The edges are means over the forms of the friction, and their `spread` is an error; residuals
    are those of the best form.

    The scale of the fit is the angular `frequency` of the cycle, rad/s; `belt_speed`, above 0 m/s,
    and `stick_time`, s, are the first guesses. Without a stick time the slide touches a speed
    near this one, and does not stick. Unless it `may_fall`, the friction is a cubic.
    """
    reach = (float(np.abs(time).max()) - stick_time / 2.0) * frequency
    length = belt_speed / frequency
    times, relative = time * frequency, (position - belt_speed * time) / length
    motion = _Motion(times, relative, (1.0 + _MARGIN) * reach)
    start = np.zeros(len(_LOWER_BOUNDS))
    start[_SIZE] = max(stick_time * frequency, 0.05) if stick_time > 0.0 else _LEAST_SIZE
    start[_STIFFNESS], start[_OFFSET] = 1.2, float(np.median(relative))
    fits = [motion.fit(start, _SMOOTH if stick_time > 0.0 else _TOUCHING)]
    if stick_time > 0.0 and may_fall:
        start, noise = fits[0].values.copy(), rms(fits[0].residual)
        for free, values in _FALLS:
            start[[*values]] = [*values.values()]
            fits.append(motion.fit(start, free, noise))
    squares = np.array([fit.residual @ fit.residual for fit in fits])
    freedom = max(len(time) - len(_STEEP), 1)
    criterion = squares / max(squares.min(), 1e-300) * freedom
    criterion += [0.0, _JUMP_LEVEL, 0.0, 0.0][: len(fits)]
    weight = np.exp(0.5 * (criterion.min() - criterion))
    best, weight = fits[int(np.argmax(weight))], weight / weight.sum()
    parameters = np.array([fit.values for fit in fits])
    mean = weight @ parameters
    apart = (parameters - mean)[:, [_CENTRE, _SIZE, _BELT]]
    units = np.array([1.0 / frequency, 1.0 / frequency, belt_speed])
    scale = np.append(units, np.ones(best.jacobian.shape[1] - 3))
    return StickFit(
        centre=float(mean[_CENTRE]) / frequency,
        stick_time=float(mean[_SIZE]) / frequency,
        belt_speed=belt_speed * (1.0 + float(mean[_BELT])),
        offset=float(mean[_OFFSET]) * length,
        residual=-best.residual * length,
        jacobian=best.jacobian * length / scale,
        spread=(apart.T * weight) @ apart * np.outer(units, units),
    )


class _Fit(NamedTuple):
    values: FloatArray
    residual: FloatArray
    jacobian: FloatArray


_CENTRE, _SIZE, _BELT, _STIFFNESS, _SLOPE, _SECOND, _THIRD, _OFFSET, _FALL, _SCALE = range(10)
_EXPONENT = 10
_SMOOTH = [_CENTRE, _SIZE, _BELT, _STIFFNESS, _SLOPE, _SECOND, _THIRD, _OFFSET]
_STEEP = [_CENTRE, _SIZE, _BELT, _STIFFNESS, _SLOPE, _OFFSET, _FALL, _SCALE]
_TOUCHING = [parameter for parameter in _SMOOTH if parameter != _SIZE]
_STRAIGHT = {_SLOPE: 0.0, _SECOND: 0.0, _THIRD: 0.0, _FALL: 0.5, _SCALE: 0.5}
_FALLS = (
    ([*_SMOOTH, _FALL], {_FALL: 0.1}),
    (_STEEP, {**_STRAIGHT, _EXPONENT: 1.0}),
    (_STEEP, {**_STRAIGHT, _EXPONENT: 2.0}),
)
"""Free parameters and starts of each form of a fall of the friction; with exponent 0 it jumps."""
_LEAST_SIZE = 1e-4
"""Least stick time of the fit: the derivative by it is proportional to it."""
_LOWER_BOUNDS = np.array([-inf, _LEAST_SIZE, -0.3, 0.0, -20.0, -20.0, -20.0, -inf, 0.0, 0.02, 0.0])
_UPPER_BOUNDS = np.array([inf, inf, 0.3, 20.0, 20.0, 20.0, 20.0, inf, 20.0, 2.0, 2.0])
_PRIOR = np.zeros((3, len(_LOWER_BOUNDS)))
_PRIOR[range(3), [_SECOND, _THIRD, _BELT]] = 1.0 / np.array([_CURVATURE, _CURVATURE, _CALIBRATION])
"""Parameters in their prior standard deviations, by the parameters."""


class _Motion:
    """Positions near a stick, in units of 1 / frequency and of belt speed / frequency."""

    def __init__(self, time: FloatArray, relative: FloatArray, reach: float) -> None:
        self._time, self._relative, self._reach = time, relative, reach

    def fit(self, start: FloatArray, free: list[int], noise: float = 0.0) -> _Fit:
        """Return the fit with the least squares by the parameters that are free.

        The prior is weighed by the noise; where it is not known, by what a fit without it leaves.
        """
        from scipy.optimize import least_squares  # takes long to import

        values, jacobian = start.copy(), np.empty(0)
        inside = np.clip(start, _LOWER_BOUNDS + 1e-9, _UPPER_BOUNDS - 1e-9)[free]

        def residual(part: FloatArray) -> FloatArray:
            nonlocal jacobian
            values[free] = part
            trials = np.tile(values, (len(free) + 1, 1))
            trials[np.arange(len(free)), free] += _STEP
            fitted = self._fitted(trials)
            slopes = (fitted[:-1] - fitted[-1]).T / _STEP
            jacobian = np.concatenate([slopes, noise * _PRIOR[:, free]])
            return np.append(fitted[-1] - self._relative, noise * (_PRIOR @ values))

        def rates(part: FloatArray) -> FloatArray:
            if not np.array_equal(part, values[free]):
                residual(part)
            return jacobian

        while True:
            solution: Any = least_squares(
                residual,
                inside,
                jac=rates,  # pyright: ignore[reportArgumentType]
                bounds=(_LOWER_BOUNDS[free], _UPPER_BOUNDS[free]),
                x_scale="jac",
                ftol=1e-6,
                xtol=1e-6,
                max_nfev=50,
            )
            values[free] = inside = solution.x
            if noise > 0.0:
                return _Fit(values, solution.fun[: -len(_PRIOR)], solution.jac[: -len(_PRIOR)])
            noise = max(rms(solution.fun), 1e-300)

    def _fitted(self, trials: FloatArray) -> FloatArray:
        """Return the fit for k sets of parameters, shape (k, n)."""
        count, belt = len(trials), trials[:, _BELT, None]
        half = trials[:, _SIZE] / 2.0
        motion = self._integrate(trials)
        since_centre = self._time - trials[:, _CENTRE, None]
        fitted = trials[:, _OFFSET, None] + belt * self._time
        for side, branch in ((-1.0, motion[..., :count]), (1.0, motion[..., count:])):
            since = np.clip(side * since_centre - half[:, None], 0.0, self._reach)
            step = self._reach / _STEPS
            fitted += (1.0 + belt) * _interpolate(branch[:, 0], side * branch[:, 1], step, since)
        return fitted

    def _integrate(self, trials: FloatArray) -> FloatArray:
        """Return displacement and derivative before the landing and after the departure.

        Shape (steps + 1, 2, 2 k), from the edges outwards, by the classical Runge-Kutta method.
        """
        size, stiffness, slope, second, third, fall, scale = np.tile(
            trials[:, [_SIZE, _STIFFNESS, _SLOPE, _SECOND, _THIRD, _FALL, _SCALE]].T, 2
        )
        exponent = float(trials[0, _EXPONENT])
        side = np.repeat([-1.0, 1.0], len(trials))
        # At the landing the spring is short of the limit by the time of the stick.
        early = np.where(side < 0.0, size, 0.0)

        def rate(state: FloatArray, time: FloatArray) -> FloatArray:
            # Far from the solution the motion diverges within reach.
            velocity = np.maximum(np.minimum(state[1], _LARGEST_SPEED), -_LARGEST_SPEED)
            friction = velocity * (slope + velocity * (second + velocity * third))
            if exponent > 0.0:
                friction += fall * np.exp(-(np.abs(velocity / scale) ** exponent))
            return np.array([state[1], friction - fall - stiffness * (state[0] + time - early)])

        step = side * (self._reach / _STEPS)
        states = [np.zeros((2, len(size)))]
        for row in range(_STEPS):
            state, middle = states[-1], (row + 0.5) * step
            k1 = rate(state, row * step)
            k2 = rate(state + step / 2.0 * k1, middle)
            k3 = rate(state + step / 2.0 * k2, middle)
            k4 = rate(state + step * k3, (row + 1.0) * step)
            states.append(state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))
        return np.array(states)


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
