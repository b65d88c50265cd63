"""The picture of what several controllers do at several belt speeds, side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

from matplotlib.figure import Figure

from stickslip_ros.physics.knots import FloatArray
from stickslip_ros.plots.style import BLUE, GREY, ORANGE

_COLOURS = (GREY, ORANGE, BLUE)
_TO_MICROMETRES = 1e6


@dataclass(frozen=True)
class Course:
    """One run over time, in s from its start; SI units."""

    belt_speed: float
    controller: str
    time: FloatArray
    position: FloatArray
    force_time: FloatArray
    force: FloatArray


def draw_courses(path: Path, courses: Sequence[Course], shown: float = 0.6) -> None:
    """Write displacement and force of the first `shown` s, a column per belt speed, to `path`.

    Three controllers can be told apart. The format follows the ending.
    """
    speeds = sorted({course.belt_speed for course in courses})
    controllers = list(dict.fromkeys(course.controller for course in courses))
    colours = dict(zip(controllers, cycle(_COLOURS), strict=False))
    figure = Figure(figsize=(11.0, 5.6), layout="constrained")
    axes = figure.subplots(2, len(speeds), sharex=True, sharey="row", squeeze=False)
    for course in courses:
        column = axes[:, speeds.index(course.belt_speed)]
        style = {"color": colours[course.controller], "lw": 1.0, "label": course.controller}
        rows, forces = course.time <= shown, course.force_time <= shown
        column[0].plot(course.time[rows], course.position[rows] * _TO_MICROMETRES, **style)
        column[1].step(course.force_time[forces], course.force[forces], where="post", **style)
        column[0].set_title(f"belt speed {course.belt_speed * 1e3:g} mm/s", fontsize=10)
        column[1].set_xlabel("time (s)")
    axes[0, 0].set_ylabel("displacement (µm)")
    axes[1, 0].set_ylabel("control force (N)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    figure.savefig(path, dpi=130)
