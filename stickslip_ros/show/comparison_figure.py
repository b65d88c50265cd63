"""The figures of a comparison, which law holds where, and of a tuned loop, its Bode diagram."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from stickslip_ros.arrays import FloatArray
from stickslip_ros.show.quantities import Units
from stickslip_ros.show.style import SCREEN, FigureStyle, finish, styled
from stickslip_ros.studies.case_outcome import OUTCOMES
from stickslip_ros.studies.comparison import Comparison
from stickslip_ros.studies.tuned_design import TunedDesign

_MARKERS = "osD^vPX*<>"


@styled
def comparison_figure(
    study: Comparison,
    held: Mapping[str, FloatArray],
    costs: Mapping[str, tuple[float, float]],
    names: tuple[str, str],
    *,
    style: FigureStyle = SCREEN,
) -> Figure:
    """Return the figure.

    `held` has the share of held cases at each point by law, the best law first; `costs` the values
    of the outcomes with these `names`.
    """
    figure = style.figure(9.6, 4.4, narrow=1.5)
    style.set_title(figure, f"control laws compared, {study.scenario.name}")
    panels = (2, 1) if style.narrow else (1, 2)
    where, cost = figure.subplots(*panels)
    units = Units.for_drive(study.scenario.plant.as_drive(), study.plan.parameters)
    shares = np.array([*held.values()])
    # Pale, so that the numbers are read, and not red and green, which many do not tell apart.
    where.imshow(shares, cmap="viridis", vmin=0.0, vmax=1.0, aspect="auto", alpha=0.5)
    where.grid(visible=False)
    for (row, column), share in np.ndenumerate(shares):
        where.text(column, row, f"{share:.0%}", ha="center", va="center", fontsize=7.0)
    where.set_yticks(range(len(held)), [*held])
    grid = study.plan.grid
    if grid is None:
        where.set_xticks([])
    else:
        values = [grid.values(point) for point in range(grid.size)]
        axes_units = [axis.unit for axis in grid.axes]
        texts = [
            "\n".join(units.text(v, u) for v, u in zip(row, axes_units, strict=True))
            for row in values
        ]
        where.set_xticks(range(grid.size), texts, fontsize=7.0)
        where.set_xlabel(", ".join(axis.parameter for axis in grid.axes))
    where.set_title("share of cases held")
    scales = [
        units.axis(OUTCOMES[name].label, OUTCOMES[name].unit, [costs[law][place] for law in costs])
        for place, name in enumerate(names)
    ]
    for number, (law, values) in enumerate(costs.items()):
        force, error = (value / scale for value, (scale, _) in zip(values, scales, strict=True))
        marker = _MARKERS[number % len(_MARKERS)]
        cost.plot(force, error, marker, color=f"C{number % 10}", ls="", label=law)
    cost.set(xlabel=scales[0][1], ylabel=scales[1][1])
    for axis, of_axis in zip("xy", np.transpose([*costs.values()]), strict=True):
        if np.max(of_axis) > 10.0 * np.min(of_axis):  # else there is no power of ten to label
            cost.set(**{f"{axis}scale": "symlog"})
    cost.set_title("means of all cases")
    finish(figure)
    style.legend_below(figure, cost.get_legend_handles_labels()[0])
    return figure


@styled
def bode_figure(design: TunedDesign, *, style: FigureStyle = SCREEN) -> Figure:
    """Return magnitude and phase of the loop transfer function, and the sensitivity, by feed."""
    figure = style.figure(7.0, 6.0, narrow=1.3)
    style.set_title(figure, f"loop with {design.tuned.law.name}, {design.task.scenario.name}")
    size, phase, sensitivity = figure.subplots(3, 1, sharex=True)
    units = Units.for_drive(design.task.drive)
    for response in design.tuned.responses:
        hertz = response.plant.frequency / (2.0 * np.pi)
        label = units.text(response.plant.loop.drive.belt_speed, "m/s")
        size.loglog(hertz, np.abs(response.open_loop), label=label)
        phase.semilogx(hertz, np.degrees(np.unwrap(np.angle(response.open_loop))))
        sensitivity.loglog(hertz, np.abs(response.sensitivity))
    size.axhline(1.0, color="grey", lw=0.8)
    size.set_ylabel("|L|")
    phase.set_ylabel("arg L, degrees")
    sensitivity.axhline(1.0, color="grey", lw=0.8)
    sensitivity.set(xlabel=units.label("frequency", "Hz"), ylabel="|S|")
    finish(figure)
    style.legend_below(figure, size.get_legend_handles_labels()[0])
    return figure
