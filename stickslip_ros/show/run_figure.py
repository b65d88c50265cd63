"""The figure of a run, and that of several runs side by side."""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpecFromSubplotSpec, SubplotSpec
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.drive import Drive
from stickslip_ros.show import AMBER, BLUE, GREEN, GREY, LIGHT_GREY, ORANGE, PURPLE, SKY_BLUE
from stickslip_ros.show.drawing import (
    BELT,
    HELD,
    LEAST_PART,
    MOTION,
    PIXELS,
    POINT,
    Pane,
    broken,
    draw_analysis,
    draw_cycles,
    draw_held,
    draw_law,
    draw_line,
    label_axis,
    panels_over_time,
    say,
    shade,
    widened,
    with_edges,
)
from stickslip_ros.show.measure_table import measures_text
from stickslip_ros.show.quantities import SI
from stickslip_ros.show.run_history import DrawnRun
from stickslip_ros.show.style import MANY, SCREEN, FigureStyle, finish, styled, wrapped

_REST: Any = {"color": GREEN, "lw": 1.2, "ls": ":", "zorder": 2.5}
_CONTROL: Any = {"color": ORANGE, "lw": 1.6, "drawstyle": "steps-post"}
_DROPPED: Any = {"color": ORANGE, "alpha": 0.5, "marker": ".", "ms": 2.0, "ls": ""}
_FRICTION: Any = {"color": SKY_BLUE, "lw": 0.7}
_EARLIER: Any = {"color": LIGHT_GREY, "lw": 0.7}
_STICKS: Any = {"color": GREY, "lw": 5.0, "solid_capstyle": "butt", "zorder": 1.9}

_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY_BLUE)
_DASHES = ("-", "--", "-.", ":", (0, (6, 1)), (0, (3, 1, 1, 1)))
_LOOKS: list[dict[str, Any]] = [
    {"color": colour, "ls": dashes, "marker": marker, "ms": 4.0}
    for colour, dashes, marker in zip(_COLOURS, _DASHES, "os^Dv*", strict=True)
]
"""Looks of runs side by side."""

_ENLARGED = ", enlarged"
_LEAST_ROWS = 20
"""Rows of a motion that is worth being enlarged."""


@styled
def run_figure(*runs: DrawnRun, style: FigureStyle = SCREEN) -> Figure:
    """Return the figure of a run, or of up to six runs, each in its own colour.

    Of one run it shows the whole run, the instant at which the controller is switched on, if there
    is one, and its last cycles over time, shaded by the share of time in which the slide sticks;
    the phase portrait of these cycles and of the start; amplitude and stick fraction of each cycle;
    and the friction law with the range of relative speeds; with a motor of finite mass, on a
    screen, the force of the transmission and the phase planes of slide and motor; with a reference
    the following error, also after each reversal. The equilibrium and the friction law need a
    drive, the equilibrium also a moving belt. The belt speed is that at the end of the run.

    Of several runs there is a column each: displacement and force over time, with the same axes.
    Below are all runs together: the phase portrait of the last cycles, and amplitude and stick
    fraction of each cycle. The units are SI unless all drives are dimensionless.
    """
    figure = _single(runs[0], style) if len(runs) == 1 else _compared(runs, style)
    finish(figure)
    return figure


