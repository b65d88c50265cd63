"""Section 3: the simulations, Fig. 2 to 11."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby, pairwise
from math import sqrt

import numpy as np

from stickslip_ros.paper.claims.claim import (
    Chapter,
    Correction,
    Evidence,
    Formula,
    Number,
    Observation,
)
from stickslip_ros.paper.claims.reference import (
    DAMPING,
    FASTER,
    PRINTED_HOPF_SPEED,
    SLOWER,
    STATES,
    TAKEN_DAMPING,
    TAKEN_FOR_DAMPING,
    approximate_onset,
    arrivals,
    cycles,
    exact_onset,
    expansion,
    hopf_point,
    only_rest_at,
    overdamped_from,
    rates,
    stays,
    trace,
)
from stickslip_ros.paper.figures import (
    PRINTED_SLOPE,
    STRIBECK,
    TANGENT_SLOPE,
    BifurcationFigure,
    Panel,
    unit_drive,
)
from stickslip_ros.paper.portraits import Portrait
from stickslip_ros.physics.measures.cycles import Regime
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import Coulomb, Linear, Stribeck
from stickslip_ros.physics.theory.hopf import hopf_points
from stickslip_ros.physics.theory.limit_cycles import limit_cycle_of_run, limit_cycles
from stickslip_ros.physics.theory.linear import expand
from stickslip_ros.physics.theory.roots import zero_between

CHAPTER = Chapter("Section 3: simulations")

_PRINTED_ONSET = 0.4372
"""v_b0."""

_SAME_POINT = 1e-6
"""Distance of turning points that are one."""

_CLEAR_OF_HOPF = 0.98
"""Share of the Hopf speed beyond which a diagram looks at motions that are still on their way."""

_SOFTEST, _STIFFEST = 1e-3, 1e5
"""Stiffnesses beyond those of Fig. 4."""

VIBRATING = (Regime.STICK_SLIP, Regime.PURE_SLIP)


def falling(values: Sequence[float]) -> bool:
    """Return whether each value is below the one before."""
    return all(later < earlier for earlier, later in pairwise(values))


def border(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Return up to where it holds, between `low`, where it does, and `high`, where it does not."""
    while high - low > 1e-4:
        middle = (low + high) / 2.0
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def listed(values: Sequence[float]) -> str:
    """Return the values as a list in words."""
    return ", ".join(f"{value:.4g}" for value in values)


def regimes(portraits: Sequence[Portrait]) -> list[Regime | None]:
    """Return the regime that each motion ends in."""
    return [portrait.measures.regime for portrait in portraits]


def amplitude(portrait: Portrait) -> float:
    """Return the displacement amplitude that a motion ends with, zero at rest."""
    at_rest = portrait.measures.regime is Regime.EQUILIBRIUM
    return 0.0 if at_rest else portrait.measures.amplitude or 0.0


def stick_fractions(portraits: Sequence[Portrait]) -> list[float]:
    """Return the stick fractions of those motions that vibrate."""
    return [
        portrait.measures.stick_fraction or 0.0
        for portrait in portraits
        if portrait.measures.regime in VIBRATING
    ]


def _rows(figure: BifurcationFigure, chosen: Callable[[float, Regime | None], bool]) -> list[int]:
    measures = figure.diagram.measures
    return [
        row
        for row, (value, measure) in enumerate(zip(figure.values.tolist(), measures, strict=True))
        if chosen(value, measure.regime)
    ]


def _turning_points(figure: BifurcationFigure, row: int) -> int:
    """Return how many different turning points a row of the diagram has."""
    found = np.sort(figure.diagram.position[figure.diagram.row == row])
    return 1 + int(np.sum(np.diff(found) > _SAME_POINT))


def _periodicity(figure: BifurcationFigure, end: float) -> Observation:
    """Observe whether the motions that vibrate, up to some value, are other than periodic."""
    rows = _rows(figure, lambda value, regime: regime in VIBRATING and value < end)
    counts = {_turning_points(figure, row) for row in rows}
    return Observation(
        f"{listed(sorted(counts))} turning points",
        min(counts) > 2,
        remark=f"Each of the {len(rows)} motions up to {end:.4g} repeats the same maximum and "
        "minimum: they are periodic. A planar autonomous system has no quasi-periodic motion "
        "(Poincare and Bendixson).",
    )


