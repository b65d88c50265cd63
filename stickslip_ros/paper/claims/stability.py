"""Section 2 from eq. 6 on: equilibrium and stability."""

from math import log

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.paper.claims.paper_values import (
    BELT_SPEEDS,
    DAMPING,
    FASTER,
    PRINTED_HOPF_SPEED,
    SLOWER,
    STATES,
    STUDIED_SPEED,
    TAKEN_DAMPING,
    TAKEN_FOR_DAMPING,
    cycles,
    expansion,
    formula_for_both,
    hopf_point,
    number_for_both,
    overdamped_from,
    printed_trace,
    rates,
    trace,
)
from stickslip_ros.paper.claims.verdict import Computations, Evidence, Formula, Number, Observation
from stickslip_ros.paper.figures import STRIBECK, unit_drive

computes = Computations()


def _third_order() -> float:
    """Return the coefficient of X2^3 in X2'."""
    return float(expansion(1.0).cubic[1, 1, 1, 1]) / 6.0


def _growth(damping: float = DAMPING) -> tuple[float, float]:
    """Return the coefficients c and e of the trace p = c - e v0^2, fitted to the Jacobian's."""
    traces = [trace(speed, damping) for speed in BELT_SPEEDS]
    slope, constant = np.polyfit(BELT_SPEEDS**2, traces, 1)
    return float(constant), float(-slope)


def _jacobians(damping: float) -> FloatArray:
    return np.array([expansion(speed, damping).jacobian for speed in BELT_SPEEDS])


computes["linear-coefficient"] = lambda _: Number(_growth(0.0)[0])
computes["cubic-coefficient"] = lambda _: Number(-_third_order())
computes["eq-6-speed"] = lambda _: Formula(
    0.0, [expansion(speed).equilibrium[1] for speed in BELT_SPEEDS]
)


@computes("eq-6-position")
def _(_: Evidence) -> Formula:
    positions = np.array([expansion(speed).equilibrium[0] for speed in BELT_SPEEDS])
    accelerations = [
        abs(float(rates(unit_drive(speed), np.array([[x], [0.0]]))[1, 0]))
        for speed, x in zip(BELT_SPEEDS.tolist(), positions, strict=True)
    ]
    return Formula(
        0.4 - 0.45 * BELT_SPEEDS + 0.6 * BELT_SPEEDS**3, positions, acceleration=max(accelerations)
    )


@computes("eq-6-friction")
def _(_: Evidence) -> Formula:
    speed, belt_speed = STATES[1], 1.2  # so high that no state overtakes the belt
    friction = STRIBECK.coefficient(speed - belt_speed, -1.0)
    at_rest = STRIBECK.at_rest(belt_speed)

    def printed(last: float) -> FloatArray:
        return -0.45 * speed + 0.6 * (speed**3 + 3.0 * speed * belt_speed**2 - last * speed**2)

    return Formula(
        printed(3.0),
        at_rest - friction,
        {"With the factor v0 in the last term": printed(3.0 * belt_speed)},
    )


computes["eq-6-first"] = lambda _: Formula(
    0.0, np.concatenate([expansion(0.4).quadratic[0].ravel(), expansion(0.4).cubic[0].ravel()])
)


@computes("first-approximation")
def _(_: Evidence) -> Observation:
    drive = unit_drive(0.45)
    motion = RecordedMotion(drive, expansion(0.45).equilibrium[0] - 1e-6, 0.0)
    motion.advance(20.0 * drive.natural_period)
    breakpoints = motion.take_breakpoints()
    turns = np.flatnonzero((breakpoints.velocity[:-1] == 0.0) & (breakpoints.velocity[1:] > 0.0))
    distance = expansion(0.45).equilibrium[0] - breakpoints.position[turns]
    growth = log(distance[-1] / distance[0]) / float(
        breakpoints.time[turns[-1]] - breakpoints.time[turns[0]]
    )
    expected = float(expansion(0.45).eigenvalues[0].real)
    return Observation(
        abs(growth / expected - 1.0) < 1e-3, growth=growth, expected=expected, cycles=len(turns) - 1
    )


@computes("eq-7")
def _(_: Evidence) -> Formula:
    jacobians = _jacobians(DAMPING)
    structure = jacobians.copy()
    structure[:, 0] = [0.0, 1.0]
    return Formula(
        np.zeros_like(jacobians),
        jacobians,
        {"Without the = 0, with first row (0, 1) as printed,": structure},
    )


