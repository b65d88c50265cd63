"""Panels of what was concluded from a noisy record: its mean cycle, and its slips."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec, GridSpecFromSubplotSpec

from stickslip_ros.physics.measures.cycle_fit import MeanCycle
from stickslip_ros.physics.measures.observer import Conclusions
from stickslip_ros.plots.style import BLUE, GREY, ORANGE
from stickslip_ros.plots.units import Units

_RAW: Any = {"color": BLUE, "marker": ".", "ms": 2.0, "ls": "", "alpha": 0.5, "mew": 0.0}
_FITTED: Any = {"color": ORANGE, "lw": 1.2}
_CONFIDENCE = 1.96
"""Half of a 95 % interval, in standard errors."""
_BINS = 30


def draw_conclusions(
    figure: Figure,
    part: GridSpec | GridSpecFromSubplotSpec,
    found: Conclusions,
    units: Units,
    *,
    short: bool,
) -> None:
    """Draw the mean cycle with its edges, or the distributions over the slips.

    `part` has three cells, beside each other or one above another. Labels may have to be `short`.
    """
    if found.slips is not None:  # they were asked for
        each = found.slips["each"]
        for column, (name, title, unit) in enumerate(
            (
                ("stick_time", "time of sticking", "s"),
                ("drop", "drop of a slip", "m"),
                ("slip_time", "time of slipping", "s"),
            )
        ):
            values = np.array([value for value in each[name] if value is not None])
            _distribution(figure.add_subplot(part[column]), values, title, unit, units)
    elif found.mean_cycle is not None:
        _cycle(figure.add_subplot(part[0:2]), found.mean_cycle, units, short=short)
        _residual(figure.add_subplot(part[2]), found.mean_cycle, units)


def _cycle(axes: Axes, mean: MeanCycle, units: Units, *, short: bool) -> None:
    scale, label = units.axis(units.named("displacement", short=short), "m", mean.position)
    second, time_label = units.axis("time within the cycle", "s", mean.phase)
    order = np.argsort(mean.phase)
    axes.plot(mean.phase / second, mean.position / scale, **_RAW, label="measured, all cycles")
    axes.plot(mean.phase[order] / second, mean.fitted[order] / scale, **_FITTED, label="fitted")
    if mean.edges is not None and mean.edge_errors is not None:
        period = mean.cycle.period
        named = zip(("landing", "departure"), mean.edges, mean.edge_errors, strict=True)
        for line, (name, edge, error) in enumerate(named):
            at, half = edge % period / second, _CONFIDENCE * error / second
            axes.axvspan(at - half, at + half, color=GREY, alpha=0.6, lw=0.0)
            axes.axvline(at, color="black", lw=0.8, ls="--")
            axes.annotate(
                f"{name} ± {units.text(_CONFIDENCE * error, 's')}", (at, 0.0),
                (3.0, 3.0 + 11.0 * line), xycoords=("data", "axes fraction"),
                textcoords="offset points", fontsize="small",
            )  # fmt: skip
    axes.set_xlabel(time_label)
    axes.set_ylabel(label)
    axes.set_title("mean cycle; edges with 95 % intervals")
    axes.legend(loc="upper right", fontsize="small")


def _residual(axes: Axes, mean: MeanCycle, units: Units) -> None:
    residual = mean.position - mean.fitted
    scale, label = units.axis("residual", "m", residual)
    second, time_label = units.axis("time within the cycle", "s", mean.phase)
    axes.plot(mean.phase / second, residual / scale, **_RAW)
    axes.set_xlabel(time_label)
    axes.set_ylabel(label)
    axes.set_title(f"noise {units.text(mean.noise, 'm')}")


def _distribution(axes: Axes, values: np.ndarray, title: str, unit: str, units: Units) -> None:
    scale, label = units.axis(title, unit, values)
    if len(values):
        axes.hist(values / scale, bins=_BINS, color=BLUE)
        axes.axvline(float(np.median(values)) / scale, color=ORANGE, lw=1.2, label="median")
        axes.legend(fontsize="small")
    axes.set_xlabel(label)
    axes.set_ylabel("slips")
    axes.set_title(f"{title}, {len(values)} slips")
