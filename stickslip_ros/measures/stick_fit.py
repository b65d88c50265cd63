"""Stick edges from positions with noise: the motion near the speed of the belt, fitted."""

from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np

from stickslip_ros.arrays import FloatArray

_STEPS = 24
"""Steps of the integration on each side of the stick."""
_MARGIN = 0.5
"""Part of the reach of the data by which the integration reaches further: edges move."""
_LARGEST_SPEED = 10.0
"""Largest velocity of the fit, in belt speeds."""
_CURVATURE, _CALIBRATION = 1.0, 0.05
"""Prior standard deviations of the friction's second and third power, in natural units, and of the
belt speed, as a share of it."""
_JUMP_LEVEL = 25.0
"""Gain in squared residuals, in variances, of a jump of the friction over a form with as many
parameters but one: a small one makes the edge at the departure uncertain, and laws have none."""


@dataclass(frozen=True)
class StickFit:
    """Fitted motion on both sides of a stick, or of the highest speed of a motion without one.

    Near the belt's speed the displacement r relative to the belt obeys

        r'' = g r' + g2 r'^2 + g3 r'^3 - w0^2 r - w0^2 v_b (t - t_departure) - j (1 - e^-|r'/s|^n)

    on both sides of the stick, from r = r' = 0 at its edges: the spring has reached the limit of
    the friction at departure, and is short of it by k v_b t_stick at landing. The powers of r' and
    the fall j of the friction, at once or with n = 1 or 2, are the kinetic curve less the damping,
    over the mass. A motion without a stick obeys it, too, with r' < 0 where r'' = 0.
    """

    centre: float
    """Middle of the stick, or instant of the highest speed, s."""
    stick_time: float
    """Duration of the stick, s; 0 without."""
    belt_speed: float
    """Speed during the stick, m/s; the given one without."""
    offset: float
    """Position of a slide that sticks, at time 0, m."""
    residual: FloatArray
    """Differences between positions and fit, m; shape (n,)."""
    jacobian: FloatArray
    """Derivatives of the fit by its free parameters: the centre, the stick time, the belt speed of
    a fit with a stick, and others; shape (n, p)."""
    squares: float
    """Sum of the squared residuals, m^2."""
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


def fit_stick(
    time: FloatArray,
    position: FloatArray,
    belt_speed: float,
    frequency: float,
    stick_time: float,
    *,
    sticks: bool = True,
    may_fall: bool = True,
) -> StickFit:
    """Fit the motion around a stick at time 0, and the belt speed, to positions, m, at times, s.

    Nonlinear least squares, with the motion integrated from its edges (single shooting). Where the
    data do not tell one form of the friction from another, the edges are means over the forms, with
    the weights of their information criteria by Akaike (Burnham and Anderson, Model selection,
    2002), and their `spread` is an error; residuals are those of the best form.

    The scale of the fit is the angular `frequency` of the cycle, rad/s; `belt_speed`, above 0 m/s,
    and `stick_time`, s, are the first guesses. Without `sticks` the belt has this speed, and the
    highest speed of the slide is another. Unless it `may_fall`, the friction is a cubic.
    """
    reach = (float(np.abs(time).max()) - stick_time / 2.0) * frequency
    length = belt_speed / frequency
    times, relative = time * frequency, (position - belt_speed * time) / length
    start = np.zeros(len(_LOWER_BOUNDS))
    start[_SIZE] = max(stick_time * frequency, 0.05) if sticks else 0.02
    start[_STIFFNESS], start[_OFFSET] = 1.2, float(np.median(relative))
    free = _SMOOTH if sticks else _NO_STICK
    fits = [_Fit.of(_Problem(times, relative, reach, sticks=sticks), start, free)]
    if sticks:
        start = fits[0].values.copy()
        noise = (fits[0].squares / len(time)) ** 0.5
        for exponent, free, values in _FALLS if may_fall else ():
            start[[*values]] = [*values.values()]
            problem = _Problem(times, relative, reach, exponent=exponent, noise=noise)
            fits.append(_Fit.of(problem, start, free))
    squares = np.array([fit.squares for fit in fits])
    freedom = max(len(time) - len(_STEEP), 1)
    criterion = squares / max(squares.min(), 1e-300) * freedom
    criterion += [0.0, _JUMP_LEVEL, 0.0, 0.0][: len(fits)]
    weight = np.exp(0.5 * (criterion.min() - criterion))
    best, weight = fits[int(np.argmax(weight))], weight / weight.sum()
    found = np.array([fit.values for fit in fits])
    mean = weight @ found
    apart = (found - mean)[:, [_CENTRE, _SIZE, _BELT]]
    spread = (apart.T * weight) @ apart
    units = np.array([1.0 / frequency, 1.0 / frequency, belt_speed])
    scale = np.append(units, np.ones(best.jacobian.shape[1] - 3))
    if not sticks:
        scale[2] = 1.0
    return StickFit(
        centre=float(mean[_CENTRE]) / frequency,
        stick_time=float(mean[_SIZE]) / frequency if sticks else 0.0,
        belt_speed=belt_speed * (1.0 + float(mean[_BELT])),
        offset=float(mean[_OFFSET]) * length,
        residual=-best.residual * length,
        jacobian=best.jacobian * length / scale,
        squares=best.squares * length**2,
        spread=spread * np.outer(units, units),
    )