@CHAPTER.statement("hopf-notion", "section 3.1", "A stable focus becomes an unstable one")
def _(_: Evidence) -> Observation:
    speed = hopf_point().belt_speed
    inside, outside = (expansion(speed + step).eigenvalues[0] for step in (-0.01, 0.01))
    return Observation(
        f"real part {inside.real:.5f} below, {outside.real:.5f} above",
        inside.real > 0.0 > outside.real and min(inside.imag, outside.imag) > 0.0,
        remark=f"0.01 to both sides of v_b1; imaginary part {inside.imag:.5f}.",
    )


@CHAPTER.formula("gamma", "section 3.1", "What gamma is", "gamma = 1, in no equation")
def _() -> Formula:
    gamma, belt_speed = 2.0, 0.4
    drive = unit_drive(belt_speed, stiffness=gamma)
    position, speed = STATES[0] * drive.length_scale, STATES[1] * drive.speed_scale
    friction = STRIBECK.coefficient(speed - belt_speed, np.sign(speed - belt_speed))
    return Formula(
        None,
        rates(drive, STATES[:2])[1],
        [
            Correction(
                "With gamma X for X in eq. 5, the stiffness at fixed scales,",
                friction - DAMPING * speed - gamma * position,
            )
        ],
        "Eq. 2 has made the stiffness one.",
    )


@CHAPTER.number(
    "fig-2-end", "section 3.1, Fig. 2", "Belt speed at which the vibration ends", 0.4944
)
def _(evidence: Evidence) -> Number:
    figure = evidence.bifurcation(2)
    rows = _rows(
        figure,
        lambda value, regime: (
            regime is Regime.PURE_SLIP and value < _CLEAR_OF_HOPF * hopf_point().belt_speed
        ),
    )
    amplitudes = [figure.diagram.measures[row].velocity_amplitude or 0.0 for row in rows]
    # By averaging r^2 = 4 (v_b1^2 - v0^2) near the Hopf point; higher orders bend the line.
    quadratic = np.polyfit(np.square(amplitudes), figure.values[rows] ** 2, 2)
    return Number(
        sqrt(float(quadratic[-1])),
        [Correction(TAKEN_FOR_DAMPING, hopf_point(TAKEN_DAMPING).belt_speed)],
        "From Fig. 2: where the speed amplitudes of pure slip extrapolate to zero. Theory with the "
        f"same damping has {hopf_point().belt_speed:.4f}.",
    )


@CHAPTER.statement(
    "fig-2-direction",
    "section 3.1, Fig. 2",
    "As the belt speed rises past v_b1 the equilibrium loses its stability and the cycle vanishes",
)
def _(_: Evidence) -> Observation:
    speed = hopf_point().belt_speed
    below, above = expansion(speed - 0.01).stable, expansion(speed + 0.01).stable
    vanishes = len(cycles(speed - 2e-3)) == 1 and not cycles(speed + 2e-3)
    return Observation(
        f"{'stable' if below else 'unstable'} below, {'stable' if above else 'unstable'} above",
        below and not above and vanishes,
        above and not below and vanishes,
        "The other way round: it is as the speed falls that stability is lost; the cycle vanishes "
        "as the speed rises.",
    )


@CHAPTER.statement(
    "fig-2-quasi-periodic", "section 3.1, Fig. 2", "Below v_b1 the motion is quasi-periodic"
)
def _(evidence: Evidence) -> Observation:
    return _periodicity(evidence.bifurcation(2), _CLEAR_OF_HOPF * hopf_point().belt_speed)


@CHAPTER.statement(
    "fig-2-single-valued", "section 3.1, Fig. 2", "From 0.4944 to 1 the diagram is a single curve"
)
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(2)
    rows = _rows(figure, lambda value, _: value > PRINTED_HOPF_SPEED)
    counts = [_turning_points(figure, row) for row in rows]
    return Observation(
        f"{counts.count(1)} of {len(rows)} belt speeds",
        set(counts) == {1},
        remark=f"With beta = 0.01 in eq. 5 it is single from {hopf_point().belt_speed:.4f} on.",
    )


@CHAPTER.statement(
    "fig-2-verifies", "section 3.1, Fig. 2", "The diagram confirms the stability analysis"
)
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
        f"with v_b1 = {speed:.5f} for the damping that the motion has.",
    )


