"""What rests of a slide tell of its static friction: the forces that it holds, and break-aways."""

from math import inf, sqrt

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.record import Record
from stickslip_ros.measures.noise import white_noise

_STILL_SAMPLES = 20
"""Samples over which the position of a slide that rests stays."""
_MOVED, _GONE = 4.0, 32.0
"""Distances, in errors of position, from which a slide has moved, and is gone. It takes as long for
the first as from there to the second if its acceleration rises evenly, and less if it jumps."""
_MARGIN = 2
"""Time before the first in which it may move already, in that from there to the second."""
_MEAN_SAMPLES, _MEAN_ERRORS = 5, 4.0
"""Samples of a held force, and errors of their mean by which noise may raise the largest one."""


def static_force(record: Record, held: FloatArray, sign: float) -> tuple[float, float]:
    """Return the largest friction that holds the slide, and the least at which it breaks loose, N.

    It is a break-away test (B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, Automatica 30(7),
    1994): the largest mean force of a few samples while the position stays, and the largest force
    until it is gone.

    `held` is the force that friction holds, N, shape (samples,), and `sign` the direction in which
    it pushes the slide over the belt. Static friction is between both; they are minus infinity and
    infinite where the slide never rests, and never starts. The instant of a break-away is known as
    far as the encoder tells.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    error = max(white_noise(record.position), record.resolution / sqrt(12.0))
    noise = white_noise(held)
    place = record.position - record.period * np.cumsum(record.belt_velocity)
    # A window looks back from its sample.
    back = _STILL_SAMPLES // 2 - 1
    width = maximum_filter1d(place, _STILL_SAMPLES, origin=back)
    width -= minimum_filter1d(place, _STILL_SAMPLES, origin=back)
    still = width <= _MOVED * error
    still[: 2 * _STILL_SAMPLES] = False
    means = np.convolve(sign * held, np.full(_MEAN_SAMPLES, 1.0 / _MEAN_SAMPLES))[: len(held)]
    edges = np.flatnonzero(np.diff(still, prepend=False, append=False))
    low, high = -inf, inf
    for start, end in edges.reshape(-1, 2).tolist():
        away = place[end - 1 :] - np.median(place[start:end])
        gone = np.flatnonzero(np.abs(away) > _GONE * error)
        far = int(gone[0]) if len(gone) else len(away) - 1
        moved = np.flatnonzero(np.abs(away[: far + 1]) > _MOVED * error)
        near = int(moved[0]) if len(moved) else far
        begun = max(end - 2 + near - _MARGIN * (far - near), start)
        if begun > start:
            largest = float(np.max(means[start:begun]))
            low = max(low, largest - _MEAN_ERRORS * noise / sqrt(_MEAN_SAMPLES))
        direct = len(gone) and (away[near : far + 1] * away[far] > 0.0).all()
        if direct and begun > start and away[far] * sign > 0.0:
            largest = float(np.max(sign * held[begun : end + near]))
            high = min(high, largest + _MEAN_ERRORS * noise)
    return low, high
