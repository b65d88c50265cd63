"""Figures that compare a run before and after its controller is switched on, and controllers."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any

from matplotlib.figure import Figure

from stickslip_ros.physics.measures.breakpoints import breakpoints_from_samples
from stickslip_ros.plots.style import BLUE, GREEN, GREY, ORANGE, styled
from stickslip_ros.plots.units import SI
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.stamps import NANOSECONDS


@dataclass(frozen=True)
class ControlledRun:
    """A run at a belt speed (m/s) with a controller."""

    belt_speed: float
    controller: str
    states: SampleColumns
    forces: ForceColumns


@styled
def comparison_figure(runs: Sequence[ControlledRun], shown: float = 0.6) -> Figure:
    """Return the figure of displacement and force over the first `shown` s, a column per speed.

    There are looks for three controllers.
    """
    length, length_label = SI.axis(
        SI.named("displacement"), "m", *(run.states.position for run in runs)
    )
    newton, force_label = SI.axis(
        SI.named("control force"), "N", *(run.forces.force for run in runs)
    )
    speeds = sorted({run.belt_speed for run in runs})
    controllers = dict.fromkeys(run.controller for run in runs)
    thin, dashed, thick = (GREY, "-", 0.8), (ORANGE, "--", 1.2), (BLUE, "-", 1.6)
    looks = dict(zip(controllers, cycle((thin, dashed, thick)), strict=False))
    figure = Figure(figsize=(11.0, 5.6))
    axes = figure.subplots(2, len(speeds), sharex=True, sharey="row", squeeze=False)
    for run in runs:
        column = axes[:, speeds.index(run.belt_speed)]
        colour, dashes, width = looks[run.controller]
        look: Any = {"color": colour, "ls": dashes, "lw": width, "label": run.controller}
        start = run.states.stamp[0]
        end = start + round(shown * NANOSECONDS)
        states, forces = run.states[run.states.stamp <= end], run.forces[run.forces.stamp <= end]
        time, force_time = ((each.stamp - start) / NANOSECONDS for each in (states, forces))
        column[0].plot(time, states.position / length, **look)
        column[1].step(force_time, forces.force / newton, where="post", **look)
        column[0].set_title(f"belt speed {SI.text(run.belt_speed, 'm/s')}")
        column[1].set_xlabel("time (s)")
    axes[0, 0].set_ylabel(length_label)
    axes[1, 0].set_ylabel(force_label)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


@styled
def control_switched_on_figure(
    states: SampleColumns, forces: ForceColumns, switched_on: float, around: tuple[float, float]
) -> Figure:
    """Return the figure of displacement and force around `switched_on`, and of both portraits.

    `switched_on` is in s from the first sample; `around` are the times shown before and after, s.
    """
    time, force_time = ((each.stamp - states.stamp[0]) / NANOSECONDS for each in (states, forces))
    figure = Figure(figsize=(10.0, 8.5))
    grid = figure.add_gridspec(3, 2, height_ratios=(2.0, 1.0, 2.4))
    displacement = figure.add_subplot(grid[0, :])
    force = figure.add_subplot(grid[1, :], sharex=displacement)
    before = figure.add_subplot(grid[2, 0])
    after = figure.add_subplot(grid[2, 1], sharex=before, sharey=before)

    length, length_label = SI.axis(SI.named("displacement"), "m", states.position)
    speed, speed_label = SI.axis(SI.named("velocity"), "m/s", states.velocity)
    newton, force_label = SI.axis(SI.named("control force"), "N", forces.force)
    start, end = switched_on - around[0], switched_on + around[1]
    shown = (time >= start) & (time <= end)
    x, v, belt = (each[shown] for each in (states.position, states.velocity, states.belt_velocity))
    breakpoints = breakpoints_from_samples(time[shown], x, v, belt)
    displacement.fill_between(
        breakpoints.time, 0.0, 1.0, where=breakpoints.stuck,
        transform=displacement.get_xaxis_transform(),
        color=GREY, alpha=0.4, lw=0.0, label="slide sticks to the belt",
    )  # fmt: skip
    displacement.plot(time[shown], x / length, color=BLUE, lw=1.0)
    displacement.legend(loc="upper right")
    displacement.set_ylabel(length_label)
    displacement.tick_params(labelbottom=False)
    shown = (force_time >= start) & (force_time <= end)
    force.step(force_time[shown], forces.force[shown] / newton, where="post", color=ORANGE)
    force.set_ylabel(force_label)
    force.set_xlabel("time (s)")
    force.set_xlim(start, end)
    for axes in (displacement, force):
        axes.axvline(switched_on, color="black", lw=1.0, ls=":")

    x, v, belt_speed = states.position / length, states.velocity / speed, states.belt_velocity[-1]
    late = time >= switched_on
    settled = ~late & (time >= switched_on / 2.0)
    for axes, rows, colour, title in (
        (before, settled, BLUE, f"before: {switched_on / 2.0:g} s to {switched_on:g} s"),
        (after, late, GREEN, f"after: {switched_on:g} s to {time[-1]:g} s"),
    ):
        axes.axhline(belt_speed / speed, color="black", ls="--", lw=1.0, label="belt speed")
        axes.plot(x[rows], v[rows], color=colour, lw=0.9)
        axes.set_title(title)
        axes.set_xlabel(length_label)
    after.plot(x[-1], v[-1], "o", color="black", ms=5, label="end")
    after.legend(loc="lower left")
    before.set_ylabel(speed_label)
    return figure
