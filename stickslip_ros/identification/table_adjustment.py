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

    predictors = [Predictor(record.delayed(fit.delay)) for record in records]
    measured = np.concatenate([record.position for record in records])
    drive = fit.drive(1.0)
    speeds, runs = zip(*(predictor.free_run(drive) for predictor in predictors), strict=True)
    left = np.concatenate(runs) - measured
    if not np.isfinite(left).all():
        return fit
    of_forces = 1.0 / (rms(fit.residual) * np.sqrt(len(fit.residual)))
    of_runs = _FREE_WEIGHT / (rms(left) * np.sqrt(len(left)))

    def residual(point: FloatArray) -> FloatArray:
        """Return the weighted errors of the forces and of the free runs.

        A point has the unknowns and the shapes, then the velocity at the start of each record.
        """
        moved = fit.at(point)
        drive, speeds = moved.drive(1.0), point[len(moved.point) :].tolist()
        pairs = zip(predictors, speeds, strict=True)
        runs = [predictor.positions(drive, speed) for predictor, speed in pairs]
        errors = np.nan_to_num(np.concatenate(runs) - measured, nan=_UNBOUNDED_ERROR / of_runs)
        return np.concatenate([moved.residual * of_forces, errors * of_runs])

    start: FloatArray = np.concatenate([fit.point, speeds])
    slowest = np.full(len(fit.shapes), fit.rows.least_shape(fit.curve))
    least = np.array([*fit.least, *slowest, *[-np.inf] * len(records)])
    if "mass" in fit.free:  # a mass of 0 has no motion
        place = [*fit.free].index("mass")
        least[place] = _LEAST_MASS_SHARE * fit.unknowns[place]
    solved = least_squares(
        residual,
        np.maximum(start, least + 1e-9),
        bounds=(least, np.inf),
        x_scale=np.maximum(np.abs(start), 1e-3),
        diff_step=_STEP,
        max_nfev=_FREE_RUN_STEPS,
    )
    return fit.at(solved.x)