@CHAPTER.statement(
    "fig-3-region", "section 3.1, Fig. 3", "Little damping lets the slide vibrate, much does not"
)
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(3)
    critical = _critical_beta(figure.diagram.drives[0].belt_speed)
    vibrating = [measure.regime in VIBRATING for measure in figure.diagram.measures]
    edges = sum(a != b for a, b in pairwise(vibrating))
    return Observation(
        f"from beta = {critical:.4f} on at rest",
        vibrating[0] and not vibrating[-1] and edges == 1,
        remark=f"At v0 = {figure.diagram.drives[0].belt_speed:g}, by p = 0; the diagram has the "
        f"last vibration, still dying out, at {figure.values[vibrating].max():.4f}.",
    )


@CHAPTER.number("fig-3-end", "section 3.1, Fig. 3", "beta at which the vibration ends", 0.02)
def _(evidence: Evidence) -> Number:
    belt_speed = evidence.bifurcation(3).diagram.drives[0].belt_speed
    # At v0 = 0.4, which the other figures use, and with v0 chosen to make it so.
    fitting = zero_between(lambda v: _critical_beta(v) - 0.02, 0.1, 0.499)
    return Number(
        _critical_beta(0.4),
        [
            Correction(
                f"With the belt speed {belt_speed:g} in place of 0.4", _critical_beta(belt_speed)
            )
        ],
        "The belt speed of the figure is not printed; computed is 0.4, which other figures have. "
        f"The printed beta belongs to v0 = {fitting:.4f}.",
    )


def _critical_beta(belt_speed: float) -> float:
    return trace(belt_speed, 0.0) / 2.0


@CHAPTER.statement(
    "fig-3-quasi-periodic",
    "section 3.1, Fig. 3",
    "The motion under little damping is quasi-periodic",
)
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(3)
    return _periodicity(figure, 0.9 * _critical_beta(figure.diagram.drives[0].belt_speed))


@CHAPTER.statement(
    "fig-4-influence", "section 3.1, Fig. 4", "Stiffness has no great influence on the vibration"
)
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(4)
    displacement, speed, stuck = (
        [getattr(measure, name) for measure in figure.diagram.measures]
        for name in ("amplitude", "velocity_amplitude", "stick_fraction")
    )
    ratios = [max(values) / min(values) for values in (displacement, speed, stuck)]
    softest, stiffest = (
        cycles(0.2, stiffness=stiffness)[0].measures.velocity_amplitude or 0.0
        for stiffness in (_SOFTEST, _STIFFEST)
    )
    return Observation(
        f"amplitude changes by a factor of {ratios[0]:.3g}",
        max(ratios) < 1.5,
        softest / stiffest < 2.5,
        f"On the speed amplitude: over a stiffness of {figure.values[0]:g} to "
        f"{figure.values[-1]:g} it changes by a factor of {ratios[1]:.3g}, and over one of "
        f"{_SOFTEST:g} to {_STIFFEST:g} by {softest / stiffest:.3g}. The stick fraction changes by "
        f"{ratios[2]:.3g}, and goes to zero (see Fig. 10).",
    )


@CHAPTER.statement(
    "fig-4-no-cure", "section 3.1, Fig. 4", "More stiffness alone does not end the vibration"
)
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(4)
    vibrating = [measure.regime in VIBRATING for measure in figure.diagram.measures]
    return Observation(
        f"{sum(vibrating)} of {len(vibrating)} stiffnesses vibrate",
        all(vibrating),
        remark="The trace p, whose sign decides, does not contain the stiffness.",
    )


@CHAPTER.statement(
    "fig-5-ratio",
    "section 3.1, Fig. 5",
    "A large ratio of friction coefficients makes it vibrate, a small one does not",
)
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(5)
    vibrating = [measure.regime in VIBRATING for measure in figure.diagram.measures]
    edges = sum(a != b for a, b in pairwise(vibrating))

    def p(ratio: float) -> float:
        law = replace(STRIBECK, minimum=STRIBECK.static / ratio)
        found = expand(replace(figure.diagram.drives[0], friction=law))
        assert found is not None
        return float(np.trace(found.jacobian))

    critical = zero_between(p, float(figure.values[0]), float(figure.values[-1]))
    slippery = unit_drive(0.4, friction=replace(STRIBECK, minimum=STRIBECK.static / 1000.0))
    return Observation(
        f"from mu_s/mu_m = {critical:.4f} on",
        vibrating[-1] and not vibrating[0] and edges == 1,
        remark=f"By p = 0, at v0 = {figure.diagram.drives[0].belt_speed:g}; in the diagram from "
        f"{figure.values[vibrating].min():.4f} on, where a vibration still dies out slowly. A "
        f"ratio of 1000 too makes it vibrate below v0 = {hopf_points(slippery)[0].belt_speed:.4f} "
        "only.",
    )


