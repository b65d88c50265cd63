"""The figures of recordings that were fitted: an identification, a friction map, a margin."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.fit import QUANTILE
from stickslip_ros.measures.onset import Onset
from stickslip_ros.model.friction import FrictionLaw
from stickslip_ros.show import BLUE, GREEN, GREY, ORANGE
from stickslip_ros.show.drawing import DOTS
from stickslip_ros.show.quantities import SI, Units
from stickslip_ros.show.style import SCREEN, FigureStyle, finish, styled

_MEASURED: Any = DOTS | {"ms": 7.0, "alpha": 0.15}
"""Wider than the curve, which hides what it fits."""
_LEAST_BAND = 0.005
"""Width of a band that can be seen, as a share of the axis."""
_SHOWN_SHARE = 0.995
"""Share of the dots that the vertical axis shows at least."""
_LARGEST_BAND = 100.0
"""Largest band that is drawn, in largest forces."""
_CURVE_POINTS = 400
_NAMES = {1.0: "forward slip", -1.0: "backward slip"}


@styled
def identification_figure(
    findings: Findings, *, style: FigureStyle = SCREEN, units: Units = SI
) -> Figure:
    """Return the figure of what was found.

    It has the friction curve with its 95 % band and what was measured; residuals over speed,
    position and time, of the forces of an axis, and of the positions in segments of a drive on a
    spring; and the run without feedback beside the measured positions, with their difference.
    """
    figure = style.figure(10.0, 9.0, narrow=2.6)
    if style.narrow:  # the last one has two panels
        first, *residuals, last = figure.add_gridspec(5, 1, height_ratios=(*[1.0] * 4, 1.8))
    else:
        grid = figure.add_gridspec(3, 2)
        first, *residuals, last = grid[0, :], grid[1, 0], grid[1, 1], grid[2, 0], grid[2, 1]
    _friction(figure.add_subplot(first), findings, units)
    left = findings.residuals(findings.records[0])
    quantity, error_unit = ("position", "m") if findings.chosen.has_spring else ("force", "N")
    what = "residual" if style.printed else "measured less fitted"
    errors = left.error, f"{quantity}, {what}", error_unit
    for place, values, name, unit in zip(
        residuals,
        (left.relative_speed, left.position, left.time),
        ("velocity relative to the belt", "displacement", "time"),
        ("m/s", "m", "s"),
        strict=True,
    ):
        _residuals(figure.add_subplot(place), (values, name, unit), errors, units)
    _free_run(figure, last, findings, units, short=style.printed)
    names = ", ".join(dict.fromkeys(Path(record.name).name for record in findings.records))
    error = f"{100.0 * findings.chosen.error:.4g} %"
    title = f"Identified drive, {names}: law {findings.chosen.label}, validation error {error}"
    style.set_title(figure, title)
    finish(figure)
    return figure


@styled
def map_figure(
    names: str,
    velocity: FloatArray,
    force: FloatArray,
    laws: Sequence[FrictionLaw],
    *,
    style: FigureStyle = SCREEN,
    units: Units = SI,
) -> Figure:
    """Return the figure of tests at constant speeds, and the law of each direction, or of both."""
    figure = style.figure(8.0, 5.0)
    axes = figure.add_subplot()
    scale, label = units.axis("velocity", "m/s", velocity)
    force_scale, force_label = units.axis("force", "N", force)
    axes.plot(velocity / scale, force / force_scale, ".", color=BLUE, label="measured")
    for sign, law in ((1.0, laws[0]), (-1.0, laws[-1])):
        size = float(np.max(sign * velocity, initial=0.0))
        speed = np.linspace(0.0, size, _CURVE_POINTS) if size else np.empty(0)
        driving = -np.array([law.coefficient(sign * w, sign) for w in speed.tolist()])
        named = f"law {law.name}" if sign > 0.0 else None
        axes.plot(sign * speed / scale, driving / force_scale, color=ORANGE, label=named)
    axes.set(xlabel=label, ylabel=force_label)
    axes.legend(loc="best")
    style.set_title(figure, f"Friction map, {names}")
    finish(figure)
    return figure


def _friction(axes: Axes, findings: Findings, units: Units) -> None:
    errors, curves = findings.chosen.errors(findings.records[0]), findings.curves
    sizes = [np.abs(errors.friction), *(curve.force for curve in curves)]
    top = max(float(np.quantile(part, _SHOWN_SHARE)) for part in sizes if len(part))
    scale, label = units.axis("friction force", "N", np.array([top]))
    fastest = max(float(curve.speed[-1]) for curve in curves)
    speed_scale, speed_label = units.axis("sliding speed $|v_r|$", "m/s", np.array([fastest]))
    for curve, colour in zip(curves, (BLUE, ORANGE), strict=False):
        direction = curve.direction
        rows, name = errors.relative_speed * direction > 0.0, _NAMES[direction]
        axes.plot(
            np.abs(errors.relative_speed[rows]) / speed_scale,
            direction * errors.friction[rows] / scale,
            color=colour,
            label=f"{name}, measured",
            **_MEASURED,
        )
        speed, force = curve.speed / speed_scale, curve.force / scale
        axes.plot(speed, force, color=colour, lw=1.0, label="fitted")
        band = QUANTILE * curve.standard_error / scale
        # What is not identified has a band that is not finite.
        band = np.minimum(band, _LARGEST_BAND * top / scale)
        limits = force - band, force + band
        seen = 2.0 * float(band.max()) * scale > _LEAST_BAND * top
        name = "95 % band" if seen else "95 % band: narrower than the line"
        axes.fill_between(speed, *limits, color=colour, alpha=0.3, lw=0.0, label=name)
    axes.set(xlabel=speed_label, ylabel=label)
    axes.set_xlim(0.0, 1.05 * fastest / speed_scale)
    # A band may be many times as large as the friction.
    axes.set_ylim(0.0, 1.15 * top / scale)
    axes.set_title("friction")
    axes.legend(loc="best", fontsize="small", ncols=len(curves), markerscale=1.5)


def _residuals(
    axes: Axes,
    over: tuple[FloatArray, str, str],
    measured: tuple[FloatArray, str, str],
    units: Units,
) -> None:
    (values, name, unit), (errors, quantity, error_unit) = over, measured
    scale, label = units.axis(units.named(name), unit, values)
    error_scale, error_label = units.axis(quantity, error_unit, errors)
    axes.plot(values / scale, errors / error_scale, color=BLUE, **DOTS)
    axes.axhline(0.0, color="black", lw=0.6)
    axes.set(xlabel=label, ylabel=error_label, title=f"residuals over {name}")


def _free_run(figure: Figure, place: Any, findings: Findings, units: Units, *, short: bool) -> None:
    record = findings.records[0]
    time = record.period * np.arange(len(record.position))
    run = findings.free_run(record)
    below = place.subgridspec(2, 1, height_ratios=(2.0, 1.0))
    upper = figure.add_subplot(below[0])
    lower = figure.add_subplot(below[1], sharex=upper)
    name = units.named("displacement", short=short)
    scale, label = units.axis(name, "m", record.position)
    upper.plot(time, record.position / scale, color=BLUE)
    upper.plot(time, run / scale, color=ORANGE, ls="--")
    upper.set(ylabel=label, title="in-sample: measured, and without feedback (dashed)")
    upper.tick_params(labelbottom=False)
    away = record.position - run
    scale, label = units.axis("difference", "m", away)
    lower.plot(time, away / scale, color=GREEN)
    lower.set(xlabel="time (s)", ylabel=label)


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