def _single(run: DrawnRun, style: FigureStyle) -> Figure:
    history, drive, notes = run.history, run.drive, [*run.notes]
    if drive is None:
        notes.append("it is not recorded what drive it was: no equilibrium, no friction law")
    elif len(history.motion.time):
        drive = replace(drive, belt_speed=float(history.motion.belt_velocity[-1]))
        run = run._replace(drive=drive)
    if history.left_out:
        notes.append(f"not drawn: {history.left_out} samples without an increasing time")
    analysis = history.analysis
    has_motor = drive is not None and drive.motor is not None and not style.printed
    lower_rows = (  # each with three panels
        (_OneRun.following, analysis.followed is not None),
        (_OneRun.analysis, analysis.mean_cycle is not None or analysis.slips is not None),
        (_OneRun.behind_the_screw, has_motor and len(history.motor) > 0),
    )
    rows = [draw for draw, is_shown in lower_rows if is_shown]
    size = (12.0, 10.0 + 2.5 * len(rows))
    panels = _OneRun([run], narrow=style.narrow, short=style.crowded(*size))
    figure = style.figure(*size, wide=1.1 + 0.3 * len(rows), narrow=2.5 + 0.26 * len(rows))
    style.set_title(figure, run.title, measures_text(run.measures, panels.units), *notes)
    ratios = (2.8, 2.4, *[1.5] * len(rows)) if panels.short else (3.0, 1.9, *[1.2] * len(rows))
    if style.narrow:
        ratios = (4.4, 3.6, *[2.2] * len(rows))
    above, below, *lower = figure.add_gridspec(2 + len(rows), 1, height_ratios=ratios)
    panels.over_time(figure, above)
    has_cycles, has_law = len(history.cycles[0]) > 0, drive is not None
    if style.narrow:
        lines = below.subgridspec(1 + has_cycles, 1, height_ratios=(1.3, *[1.0] * has_cycles))
        first, *middle = lines
        left, *right = first.subgridspec(1, 1 + has_law)
    else:
        left, *others = below.subgridspec(1, 1 + has_cycles + has_law)
        middle, right = others[:has_cycles], others[has_cycles:]
    for draw, row in zip(rows, lower, strict=True):
        draw(panels, figure, row.subgridspec(1, 3))
    panels.portrait(figure.add_subplot(left))
    for part in middle:
        cells = part.subgridspec(*((1, 2) if style.narrow else (2, 1)))
        panels.cycles(*(figure.add_subplot(cell) for cell in cells))
    law_handles = [entry for part in right for entry in panels.law(figure.add_subplot(part))]
    style.legend_below(figure, [*panels.handles(), *law_handles])
    return figure


def _compared(runs: Sequence[DrawnRun], style: FigureStyle) -> Figure:
    count = len(runs)
    rows = ceil(count / _runs_across(count, narrow=style.narrow))
    figure = style.figure(12.0, 9.0, wide=0.95, narrow=0.8 * rows + 1.2)
    notes = [f"{run.name}: {note}" for run in runs for note in run.notes]
    style.set_title(figure, "Runs compared, " + "; ".join(run.name for run in runs), *notes)
    panels = _SeveralRuns(runs, narrow=style.narrow, short=style.crowded(12.0, 9.0))
    ratios = (0.8 * rows, 1.0) if style.narrow else (1.3, 1.0)
    above, below = figure.add_gridspec(2, 1, height_ratios=ratios)
    panels.over_time(figure, above)
    if style.narrow:
        parts = below.subgridspec(2, 2, height_ratios=(1.3, 1.0))
        left, middle, right = parts[0, :], parts[1, 0], parts[1, 1]
    else:
        left, middle, right = below.subgridspec(1, 3)
    panels.portrait(figure.add_subplot(left))
    amplitude = figure.add_subplot(middle)
    panels.cycles(amplitude, figure.add_subplot(right, sharex=amplitude))
    looks = zip(runs, _LOOKS, strict=False)
    style.legend_below(figure, [Line2D([], [], label=run.name, **look) for run, look in looks])
    return figure


class _Panels:
    """Common part of the panels of a figure: runs and axes."""

    def __init__(self, runs: Sequence[DrawnRun], *, narrow: bool, short: bool) -> None:
        all_units = {run.units.shortened() for run in runs}
        self.units = units = all_units.pop() if len(all_units) == 1 else SI
        self.short, self._narrow, self._runs = short, narrow, runs
        self._motions = motions = [run.history.motion for run in runs]
        positions = [motion.position for motion in motions]
        speeds = [speed for motion in motions for speed in (motion.velocity, motion.belt_velocity)]
        self._length = units.axis(units.named("displacement", short=short), "m", *positions)
        self._speed = units.axis(units.named("velocity", short=short), "m/s", *speeds)


