"""Look of each regime in all figures."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.plots.style import BLUE, GREEN, GREY, LIGHT_GREY, MANY, ORANGE, SKY_BLUE, YELLOW

INK = "#333333"
"""Colour of hatches, visible on every colour except black."""


class Look(NamedTuple):
    """Colour and label of a regime, with marker and hatch to distinguish it without colour."""

    colour: str
    label: str
    marker: str
    hatch: str
    """Hatch pattern, drawn in `INK`."""


REGIMES: Mapping[Regime | None, Look] = {
    regime: Look(colour, Regime.label(regime), marker, hatch)
    for regime, colour, marker, hatch in (
        (Regime.STICK_SLIP, ORANGE, "o", ""),
        (Regime.PURE_SLIP, BLUE, "^", "..."),
        (Regime.EQUILIBRIUM, GREEN, "s", "///"),
        (Regime.HELD, SKY_BLUE, "v", "---"),
        (Regime.STUCK, GREY, "D", "xxx"),
        (Regime.UNBOUNDED, "black", "X", ""),
        (Regime.UNDERSAMPLED, YELLOW, "p", "+++"),
        (None, LIGHT_GREY, "P", "\\\\\\"),
    )
}
"""Look by regime; None is for a motion without one."""


def draw_cells(
    axes: Axes, x: FloatArray, y: FloatArray, shown: BoolArray, look: Look, **more: Any
) -> None:
    """Fill the cells of a grid that are `shown`, in the colour and with the hatch of a look."""
    if not shown.any():
        return
    rasterized = shown.size > MANY
    filling = ListedColormap([look.colour])
    cells = np.where(shown, 0.0, np.nan)
    mesh: Any = axes.pcolormesh(x, y, cells, cmap=filling, rasterized=rasterized, **more)
    if not look.hatch:
        return
    # One outline of all cells: hatching each cell takes a hundred times as long.
    corners = mesh.get_coordinates()
    around = corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]
    outlines = np.stack([corner[shown] for corner in (*around, around[0])], axis=1)
    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    outline: Any = Path(outlines.reshape(-1, 2), np.tile(codes, len(outlines)))
    hatched: Any = PathPatch(outline, lw=0.0, rasterized=rasterized, hatch=look.hatch)
    hatched.set(facecolor="none", edgecolor=INK)
    axes.add_patch(hatched)


def patch(look: Look, label: str) -> Patch:
    """Return the legend entry of such cells."""
    return Patch(facecolor=look.colour, hatch=look.hatch, edgecolor=INK, lw=0.0, label=label)
