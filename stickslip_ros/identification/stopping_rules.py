"""When the fits of a law are good enough, and when they are too far behind to go on."""

from collections.abc import Iterable, Sequence
from math import inf, sqrt

from stickslip_ros.arrays import rms
from stickslip_ros.identification.refinement import Refinement

_ROUNDING = 1.4
"""Errors, in rounding errors of the encoder, up to which no other start is tried."""
_WHITE_CORRELATION = 0.3
"""Correlation of successive errors up to which they are noise: rounding leaves some."""
_EXACT_SHARE = 1e-9
"""Share of the motion up to which an error is none: recordings of simulations have no noise."""
_MISSING_INPUT_ERROR = 0.5
"""Error, as a share of the motion, from which a memory is not tried: an input is missing."""
_GIVEN_UP_LOSS_RATIO = 100.0
"""A law whose squared error is larger by this factor is searched no further."""
_HOPELESS_LOSS_RATIO = 4.0
"""A law whose squared error is larger by this factor after its search is not fitted further."""


def is_white(fit: Refinement) -> bool:
    """Return whether errors are noise, as far as their successive ones tell, or none."""
    exact = rms(fit.residual) < _EXACT_SHARE * fit.scale
    return exact or abs(fit.correlation) < _WHITE_CORRELATION


def is_rounding(fit: Refinement) -> bool:
    """Return whether the errors of positions are as small as those of the encoder.

    They repeat where a slide sticks and the belt moves by whole steps of it between samples.
    """
    task = fit.task
    step = min(record.resolution for record in task.records)
    rows = task.of_positions
    return rms(fit.residual[rows]) < _ROUNDING * step / sqrt(12.0) * rms(task.weight[rows])


def loss_of(fit: Refinement) -> float:
    """Return the squared error of a fit."""
    return fit.loss


def noise_of(fits: Iterable[Refinement]) -> float:
    """Return the least squared error of fits whose errors are noise; infinite if there is none."""
    return min(map(loss_of, filter(is_white, fits)), default=inf)


def may_have_memory(fits: Sequence[Refinement]) -> bool:
    """Return whether a memory may explain the errors: no noise, and no input that is missing."""
    shares = (rms(fit.residual) / fit.scale for fit in fits)
    return noise_of(fits) == inf and min(shares) < _MISSING_INPUT_ERROR


def is_given_up(fit: Refinement, loss: float) -> bool:
    """Return whether a fit is too far behind a squared error for a search to go on.

    It is that of noise, that of LuGre's law after the first steps, or that of the best law before
    constants are added that the records ask for.
    """
    return fit.loss > _GIVEN_UP_LOSS_RATIO * loss


def is_hopeless(loss: float, best: Refinement) -> bool:
    """Return whether a squared error is too far behind a fit for its law to be fitted further."""
    return loss > _HOPELESS_LOSS_RATIO * best.loss
