"""Bifurcation diagram by theory: equilibria and limit cycles over the belt speed."""

from collections.abc import Iterator
from itertools import pairwise
from math import isclose
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.physics.theory.bifurcation_branches import BifurcationBranches, Branch
from stickslip_ros.plots.regimes import REGIMES
from stickslip_ros.plots.style import (
    DASHES,
    GREY,
    SCREEN,
    FigureStyle,
    finish,
    styled,
    text_width,
)
from stickslip_ros.plots.units import Units

_UNSTABLE: Any = {"ls": (0, (4.0, 2.0))}
_POINT: Any = {"marker": "o", "ms": 5.0, "ls": "", "color": "white", "mec": "black", "zorder": 4.0}
_FOLD: Any = {**_POINT, "marker": "D", "ms": 4.0}
_NOW: Any = {"color": GREY, "lw": 3.0, "alpha": 0.6, "zorder": 1.0}
_ONSET: Any = {"color": "black", "lw": 0.8, "ls": DASHES[2], "zorder": 1.5}
_BORDER: Any = {"color": "black", "lw": 0.5, "ls": DASHES[1], "zorder": 1.5}

_SAME = 1e-3
"""Relative distance of two belt speeds below which one mark serves for both."""


@styled
def branches_figure(
    found: BifurcationBranches, *, title: str, style: FigureStyle = SCREEN
) -> Figure:
    """Return the bifurcation diagram of a drive without control.

    Lines are solid where the motion is stable and dashed where it is not. A limit cycle has two
    lines, its least and its greatest displacement. Above each range of belt speeds stands the
    motion that the drive settles to. The drive's own belt speed is marked.
    """
    figure = style.figure(8.0, 5.6, narrow=1.15)
    style.set_title(figure, title)
    axes = figure.subplots()
    units = Units.for_drive(found.drive)
    branches = [*found.equilibria, *found.cycles]
    every = [each for branch in branches for each in (branch.least, branch.greatest)]
    length, y_label = units.axis(units.named("displacement"), "m", *every)
    speed, x_label = units.axis(units.named("belt speed"), "m/s", found.belt_speeds)
    for branch in found.equilibria:
        look: Any = {"color": REGIMES[Regime.EQUILIBRIUM].colour, "lw": 1.8}
        _draw(axes, branch, branch.least, speed, length, look)
    for branch in found.cycles:
        for edge in (branch.least, branch.greatest):
            for sticks in (False, True):
                shown = np.where(_touching(branch.sticks == sticks), edge, np.nan)
                _draw(axes, branch, shown, speed, length, _look(sticks=sticks))
    handles = _legend(found)
    for point in found.hopf_points:
        rest = np.interp(point.belt_speed, *_equilibrium(found))
        axes.plot(point.belt_speed / speed, rest / length, **_POINT)
        handles.append(Line2D([], [], **_POINT, label=f"Hopf point {_at(units, point.belt_speed)}"))
    onset, own = found.sticking_onset, found.drive.belt_speed
    for fold in found.folds:
        name = "fold"
        if onset is not None and isclose(fold, onset, rel_tol=_SAME):
            name, onset = "fold, onset of sticking", None
        for branch in found.cycles:
            for end in (0, -1):
                if branch.belt_speeds[end] == fold:
                    ends = branch.least[end] / length, branch.greatest[end] / length
                    axes.plot([fold / speed] * 2, ends, **_FOLD)
        handles.append(Line2D([], [], **_FOLD, label=f"{name} {_at(units, fold)}"))
    if onset is not None:
        axes.axvline(onset / speed, **_ONSET)
        label = f"onset of sticking {_at(units, onset)}"
        handles.append(Line2D([], [], **_ONSET, label=label))
    if own != 0.0:
        axes.axvline(own / speed, **_NOW)
        label = f"belt speed of the drive {_at(units, own)}"
        handles.append(Line2D([], [], **_NOW, label=label))
    low, high = found.belt_speeds[[0, -1]].tolist()
    axes.set_xlim(min(low, own, 0.0) / speed, max(high, own, 0.0) / speed)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    finish(figure)
    style.legend_below(figure, handles, most=3)
    _name_regions(figure, axes, found, speed)
    return figure


def _draw(
    axes: Axes, branch: Branch, edge: FloatArray, speed: float, length: float, look: dict[str, Any]
) -> None:
    dashes = {} if branch.stable else _UNSTABLE
    axes.plot(branch.belt_speeds / speed, edge / length, **{**look, **dashes})


