"""The figure of a margin: decay rate over the belt speed, extrapolated to the onset."""

import numpy as np
from matplotlib.figure import Figure

from stickslip_ros.measures.onset import Onset
from stickslip_ros.show.quantities import SI, Units
from stickslip_ros.show.style import BLUE, GREY, ORANGE, SCREEN, FigureStyle, finish, styled


@styled
def margin_figure(
    names: str, onset: Onset, *, style: FigureStyle = SCREEN, units: Units = SI
) -> Figure:
    """Return the figure: decay rates, families that fit, and the interval of the onset."""
    figure = style.figure(8.0, 5.0)
    axes = figure.add_subplot()
    feeds = [(feed.belt_speed, feed.decay_rate, 1.96 * feed.decay_error) for feed in onset.feeds]
    speed, rate, error = np.array(feeds).T
    scale, label = units.axis("belt speed", "m/s", speed)
    axes.errorbar(speed / scale, rate, error, fmt=".", color=BLUE, capsize=3.0, label="measured")
    for name, family in onset.families.items():
        if not family.rejected:
            over = np.linspace(min(family.onset_speed, 0.5 * speed[0]), speed[-1], 200)
            axes.plot(over / scale, family.decay_rate(over), lw=1.0, label=name)
    if onset.upper is not None:
        ends = (onset.lower or 0.0) / scale, onset.upper / scale
        axes.axvspan(*ends, color=ORANGE, alpha=0.2, label="onset, 95 % interval")
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set(xlabel=label, ylabel="decay rate (1/s)")
    axes.set_xlim(left=0.0)
    axes.legend(loc="best")
    style.set_title(figure, f"Onset of vibration, {names}")
    finish(figure)
    return figure