def _of_speed(evidence: Evidence, low: float, high: float) -> list[Portrait]:
    """Return the motions of Fig. 6 whose belt speed is between `low` and `high`."""
    return [p for p in evidence.portraits(6).portraits if low < p.drive.belt_speed < high]


@CHAPTER.statement(
    "fig-6-rest",
    "section 3.2, Fig. 6",
    "Above v_b1 it rests, and slips at the belt's speed",
)
def _(evidence: Evidence) -> Observation:
    above = _of_speed(evidence, hopf_point().belt_speed, 9.0)
    off = max(
        abs((portrait.least_relative_speed or 0.0) / portrait.drive.belt_speed - 1.0)
        for portrait in above
    )
    return Observation(
        f"v0 = {listed([portrait.drive.belt_speed for portrait in above])}: at rest",
        set(regimes(above)) == {Regime.EQUILIBRIUM} and off < 1e-3 and only_rest_at(FASTER),
        remark=f"The relative speed deviates from the belt's by {off:.3%} at most. At v0 = "
        f"{listed(FASTER)} too the equilibrium is stable and shooting finds no limit cycle.",
    )


@CHAPTER.statement(
    "fig-6-settling", "section 3.2, Fig. 6", "Above v_b1 it settles the sooner the faster the belt"
)
def _(evidence: Evidence) -> Observation:
    above = _of_speed(evidence, hopf_point().belt_speed, 9.0)
    times = [portrait.settling_time or 0.0 for portrait in above]
    overdamped = overdamped_from()
    near, rates = (
        [-float(expansion(speed).eigenvalues[0].real) for speed in speeds.tolist()]
        for speeds in (
            np.linspace(hopf_point().belt_speed, overdamped, 20),
            np.array([overdamped, 1.5, 2.0]),
        )
    )
    rises = falling(times) and falling([-rate for rate in near])
    return Observation(
        f"after {listed(times)}",
        rises and falling([-rate for rate in rates]),
        rises,
        f"Only up to v0 = {overdamped:.4f}, where the drive becomes overdamped. The decay rate is "
        f"{rates[0]:.3f} there, {rates[1]:.3f} at 1.5 and {rates[2]:.3f} at 2. Settling times of "
        f"Fig. 6 for v0 = {listed([portrait.drive.belt_speed for portrait in above])}.",
    )


@CHAPTER.statement("fig-6-unstable", "section 3.2, Fig. 6", "Below v_b1 it vibrates by itself")
def _(evidence: Evidence) -> Observation:
    below = _of_speed(evidence, 0.0, hopf_point().belt_speed)
    return Observation(
        f"v0 = {listed([portrait.drive.belt_speed for portrait in below])} vibrate",
        set(regimes(below)) <= set(VIBRATING),
        remark=f"Amplitudes {listed([amplitude(portrait) for portrait in below])}.",
    )


@CHAPTER.statement(
    "fig-6-pure-slip",
    "section 3.2, Fig. 6",
    "Between v_b0 and v_b1 the least relative speed is above zero: pure slip",
)
def _(evidence: Evidence) -> Observation:
    between = _of_speed(evidence, exact_onset(), hopf_point().belt_speed)
    least = [portrait.least_relative_speed or 0.0 for portrait in between]
    return Observation(
        f"{listed(least)}",
        set(regimes(between)) == {Regime.PURE_SLIP} and min(least) > 0.0,
        remark=f"At v0 = {listed([portrait.drive.belt_speed for portrait in between])}.",
    )


@CHAPTER.statement("fig-6-no-cycle", "section 3.2, Fig. 6", "In pure slip there is no limit cycle")
def _(_: Evidence) -> Observation:
    found = cycles(0.45)
    return Observation(
        f"{len(found)} limit cycle at v0 = 0.45",
        not found,
        remark="There is a stable one, of the amplitude "
        f"{listed([cycle.measures.amplitude or 0.0 for cycle in found])}, period "
        f"{listed([cycle.period for cycle in found])} and Floquet multiplier "
        f"{listed([abs(cycle.multipliers[0]) for cycle in found])}. Section 2 expects it too.",
    )


