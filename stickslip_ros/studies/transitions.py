"""Hopf bifurcations and stick-slip onsets by theory, over any parameter."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import nan, tanh

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import StickslipError
from stickslip_ros.model.functions import zero_between
from stickslip_ros.studies.plan import Axis
from stickslip_ros.studies.settling import ControlledDrive
from stickslip_ros.studies.study import Study
from stickslip_ros.theory.linear import expand, hurwitz_determinants
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.theory.sticking import release_margin

_Margin = Callable[[ControlledDrive], float]

HOPF_POINT = "Hopf point"

STABILITY_LIMIT = "limit of stability"
"""Of a sampled loop: a pair of multipliers, or one at -1, leaves the unit circle there."""

STICKING_LIMIT = "limit of sticking"
"""An end of a range in which a slide sticks again after release; there may be several ranges."""

_LABELS = {
    HOPF_POINT: ("Hopf bifurcation", "critical feed speed (Hopf)"),
    STICKING_LIMIT: ("stick-slip onset", "stick-slip onset speed"),
}

_MAP_POINTS = 50
"""Number of values of each axis of a map."""


@dataclass(frozen=True)
class TransitionMap:
    """Margins of the transitions by theory, over two parameters."""

    first: FloatArray
    """Values of the first parameter, shape (n,)."""
    second: FloatArray
    """Values of the second parameter, shape (m,)."""
    margins: Mapping[str, FloatArray]
    """Margin by name of the transition, zero at it, NaN without a theory; shape (n, m)."""


def transition_label(name: str, parameter: str = "") -> str:
    """Return the display text of a transition, which over the belt speed is a speed."""
    label, speed = _LABELS.get(name, (name, name))
    return speed if parameter == "plant.belt_speed" else label


def hopf_margin(case: ControlledDrive, *, coarse: bool = False) -> float:
    """Return a margin above zero if the equilibrium is stable, and zero at the Hopf bifurcation.

    Without sampling it is the smallest Hurwitz determinant: of two or three eigenvalues only a pair
    can cross, unless a gain of the displacement makes their product zero. For a sampled loop it is
    one minus the spectral radius, with `coarse` that of a similar loop of lower order. NaN on a
    belt at rest, for continuous control by a law without equations, and for a loop that is not
    linear near the equilibrium or changes from sample to sample.
    """
    drive, law, plant = case.drive, case.law, case.sampled
    if law is None or plant is None:
        control = None if law is None else law.continuous
        expansion = expand(drive, control) if law is None or control is not None else None
        return nan if expansion is None else float(hurwitz_determinants(expansion.jacobian).min())
    loop = LinearSampledLoop.from_drive(drive, *plant.linear_sampling)
    if loop is None or plant.force_jitter > 0.0 or law.force_limit == 0.0:
        return nan
    if law.linear_feedback(1.0 / plant.control_rate) is None:
        return nan
    return 1.0 - (loop.coarsened() if coarse else loop).spectral_radius(law)


def stick_margin(case: ControlledDrive) -> float:
    """Return a margin above zero if the slide sticks again after release, and zero at the limit.

    NaN on a belt at rest, and under control or a disturbance, for which there is no theory.
    """
    drive = case.drive
    if case.law is not None or case.sampled is not None or drive.belt_speed == 0.0:
        return nan
    return tanh(release_margin(replace(drive, belt_speed=abs(drive.belt_speed))))


def sign_changes(margin: Callable[[float], float], values: Sequence[float]) -> Iterator[float]:
    """Yield the points where `margin` changes sign between neighbouring `values`, to rounding."""
    known = [(value, size) for value in values if (size := margin(value)) != 0.0]
    for (before, one), (after, other) in pairwise(known):
        if one * other < 0.0:
            yield zero_between(margin, before, after)


def transitions(study: Study, axis: Axis) -> dict[str, list[float]]:
    """Return the values of the axis' parameter at each kind of transition, by name, SI units.

    All other parameters are those of the study's scenario. Two transitions closer than 1/200 of
    the axis may be missed. Over whole numbers there are none.
    """
    if axis.whole:
        return {}
    values = [axis.at(number / 200) for number in range(201)]
    speeds: dict[str, list[float]] = {}
    for name, margin in _margins(study).items():
        at = partial(_at, study, [axis.parameter], margin)
        if places := list(sign_changes(at, values)):
            speeds[name] = places
    return speeds


def transition_map(study: Study, axes: tuple[Axis, Axis]) -> TransitionMap:
    """Return the margins over two axes of the transitions that have a theory.

    If one is over whole numbers, there are none.
    """
    if any(axis.whole for axis in axes):
        return TransitionMap(axes[0].values(), axes[1].values(), {})
    first, second = (
        np.array([axis.at(place / (_MAP_POINTS - 1)) for place in range(_MAP_POINTS)])
        for axis in axes
    )
    names = [axis.parameter for axis in axes]
    margins: dict[str, FloatArray] = {}
    for name, margin in _margins(study, coarse=True).items():
        values = np.array([[_at(study, names, margin, x, y) for y in second] for x in first])
        if not np.isnan(values).all():
            margins[name] = values
    return TransitionMap(first, second, margins)


def _margins(study: Study, *, coarse: bool = False) -> dict[str, _Margin]:
    sampled = study.scenario.plant.expects_control and not study.continuous
    return {
        STABILITY_LIMIT if sampled else HOPF_POINT: lambda case: hopf_margin(case, coarse=coarse),
        STICKING_LIMIT: stick_margin,
    }


def _at(study: Study, parameters: Sequence[str], margin: _Margin, *values: float) -> float:
    """Return the margin for these values of the parameters; NaN if these are invalid."""
    try:
        scenario = study.scenario.changed(dict(zip(parameters, values, strict=True)))
        return margin(ControlledDrive.from_scenario(scenario, continuous=study.continuous))
    except (StickslipError, ArithmeticError, np.linalg.LinAlgError):
        return nan