class _Fit(NamedTuple):
    values: FloatArray
    residual: FloatArray
    jacobian: FloatArray

    @classmethod
    def of(cls, problem: "_Problem", start: FloatArray, free: list[int]) -> Self:
        values = problem.solve(start, free)
        return cls(values, *problem.linearized(values, free))

    @property
    def squares(self) -> float:
        return float(self.residual @ self.residual)


_CENTRE, _SIZE, _BELT, _STIFFNESS, _SLOPE, _SECOND, _THIRD, _OFFSET, _FALL, _SCALE = range(10)
_SMOOTH = [_CENTRE, _SIZE, _BELT, _STIFFNESS, _SLOPE, _SECOND, _THIRD, _OFFSET]
_JUMPING = [*_SMOOTH, _FALL]
_STEEP = [_CENTRE, _SIZE, _BELT, _STIFFNESS, _SLOPE, _OFFSET, _FALL, _SCALE]
_NO_STICK = [each for each in _SMOOTH if each != _BELT]
_STRAIGHT = {_SLOPE: 0.0, _SECOND: 0.0, _THIRD: 0.0, _FALL: 0.5, _SCALE: 0.5}
_FALLS = ((0, _JUMPING, {_FALL: 0.1}), (1, _STEEP, _STRAIGHT), (2, _STEEP, _STRAIGHT))
"""Exponent, free parameters and starts of each form of a fall of the friction; 0: it jumps."""
_PRIOR = {_SECOND: _CURVATURE, _THIRD: _CURVATURE, _BELT: _CALIBRATION}
_LEAST_SIZE = 1e-4
"""Least stick time of the fit: the derivative by it is proportional to it."""
_LOWER_BOUNDS = np.array([-np.inf, _LEAST_SIZE, -0.3, 0.0, -20.0, -20.0, -20.0, -np.inf, 0.0, 0.02])
_UPPER_BOUNDS = np.array([np.inf, np.inf, 0.3, 20.0, 20.0, 20.0, 20.0, np.inf, 20.0, 2.0])


