"""Section 3.1: the bifurcation diagrams, Fig. 2 to 5."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from math import sqrt

import numpy as np

from stickslip_ros.paper.claims.claim import Computations, Evidence, Formula, Number, Observation
from stickslip_ros.paper.claims.paper_values import (
    DAMPING,
    PRINTED_HOPF_SPEED,
    STATES,
    TAKEN_DAMPING,
    TAKEN_FOR_DAMPING,
    VIBRATING,
    critical_beta,
    cycles,
    expansion,
    hopf_point,
    listed,
    rates,
    slip_friction,
    trace_of,
)
from stickslip_ros.paper.figures import STRIBECK, BifurcationFigure, unit_drive
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.physics.model.functions import zero_between
from stickslip_ros.physics.theory.hopf import hopf_points

computes = Computations()

_CLEAR_OF_HOPF = 0.98
"""Share of the Hopf speed above which the motions of a diagram have not settled yet."""


def _rows(figure: BifurcationFigure, chosen: Callable[[float, Regime | None], bool]) -> list[int]:
    measures = figure.diagram.measures
    return [
        row
        for row, (value, measure) in enumerate(zip(figure.values.tolist(), measures, strict=True))
        if chosen(value, measure.regime)
    ]


def _turning_points(figure: BifurcationFigure, row: int) -> int:
    """Return the number of different turning points in a row of the diagram."""
    found = np.sort(figure.diagram.position[figure.diagram.row == row])
    return 1 + int(np.sum(np.diff(found) > 1e-6))  # closer ones count as one


def _periodicity(figure: BifurcationFigure, end: float) -> Observation:
    """Observe whether the vibrations up to the value `end` are not periodic."""
    rows = _rows(figure, lambda value, regime: regime in VIBRATING and value < end)
    counts = {_turning_points(figure, row) for row in rows}
    return Observation(
        f"{listed(sorted(counts))} turning points",
        min(counts) > 2,
        remark=f"Each of the {len(rows)} motions up to {end:.4g} repeats the same maximum and "
        "minimum: they are periodic. A planar autonomous system has no quasi-periodic motion "
        "(Poincare and Bendixson).",
    )


@computes("hopf-notion")
def _(_: Evidence) -> Observation:
    speed = hopf_point().belt_speed
    inside, outside = (expansion(speed + step).eigenvalues[0] for step in (-0.01, 0.01))
    return Observation(
        f"real part {inside.real:.5f} below, {outside.real:.5f} above",
        inside.real > 0.0 > outside.real and min(inside.imag, outside.imag) > 0.0,
        remark=f"0.01 on both sides of v_b1; imaginary part {inside.imag:.5f}.",
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
        "In eq. 2 the scales make the stiffness one.",
    )


@computes("fig-2-end")
def _(evidence: Evidence) -> Number:
    figure = evidence.bifurcation(2)
    end = _CLEAR_OF_HOPF * hopf_point().belt_speed
    rows = _rows(figure, lambda value, regime: regime is Regime.PURE_SLIP and value < end)
    amplitudes = [figure.diagram.measures[row].velocity_amplitude or 0.0 for row in rows]
    # By averaging r^2 = 4 (v_b1^2 - v0^2) near the Hopf point; higher orders bend the line.
    quadratic = np.polyfit(np.square(amplitudes), figure.values[rows] ** 2, 2)
    return Number(
        sqrt(float(quadratic[-1])),
        {TAKEN_FOR_DAMPING: hopf_point(TAKEN_DAMPING).belt_speed},
        "From Fig. 2: the speed amplitudes of pure slip extrapolate to zero there. Theory with the "
        f"same damping gives {hopf_point().belt_speed:.4f}.",
    )


@computes("fig-2-direction")
def _(_: Evidence) -> Observation:
    speed = hopf_point().belt_speed
    below, above = (bool(expansion(speed + off).stable) for off in (-0.01, 0.01))
    vanishes = len(cycles(speed - 2e-3)) == 1 and not cycles(speed + 2e-3)
    return Observation(
        f"{'stable' if below else 'unstable'} below, {'stable' if above else 'unstable'} above",
        below and not above and vanishes,
        above and not below and vanishes,
        "The opposite is true: stability is lost as the speed falls, and the cycle vanishes as the "
        "speed rises.",
    )


computes["fig-2-quasi-periodic"] = lambda evidence: _periodicity(
    evidence.bifurcation(2), _CLEAR_OF_HOPF * hopf_point().belt_speed
)


@computes("fig-2-single-valued")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(2)
    rows = _rows(figure, lambda value, _: value > PRINTED_HOPF_SPEED)
    counts = [_turning_points(figure, row) for row in rows]
    return Observation(
        f"{counts.count(1)} of {len(rows)} belt speeds",
        set(counts) == {1},
        remark=f"With beta = 0.01 in eq. 5 it is single from {hopf_point().belt_speed:.4f} on.",
    )


@computes("fig-2-verifies")
def _(evidence: Evidence) -> Observation:
    figure, speed = evidence.bifurcation(2), hopf_point().belt_speed
    below = _rows(figure, lambda v, _: 0.0 < v < _CLEAR_OF_HOPF * speed)
    above = _rows(figure, lambda v, _: v > speed / _CLEAR_OF_HOPF)
    measures = figure.diagram.measures
    agree = [measures[row].regime in VIBRATING for row in below]
    agree += [measures[row].regime is Regime.EQUILIBRIUM for row in above]
    return Observation(
        f"{sum(agree)} of {len(agree)} belt speeds",
        all(agree),
        remark=f"Vibrating up to {_CLEAR_OF_HOPF:g} v_b1, at rest from v_b1/{_CLEAR_OF_HOPF:g} on, "
        f"with v_b1 = {speed:.5f} for the damping of the motion.",
    )


@computes("fig-3-region")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(3)
    critical = critical_beta(figure.diagram.drives[0].belt_speed)
    vibrating = [measure.regime in VIBRATING for measure in figure.diagram.measures]
    edges = sum(a != b for a, b in pairwise(vibrating))
    return Observation(
        f"from beta = {critical:.4f} on at rest",
        vibrating[0] and not vibrating[-1] and edges == 1,
        remark=f"At v0 = {figure.diagram.drives[0].belt_speed:g}, by p = 0; the last vibration in "
        f"the diagram, still decaying, is at {figure.values[vibrating].max():.4f}.",
    )


@computes("fig-3-end")
def _(evidence: Evidence) -> Number:
    belt_speed = evidence.bifurcation(3).diagram.drives[0].belt_speed
    # At v0 = 0.4, as in the other figures, and with v0 chosen to give the printed beta.
    fitting = zero_between(lambda v: critical_beta(v) - 0.02, 0.1, 0.499)
    return Number(
        critical_beta(0.4),
        {f"With the belt speed {belt_speed:g} in place of 0.4": critical_beta(belt_speed)},
        "The belt speed of the figure is not printed; 0.4 is used, as in other figures. "
        f"The printed beta belongs to v0 = {fitting:.4f}.",
    )


@computes("fig-3-quasi-periodic")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(3)
    return _periodicity(figure, 0.9 * critical_beta(figure.diagram.drives[0].belt_speed))


@computes("fig-4-influence")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(4)
    displacement, speed, stuck = (
        [getattr(measure, name) for measure in figure.diagram.measures]
        for name in ("amplitude", "velocity_amplitude", "stick_fraction")
    )
    ratios = [max(values) / min(values) for values in (displacement, speed, stuck)]
    far = (1e-3, 1e5)  # beyond the stiffnesses of the figure
    softest, stiffest = (
        cycles(0.2, stiffness=stiffness)[0].measures.velocity_amplitude or 0.0 for stiffness in far
    )
    return Observation(
        f"amplitude changes by a factor of {ratios[0]:.3g}",
        max(ratios) < 1.5,
        softest / stiffest < 2.5,
        f"On the speed amplitude: over a stiffness of {figure.values[0]:g} to "
        f"{figure.values[-1]:g} it changes by a factor of {ratios[1]:.3g}, and over one of "
        f"{far[0]:g} to {far[1]:g} by {softest / stiffest:.3g}. The stick fraction changes by "
        f"{ratios[2]:.3g}, and falls to zero (see Fig. 10).",
    )


@computes("fig-4-no-cure")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(4)
    vibrating = [measure.regime in VIBRATING for measure in figure.diagram.measures]
    return Observation(
        f"{sum(vibrating)} of {len(vibrating)} stiffnesses vibrate",
        all(vibrating),
        remark="The sign of the trace p decides, and p does not contain the stiffness.",
    )


@computes("fig-5-ratio")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(5)
    vibrating = [measure.regime in VIBRATING for measure in figure.diagram.measures]
    edges = sum(a != b for a, b in pairwise(vibrating))

    def p(ratio: float) -> float:
        law = replace(STRIBECK, minimum=STRIBECK.static / ratio)
        return trace_of(replace(figure.diagram.drives[0], friction=law))

    critical = zero_between(p, float(figure.values[0]), float(figure.values[-1]))
    slippery = unit_drive(0.4, friction=replace(STRIBECK, minimum=STRIBECK.static / 1000.0))
    return Observation(
        f"from mu_s/mu_m = {critical:.4f} on",
        vibrating[-1] and not vibrating[0] and edges == 1,
        remark=f"By p = 0, at v0 = {figure.diagram.drives[0].belt_speed:g}; in the diagram from "
        f"{figure.values[vibrating].min():.4f} on, where a vibration still decays slowly. A "
        f"ratio of 1000 too makes it vibrate below v0 = {hopf_points(slippery)[0].belt_speed:.4f} "
        "only.",
    )
