"""The choice of a law: fits are compared by what they predict of held-out parts.

Which laws compete is `laws.COMPETING` for a drive on a spring, and `axes.AXIS_LAWS` for an axis.
"""

from collections.abc import Mapping, Sequence
from math import copysign, inf, sqrt

import numpy as np

from stickslip_ros.identification.fit import Fit

_SIGNIFICANT = 3.0
"""Standard errors by which a model must predict better to be preferred to a simpler one."""
_LEAST_GAIN = 0.01
"""Share of the error by which it must be better besides."""
AUTO = "auto"
"""Law that stands for the one that predicts held-out parts best."""


def better_by(better: Fit, worse: Fit) -> float:
    """Return by how many standard errors one model predicts better than the other.

    Less than one per cent, or than `Fit.least_gain`, counts as nothing. It compares the logarithms
    of the errors part by part: a single bad part decides nothing. Models that were not compared on
    the same parts are told apart by their errors alone.
    """
    if len(better.held_out) != len(worse.held_out):
        return copysign(inf, worse.error - better.error)
    if worse.error < (1.0 + _LEAST_GAIN) * better.error + better.least_gain:
        return 0.0
    tiny = np.finfo(float).tiny
    ratios = np.log(np.maximum(worse.held_out, tiny) / np.maximum(better.held_out, tiny))
    mean, count = float(np.mean(ratios)), len(ratios)
    error = float(np.std(ratios, ddof=1)) / sqrt(count) if count > 1 else 0.0
    return mean / error if error > 0.0 else copysign(inf, mean) if mean else 0.0


def choose(candidates: Sequence[Fit]) -> tuple[Fit, Mapping[str, bool]]:
    """Return the simplest model that predicts as well as any, and which others do, by label.

    A model is as good as the best one if the difference of their validation errors is within three
    standard errors, from its scatter over the parts, or if it is simpler and better than such a
    one: the rule of one standard error (L. Breiman et al., Classification and Regression Trees,
    1984, section 3.4), with three. A model with constants that the records do not tell is chosen
    only if all have some.
    """
    best = min(candidates, key=lambda fit: fit.error)
    near = [fit for fit in candidates if fit is best or better_by(best, fit) < _SIGNIFICANT]
    # An error that scatters much is within it, too: what is simpler and better is as good as that.
    as_good = [
        fit
        for fit in candidates
        if any(fit.size <= other.size and fit.error <= other.error for other in near)
    ]
    certain = [fit for fit in as_good if np.isfinite(np.diag(fit.covariance)).all()]
    chosen = min(certain or as_good, key=lambda fit: (fit.size, fit.error))
    return chosen, {fit.label: fit in as_good for fit in candidates}
