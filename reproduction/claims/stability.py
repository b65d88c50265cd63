"""Section 2 from eq. 6 on: equilibrium and stability."""

from math import log

import numpy as np

from reproduction.claims.paper_values import (
    BELT_SPEEDS,
    DAMPING,
    FASTER,
    OPEN,
    PRINTED_HOPF_SPEED,
    SLOWER,
    STATES,
    STUDIED_SPEED,
    TAKEN,
    TAKEN_DAMPING,
    TAKEN_FOR_DAMPING,
    at,
    formula_for_both,
    number_for_both,
    overdamped_from,
    printed_trace,
)
from reproduction.claims.verdict import Computations, Evidence, Formula, Number, Observation
from reproduction.figures import STRIBECK
from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.motion import RecordedMotion

computes = Computations()

_LOOPS = [at(speed) for speed in BELT_SPEEDS.tolist()]
"""The open loops at which formulas are evaluated."""

_PRINTED_POSITIONS = 0.4 - 0.45 * BELT_SPEEDS + 0.6 * BELT_SPEEDS**3
"""Displacements at the equilibrium as printed, eq. 6."""


def _third_order() -> float:
    """Return the coefficient of X2^3 in X2'."""
    return float(at(1.0).expansion.cubic[1, 1, 1, 1]) / 6.0


def _growth(damping: float = DAMPING) -> tuple[float, float]:
    """Return the coefficients c and e of the trace p = c - e v0^2, fitted to the Jacobian's."""
    traces = [at(speed, damping).trace for speed in BELT_SPEEDS]
    slope, constant = np.polyfit(BELT_SPEEDS**2, traces, 1)
    return float(constant), float(-slope)


def _jacobians(damping: float) -> FloatArray:
    return np.array([at(speed, damping).expansion.jacobian for speed in BELT_SPEEDS])


computes["linear-coefficient"] = lambda _: Number(_growth(0.0)[0])
computes["cubic-coefficient"] = lambda _: Number(-_third_order())
computes["eq-6-speed"] = lambda _: Formula(0.0, [loop.expansion.equilibrium[1] for loop in _LOOPS])


@computes("eq-6-position")
def _(_: Evidence) -> Formula:
    rates = [loop.rates(np.array([[loop.equilibrium], [0.0]])) for loop in _LOOPS]
    return Formula(
        _PRINTED_POSITIONS,
        [loop.equilibrium for loop in _LOOPS],
        acceleration=float(np.abs(rates)[:, 1].max()),
    )


@computes("eq-6-friction")
def _(_: Evidence) -> Formula:
    speed, belt_speed = STATES[1], 1.2  # so high that no state overtakes the belt
    friction = STRIBECK.coefficient(speed - belt_speed, -1.0)
    at_rest = STRIBECK.at_rest(belt_speed)

    def printed(last: float) -> FloatArray:
        return -0.45 * speed + 0.6 * (speed**3 + 3.0 * speed * belt_speed**2 - last * speed**2)

    corrections = {"With the factor v0 in the last term": printed(3.0 * belt_speed)}
    return Formula(printed(3.0), at_rest - friction, corrections)


computes["eq-6-first"] = lambda _: Formula(
    0.0, [*at(0.4).expansion.quadratic[0].ravel(), *at(0.4).expansion.cubic[0].ravel()]
)


@computes("first-approximation")
def _(_: Evidence) -> Observation:
    loop = at(0.45)
    motion = RecordedMotion(loop.drive, loop.equilibrium - 1e-6, 0.0)
    motion.advance(20.0 * loop.drive.natural_period)
    breakpoints = motion.take_breakpoints()
    turns = np.flatnonzero((breakpoints.velocity[:-1] == 0.0) & (breakpoints.velocity[1:] > 0.0))
    first, last = turns[[0, -1]]
    distance, time = loop.equilibrium - breakpoints.position, breakpoints.time
    growth = log(distance[last] / distance[first]) / float(time[last] - time[first])
    expected = loop.eigenvalues[0].real
    return Observation(
        abs(growth / expected - 1.0) < 1e-3, growth=growth, expected=expected, cycles=len(turns) - 1
    )