@CHAPTER.statement(
    "fig-6-stick-slip",
    "section 3.2, Fig. 6",
    "Below v_b0 the limit cycle has a stick phase, where the relative speed is zero",
)
def _(evidence: Evidence) -> Observation:
    below = _of_speed(evidence, 0.0, exact_onset())
    fractions = stick_fractions(below)
    slower = [cycles(speed)[0].measures.stick_fraction or 0.0 for speed in SLOWER]
    return Observation(
        f"stick fractions {listed(fractions)}",
        set(regimes(below)) == {Regime.STICK_SLIP}
        and max(portrait.least_relative_speed or 0.0 for portrait in below) == 0.0
        and min(slower) > 0.0,
        remark=f"At v0 = {listed([portrait.drive.belt_speed for portrait in below])}; by shooting "
        f"{listed(slower)} at v0 = {listed(SLOWER)}.",
    )


@CHAPTER.number(
    "vb0", "section 3.2", "The speed v_b0 below which it sticks, beta = 0.01", _PRINTED_ONSET
)
def _(_: Evidence) -> Number:
    return Number(
        exact_onset(),
        [Correction("By averaging, an approximation", approximate_onset())],
        "The periodic orbit that touches the belt's speed has the computed one. The paper does not "
        "say where its value comes from.",
    )


@CHAPTER.statement("vb0-and-vb1", "section 3.2", "v_b0 and v_b1 belong to one damping")
def _(_: Evidence) -> Observation:
    def damping(speed: float, belt_speed: Callable[[float], float]) -> float:
        return zero_between(lambda damping: belt_speed(damping) - speed, 0.0, 0.1)

    of_hopf = damping(PRINTED_HOPF_SPEED, lambda d: hopf_point(d).belt_speed)
    of_onset = damping(_PRINTED_ONSET, approximate_onset)
    of_exact = damping(_PRINTED_ONSET, exact_onset)
    rounding = 2e-4  # of the printed speeds, times the slopes of the damping over them
    apart = min(abs(of_hopf - of_onset), abs(of_hopf - of_exact))
    return Observation(
        f"{of_hopf:.4f} and {of_onset:.4f}",
        apart < rounding,
        remark=f"Damping coefficients that give v_b1 = {PRINTED_HOPF_SPEED:g} and, by averaging, "
        f"v_b0 = {_PRINTED_ONSET:g}; on the motion the latter belongs to {of_exact:.4f}.",
    )


@CHAPTER.statement(
    "grazing",
    "section 3.2",
    "The least relative speed becomes zero at the border between pure slip and stick-slip",
)
def _(_: Evidence) -> Observation:
    speed = exact_onset()
    fractions = [
        cycles(speed * factor)[0].measures.stick_fraction or 0.0
        for factor in (1.0 - 1e-4, 1.0 + 1e-4)
    ]
    return Observation(
        f"v0 = {speed:.6f}",
        fractions[0] > 0.0 == fractions[1],
        remark=f"Limit cycles by shooting: at 0.9999 times this speed the stick fraction is "
        f"{fractions[0]:.4f}, at 1.0001 times it is {fractions[1]:.4f}.",
    )


@CHAPTER.statement("damping-cures", "section 3.3", "Enough damping prevents the vibration")
def _(evidence: Evidence) -> Observation:
    most = evidence.portraits(7).portraits[-1]
    critical = _critical_beta(most.drive.belt_speed)
    return Observation(
        f"beta above {critical:.4g}",
        most.measures.regime is Regime.EQUILIBRIUM
        and critical < most.drive.damping_coefficient / 2.0,
        remark=f"At v0 = {most.drive.belt_speed:g}; with {most.case.label} the slide ends at rest.",
    )


@CHAPTER.statement(
    "critical-speed-of-damping",
    "section 3.3, eq. 8",
    "p = 0 of eq. 8 gives the critical speed for whatever beta",
)
def _(_: Evidence) -> Observation:
    betas = (0.0, 0.01, 0.05, 0.1)
    true = [hopf_point(2.0 * beta).belt_speed for beta in betas]
    once, twice = ([sqrt((0.45 - n * beta) / 1.8) for beta in betas] for n in (1.0, 2.0))
    return Observation(
        f"{listed(true)}",
        bool(np.allclose(once, true, rtol=1e-9)),
        bool(np.allclose(twice, true, rtol=1e-9)),
        f"With 2 beta in place of beta in eq. 8, which gives {listed(once)} for beta = "
        f"{listed(betas)}.",
    )


def _stick_falls(portraits: Sequence[Portrait]) -> bool:
    return falling([fraction for fraction in stick_fractions(portraits) if fraction > 0.0])


@CHAPTER.statement(
    "fig-7-stick", "section 3.3, Fig. 7", "The stick fraction falls as the damping rises"
)
def _(evidence: Evidence) -> Observation:
    portraits = evidence.portraits(7).portraits
    return Observation(
        listed(stick_fractions(portraits)),
        _stick_falls(portraits),
        remark=f"At v0 = {portraits[0].drive.belt_speed:g}, of the motions that vibrate.",
    )


