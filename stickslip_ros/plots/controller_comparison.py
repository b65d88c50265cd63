"""The picture of what several controllers do at several belt speeds, side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any

from matplotlib.figure import Figure

from stickslip_ros.arrays import FloatArray
from stickslip_ros.plots.style import BLUE, GREY, ORANGE, drawing, styled
from stickslip_ros.plots.units import SI

_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": GREY, "ls": "-", "lw": 0.8},
    {"color": ORANGE, "ls": "--", "lw": 1.2},
    {"color": BLUE, "ls": "-", "lw": 1.6},
)
"""Of the controllers."""


@dataclass(frozen=True)
class Course:
    """One run over time, in s from its start; SI units."""

    belt_speed: float
    controller: str
    time: FloatArray
    position: FloatArray
    force_time: FloatArray
    force: FloatArray


@styled
def courses_figure(courses: Sequence[Course], shown: float = 0.6) -> Figure:
    """Return displacement and force of the first `shown` s, a column per belt speed.

    Three controllers can be told apart.
    """
    units = SI
    length, length_label = units.axis("displacement", "m", *(one.position for one in courses))
    newton, force_label = units.axis("control force", "N", *(one.force for one in courses))
    speeds = sorted({course.belt_speed for course in courses})
    controllers = list(dict.fromkeys(course.controller for course in courses))
    looks = dict(zip(controllers, cycle(_LOOKS), strict=False))
    figure = Figure(figsize=(11.0, 5.6))
    axes = figure.subplots(2, len(speeds), sharex=True, sharey="row", squeeze=False)
    for course in courses:
        column = axes[:, speeds.index(course.belt_speed)]
        look = {**looks[course.controller], "label": course.controller}
        rows, forces = course.time <= shown, course.force_time <= shown
        column[0].plot(course.time[rows], course.position[rows] / length, **look)
        force = course.force[forces] / newton
        column[1].step(course.force_time[forces], force, where="post", **look)
        column[0].set_title(f"belt speed {units.text(course.belt_speed, 'm/s')}")
        column[1].set_xlabel("time (s)")
    axes[0, 0].set_ylabel(length_label)
    axes[1, 0].set_ylabel(force_label)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


draw_courses = drawing(courses_figure)
"""Write the picture to a path."""