class _Problem:
    """Least squares in natural units: time 1 / frequency, length belt speed / frequency."""

    def __init__(
        self,
        time: FloatArray,
        relative: FloatArray,
        reach: float,
        *,
        sticks: bool = True,
        exponent: int = 0,
        noise: float = 0.0,
    ) -> None:
        self.time, self.relative, self._sticks = time, relative, sticks
        self._reach, self._exponent, self._noise = (1.0 + _MARGIN) * reach, exponent, noise

    def solve(self, start: FloatArray, free: list[int]) -> FloatArray:
        """Return the parameters with the least squares of those that are free."""
        from scipy.optimize import least_squares  # takes long to import

        values, prior = start.copy(), np.zeros((len(_PRIOR), len(start)))
        prior[range(len(_PRIOR)), list(_PRIOR)] = 1.0 / np.array([*_PRIOR.values()])
        lowest = _LOWER_BOUNDS.copy()
        if not self._sticks:
            lowest[[_SIZE, _STIFFNESS]] = -0.3
        inside = np.clip(start, lowest + 1e-9, _UPPER_BOUNDS - 1e-9)[free]
        jacobian = np.empty(0)

        def residual(part: FloatArray) -> FloatArray:
            nonlocal jacobian
            values[free] = part
            rest, slopes = self.linearized(values, free)
            jacobian = np.concatenate([slopes, self._noise * prior[:, free]])
            return np.append(rest, self._noise * (prior @ values))

        def rates(_: FloatArray) -> FloatArray:
            return jacobian

        while True:
            found: Any = least_squares(
                residual,
                inside,
                jac=rates,  # pyright: ignore[reportArgumentType]
                bounds=(lowest[free], _UPPER_BOUNDS[free]),
                x_scale="jac",
                ftol=1e-6,
                xtol=1e-6,
                max_nfev=50,
            )
            inside = found.x
            # The prior is weighed by the noise that the fit leaves.
            known, self._noise = self._noise, float(np.sqrt(np.mean(np.square(found.fun))))
            if known > 0.0:
                values[free] = inside
                return values

    def linearized(self, values: FloatArray, free: list[int]) -> tuple[FloatArray, FloatArray]:
        """Return fit less data, and the derivatives of the fit by the free parameters."""
        step = 1e-6
        trials = np.tile(values, (len(free) + 1, 1))
        trials[np.arange(len(free)), free] += step
        fitted = self._fitted(trials)
        return fitted[-1] - self.relative, (fitted[:-1] - fitted[-1]).T / step

    def _fitted(self, trials: FloatArray) -> FloatArray:
        """Return the fit for k sets of parameters, shape (k, n)."""
        half = trials[:, _SIZE] / 2.0 if self._sticks else np.zeros(len(trials))
        positions, velocities = self._integrate(trials)
        step, since_centre = self._reach / _STEPS, self.time - trials[:, _CENTRE, None]
        fitted, speed = (
            trials[:, _OFFSET, None] + trials[:, _BELT, None] * self.time,
            1.0 + trials[:, _BELT, None],
        )
        for side, columns in ((-1.0, slice(None, len(trials))), (1.0, slice(len(trials), None))):
            since = np.clip(side * since_centre - half[:, None], 0.0, self._reach)
            fitted += speed * _interpolate(
                positions[:, columns], side * velocities[:, columns], step, since
            )
        return fitted

    def _integrate(self, trials: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return displacement and derivative before the landing and after the departure.

        Shape (steps + 1, 2 k), from the edges outwards.
        """
        size, stiffness, slope, second, third, fall, scale = np.tile(
            trials[:, [_SIZE, _STIFFNESS, _SLOPE, _SECOND, _THIRD, _FALL, _SCALE]].T, 2
        )
        exponent = self._exponent
        side = np.repeat([-1.0, 1.0], len(trials))
        if self._sticks:
            # At the landing the spring is short of the limit by the time of the stick.
            early, gap, limit = np.where(side < 0.0, size, 0.0), np.zeros_like(size), -fall
        else:
            early, gap = np.zeros_like(size), size
            limit = gap * (slope + gap * (-second + gap * third))
        step = side * (self._reach / _STEPS)
        position, velocity = np.zeros_like(size), -gap

        def rate(position: FloatArray, velocity: FloatArray, time: FloatArray) -> FloatArray:
            # Far from the solution the motion diverges within reach.
            velocity = np.maximum(np.minimum(velocity, _LARGEST_SPEED), -_LARGEST_SPEED)
            friction = velocity * (slope + velocity * (second + velocity * third))
            if exponent:
                share = np.abs(velocity / scale)
                friction += fall * np.exp(-(share if exponent == 1 else share * share))
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