class _OneRun(_Panels):
    """The panels of one run."""

    def __init__(self, runs: Sequence[DrawnRun], *, narrow: bool, short: bool) -> None:
        super().__init__(runs, narrow=narrow, short=short)
        (run,) = runs
        self._history, self._drive, self._disturbed = run.history, run.drive, run.disturbed
        self._balanced: Drive | None = None
        """The drive, if its spring and its friction balance at a known displacement."""
        if run.drive is not None and run.drive.has_spring and run.drive.motor is None:
            self._balanced = run.drive
        last = run.last_cycles
        self._last = last if len(last.time) > 1 else run.history.end(float("inf"))
        self._whole = Pane.covering("whole run", self._motions[0], *self._force_times)
        self.holds = False
        """Whether forces are missing for a while, so that the last one is drawn on."""

    @property
    def _force_times(self) -> list[FloatArray]:
        return [trace.columns()[0] for trace in (self._history.control, self._history.dropped)]

    def over_time(self, figure: Figure, part: SubplotSpec) -> None:
        """Draw displacement, velocity and force: the whole run, and parts of it enlarged."""
        history = self._history
        others = [] if len(self._last.time) else self._force_times
        end = Pane.covering(f"end of the run{_ENLARGED}", self._last, *others)
        traces = history.friction, history.control, history.dropped
        whole = [trace.columns() for trace in traces]
        panes = [self._whole, *self._switch_on(end), end]
        drawn = [whole] * (len(panes) - 1) + [[trace.since(end.start) for trace in traces]]
        newton, label = self.units.axis("force", "N", *(columns[1] for columns in whole))
        labels = [self._length[1], self._speed[1], label]
        if not any(len(columns[0]) for columns in whole):
            labels.pop()  # nothing tells a force
        shape = len(labels), len(panes)
        panels = panels_over_time(figure, part, *shape, narrow=self._narrow)
        for column, pane, (friction, control, dropped) in zip(panels.T, panes, drawn, strict=True):
            position, velocity, *forces = column
            title = pane.title.removesuffix(_ENLARGED) if self.short else pane.title
            position.set_title(title)
            self._draw_motion(position, velocity, pane)
            for force in forces:
                with_stick = with_edges(friction, pane.rows)
                draw_line(force, pane, with_stick, newton, history.gap, **_FRICTION)
                gap = history.control_gap
                draw_line(force, pane, control, newton, gap, **_CONTROL)
                self.holds |= draw_held(force, pane, control, newton, gap, dropped[0])
                draw_line(force, pane, dropped, newton, gap, **_DROPPED)
            self._label_time(column[-1], pane)
        for row, of_row in zip(panels, labels, strict=True):
            row[0].set_ylabel(of_row)
            row[0].set_ylim(widened(*row[0].get_ylim()))
            for axes, pane in zip(row, panes, strict=True):
                shade(axes, pane)

    def _switch_on(self, end: Pane) -> list[Pane]:
        """Return the instant at which the controller is switched on, if it is in the run.

        There must be motion before it and behind it, and not as much as to be the whole run.
        """
        at, length = self._history.switched_on, end.end - end.start
        if at is None or not len(end.rows.time):
            return []
        before, after = 0.5 * length, 1.5 * length
        if at - before < self._whole.start or at + after > end.start:
            return []
        rows = self._history.around_switch_on(before, after)
        if len(rows.time) < _LEAST_ROWS:
            return []
        title = "first force" if self._disturbed else "control switched on"
        return [Pane(f"{title}{_ENLARGED}", rows, at - before, at + after)]

    def _label_time(self, axes: Axes, pane: Pane) -> None:
        label_axis(axes.xaxis, *self.units.axis("time", "s", pane.start, pane.end))
        axes.set_xlim(pane.start, pane.end)

    def _draw_motion(self, position: Axes, velocity: Axes, pane: Pane) -> None:
        rows, gap = pane.rows, self._history.gap
        length, speed = self._length[0], self._speed[0]
        if (drive := self._balanced) is not None:
            # On a belt at rest any position within the static friction is an equilibrium.
            belt = np.where(rows.belt_velocity == 0.0, np.nan, rows.belt_velocity)
            by_friction = drive.friction.at_rest(belt) * (drive.normal_force / drive.stiffness)
            dragged = drive.bias_force + drive.guide_damping * belt
            rest = by_friction + dragged / drive.stiffness
            draw_line(position, pane, (rows.time, rest), length, gap, **_REST)
        draw_line(position, pane, (rows.time, rows.position), length, gap, **MOTION)
        draw_line(velocity, pane, (rows.time, rows.belt_velocity), speed, gap, **BELT)
        draw_line(velocity, pane, (rows.time, rows.velocity), speed, gap, **MOTION)

    def portrait(self, axes: Axes) -> None:
        """Draw the phase portrait of the last cycles, above that of the start."""
        (length, label), (speed, speed_label) = self._length, self._speed
        axes.set(title="phase portrait", xlabel=label, ylabel=speed_label)
        if not len(self._last.time):
            say(axes, "no motion recorded")
            return
        # The marker is where it ends, which is all there is of a slide at rest.
        end: Any = MOTION | {"marker": ".", "markevery": [-1]}
        for rows, look in ((self._history.beginning, _EARLIER), (self._last, end)):
            time, position, velocity, belt, stick_time = broken(self._history.gap, *rows)
            many = len(time) > MANY
            axes.plot(position / length, velocity / speed, rasterized=many, **look)
            stuck = np.diff(stick_time, prepend=np.nan) > 0.5 * np.diff(time, prepend=np.nan)
            stuck |= np.append(stuck[1:], False)
            axes.plot(np.where(stuck, position, np.nan) / length, belt / speed, **_STICKS)
        belt_speed = float(self._last.belt_velocity[-1])
        axes.axhline(belt_speed / speed, **BELT)
        if self._balanced is not None and belt_speed != 0.0:
            axes.plot(self._balanced.equilibrium_position / length, 0.0, zorder=3.0, **POINT)
        axes.set_xlim(widened(*axes.get_xlim()))
        axes.set_ylim(widened(*axes.get_ylim()))

    def analysis(self, figure: Figure, row: GridSpecFromSubplotSpec) -> None:
        """Draw the mean cycle with its edges, or the distributions over the slips."""
        draw_analysis(figure, row, self._history.analysis, self.units, short=self.short)

    def following(self, figure: Figure, row: GridSpecFromSubplotSpec) -> None:
        """Draw the following error over time, and what is of the reversals after each of them."""
        followed = self._history.analysis.followed
        assert followed is not None
        whole, turns = figure.add_subplot(row[0, :2]), figure.add_subplot(row[0, 2])
        peak = followed.values.peak_following_error or 0.0
        size, label = self.units.axis("following error", "m", peak)
        trace = followed.time, followed.error
        draw_line(whole, self._whole, trace, size, self._history.gap, **MOTION)
        whole.set(title="following error", ylabel=label)
        if followed.turns:  # the start of the run is far larger
            whole.set_ylim(-1.2 * peak / size, 1.2 * peak / size)
        self._label_time(whole, self._whole)
        errors = [turn.behind for turn in followed.turns]
        size, label = self.units.axis("error at reversals", "m", *errors)
        for turn in followed.turns:
            turns.plot(turn.time, turn.behind / size, **MOTION)
        turns.set(title="after each reversal", ylabel=label)
        end = max((turn.time[-1] for turn in followed.turns), default=1.0)
        label_axis(turns.xaxis, *self.units.axis("time", "s", end))

    def behind_the_screw(self, figure: Figure, row: GridSpecFromSubplotSpec) -> None:
        """Draw the force of the spring, and the phase planes of slide and motor, at the end."""
        force, slide, motor = (figure.add_subplot(cell) for cell in row)
        (length, label), (speed, speed_label) = self._length, self._speed
        start = float(self._last.time[0]) if len(self._last.time) else -np.inf
        time, *states = self._history.motor.since(start)
        if self._drive is not None and len(time):
            x, y, far, rate = states
            spring = self._drive.stiffness * (x - far) + self._drive.damping * (y - rate)
            size, name = self.units.axis("force", "N", spring)
            force.plot(time, spring / size, **MOTION)
            label_axis(force.xaxis, *self.units.axis("time", "s", time[0], time[-1]))
            force.set(title="force of the transmission", ylabel=name)
        for axes, body, (position, velocity) in (
            (slide, "slide", states[:2]), (motor, "motor", states[2:])
        ):  # fmt: skip
            axes.plot(position / length, velocity / speed, **MOTION)
            axes.set(title=f"phase plane of the {body}", xlabel=label, ylabel=speed_label)

    def cycles(self, amplitude: Axes, stick_fraction: Axes) -> None:
        """Draw amplitude and stick fraction of each cycle over time."""
        count = len(self._history.cycles[0])
        look = MOTION | {"marker": "." if count < PIXELS else "", "ms": 3.0, "lw": 0.5}
        panels = amplitude, stick_fraction
        draw_cycles(panels, [self._history], [look], self.units, most=PIXELS)
        amplitude.set_title("each cycle")
        if self._narrow:  # beside each other
            stick_fraction.set_title("each cycle")
            self._label_time(amplitude, self._whole)
        else:
            amplitude.sharex(stick_fraction)
            amplitude.tick_params(labelbottom=False)
        self._label_time(stick_fraction, self._whole)

    def law(self, axes: Axes) -> list[Artist]:
        """Draw the friction law; return entries for the legend below, if they have no room here."""
        short = self.short
        axes.set_title("friction law" if short else "friction law, with the range of this run")
        assert self._drive is not None
        handles = draw_law(axes, self._drive, self._history, self._last, self.units, short=short)
        if short:
            return handles
        rest = Line2D([], [], **BELT, label="steady sliding")
        axes.legend(handles=[*handles, rest], loc="best")
        return []

    def handles(self) -> list[Artist]:
        """Return the entries of the legend, but for the friction law."""
        history = self._history
        force = "control force and disturbance" if self._disturbed else "control force"
        sticks = "sticks" if self.short else "sticks (paler: part of the time)"
        entries: list[tuple[Artist, bool]] = [
            (Line2D([], [], **MOTION, label="slide"), True),
            (Line2D([], [], **BELT, label="belt speed"), True),
            (Line2D([], [], **POINT | _REST, label="equilibrium"), self._balanced is not None),
            (Patch(color=GREY, alpha=0.6, lw=0.0, label=sticks), True),
            (Line2D([], [], **_CONTROL, label=force), len(history.control) > 0),
            (Line2D([], [], **_FRICTION, label="friction force"), len(history.friction) > 0),
            (Line2D([], [], **_EARLIER | {"lw": 4.0}, label="start of the run"), True),
            (Line2D([], [], **HELD, label="no new force: last one"), self.holds),
            (
                Line2D([], [], **_DROPPED | {"ms": 6.0}, label="sent, did not act"),
                len(history.dropped) > 0,
            ),
        ]
        return [entry for entry, is_shown in entries if is_shown]


