"""The figure of an identification: the friction curve, and residuals by speed, position, time."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.intervals import QUANTILE
from stickslip_ros.plots.style import BLUE, GREEN, ORANGE, SCREEN, FigureStyle, round_ticks, styled
from stickslip_ros.plots.units import SI

_DOTS: Any = {"marker": ".", "ms": 2.0, "ls": "", "alpha": 0.4, "mew": 0.0, "rasterized": True}
_NAMES = {1.0: "forward slip", -1.0: "backward slip"}


@styled
def identification_figure(found: Findings, *, style: FigureStyle = SCREEN) -> Figure:
    """Return the figure of what was found.

    Parameters
    ----------
    found : Findings
        The model.
    style : FigureStyle, optional
        What the figure is for, by default a screen.

    Returns
    -------
    matplotlib.figure.Figure
        Friction curve with its 95 % band and what was measured, residuals over speed, position and
        time, and the free run beside the measured positions.
    """
    figure = style.figure(10.0, 9.0, narrow=2.6)
    grid = figure.add_gridspec(5, 1) if style.narrow else figure.add_gridspec(3, 2)
    places = (
        [grid[row, 0] for row in range(1, 5)]
        if style.narrow
        else [grid[1, 0], grid[1, 1], grid[2, 0], grid[2, 1]]
    )
    errors = found.errors()
    _friction(figure.add_subplot(grid[0, :]), found, errors)
    for place, (values, name, unit) in enumerate(
        (
            (errors.relative_speed, "velocity relative to the belt", "m/s"),
            (errors.position, "displacement", "m"),
        )
    ):
        _residuals(
            figure.add_subplot(places[place]),
            values,
            errors.force_error,
            name,
            unit,
            short=style.printed,
        )
    _residuals(
        figure.add_subplot(places[2]),
        errors.time,
        errors.force_error,
        "time",
        "s",
        short=style.printed,
    )
    _free_run(figure.add_subplot(places[3]), found)
    names = ", ".join(dict.fromkeys(Path(record.name).name for record in found.records))
    title = f"Identified drive, {names}: law {found.law}, error held out {found.chosen.error:.3%}"
    style.set_title(figure, title)
    round_ticks(figure)
    return figure


def _friction(axes: Axes, found: Findings, errors: Any) -> None:
    forces = errors.friction
    scale, label = SI.axis("friction force", "N", forces)
    speed_scale, speed_label = SI.axis(
        "size of the velocity relative to the belt $v_r$", "m/s", errors.relative_speed
    )
    for number, (direction, colour) in enumerate(
        zip(found.directions, (BLUE, ORANGE), strict=False)
    ):
        own = errors.relative_speed * direction > 0.0
        axes.plot(
            np.abs(errors.relative_speed[own]) / speed_scale,
            direction * forces[own] / scale,
            color=colour,
            **_DOTS,
        )
        curve = found.friction(number)
        band = QUANTILE * curve.standard_error
        axes.plot(curve.speed / speed_scale, curve.force / scale, color=colour, lw=1.5)
        axes.fill_between(
            curve.speed / speed_scale,
            (curve.force - band) / scale,
            (curve.force + band) / scale,
            color=colour,
            alpha=0.3,
            lw=0.0,
            label=f"{_NAMES[direction]}, 95 % band",
        )
    axes.set_xlabel(speed_label)
    axes.set_ylabel(label)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.set_title("friction: measured (dots) and fitted")
    axes.legend(loc="lower right", fontsize="small")


def _residuals(
    axes: Axes, over: FloatArray, residual: FloatArray, name: str, unit: str, *, short: bool
) -> None:
    scale, label = SI.axis(SI.named(name), unit, over)
    force, force_label = SI.axis(
        "residual force" if short else "force, measured less fitted", "N", residual
    )
    axes.plot(over / scale, residual / force, color=BLUE, **_DOTS)
    axes.axhline(0.0, color="black", lw=0.6)
    axes.set_xlabel(label)
    axes.set_ylabel(force_label)
    axes.set_title(f"residuals over {name}")


def _free_run(axes: Axes, found: Findings) -> None:
    record = found.records[0]
    time = record.period * np.arange(len(record.position))
    run = found.free_run(record)
    scale, label = SI.axis(SI.named("displacement"), "m", record.position)
    axes.plot(time, record.position / scale, color=BLUE, label="measured")
    axes.plot(time, run / scale, color=ORANGE, ls="--", label="simulated, no feedback")
    axes.plot(time, (run - record.position) / scale, color=GREEN, ls=":", label="difference")
    axes.set_xlabel("time (s)")
    axes.set_ylabel(label)
    axes.set_title("run with the recorded force (in-sample)")
    axes.legend(loc="lower center", fontsize="small")