@computes("eq-7-place")
def _(_: Evidence) -> Formula:
    drive, step = unit_drive(0.4), 1e-4

    def jacobian(position: float) -> FloatArray:
        ahead, behind = (
            rates(drive, np.array([[position, 0.0], [0.0, 0.0]]) + change * np.eye(2))
            for change in (step, -step)
        )
        return (ahead - behind) / (2.0 * step)

    return Formula(
        np.round(jacobian(0.0), 6), np.round(jacobian(float(expansion(0.4).equilibrium[0])), 6)
    )


computes["eq-8-constant"] = lambda _: number_for_both(lambda damping: _growth(damping)[0])
computes["eq-8-square"] = lambda _: Number(_growth()[1])


@computes("eq-8-matrix")
def _(_: Evidence) -> Formula:
    p, eigenvalue = trace(0.4), 0.3
    return Formula(
        [[eigenvalue, 1.0], [-1.0, eigenvalue - p]],
        eigenvalue * np.eye(2) - expansion(0.4).jacobian,
        {"With the signs of 1 and -1 exchanged": [[eigenvalue, -1.0], [1.0, eigenvalue - p]]},
    )


computes["eq-8-polynomial"] = lambda _: Formula(
    [[1.0, -trace(speed), 1.0] for speed in BELT_SPEEDS],
    [np.poly(expansion(speed).jacobian) for speed in BELT_SPEEDS],
)


@computes("hurwitz")
def _(_: Evidence) -> Observation:
    speed = hopf_point().belt_speed
    below, above = (bool(expansion(speed * factor).stable) for factor in (0.999, 1.001))
    p = trace(speed)
    return Observation(abs(p) < 1e-12 and above and not below, p=abs(p), speed=speed)


computes["vb1"] = lambda _: number_for_both(
    lambda damping: hopf_point(damping).belt_speed, hopf=hopf_point()
)


@computes("vb1-supercritical")
def _(_: Evidence) -> Observation:
    sigma = hopf_point().first_lyapunov_coefficient
    just_below = cycles(hopf_point().belt_speed - 2e-3)
    return Observation(
        sigma < 0.0
        and [cycle.stable for cycle in just_below] == [True]
        and not cycles(hopf_point().belt_speed + 2e-3),
        sigma=sigma,
        count=len(just_below),
        multiplier=abs(just_below[0].multipliers[0]),
    )


computes["eq-9-matrix"] = lambda _: formula_for_both(
    np.array([[[0.0, 1.0], [-1.0, p]] for p in printed_trace(BELT_SPEEDS)]), _jacobians
)
computes["eq-9-square"] = lambda _: Number(float(expansion(1.0).quadratic[1, 1, 1]) / 2.0)
computes["eq-9-cube"] = lambda _: Number(_third_order())


@computes("eq-9-jordan")
def _(_: Evidence) -> Observation:
    def defect(belt_speed: float) -> float:
        matrix = expansion(belt_speed).jacobian
        return float(abs(matrix[0, 0] - matrix[1, 1]) + abs(matrix[0, 1] + matrix[1, 0]))

    at_hopf, elsewhere = defect(hopf_point().belt_speed), defect(0.4)
    return Observation(
        max(at_hopf, elsewhere) < 1e-9, at_hopf < 1e-9, elsewhere=elsewhere, at_hopf=at_hopf
    )


@computes("eq-9-equilibrium")
def _(_: Evidence) -> Formula:
    position = 0.4 - 0.45 * BELT_SPEEDS + 0.6 * BELT_SPEEDS**3
    printed = np.array([np.zeros_like(position), position])
    return Formula(
        printed,
        np.array([expansion(speed).equilibrium for speed in BELT_SPEEDS]).T,
        {"With the two exchanged": printed[::-1]},
    )


computes["eq-10-real"] = lambda _: formula_for_both(
    printed_trace(BELT_SPEEDS) / 2.0,
    lambda damping: [expansion(v, damping).eigenvalues.real.mean() for v in BELT_SPEEDS],
    overdamped=overdamped_from(),
)


@computes("eq-10-imaginary")
def _(_: Evidence) -> Formula:
    speeds = [*BELT_SPEEDS.tolist(), *FASTER]
    radicands = np.array([trace(speed) ** 2 - 4.0 for speed in speeds])
    halves = np.array([np.ptp(expansion(speed).eigenvalues.real) for speed in speeds]) / 2.0
    frequencies = np.array([np.ptp(expansion(speed).eigenvalues.imag) for speed in speeds]) / 2.0
    return Formula(
        None if np.any(radicands < 0.0) else np.sqrt(radicands) / 2.0,
        halves + 1j * frequencies,
        {
            "With alpha +- i beta and beta = sqrt(4 - p^2) / 2 where p^2 < 4": np.emath.sqrt(
                radicands
            )
            / 2.0
        },
        overdamped=overdamped_from(),
        least=radicands.min(),
        fastest=max(speeds),
    )