class _SeveralRuns(_Panels):
    """The panels of several runs."""

    def over_time(self, figure: Figure, part: SubplotSpec) -> None:
        """Draw displacement and force of each run in its own column."""
        count = len(self._runs)
        forces = [run.history.control.columns() for run in self._runs]
        rows = 2 if any(len(time) for time, _ in forces) else 1
        across = _runs_across(count, narrow=self._narrow)
        panels = np.empty((rows, count), dtype=object)
        cells = part.subgridspec(ceil(count / across), across)
        columns = [cells[divmod(run, across)].subgridspec(rows, 1) for run in range(count)]
        for row in range(rows):
            for run, column in enumerate(columns):
                shared: Any = {"sharex": panels[0, 0], "sharey": panels[row, 0]}
                axes = panels[row, run] = figure.add_subplot(column[row], **shared)
                axes.tick_params(labelbottom=row == rows - 1, labelleft=run % across == 0)
        newton, force_label = self.units.axis(
            self.units.named("control force", short=self.short), "N", *(f[1] for f in forces)
        )
        panes = [
            Pane.covering(run.name, motion, force[0])
            for run, motion, force in zip(self._runs, self._motions, forces, strict=True)
        ]
        time = self.units.axis("time", "s", *(pane.end for pane in panes))
        width = 0.9 * figure.get_figwidth() / across
        for (position, *below), run, look, pane, trace in zip(
            panels.T, self._runs, _LOOKS[:count], panes, forces, strict=True
        ):
            solid: Any = {"color": look["color"], "ls": "-", "lw": 1.0}
            motion, history = (pane.rows.time, pane.rows.position), run.history
            draw_line(position, pane, motion, self._length[0], history.gap, **solid)
            solid["drawstyle"] = "steps-post"
            for force in below:
                draw_line(force, pane, trace, newton, history.control_gap, **solid)
            lines = pane.title, measures_text(run.measures, self.units)
            title = wrapped(lines, width, "small")
            position.set_title(title, fontsize="small", parse_math=False)
            label_axis((position, *below)[-1].xaxis, *time)
            for axes, what, recorded in (
                (position, "motion", pane.rows.time),
                *((force, "force", trace[0]) for force in below),
            ):
                if not len(recorded):
                    say(axes, f"no {what} recorded")
        for row, label in zip(panels, (self._length[1], force_label), strict=False):
            for axes in row[::across]:
                axes.set_ylabel(label)
            row[0].set_ylim(widened(*row[0].get_ylim()))
        start, end = min(pane.start for pane in panes), max(pane.end for pane in panes)
        for axes, pane in zip(panels[0], panes, strict=True):
            shade(axes, pane)
            axes.set_xlim(start, end)

    def portrait(self, axes: Axes) -> None:
        """Draw the phase portraits of the last cycles."""
        (length, label), (speed, speed_label) = self._length, self._speed
        axes.set(title="phase portrait of the last cycles", xlabel=label, ylabel=speed_label)
        for run, motion, look in zip(self._runs, self._motions, _LOOKS, strict=False):
            if not len(motion.time):
                continue
            time, position, velocity, *_ = broken(run.history.gap, *run.last_cycles)
            # The marker is where it ends, which is all there is of a slide at rest.
            ends: Any = {"markevery": [len(time) - 1], "rasterized": len(time) > MANY}
            axes.plot(position / length, velocity / speed, **look, **ends)
        spans = [
            (float(np.ptp(m.position)), float(np.ptp(m.velocity)))
            for m in self._motions
            if len(m.time)
        ]
        across, along = np.max(spans or [(0.0, 0.0)], axis=0)
        axes.set_xlim(widened(*axes.get_xlim(), LEAST_PART * across / length))
        axes.set_ylim(widened(*axes.get_ylim(), LEAST_PART * along / speed))

    def cycles(self, amplitude: Axes, stick_fraction: Axes) -> None:
        """Draw amplitude and stick fraction of each cycle over time."""
        panels = amplitude, stick_fraction
        draw_cycles(panels, [run.history for run in self._runs], _LOOKS, self.units, most=12)
        axis = self.units.axis("time", "s", *(motion.time for motion in self._motions))
        for axes, name in zip(panels, ("amplitude", "stick fraction"), strict=True):
            axes.set_title(f"{name} of each cycle")
            label_axis(axes.xaxis, *axis)


def _runs_across(count: int, *, narrow: bool) -> int:
    """Return how many runs are side by side over time."""
    return (1 if count < 3 else 2) if narrow else count
