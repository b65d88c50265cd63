"""Covariances of what was fitted, with errors that may be coloured."""

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray

QUANTILE = 1.96
"""Half of a 95 % interval, in standard errors."""


def white_covariance(jacobian: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the covariance of a least-squares fit with independent errors.

    Parameters
    ----------
    jacobian : array of shape (rows, parameters)
        Derivatives of the model.
    residual : array of shape (rows,)
        Errors.

    Returns
    -------
    array of shape (parameters, parameters)
        Covariance; of what the rows do not tell, infinite variance.
    """
    freedom = max(len(residual) - jacobian.shape[1], 1)
    return _inverse(jacobian) * (float(residual @ residual) / freedom)


def clustered_covariance(jacobian: FloatArray, residual: FloatArray, block: IntArray) -> FloatArray:
    """Return the covariance with errors that are coloured within blocks, independent between them.

    It is the sandwich estimator with the usual correction for few blocks (A. C. Cameron,
    D. L. Miller, A practitioner's guide to cluster-robust inference, Journal of Human Resources
    50(2), 2015).

    Parameters
    ----------
    jacobian : array of shape (rows, parameters)
        Derivatives of the model.
    residual : array of shape (rows,)
        Errors.
    block : array of shape (rows,)
        Number of the block of each row.

    Returns
    -------
    array of shape (parameters, parameters)
        Covariance.
    """
    bread = _inverse(jacobian)
    numbers = np.unique(block)
    scores = np.array([jacobian[block == each].T @ residual[block == each] for each in numbers])
    count = len(numbers)
    return bread @ (scores.T @ scores) @ bread * (count / max(count - 1, 1))


def _inverse(jacobian: FloatArray) -> FloatArray:
    """Return the inverse of J^T J."""
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    scaled = jacobian / scale
    inverse = np.linalg.pinv(scaled.T @ scaled, rcond=1e-13, hermitian=True)
    return inverse / np.outer(scale, scale)