@computes("eq-11-value")
def _(_: Evidence) -> Number:
    step, speed = 1e-5, PRINTED_HOPF_SPEED
    change = trace(speed + step, TAKEN_DAMPING) - trace(speed - step, TAKEN_DAMPING)
    doubled = change / (2.0 * step)
    return Number(
        hopf_point().crossing_speed,
        {
            TAKEN_FOR_DAMPING: hopf_point(TAKEN_DAMPING).crossing_speed,
            "With p' in place of p'/2, at v0 = 0.4944": doubled,
        },
        taken=hopf_point(TAKEN_DAMPING),
    )


computes["eq-11-sign"] = lambda _: Observation(hopf_point().crossing_speed < 0.0, hopf=hopf_point())


@computes("stable-below")
def _(_: Evidence) -> Observation:
    speeds = (*SLOWER, 0.2, 0.4, 0.45, 0.48)
    found = [cycles(speed) for speed in speeds]
    below = all(
        len(here) == 1 and here[0].stable and not expansion(speed).stable
        for speed, here in zip(speeds, found, strict=True)
    )
    return Observation(
        below and not expansion(STUDIED_SPEED).stable,
        below,
        outcome=f"one stable cycle at each of {len(speeds)} belt speeds"
        if below
        else "other cycles",
        cycles=len(cycles(STUDIED_SPEED)),
        multiplier=max(abs(here[0].multipliers[0]) for here in found),
    )


@computes("low-conditions", 0.45, 1.0)
@computes("high-conditions", 0.495, -1.0)
def _(_: Evidence, belt_speed: float, sign: float) -> Observation:
    matrix = expansion(belt_speed).jacobian
    p, q = float(np.trace(matrix)), float(np.linalg.det(matrix))
    discriminant = p**2 - 4.0 * q
    return Observation(p * sign > 0.0 and discriminant < 0.0, p=p, discriminant=discriminant, q=q)


@computes("low-focus")
def _(_: Evidence) -> Observation:
    upper = expansion(0.45).eigenvalues[0]
    return Observation(upper.real > 0.0 and upper.imag > 0.0, upper=upper)


@computes("low-cycle")
def _(evidence: Evidence) -> Observation:
    (portrait,) = [p for p in evidence.portraits(6).portraits if p.drive.belt_speed == 0.45]
    (cycle,) = cycles(0.45)
    run, shot = portrait.measures.amplitude or 0.0, cycle.measures.amplitude or 0.0
    return Observation(
        cycle.stable and abs(run - shot) < 1e-6,
        run=run,
        shot=shot,
        multiplier=abs(cycle.multipliers[0]),
    )


@computes("two-kinds")
def _(evidence: Evidence) -> Observation:
    measures = evidence.bifurcation(2).measures
    speeds = evidence.bifurcation(2).values
    kinds = {
        regime: [float(v) for v, m in zip(speeds, measures, strict=True) if m.regime is regime]
        for regime in (Regime.STICK_SLIP, Regime.PURE_SLIP)
    }
    others = {m.regime for m in measures} - {*kinds, Regime.EQUILIBRIUM, Regime.STUCK}
    return Observation(
        all(kinds.values()) and not others,
        outcome=", ".join(
            f"{regime} at {len(found)} belt speeds" for regime, found in kinds.items()
        ),
        fastest=max(kinds[Regime.STICK_SLIP], default=0.0),
    )


@computes("high-focus")
def _(_: Evidence) -> Observation:
    upper = expansion(0.495).eigenvalues[0]
    taken = expansion(0.495, TAKEN_DAMPING).eigenvalues[0]
    return Observation(
        upper.real < 0.0 < upper.imag,
        upper=upper,
        settling=log(100.0) / -upper.real,
        settling_taken=log(100.0) / -taken.real,
    )


@computes("high-rest")
def _(evidence: Evidence) -> Observation:
    (portrait,) = [p for p in evidence.portraits(6).portraits if p.drive.belt_speed == 0.495]
    midpoint, amplitude = portrait.measures.midpoint or 0.0, portrait.measures.amplitude or 0.0
    equilibrium = portrait.drive.equilibrium_position
    return Observation(
        amplitude < 1e-4 and abs(midpoint) < 1e-4,
        amplitude < 1e-4 and abs(midpoint - equilibrium) < 1e-4,
        midpoint=midpoint,
        equilibrium=equilibrium,
    )
