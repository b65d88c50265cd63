"""The picture of basins of attraction: which motion a start leads to."""

from collections.abc import Iterator, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip_ros.physics.knots import FloatArray
from stickslip_ros.physics.measures import Regime
from stickslip_ros.plots.regimes import REGIMES
from stickslip_ros.plots.style import LIGHT_GREY, PURPLE, SKY_BLUE, YELLOW

_MORE_COLOURS = (SKY_BLUE, YELLOW, PURPLE)
"""Of attractors whose regime another one has too."""

_UNKNOWN = -1

_MANY = 5000
"""Starts from which on a drawing of lines and curves has them as an image within."""


def draw_basin(
    path: Path,
    *,
    position: FloatArray,
    velocity: FloatArray,
    attractor: npt.NDArray[np.intp],
    regimes: Sequence[Regime | None],
    labels: Sequence[str],
    grid_shape: tuple[int, ...] | None,
    belt_speed: float,
    equilibrium_position: float,
) -> None:
    """Write which attractor each of n starts leads to, to `path`; the format follows the ending.

    `position` (m) and `velocity` (m/s) are those of the starts, `attractor` says for each which of
    the `regimes` and `labels` it has, or -1 where that is not known; arrays of n. The starts are a
    row-major grid of `grid_shape`, or anywhere if that is None. Marked are the `belt_speed` (m/s)
    and the equilibrium at `equilibrium_position` (m).
    """
    figure = Figure(figsize=(7.5, 6.8), layout="constrained")
    axes = figure.subplots()
    colours = list(_colours(regimes))
    handles: list[Any] = [
        Patch(color=colour, label=label) for colour, label in zip(colours, labels, strict=True)
    ]
    if np.any(attractor == _UNKNOWN):
        handles.append(Patch(color=LIGHT_GREY, label="not known"))
    look: Any = {
        "cmap": ListedColormap([LIGHT_GREY, *colours]),
        "norm": BoundaryNorm(np.arange(len(labels) + 2) - 1.5, len(labels) + 1),
        "rasterized": len(attractor) > _MANY,
    }
    if grid_shape is not None:
        columns = (column.reshape(grid_shape) for column in (position, velocity, attractor))
        axes.pcolormesh(*columns, shading="nearest", **look)
    else:
        area = float(np.clip(2e5 / len(attractor), 2.0, 30.0))
        axes.scatter(position, velocity, c=attractor, s=area, lw=0.0, **look)
    # White below black is to be seen on any colour.
    axes.axhline(belt_speed, color="white", lw=3.0)
    axes.axhline(belt_speed, color="black", lw=1.2, ls="--")
    axes.plot(equilibrium_position, 0.0, "o", color="white", mec="black", mew=1.5, ms=8.0)
    handles += [
        Line2D([], [], color="black", lw=1.2, ls="--", label="belt speed"),
        Line2D([], [], color="white", mec="black", mew=1.5, marker="o", ls="", label="equilibrium"),
    ]
    axes.set_xlabel("displacement at the start (m)")
    axes.set_ylabel("velocity at the start (m/s)")
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=8)
    figure.savefig(path, dpi=130)


def _colours(regimes: Sequence[Regime | None]) -> Iterator[str]:
    """Yield the colour of each attractor: that of its regime, or another if that is taken."""
    more = cycle(_MORE_COLOURS)
    for number, regime in enumerate(regimes):
        yield next(more) if regime in regimes[:number] else REGIMES[regime][0]