def _look(*, sticks: bool) -> dict[str, Any]:
    regime = Regime.STICK_SLIP if sticks else Regime.PURE_SLIP
    # Widths differ, too, so that colour is not the only distinction.
    return {"color": REGIMES[regime].colour, "lw": 2.4 if sticks else 1.2}


def _touching(rows: Any) -> Any:
    """Return the rows and those before them, so that lines in turn leave no gap."""
    return rows | np.append(rows[1:], False)


def _legend(found: BifurcationBranches) -> list[Artist]:
    """Return an entry for each kind of branch."""
    looks: dict[str, dict[str, Any]] = {}
    rest: Any = {"color": REGIMES[Regime.EQUILIBRIUM].colour, "lw": 1.8}
    for branch in found.equilibria:
        looks[f"equilibrium, {_stability(branch)}"] = rest | ({} if branch.stable else _UNSTABLE)
    for branch in found.cycles:
        for sticks in sorted({bool(each) for each in branch.sticks}, reverse=True):
            name = Regime.label(Regime.STICK_SLIP if sticks else Regime.PURE_SLIP)
            dashes = {} if branch.stable else _UNSTABLE
            looks[f"{name}, {_stability(branch)}"] = _look(sticks=sticks) | dashes
    return [Line2D([], [], **look, label=label) for label, look in looks.items()]


def _stability(branch: Branch) -> str:
    return "stable" if branch.stable else "unstable"


def _at(units: Units, belt_speed: float) -> str:
    return units.text(belt_speed, "m/s")


def _equilibrium(found: BifurcationBranches) -> tuple[FloatArray, FloatArray]:
    speeds = np.concatenate([branch.belt_speeds for branch in found.equilibria])
    return speeds, np.concatenate([branch.least for branch in found.equilibria])


def _regions(found: BifurcationBranches) -> Iterator[tuple[float, float, str]]:
    """Yield ranges of belt speeds with the motions that the drive settles to."""
    low, high = found.belt_speeds[[0, -1]].tolist()
    onset = [] if found.sticking_onset is None else [found.sticking_onset]
    edges = [point.belt_speed for point in found.hopf_points] + found.folds + onset
    start, before = low, ""
    for left, right in pairwise([low, *sorted(edges), high]):
        name = _settles(found, (left + right) / 2.0)
        if left > start and name != before:
            yield start, left, before
            start = left
        before = name
    yield start, high, before


def _settles(found: BifurcationBranches, belt_speed: float) -> str:
    """Return the stable motions at a belt speed."""
    motions: dict[str, None] = {}
    for branches, rests in ((found.cycles, False), (found.equilibria, True)):
        for branch in branches:
            speeds = branch.belt_speeds
            if branch.stable and speeds[0] <= belt_speed <= speeds[-1]:
                nearest = int(np.abs(speeds - belt_speed).argmin())
                cycle = Regime.STICK_SLIP if branch.sticks[nearest] else Regime.PURE_SLIP
                motions["rest" if rests else Regime.label(cycle)] = None
    return " or ".join(motions)


def _name_regions(figure: Figure, axes: Axes, found: BifurcationBranches, speed: float) -> None:
    """Write above each range of belt speeds what the drive settles to, upright if it is narrow."""
    points = 8.0
    figure.draw_without_rendering()
    box = axes.get_window_extent()
    width, height = box.width / figure.dpi, box.height / figure.dpi
    left, right = axes.get_xlim()
    line, deepest = 1.5 * points / 72.0, 0.0
    for start, end, name in _regions(found):
        room = width * (end - start) / speed / (right - left)
        written = text_width(name, points)
        upright = written > 0.95 * room
        if end != found.belt_speeds[-1]:
            axes.axvline(end / speed, **_BORDER)
        if not name or (upright and room < line):
            continue
        deepest = max(deepest, written if upright else line)
        axes.annotate(
            name, ((start + end) / 2.0 / speed, 1.0), (0.0, -3.0),
            xycoords=("data", "axes fraction"), textcoords="offset points", fontsize=points,
            ha="center", va="top", rotation=90.0 if upright else 0.0,
        )  # fmt: skip
    bottom, top = axes.get_ylim()
    share = min((deepest + 0.1) / height, 0.6)
    axes.set_ylim(bottom, bottom + (top - bottom) / (1.0 - share))
