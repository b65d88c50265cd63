"""The figure of a margin: decay rate over the belt speed, extrapolated to the onset."""

import numpy as np
from matplotlib.figure import Figure

from stickslip_ros.physics.measures.onset import Onset
from stickslip_ros.show.quantities import SI, Units
from stickslip_ros.show.style import BLUE, GREY, ORANGE, SCREEN, FigureStyle, finish, styled

_POINTS = 200
_ERRORS = 1.96
"""Half of a 95 % interval of a decay rate, in standard errors."""


@styled
def margin_figure(
    title: str, found: Onset, *, style: FigureStyle = SCREEN, units: Units = SI
) -> Figure:
    """Return the figure: decay rates, families that fit, and the interval of the onset."""
    figure = style.figure(8.0, 5.0)
    axes = figure.add_subplot()
    speed = np.array([each.belt_speed for each in found.feeds])
    rate, error = (
        np.array([getattr(each, name) for each in found.feeds])
        for name in ("decay_rate", "decay_error")
    )
    scale, label = units.axis("belt speed", "m/s", speed)
    axes.errorbar(
        speed / scale, rate, _ERRORS * error, fmt=".", color=BLUE, capsize=3.0, label="measured"
    )
    for name, family in found.families.items():
        if not family.rejected:
            over = np.linspace(family.onset_speed, speed[-1], _POINTS)
            axes.plot(over / scale, family.decay_rate(over), lw=1.0, label=name)
    if found.upper is not None:
        lower = found.lower or 0.0
        label_of = "onset, 95 % interval" if found.lower else "onset, upper limit"
        axes.axvspan(lower / scale, found.upper / scale, color=ORANGE, alpha=0.2, label=label_of)
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set_xlim(left=0.0)
    axes.set_xlabel(label)
    axes.set_ylabel("decay rate (1/s)")
    axes.legend(loc="best")
    style.set_title(figure, title)
    finish(figure)
    return figure