@CHAPTER.statement(
    "fig-7-order",
    "section 3.3, Fig. 7",
    "With rising damping sticking ends first, the vibration later",
)
def _(evidence: Evidence) -> Observation:
    return _stages(evidence.portraits(7).portraits)


def _stages(portraits: Sequence[Portrait]) -> Observation:
    stages = [stage for stage, _ in groupby(regimes(portraits))]
    labels = [f"{p.case.label}: {p.measures.regime}" for p in portraits]
    expected = [Regime.STICK_SLIP, Regime.PURE_SLIP, Regime.EQUILIBRIUM]
    return Observation("; ".join(labels), stages == expected)


@CHAPTER.number(
    "linear-slope",
    "section 3.3",
    "Slope of the linear law, 3 (mu_s - mu_m) / v_m, for that of the Stribeck law",
    0.9,
)
def _(_: Evidence) -> Number:
    tangent = trace(1e-9, 0.0)
    return Number(
        tangent,
        remark="Computed is the Stribeck law's slope at zero relative speed, "
        f"{tangent / PRINTED_SLOPE:.4g} times what is printed.",
    )


def _slopes(evidence: Evidence) -> tuple[Panel, Panel, Panel]:
    """Return the panels of Fig. 9: the tangent slope, and the printed one at two belt speeds."""
    tangent, printed, printed_slow = evidence.portraits(9).panels
    return tangent, printed, printed_slow


@CHAPTER.statement(
    "fig-8", "section 3.3, Fig. 8", "With Coulomb friction there is no self-excited vibration"
)
def _(evidence: Evidence) -> Observation:
    portraits = evidence.portraits(8).portraits
    damped = [portrait for portrait in portraits if portrait.drive.damping > 0.0]
    undamped = [portrait for portrait in portraits if portrait.drive.damping == 0.0]
    ranges = [(p.measures.amplitude or 0.0) / p.drive.belt_speed for p in undamped]
    betas, speeds = (0.001, 1.0), (0.02, 0.2, 2.0)
    found = [
        cycle
        for beta in betas
        for speed in speeds
        for cycle in limit_cycles(
            unit_drive(speed, damping=2.0 * beta, friction=Coulomb(STRIBECK.static))
        )
    ]
    return Observation(
        f"{regimes(damped).count(Regime.EQUILIBRIUM)} of {len(damped)} dampings come to rest",
        set(regimes(damped)) == {Regime.EQUILIBRIUM} and not found,
        remark="Without any damping what the start put in neither grows nor dies out: amplitude "
        f"{listed(ranges)} belt speeds. At v0 = {listed(speeds)} with beta = {listed(betas)} "
        f"shooting finds {len(found)} limit cycles.",
    )


@CHAPTER.statement(
    "fig-9-vibration",
    "section 3.3, Fig. 9",
    "With the linear law the slide vibrates by itself",
)
def _(evidence: Evidence) -> Observation:
    tangent, printed, slow = _slopes(evidence)
    least = [panel.portraits[0] for panel in (tangent, printed, slow)]
    vibrates = [portrait.measures.regime in VIBRATING for portrait in least]
    fastest = [
        border(
            lambda v, slope=slope: stays(unit_drive(v, friction=Linear(STRIBECK.static, slope))),
            0.01,
            2.0,
        )
        for slope in (PRINTED_SLOPE, TANGENT_SLOPE)
    ]
    passes = least[1].time_beyond(10.0)
    return Observation(
        f"{least[1].measures.regime} with the printed slope",
        all(vibrates),
        vibrates[0] and vibrates[2],
        f"On a slow belt: with the printed slope below v0 = {fastest[0]:.3f}, with half of it, "
        f"that of the Stribeck law, below {fastest[1]:.3f}, at beta = 0.01 and from rest. On a "
        f"faster one it runs away: at v0 = {least[1].drive.belt_speed:g} with the printed slope "
        f"the speed passes 10 at tau = {passes or 0.0:.1f}.",
    )


