"""Figure of a run: motion, force, phase portrait, cycles and friction law."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.cycle_measures import Measures, measures_of
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.plots.panes import (
    LEAST_SPAN,
    PIXELS,
    Pane,
    broken,
    cycle_rows,
    draw_conclusions,
    draw_line,
    end_duration,
    label_time,
    measures_text,
    say,
    shade,
    widened,
)
from stickslip_ros.plots.run_history import DrawnMotion, RunHistory
from stickslip_ros.plots.style import (
    BLUE,
    GREEN,
    GREY,
    LIGHT_GREY,
    MANY,
    ORANGE,
    SCREEN,
    SKY_BLUE,
    FigureStyle,
    finish,
    styled,
    title_of,
)
from stickslip_ros.plots.units import Units
from stickslip_ros.scenarios.files import Scenario

_MOTION: Any = {"color": BLUE, "lw": 1.0}
_BELT: Any = {"color": "black", "lw": 1.0, "ls": "--", "zorder": 2.5}
_REST: Any = {"color": GREEN, "lw": 1.2, "ls": ":", "zorder": 2.5}
_POINT: Any = {"color": GREEN, "marker": "o", "ms": 6.0, "ls": "", "mec": "white"}
_CONTROL: Any = {"color": ORANGE, "lw": 1.6, "drawstyle": "steps-post"}
_HELD: Any = {"color": ORANGE, "lw": 1.2, "ls": ":", "drawstyle": "steps-post"}
_DROPPED: Any = {"color": ORANGE, "alpha": 0.5, "marker": ".", "ms": 2.0, "ls": ""}
_FRICTION: Any = {"color": SKY_BLUE, "lw": 0.7}
_EARLIER: Any = {"color": LIGHT_GREY, "lw": 0.7}
_STICKS: Any = {"color": GREY, "lw": 5.0, "solid_capstyle": "butt", "zorder": 1.9}

_ENLARGED = ", enlarged"
_SWITCHED_ON = f"control switched on{_ENLARGED}"
_FIRST_FORCE = f"first force{_ENLARGED}"
_CONTROL_ONLY = "control force"
_LEAST_ROWS = 20
"""Rows of a motion that is worth being enlarged."""


@styled
def run_figure(
    history: RunHistory,
    measures: Measures,
    drive: Drive | None,
    *,
    title: str,
    notes: Sequence[str] = (),
    force: str = _CONTROL_ONLY,
    style: FigureStyle = SCREEN,
) -> Figure:
    """Return the figure of a run.

    It shows the whole run, the instant at which the controller is switched on, if there is one,
    and its last `LAST_CYCLES` cycles over time, shaded by the share of time
    in which the slide sticks; the phase portrait of these cycles and of the start; amplitude and
    stick fraction of each cycle; and the friction law with the range of relative speeds. The
    equilibrium and the friction law need a `drive`, the equilibrium also a moving belt. The belt
    speed is that at the end of the run. `notes` are shown below the title, and `force` is the label
    of the force.
    """
    motion = history.motion
    if drive is not None and len(motion.time):
        drive = replace(drive, belt_speed=float(motion.belt_velocity[-1]))
    last = history.end(end_duration(motion, measures, drive))
    concluded = history.conclusions
    rows = 3 if concluded.mean_cycle is not None or concluded.slips is not None else 2
    size = (12.0, 10.0 if rows == 2 else 12.5)
    panels = _Panels(
        history,
        drive,
        last if len(last.time) > 1 else history.end(float("inf")),
        narrow=style.narrow,
        short=style.crowded(*size),
        first_force=_SWITCHED_ON if force == _CONTROL_ONLY else _FIRST_FORCE,
    )
    figure = style.figure(*size, wide=1.1 if rows == 2 else 1.4, narrow=3.0 if rows == 2 else 4.0)
    if history.left_out:
        notes = [*notes, f"not drawn: {history.left_out} samples without an increasing time"]
    style.set_title(figure, title, measures_text(measures, panels.units), *notes)
    ratios = (2.8, 2.4, 1.5) if panels.short else (3.0, 1.9, 1.2)
    if style.narrow:
        ratios = (5.2, 4.2, 4.0)
    grid = figure.add_gridspec(rows, 1, height_ratios=ratios[:rows])
    above, below = grid[0], grid[1]
    panels.over_time(figure, above)
    if style.narrow:
        parts = below.subgridspec(3, 2, height_ratios=(1.5, 1.0, 1.3))
        left, right, cycles = parts[0, :], parts[2, :], (parts[1, 0], parts[1, 1])
    else:
        left, middle, right = below.subgridspec(1, 3)
        cycles = middle.subgridspec(2, 1)
    if rows == 3:
        shape = (3, 1) if style.narrow else (1, 3)
        part = grid[2].subgridspec(*shape)
        draw_conclusions(figure, part, concluded, panels.units, short=panels.short)
    panels.portrait(figure.add_subplot(left))
    first, second = (figure.add_subplot(part) for part in cycles)
    panels.cycles(first, second)
    panels.law(figure.add_subplot(right))
    sticks = "sticks" if panels.short else "sticks (paler: part of the time)"
    handles: list[Any] = [
        Line2D([], [], **_MOTION, label="slide"),
        Line2D([], [], **_BELT, label="belt speed"),
        Patch(color=GREY, alpha=0.6, lw=0.0, label=sticks),
        Line2D([], [], **_CONTROL, label=force),
        Line2D([], [], **_FRICTION, label="friction force"),
        Line2D([], [], **_EARLIER | {"lw": 4.0}, label="start of the run"),
    ]
    if drive is not None and drive.has_spring:
        handles.insert(2, Line2D([], [], **_POINT | _REST, label="equilibrium"))
    if panels.holds:
        handles.append(Line2D([], [], **_HELD, label="no new force: last one"))
    if panels.drops:
        handles.append(Line2D([], [], **_DROPPED | {"ms": 6.0}, label="sent, did not act"))
    if panels.short:
        handles += panels.of_law
    style.legend_below(figure, handles)
    finish(figure)
    return figure


def simulated_run_figure(
    scenario: Scenario, history: RunHistory, measures: Measures, *, style: FigureStyle = SCREEN
) -> Figure:
    """Return the figure of a simulated run of a scenario."""
    disturbed = scenario.plant.disturbance.kind != "none"
    title = title_of("Simulated run", scenario)
    force = f"{_CONTROL_ONLY} and disturbance" if disturbed else _CONTROL_ONLY
    drive = scenario.plant.as_drive()
    return run_figure(history, measures, drive, title=title, force=force, style=style)


def recorded_run_figure(
    bag: Path,
    drive: Drive | None,
    history: RunHistory,
    report: Mapping[str, Any],
    *,
    style: FigureStyle = SCREEN,
) -> Figure:
    """Return the figure of a recorded run, with what the `report` of its bag notes.

    `drive` is None if the bag does not hold its parameters.
    """
    notes = [*report["missing"], *report["notes"]]
    if drive is None:
        notes.append("it is not recorded what drive it was: no equilibrium, no friction law")
    title = f"Recorded run, {bag}"
    return run_figure(history, measures_of(report), drive, title=title, notes=notes, style=style)


class _Panels:
    """The panels of the figure, with their common units and data."""

    def __init__(
        self,
        history: RunHistory,
        drive: Drive | None,
        last: DrawnMotion,
        *,
        narrow: bool,
        short: bool,
        first_force: str,
    ) -> None:
        self.units = units = Units.for_drive(drive).shortened()
        self._history, self._drive, self._last = history, drive, last
        self._narrow, self.short, self._first_force = narrow, short, first_force
        motion = history.motion
        self._run = Pane.covering("whole run", motion, *self._force_times)
        self._length = units.axis(units.named("displacement", short=short), "m", motion.position)
        self._speed = units.axis(
            units.named("velocity", short=short), "m/s", motion.velocity, motion.belt_velocity
        )
        self.holds = False
        """Whether forces are missing for a while, so that the last one is drawn on."""
        self.drops = len(history.dropped.columns()[0]) > 0
        """Whether forces were sent that did not act."""
        self.of_law: list[Artist] = []
        """Entries of the legend for the friction law."""

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
        panes = [self._run, *self._switch_on(end), end]
        drawn = [whole] * (len(panes) - 1) + [[trace.since(end.start) for trace in traces]]
        newton, label = self.units.axis("force", "N", *(columns[1] for columns in whole))
        panels = _panels_over_time(figure, part, len(panes), narrow=self._narrow)
        for column, pane, (friction, control, dropped) in zip(panels.T, panes, drawn, strict=True):
            position, velocity, force = column
            title = pane.title.removesuffix(_ENLARGED) if self.short else pane.title
            position.set_title(title)
            self._draw_motion(position, velocity, pane)
            draw_line(force, pane, friction, newton, history.gap, **_FRICTION)
            gap = history.control_gap
            draw_line(force, pane, control, newton, gap, **_CONTROL)
            self.holds |= _draw_held(force, pane, control, newton, gap, dropped[0])
            draw_line(force, pane, dropped, newton, gap, **_DROPPED)
            self._label_time(force, pane)
        labels = self._length[1], self._speed[1], label
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
        if at - before < self._run.start or at + after > end.start:
            return []
        rows = self._history.around_switch_on(before, after)
        if len(rows.time) < _LEAST_ROWS:
            return []
        return [Pane(self._first_force, rows, at - before, at + after)]

    def _label_time(self, axes: Axes, pane: Pane) -> None:
        label_time(axes, self.units.axis("time", "s", pane.start, pane.end))
        axes.set_xlim(pane.start, pane.end)

    def _draw_motion(self, position: Axes, velocity: Axes, pane: Pane) -> None:
        rows, gap = pane.rows, self._history.gap
        length, speed = self._length[0], self._speed[0]
        if self._drive is not None and self._drive.has_spring:
            # On a belt at rest any position within the static friction is an equilibrium.
            belt = np.where(rows.belt_velocity == 0.0, np.nan, rows.belt_velocity)
            by_friction = self._drive.friction.at_rest(belt) * self._drive.length_scale
            rest = by_friction + self._drive.bias_force / self._drive.stiffness
            draw_line(position, pane, (rows.time, rest), length, gap, **_REST)
        draw_line(position, pane, (rows.time, rows.position), length, gap, **_MOTION)
        draw_line(velocity, pane, (rows.time, rows.belt_velocity), speed, gap, **_BELT)
        draw_line(velocity, pane, (rows.time, rows.velocity), speed, gap, **_MOTION)

    def portrait(self, axes: Axes) -> None:
        """Draw the phase portrait of the last cycles, above that of the start."""
        (length, label), (speed, speed_label) = self._length, self._speed
        axes.set_title("phase portrait")
        axes.set_xlabel(label)
        axes.set_ylabel(speed_label)
        if not len(self._last.time):
            say(axes, "no motion recorded")
            return
        for rows, look in ((self._history.beginning, _EARLIER), (self._last, _MOTION)):
            time, position, velocity, belt, stick_time = broken(
                self._history.gap, rows.time, *rows[1:]
            )
            many = len(time) > MANY
            axes.plot(position / length, velocity / speed, rasterized=many, **look)
            stuck = np.diff(stick_time, prepend=np.nan) > 0.5 * np.diff(time, prepend=np.nan)
            stuck |= np.append(stuck[1:], False)
            axes.plot(np.where(stuck, position, np.nan) / length, belt / speed, **_STICKS)
        belt_speed = float(self._last.belt_velocity[-1])
        axes.axhline(belt_speed / speed, **_BELT)
        if self._drive is not None and self._drive.has_spring and belt_speed != 0.0:
            axes.plot(self._drive.equilibrium_position / length, 0.0, zorder=3.0, **_POINT)
        axes.set_xlim(widened(*axes.get_xlim()))
        axes.set_ylim(widened(*axes.get_ylim()))

    def cycles(self, amplitude: Axes, stick_fraction: Axes) -> None:
        """Draw amplitude and stick fraction of each cycle over time."""
        time, *columns = self._history.cycles
        amplitude.set_title("each cycle")
        scale, label = self.units.axis("amplitude", "m", columns[0])
        if not len(time):
            say(amplitude, "no cycle was completed")
        rows = cycle_rows(time, *columns)
        farthest = float(np.abs(self._history.motion.position).max(initial=0.0)) / scale
        for axes, values, least in (
            (amplitude, columns[0] / scale, LEAST_SPAN * farthest),
            (stick_fraction, columns[1], 0.0),
        ):
            marker = "." if len(time) < PIXELS else ""
            axes.plot(time[rows], values[rows], marker=marker, ms=3.0, **_MOTION | {"lw": 0.5})
            axes.set_ylim(0.0, max(1.1 * float(values.max(initial=0.0)), least) or 1.0)
        amplitude.set_ylabel(label)
        stick_fraction.set_ylabel("stick fraction")
        if self._narrow:  # beside each other
            stick_fraction.set_title("each cycle")
            self._label_time(amplitude, self._run)
        else:
            amplitude.sharex(stick_fraction)
            amplitude.tick_params(labelbottom=False)
        self._label_time(stick_fraction, self._run)

    def law(self, axes: Axes) -> None:
        """Draw the friction law, and the range of relative speeds.

        Friction with a memory leaves the curve of steady slip: its loop is drawn.
        """
        axes.set_title("friction law" if self.short else "friction law, with the range of this run")
        drive, reached = self._drive, self._history.relative_speeds
        if drive is None:
            say(axes, "the drive is not known")
            axes.set(xticks=[], yticks=[])
            return
        at_rest = -drive.belt_speed
        least, largest = reached or (min(at_rest, 0.0), max(at_rest, 0.0))
        ends = min(least, at_rest, 0.0), max(largest, at_rest, 0.0)
        room = 0.1 * (ends[1] - ends[0]) or drive.speed_scale
        ends = ends[0] - room, ends[1] + room
        relative_speed = self.units.named("velocity relative to the belt", short=self.short)
        scale, label = self.units.axis(relative_speed, "m/s", ends)
        axes.set_xlabel(label)
        axes.set_ylabel(self.units.named("friction coefficient", short=self.short))
        self._law_between(axes, *ends, scale, color="black", lw=0.8, ls="-.")
        if reached is not None:
            axes.axvspan(least / scale, largest / scale, color=LIGHT_GREY, alpha=0.4, lw=0.0)
        curve, followed = "friction law", Line2D([], [], **_MOTION | {"lw": 3.0})
        followed.set_label("range of the last cycles")
        relative = self._last.velocity - self._last.belt_velocity
        if drive.friction.states:
            curve, followed = "in steady slip", Line2D([], [], **_MOTION, label="last cycles")
            self._loop(axes, relative / scale)
        elif len(relative):
            span = float(relative.min()), float(relative.max())
            self._law_between(axes, *span, scale, **_MOTION | {"lw": 3.0})
        if at_rest != 0.0:
            rest = float(drive.friction.at_rest(drive.belt_speed))
            axes.plot(at_rest / scale, rest, zorder=3.0, **_POINT)
        axes.axvline(at_rest / scale, **_BELT)
        axes.set_xlim(ends[0] / scale, ends[1] / scale)
        self.of_law = [
            Line2D([], [], color="black", lw=0.8, ls="-.", label=curve),
            followed,
            Patch(color=LIGHT_GREY, alpha=0.4, lw=0.0, label="range of the whole run"),
        ]
        if not self.short:  # otherwise there is no room for a legend within the panel
            rest = Line2D([], [], **_BELT, label="slide at rest")
            axes.legend(handles=[*self.of_law, rest], loc="best")

    def _loop(self, axes: Axes, relative: FloatArray) -> None:
        """Draw the friction of the last cycles over their relative speed."""
        assert self._drive is not None
        if len(relative):
            time, force = self._history.friction.since(float(self._last.time[0]))
            coefficient = force / self._drive.normal_force
            speed = np.interp(time, self._last.time, relative)
            axes.plot(speed, coefficient, label="loop", **_MOTION)

    def _law_between(
        self, axes: Axes, least: float, largest: float, scale: float, **look: Any
    ) -> None:
        assert self._drive is not None
        law = self._drive.friction
        for sign, start, end in ((-1.0, least, min(largest, 0.0)), (1.0, max(least, 0.0), largest)):
            if start < end:
                # Closely spaced where the law may be steep.
                steps = np.r_[0.0, np.geomspace(1e-6, 1.0, 400)]
                speeds = start + (end - start) * steps
                if sign < 0.0:
                    speeds = end - (end - start) * steps
                axes.plot(speeds / scale, law.coefficient(speeds, sign), **look)
        if least <= 0.0 <= largest:
            forward, backward = map(float, law.limits)
            axes.plot([0.0, 0.0], [-forward, backward], **look)


def _panels_over_time(figure: Figure, part: SubplotSpec, panes: int, *, narrow: bool) -> Any:
    """Return axes for three quantities and a number of panes; the first pane is the widest.

    If the figure is narrow, the first pane is above the others.
    """
    if not narrow:
        grid = part.subgridspec(3, panes, width_ratios=(2.0, *[1.0] * (panes - 1)))
        return grid.subplots(sharex="col", sharey="row")
    above, below = part.subgridspec(2, 1)
    whole: Any = above.subgridspec(3, 1).subplots(sharex=True, squeeze=False)
    others: Any = below.subgridspec(3, panes - 1).subplots(
        sharex="col", sharey="row", squeeze=False
    )
    panels = np.concatenate([whole, others], axis=1)
    for row in panels:
        row[1].sharey(row[0])
    return panels


def _draw_held(
    axes: Axes,
    pane: Pane,
    control: Sequence[FloatArray],
    scale: float,
    gap: float,
    dropped: FloatArray,
) -> bool:
    """Extend forces up to the next one after a gap; return whether there are any.

    If forces were `dropped` (times in s) in the gap, the acting force is unknown and not drawn.
    """
    time, force = control
    behind = np.flatnonzero(np.diff(time) > max(gap, 2.0 * (pane.end - pane.start) / PIXELS))
    came = np.diff(np.searchsorted(dropped, time)) > 0
    behind = behind[~came[behind]]
    behind = behind[(time[behind + 1] > pane.start) & (time[behind] < pane.end)]
    if len(behind) == 0:
        return False
    rows = np.stack([behind, behind + 1, behind + 1], axis=1).ravel()
    drawn = force[rows] / scale
    drawn[2::3] = np.nan
    axes.plot(time[rows], drawn, **_HELD)
    return True
