"""The figure of several runs: motion and force side by side, all cycles in one panel."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.cycle_measures import Measures
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.plots.panes import (
    LEAST_PART,
    LEAST_SPAN,
    Pane,
    broken,
    cycle_rows,
    draw_line,
    end_duration,
    label_time,
    measures_text,
    say,
    shade,
    widened,
)
from stickslip_ros.plots.run_history import RunHistory
from stickslip_ros.plots.style import (
    AMBER,
    BLUE,
    GREEN,
    MANY,
    ORANGE,
    PURPLE,
    SCREEN,
    SKY_BLUE,
    FigureStyle,
    finish,
    styled,
    wrapped,
)
from stickslip_ros.plots.units import SI, Units

_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY_BLUE)
_DASHES = ("-", "--", "-.", ":", (0, (6, 1)), (0, (3, 1, 1, 1)))
_MARKERS = "os^Dv*"


class DrawnRun(NamedTuple):
    """A run that is drawn beside others."""

    name: str
    history: RunHistory
    measures: Measures
    drive: Drive | None


@styled
def runs_figure(
    runs: Sequence[DrawnRun], *, notes: Sequence[str] = (), style: FigureStyle = SCREEN
) -> Figure:
    """Return the figure of up to six runs, each in its own colour.

    Above a column for each run: displacement and force over time, with the same axes. Below, all
    runs together: the phase portrait of the last cycles, and amplitude and stick fraction of each
    cycle. `notes` are printed below the title. The units are SI unless all drives are
    dimensionless.
    """
    looks: list[dict[str, Any]] = [
        {"color": colour, "ls": dashes} for colour, dashes in zip(_COLOURS, _DASHES, strict=True)
    ][: len(runs)]
    count = len(runs)
    figure = style.figure(12.0, 9.0, wide=0.95, narrow=0.9 * count + 1.4)
    style.set_title(figure, "Runs compared, " + "; ".join(run.name for run in runs), *notes)
    drawing = _Panels(runs, looks, short=style.crowded(12.0, 9.0))
    ratios = (0.9 * count, 1.3) if style.narrow else (1.3, 1.0)
    above, below = figure.add_gridspec(2, 1, height_ratios=ratios)
    if style.narrow:
        stacked: Any = above.subgridspec(2 * count, 1).subplots(sharex=True, squeeze=False)
        panels = stacked.reshape(count, 2).T
        for row in panels:
            for axes in row[1:]:
                axes.sharey(row[0])
        left, middle, right = below.subgridspec(3, 1)
    else:
        panels = above.subgridspec(2, count).subplots(sharex=True, sharey="row", squeeze=False)
        left, middle, right = below.subgridspec(1, 3)
    drawing.over_time(figure, panels)
    drawing.portrait(figure.add_subplot(left))
    amplitude = figure.add_subplot(middle)
    drawing.cycles(amplitude, figure.add_subplot(right, sharex=amplitude))
    handles = [
        Line2D([], [], marker=marker, ms=4.0, label=run.name, **look)
        for run, look, marker in zip(runs, looks, _MARKERS, strict=False)
    ]
    style.legend_below(figure, handles)
    finish(figure)
    return figure


class _Panels:
    """The panels of the figure, with their common units and data."""

    def __init__(
        self, runs: Sequence[DrawnRun], looks: Sequence[dict[str, Any]], *, short: bool
    ) -> None:
        self._runs, self._looks, self._short = runs, looks, short
        own = {Units.for_drive(run.drive).shortened() for run in runs}
        self._units = own.pop() if len(own) == 1 else SI
        motions = [run.history.motion for run in runs]
        self._motions = motions
        self._length = self._units.axis(
            self._units.named("displacement", short=short), "m", *(m.position for m in motions)
        )
        self._speed = self._units.axis(
            self._units.named("velocity", short=short), "m/s", *(m.velocity for m in motions)
        )

    def over_time(self, figure: Figure, panels: Any) -> None:
        """Draw displacement and force of each run in its own column."""
        forces = [run.history.control.columns() for run in self._runs]
        newton, force_label = self._units.axis(
            self._units.named("control force", short=self._short), "N", *(f[1] for f in forces)
        )
        panes = [
            Pane.covering(run.name, motion, force[0])
            for run, motion, force in zip(self._runs, self._motions, forces, strict=True)
        ]
        time = self._units.axis("time", "s", *(pane.end for pane in panes))
        columns = panels[0, 0].get_subplotspec().get_gridspec().ncols
        for (position, force), run, look, pane, trace in zip(
            panels.T, self._runs, self._looks, panes, forces, strict=True
        ):
            solid = look | {"ls": "-", "lw": 1.0}
            rows, history = pane.rows, run.history
            draw_line(
                position, pane, (rows.time, rows.position), self._length[0], history.gap, **solid
            )
            draw_line(
                force, pane, trace, newton, history.control_gap, drawstyle="steps-post", **solid
            )
            lines = pane.title, measures_text(run.measures, self._units)
            title = wrapped(lines, 0.9 * figure.get_figwidth() / columns, "small")
            position.set_title(title, fontsize="small", parse_math=False)
            label_time(force, time)
            if not len(rows.time):
                say(position, "no motion recorded")
        for row, label in zip(panels, (self._length[1], force_label), strict=True):
            row[0].set_ylabel(label)
            row[0].set_ylim(widened(*row[0].get_ylim()))
        start, end = min(pane.start for pane in panes), max(pane.end for pane in panes)
        for axes, pane in zip(panels[0], panes, strict=True):
            shade(axes, pane)
            axes.set_xlim(start, end)

    def portrait(self, axes: Axes) -> None:
        """Draw the phase portraits of the last cycles."""
        axes.set_title("phase portrait of the last cycles")
        axes.set_xlabel(self._length[1])
        axes.set_ylabel(self._speed[1])
        for run, motion, look, marker in zip(
            self._runs, self._motions, self._looks, _MARKERS, strict=False
        ):
            if not len(motion.time):
                continue
            rows = run.history.end(end_duration(motion, run.measures, run.drive))
            time, position, velocity = broken(
                run.history.gap, rows.time, rows.position, rows.velocity
            )
            axes.plot(
                position / self._length[0],
                velocity / self._speed[0],
                rasterized=len(time) > MANY,
                marker=marker,
                ms=4.0,
                markevery=[
                    len(time) - 1
                ],  # where it ends, which is all there is of a slide at rest
                **look,
            )
        length = _span(motion.position for motion in self._motions) / self._length[0]
        speed = _span(motion.velocity for motion in self._motions) / self._speed[0]
        axes.set_xlim(widened(*axes.get_xlim(), LEAST_PART * length))
        axes.set_ylim(widened(*axes.get_ylim(), LEAST_PART * speed))

    def cycles(self, amplitude: Axes, stick_fraction: Axes) -> None:
        """Draw amplitude and stick fraction of each cycle over time."""
        all_cycles = [run.history.cycles for run in self._runs]
        scale, y_label = self._units.axis("amplitude", "m", *(c[1] for c in all_cycles))
        amplitude.set_title("amplitude of each cycle")
        amplitude.set_ylabel(y_label)
        stick_fraction.set_title("stick fraction of each cycle")
        stick_fraction.set_ylabel("stick fraction")
        if not any(len(time) for time, *_ in all_cycles):
            say(amplitude, "no cycle was completed")
        largest = [0.0, 0.0]
        for (time, *columns), look, marker in zip(all_cycles, self._looks, _MARKERS, strict=False):
            rows = cycle_rows(time, *columns)
            values: tuple[FloatArray, FloatArray] = (columns[0] / scale, columns[1])
            for number, axes in enumerate((amplitude, stick_fraction)):
                every = max(1, len(rows) // 12)
                axes.plot(
                    time[rows], values[number][rows], marker=marker, ms=4.0, markevery=every, **look
                )
                largest[number] = max(largest[number], float(values[number].max(initial=0.0)))
        farthest = max(float(np.abs(m.position).max(initial=0.0)) for m in self._motions) / scale
        amplitude.set_ylim(0.0, max(1.1 * largest[0], LEAST_SPAN * farthest) or 1.0)
        stick_fraction.set_ylim(0.0, 1.1 * largest[1] or 1.0)
        axis = self._units.axis("time", "s", *(motion.time for motion in self._motions))
        for axes in (amplitude, stick_fraction):
            label_time(axes, axis)


def _span(columns: Iterable[FloatArray]) -> float:
    """Return the largest span of a column."""
    return max((float(np.ptp(column)) for column in columns if len(column)), default=0.0)