@CHAPTER.statement(
    "fig-9-stick",
    "section 3.3, Fig. 9",
    "With the linear law too the stick fraction falls as the damping rises",
)
def _(evidence: Evidence) -> Observation:
    panels = _slopes(evidence)
    tangent, printed, slow = (stick_fractions(panel.portraits) for panel in panels)
    belt_speed = panels[1].portraits[0].drive.belt_speed

    def drive(beta: float) -> Drive:
        law = Linear(STRIBECK.static, PRINTED_SLOPE)
        return unit_drive(belt_speed, damping=2.0 * beta, friction=law)

    gentle = zero_between(lambda beta: arrivals(drive(beta))[0] + STRIBECK.static, 0.1, 0.3)
    bounded = border(lambda beta: not stays(drive(beta)), 0.0, gentle)
    betas = np.linspace(0.1, gentle, 4).tolist()
    runs = [limit_cycle_of_run(drive(beta), 0.0) for beta in betas]
    overrunning = [run.measures.stick_fraction or 0.0 for run in runs if run is not None]
    return Observation(
        f"{listed(printed)} with the printed slope",
        all(_stick_falls(panel.portraits) for panel in panels),
        all(_stick_falls(panel.portraits) for panel in (panels[0], panels[2])),
        "Where the slide comes to the belt's speed gently enough to stick at once: with half the "
        f"slope, that of the Stribeck law, {listed(tangent)}; with the printed one at v0 = "
        f"{panels[2].portraits[0].drive.belt_speed:g} {listed(slow)}. At v0 = {belt_speed:g} that "
        f"is so above beta = {gentle:.4f}; below, it overruns the belt before it sticks, and the "
        f"stick fraction rises with the damping: {listed(overrunning)} at beta = {listed(betas)}. "
        f"Up to beta = {bounded:.4f} the motion runs away.",
    )


@CHAPTER.statement(
    "falling-slope",
    "section 3.3, Fig. 8 and 9",
    "Friction that falls with speed is the cause of the self-excited vibration",
)
def _(evidence: Evidence) -> Observation:
    laws = (Coulomb(STRIBECK.static), Linear(STRIBECK.static, TANGENT_SLOPE))
    traces: list[float] = []
    for law in laws:
        found = expand(unit_drive(0.2, friction=law))
        assert found is not None
        traces.append(float(np.trace(found.jacobian)))
    flat = [p.measures.regime for p in evidence.portraits(8).portraits if p.drive.damping > 0.0]
    falls = _slopes(evidence)[0].portraits[0].measures.regime
    return Observation(
        f"p = {traces[0]:.4g} without it, {traces[1]:.4g} with it",
        traces[0] < 0.0 < traces[1] and falls in VIBRATING and not set(flat) & set(VIBRATING),
        remark="Coulomb law and linear law with the tangent slope, beta = 0.01; the motions of "
        "Fig. 8 and 9 agree.",
    )


@CHAPTER.statement(
    "stiffness-stability", "section 3.4", "By the stability analysis stiffness improves stability"
)
def _(_: Evidence) -> Observation:
    stiffnesses = (0.5, 1.0, 2.0, 10.0, 50.0)
    speeds = [hopf_points(unit_drive(0.2, stiffness=k))[0].belt_speed for k in stiffnesses]
    return Observation(
        f"v_b1 = {listed(speeds)}",
        falling(speeds),
        remark=f"For stiffness {listed(stiffnesses)}: the Hopf speed does not depend on it, as the "
        "trace p does not. The same holds in SI units, where p is (N mu' - c)/m.",
    )


def _of_stiffnesses(evidence: Evidence) -> list[Portrait]:
    """Return the motions of Fig. 10 at v0 = 0.2."""
    usual, stiff, _ = evidence.portraits(10).panels
    return [*usual.portraits, *stiff.portraits]


@CHAPTER.statement(
    "fig-10-stick", "section 3.4, Fig. 10", "The stick fraction falls as the stiffness rises"
)
def _(evidence: Evidence) -> Observation:
    portraits = _of_stiffnesses(evidence)
    return Observation(
        listed(stick_fractions(portraits)),
        _stick_falls(portraits),
        remark=f"At v0 = {portraits[0].drive.belt_speed:g}, stiffness "
        f"{listed([portrait.drive.stiffness for portrait in portraits])}.",
    )


