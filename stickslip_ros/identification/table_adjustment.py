"""Tables of axes whose forces fit, and whose free runs through the records do, too."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stickslip_ros.arrays import FloatArray, rms
from stickslip_ros.identification.predictor import Predictor
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.regression import Regression, solve

_UNBOUNDED_ERROR = 1e3
"""Error of a free run that is not bounded, in units of that of the regression."""
_FREE_RUN_STEPS = 3
"""Steps in which forces and free runs are fitted together."""
_FREE_WEIGHT = 1.4
"""Weight of the free run beside that of the forces."""
_LEAST_MASS_SHARE = 0.1
"""Smallest mass that is tried, as a share of that by the forces."""
_STEP = 1e-4
"""Step of differences, as a share of the value."""


def adjusted(fit: Regression, records: Sequence[Record]) -> Regression:
    """Return a regression whose forces fit, and whose free run through each record, too.

    The sum of both mean squares is least, each in units of what the regression leaves. `records`
    are those that it was fitted to. Forces that leave a free run unbounded stay as they are.
    """
    from scipy.optimize import least_squares

    task = _FreeRuns(fit, records)
    if not task.bounded:
        return fit
    start = task.begun(fit if fit.rows.resting else task.linear())
    slowest = np.full(len(fit.shapes), fit.rows.least_shape(fit.curve))
    least = np.array([*task.least, *slowest, *[-np.inf] * len(records)])
    solved = least_squares(
        task.residual,
        np.maximum(start, least + 1e-9),
        bounds=(least, np.inf),
        x_scale=np.maximum(np.abs(start), 1e-3),
        diff_step=_STEP,
        max_nfev=_FREE_RUN_STEPS,
    )
    return fit.at(solved.x)


class _FreeRuns:
    """The forces of a regression and the free runs of its drive, as one residual.

    A point has the unknowns and the shapes of the regression, then the velocity at the start of
    each record.
    """

    def __init__(self, fit: Regression, records: Sequence[Record]) -> None:
        self._fit = fit
        self._predictors = [Predictor(record.delayed(fit.delay)) for record in records]
        self._measured = np.concatenate([record.position for record in records])
        left = np.concatenate([run for _, run in self._runs(fit)]) - self._measured
        self.bounded = bool(np.isfinite(left).all())
        count = len(fit.residual)
        self._weights = (
            1.0 / (rms(fit.residual) * np.sqrt(count)),
            _FREE_WEIGHT / (rms(left) * np.sqrt(len(left))),
        )
        # The same weight for a run that is sampled as the rows are.
        self._row_weight = _FREE_WEIGHT / (rms(left) * np.sqrt(count))

    @property
    def least(self) -> FloatArray:
        """Smallest value of each of the unknowns; a mass of 0 has no motion."""
        least = self._fit.least
        if "mass" in self._fit.free:
            place = [*self._fit.free].index("mass")
            least[place] = _LEAST_MASS_SHARE * self._fit.unknowns[place]
        return least

    def residual(self, point: FloatArray) -> FloatArray:
        """Return the errors of the forces and of the simulated free runs, weighted."""
        moved = self._fit.at(point)
        drive, speeds = moved.drive(1.0), point[len(moved.point) :].tolist()
        pairs = zip(self._predictors, speeds, strict=True)
        runs = [predictor.positions(drive, speed) for predictor, speed in pairs]
        errors = np.concatenate(runs) - self._measured
        errors = np.nan_to_num(errors, nan=_UNBOUNDED_ERROR / self._weights[1])
        return np.concatenate([moved.residual * self._weights[0], errors * self._weights[1]])

    def begun(self, fit: Regression) -> FloatArray:
        """Return the point of a regression with the velocities of its best free runs."""
        return np.concatenate([fit.point, [speed for speed, _ in self._runs(fit)]])

    def linear(self) -> Regression:
        """Return the fit whose residual is least if errors of force move the mass alone.

        The position error of a free run is then the force error through mass and viscous friction,
        which is linear in the unknowns.
        """
        from scipy.optimize import least_squares
        from scipy.signal import lfilter

        fit, parts = self._fit, self._fit.rows.parts
        mass = fit.constants["mass"]
        speed, typical = fit.rows.speeds, rms(fit.rows.speeds)
        rate = max(_slope(fit, typical, float(speed[-1])) / mass, 1e-3)
        lengths = [len(part.rows(part.time)) for part in parts]
        steps = [float(part.time[1] - part.time[0]) * part.decimation for part in parts]
        place = np.split(np.arange(sum(lengths)), np.cumsum(lengths)[:-1])

        def positions(columns: FloatArray) -> FloatArray:
            made: list[FloatArray] = []
            for rows, step in zip(place, steps, strict=True):
                speeds = lfilter([step / mass], [1.0, -np.exp(-rate * step)], columns[rows], 0)
                made.append(np.cumsum(speeds, axis=0) * step)
            return np.concatenate(made)

        by_speed = np.zeros((len(fit.residual), len(parts)))
        for number, (rows, step) in enumerate(zip(place, steps, strict=True)):
            by_speed[rows, number] = -np.expm1(-rate * step * np.arange(len(rows))) / rate

        def solved(shapes: FloatArray) -> tuple[FloatArray, FloatArray]:
            design, wanted = replace(fit, shapes=shapes).system
            matrix = np.vstack(
                [
                    np.hstack([design * self._weights[0], np.zeros_like(by_speed)]),
                    np.hstack([positions(design), by_speed]) * self._row_weight,
                ]
            )
            target = np.concatenate(
                [wanted * self._weights[0], positions(wanted) * self._row_weight]
            )
            least = np.array([*self.least, *[-np.inf] * len(parts)])
            values = solve(matrix, target, least)
            return values, target - matrix @ values

        def by_logarithms(logarithms: FloatArray) -> FloatArray:
            return solved(np.exp(logarithms))[1]

        shapes = fit.shapes
        if len(shapes):
            lowest = np.log(fit.rows.least_shape(fit.curve))
            optimum = least_squares(
                by_logarithms,
                np.maximum(np.log(shapes), lowest),
                bounds=(lowest, np.inf),
                diff_step=1e-3,
                max_nfev=10,
            )
            shapes = np.exp(optimum.x)
        return replace(fit, unknowns=solved(shapes)[0][: len(fit.unknowns)], shapes=shapes)

    def _runs(self, fit: Regression) -> list[tuple[float, FloatArray]]:
        drive = fit.drive(1.0)
        return [predictor.free_run(drive) for predictor in self._predictors]


def _slope(fit: Regression, low: float, high: float) -> float:
    """Return the mean slope of the friction curves between two speeds, N s/m."""
    rises = [
        np.diff(fit.curve.terms(np.array([low, high]), shape) @ forces)
        for forces, shape in fit.curves
    ]
    return float(np.mean(rises)) / (high - low)
