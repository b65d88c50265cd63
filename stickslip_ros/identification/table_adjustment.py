"""Tables of axes whose forces fit, and whose free runs through the records do, too."""

from collections.abc import Sequence

import numpy as np

from stickslip_ros.arrays import FloatArray, rms
from stickslip_ros.identification.predictor import Predictor
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.regression import Regression

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
    slowest = np.full(len(fit.shapes), fit.rows.least_shape(fit.curve))
    least = np.array([*task.least, *slowest, *[-np.inf] * len(records)])
    solved = least_squares(
        task.residual,
        np.maximum(task.start, least + 1e-9),
        bounds=(least, np.inf),
        x_scale=np.maximum(np.abs(task.start), 1e-3),
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
        drive = fit.drive(1.0)
        speeds, runs = zip(
            *(predictor.free_run(drive) for predictor in self._predictors), strict=True
        )
        self.start: FloatArray = np.concatenate([fit.point, speeds])
        """Point of the regression, with the velocities of its best free runs."""
        left = np.concatenate(runs) - self._measured
        self.bounded = bool(np.isfinite(left).all())
        self._weights = (
            1.0 / (rms(fit.residual) * np.sqrt(len(fit.residual))),
            _FREE_WEIGHT / (rms(left) * np.sqrt(len(left))),
        )

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
