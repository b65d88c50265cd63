"""Where a slide rests, and what that tells of its static friction: held forces, break-aways."""

from math import inf, sqrt

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.record import Record
from stickslip_ros.measures.noise import white_noise

_LEAST_REST = 5
"""Samples from which the slide rests; without sticking it passes zero speed faster."""
_REST_NOISE, _REST_SHARE = 0.8, 1e-3
"""Speed below which the slide may rest: in errors of position per period, and as a share of the
fastest one."""
_REST_ERRORS, _REST_DRIFT = 12.0, 10.0
"""Range of positions of a slide that rests: in errors of position, and in periods at that speed, as
the filter blurs both ends."""
_HELD_SAMPLES = 10
"""Samples from which a rest tells static friction: near a reversal a slide is as slow for less."""
_MOVED, _GONE = 4.0, 32.0
"""Distances, in errors of position, from which a slide has moved, and is gone. It takes as long for
the first as from there to the second if its acceleration rises evenly, and less if it jumps."""
_MARGIN = 2
"""Time before the first in which it may move already, in that from there to the second."""
_MEAN_SAMPLES, _MEAN_ERRORS = 5, 4.0
"""Samples of a held force, and errors of their mean by which noise may raise the largest one."""


def rests(record: Record, relative: FloatArray) -> list[tuple[int, int]]:
    """Return first sample and end of each rest of the slide on the belt.

    `relative` is the filtered speed, m/s. It rests where it is slower than the encoder tells, and
    has not drifted when it goes on: slow slip does.
    """
    noise = record.noise
    slow = max(_REST_NOISE * noise / record.period, _REST_SHARE * float(np.abs(relative).max()))
    drift = _REST_ERRORS * noise + _REST_DRIFT * slow * record.period
    place = record.position_on_belt
    edges = np.flatnonzero(np.diff(np.abs(relative) < slow, prepend=False, append=False))
    return [
        (low, high)
        for low, high in edges.reshape(-1, 2).tolist()
        if high - low >= _LEAST_REST and float(np.ptp(place[low:high])) <= drift
    ]


def static_force(record: Record, held: FloatArray, sign: float) -> tuple[float, float]:
    """Return the largest friction that holds the slide, and the least at which it breaks loose, N.

    It is a break-away test (B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, Automatica 30(7),
    1994): the largest mean force of a few samples while the slide rests, and the largest force
    until it is gone.

    `held` is the force that friction holds, N, shape (samples,), and `sign` the direction in which
    it pushes the slide over the belt. Static friction is between both; they are minus infinity and
    infinite where the slide never rests, and never starts. The instant of a break-away is known as
    far as the encoder tells.
    """
    error, noise = record.noise, white_noise(held)
    place = record.position_on_belt
    means = np.convolve(sign * held, np.full(_MEAN_SAMPLES, 1.0 / _MEAN_SAMPLES))[: len(held)]
    low, high = -inf, inf
    for start, end in rests(record, record.smoothed(1) - record.belt_velocity):
        if end - start < _HELD_SAMPLES:
            continue
        away = place[end - 1 :] - np.median(place[start:end])
        gone = np.flatnonzero(np.abs(away) > _GONE * error)
        far = int(gone[0]) if len(gone) else len(away) - 1
        moved = np.flatnonzero(np.abs(away[: far + 1]) > _MOVED * error)
        near = int(moved[0]) if len(moved) else far
        # The mean of the first samples of a rest has those before it.
        first = start + _MEAN_SAMPLES - 1
        begun = end - 2 + near - _MARGIN * (far - near)
        if begun <= first:
            continue
        largest = float(np.max(means[first:begun]))
        low = max(low, largest - _MEAN_ERRORS * noise / sqrt(_MEAN_SAMPLES))
        direct = len(gone) and (away[near : far + 1] * away[far] > 0.0).all()
        if direct and away[far] * sign > 0.0:
            largest = float(np.max(sign * held[begun : end + near]))
            high = min(high, largest + _MEAN_ERRORS * noise)
    return low, high