@computes("eq-7")
def _(_: Evidence) -> Formula:
    jacobians = _jacobians(DAMPING)
    structure = jacobians.copy()
    structure[:, 0] = [0.0, 1.0]
    corrections = {"Without the = 0, with first row (0, 1) as printed,": structure}
    return Formula(np.zeros_like(jacobians), jacobians, corrections)


@computes("eq-7-place")
def _(_: Evidence) -> Formula:
    loop, step = at(0.4), 1e-4

    def jacobian(position: float) -> FloatArray:
        ahead, behind = (
            loop.rates(np.array([[position, 0.0], [0.0, 0.0]]) + change * np.eye(2))
            for change in (step, -step)
        )
        return np.round((ahead - behind) / (2.0 * step), 6)

    return Formula(jacobian(0.0), jacobian(loop.equilibrium))


computes["eq-8-constant"] = lambda _: number_for_both(lambda damping: _growth(damping)[0])
computes["eq-8-square"] = lambda _: Number(_growth()[1])


@computes("eq-8-matrix")
def _(_: Evidence) -> Formula:
    p, eigenvalue = at(0.4).trace, 0.3
    return Formula(
        [[eigenvalue, 1.0], [-1.0, eigenvalue - p]],
        eigenvalue * np.eye(2) - at(0.4).expansion.jacobian,
        {"With the signs of 1 and -1 exchanged": [[eigenvalue, -1.0], [1.0, eigenvalue - p]]},
    )


computes["eq-8-polynomial"] = lambda _: Formula(
    [[1.0, -loop.trace, 1.0] for loop in _LOOPS],
    [np.poly(loop.expansion.jacobian) for loop in _LOOPS],
)


@computes("hurwitz")
def _(_: Evidence) -> Observation:
    speed = OPEN.hopf.belt_speed
    p = abs(at(speed).trace)
    return Observation(p < 1e-12 and at(speed * 1.001).stable and not at(speed * 0.999).stable, p=p)


computes["vb1"] = lambda _: number_for_both(lambda damping: at(1.0, damping).hopf.belt_speed)


@computes("vb1-supercritical")
def _(_: Evidence) -> Observation:
    below, above = (at(OPEN.hopf.belt_speed + off) for off in (-2e-3, 2e-3))
    ends = [cycle.stable for cycle in below.cycles] == [True] and not above.cycles
    return Observation(OPEN.hopf.supercritical and ends, below=below, count=len(below.cycles))


computes["eq-9-matrix"] = lambda _: formula_for_both(
    np.array([[[0.0, 1.0], [-1.0, p]] for p in printed_trace(BELT_SPEEDS)]), _jacobians
)
computes["eq-9-square"] = lambda _: Number(float(at(1.0).expansion.quadratic[1, 1, 1]) / 2.0)
computes["eq-9-cube"] = lambda _: Number(_third_order())


@computes("eq-9-jordan")
def _(_: Evidence) -> Observation:
    def defect(belt_speed: float) -> float:
        matrix = at(belt_speed).expansion.jacobian
        return float(abs(matrix[0, 0] - matrix[1, 1]) + abs(matrix[0, 1] + matrix[1, 0]))

    at_hopf, elsewhere = defect(OPEN.hopf.belt_speed), defect(0.4)
    return Observation(
        max(at_hopf, elsewhere) < 1e-9, at_hopf < 1e-9, elsewhere=elsewhere, at_hopf=at_hopf
    )


@computes("eq-9-equilibrium")
def _(_: Evidence) -> Formula:
    printed = np.array([np.zeros_like(_PRINTED_POSITIONS), _PRINTED_POSITIONS])
    true = np.array([loop.expansion.equilibrium for loop in _LOOPS]).T
    return Formula(printed, true, {"With the two exchanged": printed[::-1]})


computes["eq-10-real"] = lambda _: formula_for_both(
    printed_trace(BELT_SPEEDS) / 2.0,
    lambda damping: [at(v, damping).eigenvalues.real.mean() for v in BELT_SPEEDS],
    overdamped=overdamped_from(),
)


@computes("eq-10-imaginary")
def _(_: Evidence) -> Formula:
    loops = [*_LOOPS, *map(at, FASTER)]
    radicands = np.array([loop.trace**2 - 4.0 for loop in loops])
    values = np.array([loop.eigenvalues for loop in loops])
    roots = np.emath.sqrt(radicands) / 2.0
    return Formula(
        None if np.any(radicands < 0.0) else roots,
        (np.ptp(values.real, axis=1) + 1j * np.ptp(values.imag, axis=1)) / 2.0,
        {"With alpha +- i beta and beta = sqrt(4 - p^2) / 2 where p^2 < 4": roots},
        overdamped=overdamped_from(),
        least=radicands.min(),
        fastest=max(loop.drive.belt_speed for loop in loops),
    )


