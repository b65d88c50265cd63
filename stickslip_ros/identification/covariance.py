"""Covariances of least-squares fits to series whose errors may be coloured."""

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray

BLOCKS = 24
"""Number of blocks of time from whose scatter covariances are computed."""
_RANK = 1e-13
"""Share of the largest eigenvalue below which rows do not tell a combination of parameters."""
_PART = 1e-6
"""Part in such a combination from which a parameter is not identifiable; less is rounding error."""


def block_covariance(jacobian: FloatArray, residual: FloatArray, lost: int = 0) -> FloatArray:
    """Return the covariance of a least-squares fit to a series whose errors may be coloured.

    It is the jackknife over blocks of time, to first order (A. C. Cameron, D. L. Miller, A
    practitioner's guide to cluster-robust inference, Journal of Human Resources 50(2), 2015):
    errors may be correlated within a block. No variance is below that with independent errors. The
    jacobian has the shape (rows, parameters), its rows follow one another in time; `lost` further
    values were fitted. The variance of what the rows do not tell is infinite, its covariances are
    0; see `propagated`.
    """
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    scaled = jacobian / scale
    product = scaled.T @ scaled
    untold = _untold(product)
    changes: list[FloatArray] = []
    for rows in np.array_split(np.arange(len(residual)), BLOCKS):
        part = scaled[rows]
        rest = np.linalg.pinv(product - part.T @ part, rcond=_RANK, hermitian=True)
        changes.append(rest @ (part.T @ residual[rows]))
    away = np.array(changes) - np.mean(changes, axis=0)
    covariance = (away.T @ away) * (BLOCKS - 1) / BLOCKS
    freedom = max(len(residual) - jacobian.shape[1] - lost, 1)
    white = np.linalg.pinv(product, rcond=_RANK, hermitian=True)
    white *= float(residual @ residual) / freedom
    tiny = np.finfo(float).tiny
    ratios = np.maximum(np.diag(white), tiny) / np.maximum(np.diag(covariance), tiny)
    larger = np.sqrt(np.maximum(ratios, 1.0))
    covariance = covariance * np.outer(larger / scale, larger / scale)
    covariance[untold, :] = covariance[:, untold] = 0.0
    covariance[untold, untold] = np.inf
    return covariance


def _untold(product: FloatArray) -> BoolArray:
    """Return which parameters have a part in a combination that rows do not tell."""
    if not len(product):
        return np.zeros(0, bool)
    sizes, axes = np.linalg.eigh(product)
    lost = sizes <= _RANK * max(float(sizes[-1]), np.finfo(float).tiny)
    return np.any(np.abs(axes[:, lost]) > _PART, axis=1)


def propagated(linear: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the covariance of results that depend linearly on values with a covariance.

    `linear` has the derivatives of the results, shape (results, values). The variance of what
    depends on a value with an infinite variance is infinite.
    """
    finite = np.isfinite(np.diag(covariance))
    known = linear[:, finite]
    variances = known @ covariance[np.ix_(finite, finite)] @ known.T
    untold = (linear[:, ~finite] != 0.0).any(axis=1)
    variances[untold, :] = variances[:, untold] = 0.0
    variances[untold, untold] = np.inf
    return variances
