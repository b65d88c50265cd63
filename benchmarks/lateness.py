"""Lateness at a fixed rate, and the bare sleep loop that is its limit."""

import time
from array import array
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks.slices import Row

SLEEP_LOOP = "sleep loop"

FIGURES: dict[str, Callable[[NDArray[np.float64]], Any]] = {
    "p50": np.median,
    "p99": partial(np.quantile, q=0.99),
    "p99.9": partial(np.quantile, q=0.999),
    "max": np.max,
}


def times_of(samples: int) -> "array[float]":
    """Return an array for `samples` times; filling it allocates no memory."""
    return array("d", bytes(8 * samples))


def sleep_loop(samples: int, period: float) -> "array[float]":
    """Sleep until each deadline, the first being now; return the wake-up times, s."""
    times = times_of(samples)
    times[0] = origin = time.monotonic()
    for number in range(1, samples):
        wait = origin + number * period - time.monotonic()
        if wait > 0.0:
            time.sleep(wait)
        times[number] = time.monotonic()
    return times


def lateness(times: ArrayLike, period: float) -> NDArray[np.float64]:
    """Return how long after its deadline each time but the first was, s; not accumulated."""
    times = np.asarray(times, dtype=float)
    return (times - times[0] - period * np.arange(len(times)))[1:]


def lateness_rows(
    name: str,
    ours: NDArray[np.float64],
    against: str,
    peer: NDArray[np.float64],
    *,
    p99_aim: float | None = None,
) -> list[Row]:
    rows: list[Row] = []
    for figure, of in FIGURES.items():
        late, peer_late = float(of(ours)), float(of(peer))
        aim = p99_aim if figure == "p99" else None
        what = f"{name}, lateness {figure}"
        rows.append(Row(what, "s", late, against, peer_late, peer_late / late, aim=aim))
    return rows