@CHAPTER.statement(
    "fig-10-end", "section 3.4, Fig. 10", "Enough stiffness ends the sticking at v0 = 0.2"
)
def _(_: Evidence) -> Observation:
    def beyond_friction(stiffness: float, arrival: int) -> float:
        """Return by how much friction cannot hold a slide that comes to the belt's speed."""
        return abs(arrivals(unit_drive(0.2, stiffness=stiffness))[arrival]) - STRIBECK.static

    overruns = zero_between(lambda stiffness: beyond_friction(stiffness, 0), 1.0, 100.0)
    never = zero_between(lambda stiffness: beyond_friction(stiffness, 1), 100.0, 10_000.0)
    stiffer = [never * factor for factor in (1.01, 10.0, 100.0)]
    found = [cycle for stiffness in stiffer for cycle in cycles(0.2, stiffness=stiffness)]
    less = [cycles(0.2, stiffness=never / factor)[0] for factor in (1.01, 10.0, 100.0)]
    return Observation(
        f"from stiffness {never:.4g} on",
        [cycle.measures.regime for cycle in found] == [Regime.PURE_SLIP] * len(stiffer)
        and all(cycle.stable for cycle in found)
        and all(cycle.measures.regime is Regime.STICK_SLIP for cycle in less),
        remark=f"Above stiffness {overruns:.4g} the slide comes to the belt's speed with a "
        "reaction that friction cannot hold, and overruns the belt; it sticks when it comes back "
        f"to the belt's speed, until above {never:.4g} friction cannot hold it then either. "
        "Shooting finds one stable cycle, which does not stick, at stiffness "
        f"{listed(stiffer)}. Just below the onset of sticking less is enough, since that moves "
        f"from v0 = {exact_onset():.5f} at stiffness 1 to {exact_onset(stiffness=2.0):.5f} at 2 "
        f"and {exact_onset(stiffness=50.0):.5f} at 50.",
    )


@CHAPTER.statement(
    "fig-10-size", "section 3.4, Fig. 10", "The limit cycle shrinks as the stiffness rises"
)
def _(evidence: Evidence) -> Observation:
    portraits = _of_stiffnesses(evidence)
    sizes = [amplitude(portrait) for portrait in portraits]
    speeds = [portrait.measures.velocity_amplitude or 0.0 for portrait in portraits]
    return Observation(
        listed(sizes),
        falling(sizes) and falling(speeds),
        remark=f"Displacement amplitudes; speed amplitudes {listed(speeds)}.",
    )


@CHAPTER.statement(
    "fig-11-amplitude",
    "section 3.5, Fig. 11",
    "The amplitude rises with the gap between the friction coefficients",
)
def _(evidence: Evidence) -> Observation:
    sizes = [amplitude(portrait) for portrait in evidence.portraits(11).portraits]
    at_rest = sizes.count(0.0)
    return Observation(
        listed(sizes),
        falling(sizes[: len(sizes) - at_rest]) and not any(sizes[len(sizes) - at_rest :]),
        remark=_of_minima(evidence),
    )


@CHAPTER.statement(
    "fig-11-stick",
    "section 3.5, Fig. 11",
    "The stick fraction rises with the gap between the friction coefficients",
)
def _(evidence: Evidence) -> Observation:
    portraits = evidence.portraits(11).portraits
    belt_speed, minima = 0.15, (0.1, 0.02, 0.001)

    def drive(minimum: float) -> Drive:
        return unit_drive(belt_speed, friction=replace(STRIBECK, minimum=minimum))

    fractions = [limit_cycles(drive(m))[0].measures.stick_fraction or 0.0 for m in minima]
    overruns = zero_between(lambda m: arrivals(drive(m))[0] + STRIBECK.static, 0.001, 0.1)
    return Observation(
        listed(stick_fractions(portraits)),
        _stick_falls(portraits) and falling(fractions[::-1]),
        _stick_falls(portraits),
        f"As long as the slide does not overrun the belt before it sticks. {_of_minima(evidence)} "
        f"At v0 = {belt_speed:g}, where it does so below mu_m = {overruns:.4f}, it is "
        f"{listed(fractions)} for mu_m = {listed(minima)}.",
    )


@CHAPTER.statement(
    "fig-11-order",
    "section 3.5, Fig. 11",
    "With a smaller gap sticking ends first, the vibration later",
)
def _(evidence: Evidence) -> Observation:
    return _stages(evidence.portraits(11).portraits)


def _of_minima(evidence: Evidence) -> str:
    minima = [
        portrait.drive.friction.minimum
        for portrait in evidence.portraits(11).portraits
        if isinstance(portrait.drive.friction, Stribeck)
    ]
    return f"At v0 = 0.4 for mu_m = {listed(minima)}: the gap shrinks."


CHAPTER.undecidable(
    "drawings",
    "Fig. 1 to 13",
    "What the drawings themselves show",
    "Only their captions and the text about them remain; the computed figures stand for them, with "
    "parameter values of our own where the text has none.",
)
