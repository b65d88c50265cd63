"""Section 3.1: the bifurcation diagrams, Fig. 2 to 5."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from math import sqrt

import numpy as np

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.functions import zero_between
from stickslip_ros.paper.claims.paper_values import (
    DAMPING,
    PRINTED_HOPF_SPEED,
    STATES,
    TAKEN_DAMPING,
    TAKEN_FOR_DAMPING,
    critical_beta,
    cycles,
    expansion,
    hopf_point,
    rates,
    slip_friction,
    trace_of,
)
from stickslip_ros.paper.claims.verdict import Computations, Evidence, Formula, Number, Observation
from stickslip_ros.paper.figures import STRIBECK, BifurcationFigure, unit_drive
from stickslip_ros.studies.settling import CYCLES
from stickslip_ros.theory.hopf import hopf_points

computes = Computations()

_SETTLED_SHARE = 0.98
"""Share of the Hopf speed above which the motions of a diagram have not settled yet."""


def _rows(figure: BifurcationFigure, chosen: Callable[[float, Regime | None], bool]) -> list[int]:
    measures = figure.measures
    return [
        row
        for row, (value, measure) in enumerate(zip(figure.values.tolist(), measures, strict=True))
        if chosen(value, measure.regime)
    ]


def _turning_points(figure: BifurcationFigure, row: int) -> int:
    """Return the number of different turning points in a row of the diagram."""
    found = np.sort(figure.settled[row].turning_points)
    return 1 + int(np.sum(np.diff(found) > 1e-6))  # closer ones count as one


def _periodicity(figure: BifurcationFigure, end: float) -> Observation:
    """Observe whether the vibrations up to the value `end` are not periodic."""
    rows = _rows(figure, lambda value, regime: regime in CYCLES and value < end)
    counts = {_turning_points(figure, row) for row in rows}
    return Observation(min(counts) > 2, counts=sorted(counts), motions=len(rows), end=end)


@computes("hopf-notion")
def _(_: Evidence) -> Observation:
    speed = hopf_point().belt_speed
    inside, outside = (expansion(speed + step).eigenvalues[0] for step in (-0.01, 0.01))
    return Observation(
        inside.real > 0.0 > outside.real and min(inside.imag, outside.imag) > 0.0,
        inside=inside,
        outside=outside,
    )


@computes("gamma")
def _(_: Evidence) -> Formula:
    gamma, belt_speed = 2.0, 0.4
    drive = unit_drive(belt_speed, stiffness=gamma)
    position, speed = STATES[0] * drive.length_scale, STATES[1] * drive.speed_scale
    friction = slip_friction(STRIBECK, speed - belt_speed)
    return Formula(
        None,
        rates(drive, STATES[:2])[1],
        {
            "With gamma X for X in eq. 5, the stiffness at fixed scales,": friction
            - DAMPING * speed
            - gamma * position
        },
    )


@computes("fig-2-end")
def _(evidence: Evidence) -> Number:
    figure = evidence.bifurcation(2)
    end = _SETTLED_SHARE * hopf_point().belt_speed
    rows = _rows(figure, lambda value, regime: regime is Regime.PURE_SLIP and value < end)
    amplitudes = [figure.measures[row].velocity_amplitude or 0.0 for row in rows]
    # By averaging r^2 = 4 (v_b1^2 - v0^2) near the Hopf point; higher orders bend the line.
    quadratic = np.polyfit(np.square(amplitudes), figure.values[rows] ** 2, 2)
    return Number(
        sqrt(float(quadratic[-1])),
        {TAKEN_FOR_DAMPING: hopf_point(TAKEN_DAMPING).belt_speed},
        hopf=hopf_point(),
    )


@computes("fig-2-direction")
def _(_: Evidence) -> Observation:
    speed = hopf_point().belt_speed
    below, above = (bool(expansion(speed + off).stable) for off in (-0.01, 0.01))
    vanishes = len(cycles(speed - 2e-3)) == 1 and not cycles(speed + 2e-3)
    return Observation(
        below and not above and vanishes,
        above and not below and vanishes,
        below="stable" if below else "unstable",
        above="stable" if above else "unstable",
    )


computes["fig-2-quasi-periodic"] = lambda evidence: _periodicity(
    evidence.bifurcation(2), _SETTLED_SHARE * hopf_point().belt_speed
)


@computes("fig-2-single-valued")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(2)
    rows = _rows(figure, lambda value, _: value > PRINTED_HOPF_SPEED)
    counts = [_turning_points(figure, row) for row in rows]
    return Observation(
        set(counts) == {1}, single=counts.count(1), total=len(rows), hopf=hopf_point()
    )


@computes("fig-2-verifies")
def _(evidence: Evidence) -> Observation:
    figure, speed = evidence.bifurcation(2), hopf_point().belt_speed
    below = _rows(figure, lambda v, _: 0.0 < v < _SETTLED_SHARE * speed)
    above = _rows(figure, lambda v, _: v > speed / _SETTLED_SHARE)
    agree = [figure.vibrating[row] for row in below]
    agree += [figure.measures[row].regime is Regime.EQUILIBRIUM for row in above]
    return Observation(
        all(agree), agreeing=sum(agree), total=len(agree), settled_share=_SETTLED_SHARE, speed=speed
    )


@computes("fig-3-region")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(3)
    critical = critical_beta(figure.drives[0].belt_speed)
    vibrating = figure.vibrating
    edges = sum(a != b for a, b in pairwise(vibrating))
    return Observation(
        vibrating[0] and not vibrating[-1] and edges == 1,
        critical=critical,
        figure=figure,
        last=figure.values[vibrating].max(),
    )


@computes("fig-3-end")
def _(evidence: Evidence) -> Number:
    belt_speed = evidence.bifurcation(3).drives[0].belt_speed
    # At v0 = 0.4, as in the other figures, and with v0 chosen to give the printed beta.
    fitting = zero_between(lambda v: critical_beta(v) - 0.02, 0.1, 0.499)
    return Number(
        critical_beta(0.4),
        {f"With the belt speed {belt_speed:g} in place of 0.4": critical_beta(belt_speed)},
        fitting=fitting,
    )


@computes("fig-3-quasi-periodic")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(3)
    return _periodicity(figure, 0.9 * critical_beta(figure.drives[0].belt_speed))


@computes("fig-4-influence")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(4)
    displacement, speed, stuck = (
        [getattr(measure, name) for measure in figure.measures]
        for name in ("amplitude", "velocity_amplitude", "stick_fraction")
    )
    ratios = [max(values) / min(values) for values in (displacement, speed, stuck)]
    far = (1e-3, 1e5)  # beyond the stiffnesses of the figure
    softest, stiffest = (
        cycles(0.2, stiffness=stiffness)[0].measures.velocity_amplitude or 0.0 for stiffness in far
    )
    return Observation(
        max(ratios) < 1.5,
        softest / stiffest < 2.5,
        ratios=ratios,
        figure=figure,
        end=figure.values[-1],
        far=far,
        change=softest / stiffest,
    )


@computes("fig-4-no-cure")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(4)
    vibrating = figure.vibrating
    return Observation(all(vibrating), count=sum(vibrating), total=len(vibrating))


@computes("fig-5-ratio")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(5)
    vibrating = figure.vibrating
    edges = sum(a != b for a, b in pairwise(vibrating))

    def p(ratio: float) -> float:
        law = replace(STRIBECK, minimum=STRIBECK.static / ratio)
        return trace_of(replace(figure.drives[0], friction=law))

    critical = zero_between(p, float(figure.values[0]), float(figure.values[-1]))
    slippery = unit_drive(0.4, friction=replace(STRIBECK, minimum=STRIBECK.static / 1000.0))
    return Observation(
        vibrating[-1] and not vibrating[0] and edges == 1,
        critical=critical,
        figure=figure,
        first=figure.values[vibrating].min(),
        speed=hopf_points(slippery)[0].belt_speed,
    )
