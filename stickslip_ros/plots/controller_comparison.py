"""Figure that compares several controllers at several belt speeds."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any

from matplotlib.figure import Figure

from stickslip_ros.plots.style import BLUE, GREY, ORANGE, styled
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
