"""The picture of a run in which the control comes on: what it was like before, and after."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip_ros.arrays import FloatArray
from stickslip_ros.physics.measures.breakpoints import breakpoints_from_samples
from stickslip_ros.plots.style import BLUE, GREEN, GREY, ORANGE, drawing, styled
from stickslip_ros.plots.units import SI
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.stamps import NANOSECONDS


@styled
def control_coming_on_figure(
    states: SampleColumns, forces: ForceColumns, switched_on: float, around: tuple[float, float]
) -> Figure:
    """Return displacement and force around `switched_on`, and both phase portraits.

    It is in s from the first sample; `around` is how long before and after it is shown, s.
    """
    time, force_time = ((each.stamp - states.stamp[0]) / NANOSECONDS for each in (states, forces))
    figure = Figure(figsize=(10.0, 8.5))
    grid = figure.add_gridspec(3, 2, height_ratios=(2.0, 1.0, 2.4))
    displacement = figure.add_subplot(grid[0, :])
    force = figure.add_subplot(grid[1, :], sharex=displacement)
    before = figure.add_subplot(grid[2, 0])
    after = figure.add_subplot(grid[2, 1], sharex=before, sharey=before)

    units = SI
    length, length_label = units.axis("displacement", "m", states.position)
    speed, speed_label = units.axis("velocity", "m/s", states.velocity)
    newton, force_label = units.axis("control force", "N", forces.force)
    start, end = switched_on - around[0], switched_on + around[1]
    _draw_displacement(displacement, time, states, length, (start, end))
    displacement.set_ylabel(length_label)
    displacement.tick_params(labelbottom=False)
    shown = (force_time >= start) & (force_time <= end)
    force.step(force_time[shown], forces.force[shown] / newton, where="post", color=ORANGE)
    force.set_ylabel(force_label)
    force.set_xlabel("time (s)")
    force.set_xlim(start, end)
    for axes in (displacement, force):
        axes.axvline(switched_on, color="black", lw=1.0, ls=":")

    belt = float(states.belt_velocity[-1])
    late = time >= switched_on
    settled = ~late & (time >= switched_on / 2.0)
    for axes, rows, colour, title in (
        (before, settled, BLUE, f"before: {switched_on / 2.0:g} s to {switched_on:g} s"),
        (after, late, GREEN, f"after: {switched_on:g} s to {time[-1]:g} s"),
    ):
        axes.axhline(belt / speed, color="black", ls="--", lw=1.0, label="belt speed")
        axes.plot(
            states.position[rows] / length, states.velocity[rows] / speed, color=colour, lw=0.9
        )
        axes.set_title(title)
        axes.set_xlabel(length_label)
    after.plot(
        states.position[-1] / length,
        states.velocity[-1] / speed,
        "o",
        color="black",
        ms=5,
        label="end",
    )
    after.legend(loc="lower left")
    before.set_ylabel(speed_label)
    return figure


draw_control_coming_on = drawing(control_coming_on_figure)
"""Write the picture to a path."""


def _draw_displacement(
    axes: Axes,
    time: FloatArray,
    states: SampleColumns,
    length: float,
    span: tuple[float, float],
) -> None:
    shown = (time >= span[0]) & (time <= span[1])
    time, states = time[shown], states[shown]
    breakpoints = breakpoints_from_samples(
        time, states.position, states.velocity, states.belt_velocity
    )
    axes.fill_between(
        breakpoints.time, 0.0, 1.0, where=breakpoints.stuck, transform=axes.get_xaxis_transform(),
        color=GREY, alpha=0.4, lw=0.0, label="slide sticks to the belt",
    )  # fmt: skip
    axes.plot(time, states.position / length, color=BLUE, lw=1.0)
    axes.legend(loc="upper right")
