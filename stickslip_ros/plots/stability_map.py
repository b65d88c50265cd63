"""Figure of the stability and the decay rates of a sampled loop."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip_ros.physics.theory.stability_map import CriticalGainCurves, StabilityMap
from stickslip_ros.plots.style import BLUE, GREEN, GREY, ORANGE, SKY_BLUE, styled
from stickslip_ros.plots.units import Units

_UNSTABLE = "#eeeeee"
_GAINS: Any = {"color": "white", "mec": "black", "marker": "*", "ls": ""}
_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "ls": "-"},
    {"color": ORANGE, "ls": "--"},
    {"color": GREEN, "ls": "-."},
    {"color": SKY_BLUE, "ls": ":"},
    {"color": "black", "ls": (0, (5, 1, 1, 1, 1, 1))},
)
"""Looks of the curves, one for each rate."""


@styled
def stability_figure(found: StabilityMap, critical: CriticalGainCurves | None) -> Figure:
    """Return the figure of the map and, if given, of the critical gains over the delay."""
    figure = Figure(figsize=(6.4 if critical is None else 12.0, 5.2))
    axes = figure.subplots(1, 1 if critical is None else 2, squeeze=False)[0]
    _draw_map(figure, axes[0], found)
    if critical is not None:
        _draw_critical_gains(axes[1], critical, found)
    return figure


def _draw_map(figure: Figure, axes: Axes, found: StabilityMap) -> None:
    corners, gains, rates = found.corner_frequencies, found.linear_gains, found.decay_rates.T
    units = Units.for_drive(found.loop.drive)
    axes.grid(visible=False)
    fastest = float(rates.max())
    if fastest > 0.0:
        levels = np.linspace(0.0, fastest, 9)
        filled = axes.contourf(corners, gains, rates, levels=levels, cmap="viridis")
        figure.colorbar(filled, ax=axes, label=units.label("decay rate", "1/s"), format="%.3g")
        axes.contour(corners, gains, rates, levels=[0.0], colors=[ORANGE], linewidths=2.0)
    axes.plot(corners, found.continuous, color="black", ls="--", lw=1.2)
    axes.plot(found.gains.corner_frequency, found.gains.linear, **_GAINS, ms=14)
    axes.set_facecolor(_UNSTABLE)
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set_xscale("log")
    axes.set_xlim(corners[0], corners[-1])
    axes.set_ylim(gains[0], gains[-1])
    axes.set_xlabel(units.label("cutoff frequency d", "rad/s"))
    axes.set_ylabel(units.label("linear gain k1", "N s/m"))
    loop = found.loop
    late = units.text(loop.force_delay, "s")
    delay = f", force delay {late}" if loop.force_delay > 0.0 else ""
    belt, rate = units.text(loop.drive.belt_speed, "m/s"), units.text(loop.rate, "Hz")
    axes.set_title(f"belt speed {belt}, sample rate {rate}{delay}")
    axes.legend(
        handles=[
            Line2D([], [], color=ORANGE, lw=2.0, label="limit of stability, sampled"),
            Line2D([], [], color="black", ls="--", lw=1.2, label="limit of stability, continuous"),
            Line2D([], [], **_GAINS, ms=12, label="gains"),
            Patch(facecolor=_UNSTABLE, edgecolor=GREY, label="unstable"),
        ],
        loc="lower left",
    )


def _draw_critical_gains(axes: Axes, critical: CriticalGainCurves, found: StabilityMap) -> None:
    units = Units.for_drive(found.loop.drive)
    late, label = units.axis("force delay", "s", critical.force_delays)
    axes.set_xlabel(label)
    for index, (rate, gains) in enumerate(zip(critical.rates, critical.linear_gains, strict=True)):
        look = _LOOKS[index % len(_LOOKS)]
        # At a change of sign the curve jumps from one interval of gains to another.
        jumps = np.flatnonzero(gains[:-1] * gains[1:] < 0.0) + 1
        delays = np.insert(critical.force_delays, jumps, np.nan)
        label = units.text(float(rate), "Hz")
        axes.plot(delays / late, np.insert(gains, jumps, np.nan), **look, lw=1.6, label=label)
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.plot(found.loop.force_delay / late, found.gains.linear, **_GAINS, ms=14)
    axes.set_ylabel(units.label("critical linear gain k1", "N s/m"))
    corner = found.gains.corner_frequency
    axes.set_title(f"cutoff frequency {corner:.3g}{'' if units.dimensionless else ' rad/s'}")
    axes.legend(title="sample rate")