@computes("eq-11-value")
def _(_: Evidence) -> Number:
    step, speed = 1e-5, PRINTED_HOPF_SPEED
    ahead, behind = (at(speed + off, TAKEN_DAMPING).trace for off in (step, -step))
    corrections = {
        TAKEN_FOR_DAMPING: TAKEN.hopf.crossing_speed,
        "With p' in place of p'/2, at v0 = 0.4944": (ahead - behind) / (2.0 * step),
    }
    return Number(OPEN.hopf.crossing_speed, corrections)


computes["eq-11-sign"] = lambda _: Observation(OPEN.hopf.crossing_speed < 0.0)


@computes("stable-below")
def _(_: Evidence) -> Observation:
    loops = [at(speed) for speed in (*SLOWER, 0.2, 0.4, 0.45, 0.48)]
    below = all(
        len(loop.cycles) == 1 and loop.cycles[0].stable and not loop.stable for loop in loops
    )
    outcome = f"one stable cycle at each of {len(loops)} belt speeds" if below else "other cycles"
    return Observation(
        below and not at(STUDIED_SPEED).stable,
        below,
        outcome=outcome,
        cycles=len(at(STUDIED_SPEED).cycles),
        multiplier=max(loop.multipliers[0] for loop in loops),
    )


@computes("low-conditions", 0.45, 1.0)
@computes("high-conditions", 0.495, -1.0)
def _(_: Evidence, belt_speed: float, sign: float) -> Observation:
    p, q = at(belt_speed).trace, float(np.linalg.det(at(belt_speed).expansion.jacobian))
    discriminant = p**2 - 4.0 * q
    return Observation(p * sign > 0.0 and discriminant < 0.0, p=p, discriminant=discriminant, q=q)


@computes("low-focus")
def _(_: Evidence) -> Observation:
    upper = at(0.45).eigenvalues[0]
    return Observation(upper.real > 0.0 and upper.imag > 0.0, upper=upper)


@computes("low-cycle")
def _(evidence: Evidence) -> Observation:
    (portrait,) = evidence.portraits(6).portraits.between(0.44, 0.46)
    (cycle,), (shot,) = at(0.45).cycles, at(0.45).amplitudes
    same = abs(portrait.amplitude - shot) < 1e-6
    return Observation(cycle.stable and same, run=portrait.amplitude, loop=at(0.45))


@computes("two-kinds")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(2)
    regimes = figure.columns.regime
    kinds = (Regime.STICK_SLIP, Regime.PURE_SLIP)
    counts = [int(np.sum(regimes == kind)) for kind in kinds]
    others = {*regimes} - {*kinds, Regime.EQUILIBRIUM, Regime.STUCK}
    outcome = ", ".join(f"{kind} at {n} belt speeds" for kind, n in zip(kinds, counts, strict=True))
    fastest = figure.values[regimes == Regime.STICK_SLIP].max(initial=0.0)
    return Observation(all(counts) and not others, outcome=outcome, fastest=fastest)


@computes("high-focus")
def _(_: Evidence) -> Observation:
    upper, taken = (at(0.495, damping).eigenvalues[0] for damping in (DAMPING, TAKEN_DAMPING))
    settling, settling_taken = (log(100.0) / -each.real for each in (upper, taken))
    return Observation(
        upper.real < 0.0 < upper.imag, upper=upper, settling=settling, settling_taken=settling_taken
    )


@computes("high-rest")
def _(evidence: Evidence) -> Observation:
    (portrait,) = evidence.portraits(6).portraits.between(0.49, 0.5)
    midpoint, swing = portrait.measures.midpoint or 0.0, portrait.measures.amplitude or 0.0
    equilibrium = portrait.drive.equilibrium_position
    return Observation(
        swing < 1e-4 and abs(midpoint) < 1e-4,
        swing < 1e-4 and abs(midpoint - equilibrium) < 1e-4,
        midpoint=midpoint,
        equilibrium=equilibrium,
    )
