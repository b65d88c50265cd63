"""The figures of a comparison, what laws leave and need, and of a tuned loop, its Bode diagram."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from stickslip_ros.arrays import FloatArray
from stickslip_ros.show.quantities import Units
from stickslip_ros.show.style import SCREEN, FigureStyle, finish, styled
from stickslip_ros.studies.case_outcome import OUTCOMES
from stickslip_ros.studies.comparison import Comparison
from stickslip_ros.studies.design import Design

_MARKERS = "osD^vPX*<>"


@styled
def comparison_figure(
    study: Comparison,
    values: Mapping[str, Mapping[str, tuple[FloatArray, FloatArray]]],
    names: Sequence[str],
    *,
    style: FigureStyle = SCREEN,
) -> Figure:
    """Return the figure: outcomes of each law over the points, with standard errors.

    `values` has mean and standard error at each point by law, the best law first, and by name of an
    outcome: those of `names` and `held`, the share of held cases, which is shown where it is not 1
    everywhere.
    """
    shares = np.array([outcomes["held"][0] for outcomes in values.values()])
    shown = [*names, *["held"] * bool((shares < 1.0).any())]
    figure = style.figure(4.8 * len(shown), 4.4, narrow=0.9 * len(shown))
    said = "" if "held" in shown else ": all of them hold all cases"
    title = f"control laws compared, {study.scenario.name}{said}"
    style.set_title(figure, title, "means of the cases, with standard errors over the seeds")
    panels = figure.subplots(*((len(shown), 1) if style.narrow else (1, len(shown))), squeeze=False)
    units = Units.for_drive(study.scenario.plant.as_drive(), study.plan.parameters)
    grid = study.plan.grid
    points, label, texts = np.zeros(1), "", [""]
    if grid is not None:
        rows = [grid.values(point) for point in range(grid.size)]
        points = np.arange(len(rows))
        label = ", ".join(units.named(axis.parameter) for axis in grid.axes)
        texts = [
            "\n".join(units.text(v, a.unit) for v, a in zip(row, grid.axes, strict=True))
            for row in rows
        ]
    for axes, name in zip(panels.ravel(), shown, strict=True):
        means = [outcomes[name][0] for outcomes in values.values()]
        scale, text = units.axis(OUTCOMES[name].label, OUTCOMES[name].unit, np.array(means))
        for number, (law, outcomes) in enumerate(values.items()):
            mean, error = outcomes[name]
            # Beside each other, so that no law hides another.
            beside = points + 0.6 * ((number + 0.5) / len(values) - 0.5)
            axes.errorbar(
                beside, mean / scale, np.nan_to_num(error) / scale, label=law,
                fmt=_MARKERS[number % len(_MARKERS)], color=f"C{number % 10}", capsize=2.0, ms=5.0,
            )  # fmt: skip
        axes.set_xticks(points, texts)
        axes.set(xlabel=label, ylabel="share of cases held" if name == "held" else text)
        known = np.array(means)[np.isfinite(means) & (np.array(means) > 0.0)]
        if known.size and name != "held" and known.max() > 10.0 * known.min():
            axes.set_yscale("log")
    finish(figure)
    style.legend_below(figure, panels[0, 0].get_legend_handles_labels()[0])
    return figure


@styled
def bode_figure(design: Design, *, style: FigureStyle = SCREEN) -> Figure:
    """Return magnitude and phase of the loop transfer function, and the sensitivity, by feed."""
    assert design.tuned is not None
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
