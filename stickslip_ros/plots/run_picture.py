"""The picture of a run in which the control comes on: what it was like before, and after."""

from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip_ros.arrays import FloatArray
from stickslip_ros.plots.style import BLUE, GREEN, GREY, ORANGE, drawing, styled
from stickslip_ros.plots.units import SI


@dataclass(frozen=True)
class RunColumns:
    """A recorded run as columns, times in s from the first sample, SI units."""

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    belt_velocity: FloatArray
    force_time: FloatArray
    force: FloatArray


@styled
def control_coming_on_figure(
    run: RunColumns, switched_on: float, around: tuple[float, float]
) -> Figure:
    """Return displacement and force around `switched_on` (s), and both phase portraits.

    `around` is how long before and after it is shown over time, s.
    """
    figure = Figure(figsize=(10.0, 8.5))
    grid = figure.add_gridspec(3, 2, height_ratios=(2.0, 1.0, 2.4))
    displacement = figure.add_subplot(grid[0, :])
    force = figure.add_subplot(grid[1, :], sharex=displacement)
    before = figure.add_subplot(grid[2, 0])
    after = figure.add_subplot(grid[2, 1], sharex=before, sharey=before)

    units = SI
    length, length_label = units.axis("displacement", "m", run.position)
    speed, speed_label = units.axis("velocity", "m/s", run.velocity)
    newton, force_label = units.axis("control force", "N", run.force)
    start, end = switched_on - around[0], switched_on + around[1]
    _draw_displacement(displacement, run, length, (start, end))
    displacement.set_ylabel(length_label)
    displacement.tick_params(labelbottom=False)
    shown = (run.force_time >= start) & (run.force_time <= end)
    force.step(run.force_time[shown], run.force[shown] / newton, where="post", color=ORANGE)
    force.set_ylabel(force_label)
    force.set_xlabel("time (s)")
    force.set_xlim(start, end)
    for axes in (displacement, force):
        axes.axvline(switched_on, color="black", lw=1.0, ls=":")

    belt = float(run.belt_velocity[-1])
    late = run.time >= switched_on
    settled = ~late & (run.time >= switched_on / 2.0)
    for axes, rows, colour, title in (
        (before, settled, BLUE, f"before: {switched_on / 2.0:g} s to {switched_on:g} s"),
        (after, late, GREEN, f"after: {switched_on:g} s to {run.time[-1]:g} s"),
    ):
        axes.axhline(belt / speed, color="black", ls="--", lw=1.0, label="belt speed")
        axes.plot(run.position[rows] / length, run.velocity[rows] / speed, color=colour, lw=0.9)
        axes.set_title(title)
        axes.set_xlabel(length_label)
    after.plot(
        run.position[-1] / length, run.velocity[-1] / speed, "o", color="black", ms=5, label="end"
    )
    after.legend(loc="lower left")
    before.set_ylabel(speed_label)
    return figure


draw_control_coming_on = drawing(control_coming_on_figure)
"""Write the picture to a path."""


def _draw_displacement(
    axes: Axes, run: RunColumns, length: float, span: tuple[float, float]
) -> None:
    shown = (run.time >= span[0]) & (run.time <= span[1])
    sticking = run.velocity[shown] == run.belt_velocity[shown]
    axes.fill_between(
        run.time[shown], 0.0, 1.0, where=sticking, transform=axes.get_xaxis_transform(),
        color=GREY, alpha=0.4, lw=0.0, label="slide sticks to the belt",
    )  # fmt: skip
    axes.plot(run.time[shown], run.position[shown] / length, color=BLUE, lw=1.0)
    axes.legend(loc="upper right")
