"""The picture of where a sampled loop is stable, and how fast it comes to rest there."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip_ros.physics.theory.stability_map import CriticalGainCurves, StabilityMap
from stickslip_ros.plots.style import BLUE, GREEN, GREY, ORANGE, SKY_BLUE

_LEVELS = 9
_UNSTABLE = "#eeeeee"
_COLOURS = (BLUE, ORANGE, GREEN, SKY_BLUE, "black")


def draw_stability_map(
    path: Path, found: StabilityMap, critical: CriticalGainCurves | None
) -> None:
    """Write the map, and beside it the critical gain over the delay if given, to `path`.

    The format follows the ending.
    """
    width = 6.4 if critical is None else 12.0
    figure = Figure(figsize=(width, 5.2), layout="constrained")
    axes = figure.subplots(1, 1 if critical is None else 2, squeeze=False)[0]
    _draw_map(figure, axes[0], found)
    if critical is not None:
        _draw_critical_gains(axes[1], critical, found)
    figure.savefig(path, dpi=130)


def _draw_map(figure: Figure, axes: Axes, found: StabilityMap) -> None:
    corners, gains, rates = found.corner_frequencies, found.linear_gains, found.decay_rates.T
    fastest = float(rates.max())
    if fastest > 0.0:
        levels = np.linspace(0.0, fastest, _LEVELS)
        filled = axes.contourf(corners, gains, rates, levels=levels, cmap="viridis")
        figure.colorbar(filled, ax=axes, label="decay rate (1/s)", format="%.3g")
        axes.contour(corners, gains, rates, levels=[0.0], colors=[ORANGE], linewidths=2.0)
    axes.plot(corners, found.continuous, color="black", ls="--", lw=1.2)
    axes.plot(
        found.gains.corner_frequency, found.gains.linear, "*", color="white", mec="black", ms=14
    )
    axes.set_facecolor(_UNSTABLE)
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set_xscale("log")
    axes.set_xlim(corners[0], corners[-1])
    axes.set_ylim(gains[0], gains[-1])
    axes.set_xlabel("corner frequency d (rad/s)")
    axes.set_ylabel("linear gain k1 (N s/m)")
    loop = found.loop
    delay = f", force {loop.force_delay:g} s late" if loop.force_delay > 0.0 else ""
    axes.set_title(f"belt {loop.drive.belt_speed:.4g} m/s, {loop.rate:g} Hz{delay}", fontsize=10)
    axes.legend(
        handles=[
            Line2D([], [], color=ORANGE, lw=2.0, label="limit of stability, sampled"),
            Line2D([], [], color="black", ls="--", lw=1.2, label="the same, continuous"),
            Line2D([], [], color="white", mec="black", marker="*", ls="", ms=12, label="gains"),
            Patch(facecolor=_UNSTABLE, edgecolor=GREY, label="unstable"),
        ],
        loc="lower left",
        fontsize=8,
    )


def _draw_critical_gains(axes: Axes, critical: CriticalGainCurves, found: StabilityMap) -> None:
    for index, (rate, gains) in enumerate(zip(critical.rates, critical.linear_gains, strict=True)):
        colour = _COLOURS[index % len(_COLOURS)]
        # Where it changes sign it jumps from one interval of gains to another.
        jumps = np.flatnonzero(gains[:-1] * gains[1:] < 0.0) + 1
        delays = np.insert(critical.force_delays, jumps, np.nan)
        axes.plot(
            delays, np.insert(gains, jumps, np.nan), color=colour, lw=1.6, label=f"{rate:g} Hz"
        )
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.plot(found.loop.force_delay, found.gains.linear, "*", color="white", mec="black", ms=14)
    axes.set_xlabel("delay of the force (s)")
    axes.set_ylabel("critical linear gain k1 (N s/m)")
    axes.set_title(f"corner frequency {found.gains.corner_frequency:.3g} rad/s", fontsize=10)
    axes.legend(fontsize=8)
