"""Section 4: the washout filter, eq. 16 to 30, Fig. 12 and 13."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from math import log

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.paper.claims.claim import (
    Chapter,
    Correction,
    Evidence,
    Formula,
    Number,
    Observation,
)
from stickslip_ros.paper.claims.normal_form import Nonlinearity, samples
from stickslip_ros.paper.claims.reference import (
    BELT_SPEEDS,
    DAMPING,
    FASTER,
    FILTER,
    SLOWER,
    STATES,
    STUDIED_SPEED,
    TAKEN_DAMPING,
    TAKEN_FOR_DAMPING,
    amplitudes,
    cycles,
    expansion,
    hopf_point,
    rates,
    trace,
)
from stickslip_ros.paper.claims.simulations import (
    VIBRATING,
    amplitude,
    border,
    falling,
    listed,
)
from stickslip_ros.paper.claims.stability import (
    g11_formula,
    g20_formula,
    printed_trace,
)
from stickslip_ros.paper.figures import unit_drive
from stickslip_ros.physics.measures.cycles import Regime
from stickslip_ros.physics.model.equations import WashoutGains
from stickslip_ros.physics.motion.motion import Motion
from stickslip_ros.physics.theory.closed_loop import CriticalGains, critical_gains
from stickslip_ros.physics.theory.hopf import crossing_speed, hopf_points
from stickslip_ros.physics.theory.limit_cycles import limit_cycle_of_run
from stickslip_ros.physics.theory.linear import hurwitz_determinants
from stickslip_ros.physics.theory.roots import zero_between

CHAPTER = Chapter("Section 4: bifurcation control")

_PRINTED_GAIN, _PRINTED_TRACE = -0.0395, 0.0078
_SOME_GAINS = replace(FILTER, linear=-0.3, cubic=-2.0)
_STARTS = ((3.0, 0.0), (-3.0, 0.0), (0.0, 3.0), (0.0, -3.0))
_FIG_12_SPEEDS = (0.48, 0.49, 0.492)


@cache
def critical(belt_speed: float, damping: float, corner_frequency: float = 2.0) -> CriticalGains:
    """Return the critical gains of the loop without a cubic gain."""
    gains = replace(FILTER, corner_frequency=corner_frequency)
    found = critical_gains(unit_drive(belt_speed, damping=damping), gains)
    assert found is not None
    return found


def _at_critical_gain(damping: float, cubic: float = 0.0) -> Nonlinearity:
    """Return the nonlinearity at the belt speed and the critical gain of section 4.1."""
    gains = replace(FILTER, linear=critical(STUDIED_SPEED, damping).linear, cubic=cubic)
    return Nonlinearity.at(expansion(STUDIED_SPEED, damping, gains))


def _number(value: complex) -> str:
    return f"{value.real:.4f} {'-' if value.imag < 0.0 else '+'} {abs(value.imag):.4f} i"


@CHAPTER.number(
    "fig-12-place", "section 4.1, Fig. 12", "The amplitude changes much near v0 =", 0.49
)
def _(_: Evidence) -> Number:
    speed = hopf_point().belt_speed
    return Number(
        speed,
        remark="The Hopf speed for beta = 0.01 in eq. 5: what is seen there is the supercritical "
        f"Hopf point itself, which eq. 8 has put at {hopf_point(TAKEN_DAMPING).belt_speed:.4f}.",
    )


@CHAPTER.statement(
    "fig-12-sudden", "section 4.1, Fig. 12", "From v0 = 0.49 on the amplitude is suddenly smaller"
)
def _(_: Evidence) -> Observation:
    return _square_root_law()


def _square_root_law() -> Observation:
    """Observe whether the amplitude jumps below the Hopf point."""
    speed = hopf_point().belt_speed
    distances = (4e-2, 4e-3, 4e-4, 4e-5)
    sizes = [amplitudes(speed - distance)[0] for distance in distances]
    exponent = log(sizes[-2] / sizes[-1]) / log(distances[-2] / distances[-1])
    squares = [size**2 / distance for size, distance in zip(sizes, distances, strict=True)]
    here, taken = (
        [(amplitudes(v, damping) or [0.0])[0] for v in _FIG_12_SPEEDS]
        for damping in (DAMPING, TAKEN_DAMPING)
    )
    return Observation(
        f"{listed(here)}",
        exponent < 0.1,
        remark=f"Amplitudes of the limit cycles at v0 = {listed(_FIG_12_SPEEDS)}; with the damping "
        f"of eq. 8 {listed(taken)}. They go to zero without a jump: amplitude squared over the "
        f"distance to v_b1 is {listed(squares)} at distances {listed(distances)}, and at the "
        f"last the amplitude goes with power {exponent:.3f} of it. A root is steep there.",
    )


@CHAPTER.statement(
    "fig-12-unstable", "section 4.1, Fig. 12", "At v0 = 0.49 and above the equilibrium is unstable"
)
def _(evidence: Evidence) -> Observation:
    speeds = _FIG_12_SPEEDS[1:]
    here, taken = (
        [not expansion(speed, damping).stable for speed in speeds]
        for damping in (DAMPING, TAKEN_DAMPING)
    )
    portraits = [
        p for p in evidence.portraits(12).portraits
        if p.drive.belt_speed == STUDIED_SPEED and p.drive.damping == DAMPING
    ]  # fmt: skip
    left = [p.measures.amplitude or 0.0 for p in portraits]
    ends = [float(p.trajectory.time[-1]) for p in portraits]
    return Observation(
        f"p = {listed([trace(speed) for speed in speeds])}",
        all(here),
        all(taken),
        f"{TAKEN_FOR_DAMPING} p = {listed([trace(v, TAKEN_DAMPING) for v in speeds])}, up to v0 = "
        f"{hopf_point(TAKEN_DAMPING).belt_speed:.4f}. With that "
        f"of eq. 5 the motion at 0.49 dies out slowly: amplitude {listed(left)} "
        f"after {listed(ends)}.",
    )


@CHAPTER.statement(
    "fig-12-exchange",
    "section 4.1, Fig. 12",
    "As the belt slows down, the cycle becomes unstable and the equilibrium stable",
)
def _(_: Evidence) -> Observation:
    falling_speeds = (*sorted(_FIG_12_SPEEDS, reverse=True), 0.4, 0.1, 0.02)
    found = [cycles(speed, TAKEN_DAMPING) for speed in falling_speeds]
    resting = [expansion(speed, TAKEN_DAMPING).stable for speed in falling_speeds]
    multipliers = [abs(cycle.multipliers[0]) for here in found for cycle in here]
    above = expansion(hopf_point(TAKEN_DAMPING).belt_speed + 1e-3, TAKEN_DAMPING).stable
    return Observation(
        f"multipliers {listed(multipliers)}",
        multipliers[-1] > 1.0 and resting[-1],
        remark=f"At v0 = {listed(falling_speeds)} with the damping of eq. 8: the cycle is stable "
        f"and becomes more so; {resting.count(False)} of the equilibria are unstable, while "
        f"above v_b1 it is {'stable' if above else 'unstable'}.",
    )


@CHAPTER.statement(
    "fig-12-subcritical", "section 4.1, Fig. 12", "At v0 = 0.49 there is a subcritical bifurcation"
)
def _(_: Evidence) -> Observation:
    return _subcritical()


def _subcritical() -> Observation:
    """Observe whether unstable cycles surround a stable equilibrium anywhere near."""
    sigmas = [hopf_point(d).first_lyapunov_coefficient for d in (DAMPING, TAKEN_DAMPING)]
    speeds = (*SLOWER, 0.2, 0.4, 0.48, 0.488, STUDIED_SPEED, 0.492, 0.5, *FASTER)
    found = [cycle for speed in speeds for cycle in cycles(speed)]
    unstable = [cycle for cycle in found if not cycle.stable]
    return Observation(
        f"sigma = {listed(sigmas)}",
        max(sigmas) > 0.0 or bool(unstable),
        remark="For both dampings: supercritical, as section 2 finds too. Among the "
        f"{len(found)} limit cycles at v0 = {listed(speeds)} {len(unstable)} are unstable.",
    )


@CHAPTER.statement("eq-16-linear", "eq. 16", "The friction in it is linear")
def _(_: Evidence) -> Observation:
    found = expansion(STUDIED_SPEED)
    square, cube = found.quadratic[1, 1, 1] / 2.0, found.cubic[1, 1, 1, 1] / 6.0
    return Observation(
        f"{square:.4g} y^2, {cube:.4g} y^3",
        max(abs(square), abs(cube)) < 1e-9,
        remark=f"The square and the cube of the Stribeck law are in F, at v0 = {STUDIED_SPEED:g}; "
        "with a linear law there would be no limit cycle to speak of.",
    )


def _slow_states() -> FloatArray:
    """Return deviations from the equilibrium in which the slide is slower than the belt, up to ten.

    Near it too: half of them are of the size of one.
    """
    states = STATES * np.where(np.arange(STATES.shape[1]) % 2, 10.0, 1.0)
    states[1] = STUDIED_SPEED - np.abs(states[1])
    return states


def _friction(speed: FloatArray, last: float) -> FloatArray:
    """Return F of eq. 6 and 16 at the belt speed of section 4.1, with a factor in the last term."""
    cubes = speed**3 + 3.0 * speed * STUDIED_SPEED**2 - last * speed**2
    return -0.45 * speed + 0.6 * cubes


def _loop_rates(gains: WashoutGains | None) -> FloatArray:
    states = _slow_states()
    states[0] += expansion(STUDIED_SPEED).equilibrium[0]
    return rates(unit_drive(STUDIED_SPEED), states if gains else states[:2], gains)


@CHAPTER.formula("eq-16", "eq. 16", "The system about its equilibrium", "y' = -F - C y - K x")
def _() -> Formula:
    x, y, _w = _slow_states()
    printed, corrected = (
        -_friction(y, last) - DAMPING * y - x for last in (3.0, 3.0 * STUDIED_SPEED)
    )
    return Formula(
        printed,
        _loop_rates(None)[1],
        [Correction("With the factor v0 in the last term of F", corrected)],
        "C and K, which are not defined, are 2 beta and 1. F as in eq. 6: while the slide is "
        "slower than the belt.",
    )


@CHAPTER.formula("eq-17", "eq. 17", "The washout filter", "w' = y - d w")
def _() -> Formula:
    _x, y, w = _slow_states()
    moved = expansion(STUDIED_SPEED, gains=_SOME_GAINS).equilibrium[0]
    moved -= expansion(STUDIED_SPEED).equilibrium[0]
    return Formula(
        y - _SOME_GAINS.corner_frequency * w,
        _loop_rates(_SOME_GAINS)[2],
        remark=f"It moves the equilibrium by {abs(moved):.6f}.",
    )


@CHAPTER.formula("eq-18", "eq. 18", "The control force", "u = k1 v + k2 v^3")
def _() -> Formula:
    _x, y, w = _slow_states()
    v = y - _SOME_GAINS.corner_frequency * w
    return Formula(
        None,
        _loop_rates(_SOME_GAINS)[1] - _loop_rates(None)[1],
        [
            Correction(
                "With v, which is not defined, read as y - d w as in eq. 19",
                _SOME_GAINS.linear * v + _SOME_GAINS.cubic * v**3,
            )
        ],
    )


@CHAPTER.statement("eq-18-linear", "eq. 18", "The linear gain governs where the Hopf point is")
def _(_: Evidence) -> Observation:
    gains = (0.0, -0.1, -0.3)

    def speeds(cubic: float) -> list[float]:
        loops = [replace(FILTER, linear=linear, cubic=cubic) for linear in gains]
        return [hopf_points(unit_drive(0.4), loop)[-1].belt_speed for loop in loops]

    without, with_cubic = speeds(0.0), speeds(-5.0)
    return Observation(
        f"v_b1 = {listed(without)}",
        falling(without) and bool(np.allclose(without, with_cubic, rtol=1e-12)),
        remark=f"For k1 = {listed(gains)} with d = 2, whatever k2.",
    )


@CHAPTER.statement("eq-18-cubic", "eq. 18", "The cubic gain governs the amplitude")
def _(evidence: Evidence) -> Observation:
    linear, cubic, _ = evidence.portraits(13).panels
    portraits = [linear.portraits[0], *cubic.portraits]
    sizes = [amplitude(portrait) for portrait in portraits]
    gains = [portrait.case.gains.cubic for portrait in portraits if portrait.case.gains]
    strong = (0.0, -100.0, -1000.0)
    loops = ((0.4, 2.0), (0.4, 0.2), (0.4, 20.0), (0.45, 2.0), (0.2, 2.0))
    left = {
        (v, d): [controlled_amplitude(v, replace(FILTER, corner_frequency=d, cubic=k2))
        for k2 in strong] for v, d in loops
    }  # fmt: skip
    shares = (
        f"{listed([size / found[0] for size in found[1:]])} at v0 = {v:g}, d = {d:g}"
        for (v, d), found in left.items()
    )
    return Observation(
        listed(sizes),
        falling(sizes) and all(map(falling, left.values())),
        falling(sizes) and falling(left[0.4, 2.0]),
        "Only where the filter passes the vibration and sticking does not hold its size. At "
        f"v0 = 0.4, d = 2, k1 = 0, k2 = {listed(gains)}: it takes k2 = {gains[-1]:g} to "
        f"lower the amplitude by {1.0 - sizes[-1] / sizes[0]:.0%}. What k2 = {listed(strong[1:])} "
        f"leave of it: {'; '.join(shares)}.",
    )


def controlled_amplitude(belt_speed: float, gains: WashoutGains) -> float:
    """Return the amplitude of the limit cycle that the motion from rest at X = 0 leads to."""
    cycle = limit_cycle_of_run(unit_drive(belt_speed), 0.0, gains=gains)
    return 0.0 if cycle is None else cycle.measures.amplitude or 0.0


@CHAPTER.formula(
    "eq-19",
    "eq. 19",
    "The closed loop",
    "y' = -F - C y - K x + k1 (y - d w) + k2 (y - d w)^3, w' = y - d w",
)
def _() -> Formula:
    x, y, w = _slow_states()
    v = y - _SOME_GAINS.corner_frequency * w
    force = _SOME_GAINS.linear * v + _SOME_GAINS.cubic * v**3
    friction = _friction(y, 3.0 * STUDIED_SPEED)
    return Formula(
        [y, -friction - DAMPING * y - x + force, v],
        _loop_rates(_SOME_GAINS),
        remark="With F corrected as in eq. 16, while the slide is slower than the belt. Eq. 18 "
        "goes into eq. 17, not the reverse.",
    )


def _printed_jacobian(p: float, linear: float) -> FloatArray:
    return np.array([[0.0, 1.0, 0.0], [-1.0, p + linear, -2.0 * linear], [0.0, 1.0, -2.0]])


@CHAPTER.formula(
    "eq-20",
    "eq. 20",
    "The Jacobian of the closed loop, with d = 2 and p for 0.0078",
    "[[0, 1, 0], [-1, p + k1, -2 k1], [0, 1, -2]]",
)
def _() -> Formula:
    linear = _SOME_GAINS.linear
    return Formula(
        _printed_jacobian(trace(STUDIED_SPEED), linear),
        expansion(STUDIED_SPEED, gains=_SOME_GAINS).jacobian,
        remark="That d = 2 is to be read from it; the text does not say so.",
    )


@CHAPTER.number("eq-20-trace", "eq. 20", "p at v0 = 0.49, beta = 0.01", _PRINTED_TRACE)
def _(_: Evidence) -> Number:
    return Number(
        trace(STUDIED_SPEED),
        [Correction(TAKEN_FOR_DAMPING, trace(STUDIED_SPEED, TAKEN_DAMPING))],
        "With the damping of eq. 5 there is nothing to control at v0 = 0.49: p is below zero.",
    )


def _coefficient(order: int, printed: Callable[[FloatArray, float], FloatArray]) -> Formula:
    """Compare a coefficient of eq. 21, over belt speeds, with that of the loop's Jacobian."""
    linear = _SOME_GAINS.linear
    here, taken = (
        [
            np.poly(expansion(speed, damping, _SOME_GAINS).jacobian)[order]
            for speed in BELT_SPEEDS.tolist()
        ]
        for damping in (DAMPING, TAKEN_DAMPING)
    )
    values = printed(printed_trace(BELT_SPEEDS), linear)
    return Formula(values - here, 0.0, [Correction(TAKEN_FOR_DAMPING, values - taken)])


@CHAPTER.formula("eq-21-c1", "eq. 21", "c1", "c1 = 2 - (0.44 - 1.8 v0^2 + k1)")
def _() -> Formula:
    return _coefficient(1, lambda p, k1: 2.0 - (p + k1))


@CHAPTER.formula("eq-21-c2", "eq. 21", "c2", "c2 = 2 k1 - (0.44 - 1.8 v0^2 + 1)")
def _() -> Formula:
    p = trace(STUDIED_SPEED, TAKEN_DAMPING)
    # c1 c2 - c3 = 0 with c1 = 2 - p - k1, c2 = 2 k1 - p - 1, c3 = 2, a square in k1
    discriminant = (5.0 - p) ** 2 - 8.0 * (2.0 + (2.0 - p) * (p + 1.0))
    true = np.poly(_printed_jacobian(p, _SOME_GAINS.linear))[2]
    return replace(
        _coefficient(2, lambda p, k1: 2.0 * k1 - (p + 1.0)),
        remark=f"The matrix of eq. 20 has c2 = 1 - 2 p = {true:.4f} at v0 = {STUDIED_SPEED:g}, "
        "without k1. With the printed c2 the condition c1 c2 = c3 has "
        f"{'no' if discriminant < 0.0 else 'a'} real root (discriminant {discriminant:.3g}).",
    )


@CHAPTER.formula("eq-21-c3", "eq. 21", "c3", "c3 = 2")
def _() -> Formula:
    return _coefficient(3, lambda p, _: np.full_like(p, 2.0))


@CHAPTER.statement("eq-21-condition", "eq. 21", "The Hopf condition is c1 c2 = c3")
def _(_: Evidence) -> Observation:
    gain = critical(STUDIED_SPEED, TAKEN_DAMPING).linear
    c1, c2, c3 = np.poly(_printed_jacobian(trace(STUDIED_SPEED, TAKEN_DAMPING), gain))[1:]
    found = expansion(STUDIED_SPEED, TAKEN_DAMPING, replace(FILTER, linear=gain)).eigenvalues
    return Observation(
        f"c1 c2 - c3 = {abs(c1 * c2 - c3):.6f}",
        abs(c1 * c2 - c3) < 1e-9 and abs(found[0].real) < 1e-9,
        remark=f"With the coefficients of eq. 20 at the critical gain {gain:.6f}; the pair there "
        f"has real part {abs(found[0].real):.6f} and the frequency {found[0].imag:.5f}.",
    )


@CHAPTER.number("eq-21-gain", "eq. 21", "The critical linear gain k1, beta = 0.01", _PRINTED_GAIN)
def _(_: Evidence) -> Number:
    rounded = zero_between(
        lambda k1: float(hurwitz_determinants(_printed_jacobian(_PRINTED_TRACE, k1))[-1]), -0.5, 0.5
    )
    exact = critical(STUDIED_SPEED, TAKEN_DAMPING).linear
    return Number(
        critical(STUDIED_SPEED, DAMPING).linear,
        [
            Correction(TAKEN_FOR_DAMPING, exact),
            Correction(f"{TAKEN_FOR_DAMPING}, and p rounded to {_PRINTED_TRACE:g}", rounded),
        ],
        f"Without that rounding it is {exact:.6f}. The printed c2 did not lead there.",
    )


@CHAPTER.statement("eq-22-roots", "eq. 22", "The loop has a complex pair and a real eigenvalue")
def _(_: Evidence) -> Observation:
    gains = replace(FILTER, linear=_PRINTED_GAIN)
    pair, _conjugate, real = expansion(STUDIED_SPEED, TAKEN_DAMPING, gains).eigenvalues
    return Observation(
        f"{_number(pair)} and its conjugate, {real.real:.4f}",
        pair.imag > 0.0 and real.imag == 0.0,
        remark="With the damping of eq. 8 and k1 = -0.0395.",
    )


@CHAPTER.formula("eq-22-alpha", "eq. 22", "Real part of the pair", "alpha = -(1.5995 + 1.8 v0^2)")
def _() -> Formula:
    gains = replace(FILTER, linear=_PRINTED_GAIN)
    found = [expansion(speed, TAKEN_DAMPING, gains).eigenvalues for speed in BELT_SPEEDS.tolist()]
    printed = -(1.5995 + 1.8 * BELT_SPEEDS**2)
    off = np.abs(printed - [values.sum().real for values in found]).max()
    at_studied = expansion(STUDIED_SPEED, TAKEN_DAMPING, gains).eigenvalues[0].real
    return Formula(
        printed,
        [values[0].real for values in found],
        remark="It deviates from the sum of all three eigenvalues, the trace of eq. 20, by "
        f"{off:.6f}. The pair's real part at v0 = {STUDIED_SPEED:g} is {at_studied:.6f}, as it "
        "must be near zero for a Hopf point.",
    )


@CHAPTER.number("eq-22-value", "eq. 22", "Crossing speed of the pair at v0 = 0.49", -1.764)
def _(_: Evidence) -> Number:
    here, taken = (_crossing(damping) for damping in (DAMPING, TAKEN_DAMPING))
    return Number(
        here,
        [Correction(TAKEN_FOR_DAMPING, taken)],
        "At the critical gain, by projection onto the eigenvectors; printed is the derivative of "
        f"the trace of eq. 20. With the damping of eq. 8 it is {taken:.5f}.",
    )


def _crossing(damping: float) -> float:
    gains = replace(FILTER, linear=critical(STUDIED_SPEED, damping).linear)
    found = crossing_speed(expansion(STUDIED_SPEED, damping, gains))
    assert found is not None
    return found


@CHAPTER.number("eq-22-product", "eq. 22", "-3.6 times 0.49", -1.764)
def _(_: Evidence) -> Number:
    return Number(-3.6 * STUDIED_SPEED, remark="Only the multiplication.")


@CHAPTER.statement("eq-22-sign", "eq. 22", "The crossing speed is negative")
def _(_: Evidence) -> Observation:
    found = [_crossing(damping) for damping in (DAMPING, TAKEN_DAMPING)]
    return Observation(listed(found), max(found) < 0.0, remark="For both dampings.")


@CHAPTER.formula(
    "eq-23-formula",
    "eq. 23",
    "g20 from the derivatives of Q",
    "g20 = (Q1_11 - Q1_22 + 2 Q1_12 + i (Q2_11 - Q2_22 - 2 Q1_12)) / 4",
)
def _() -> Formula:
    return g20_formula()


def _quadratic_size(coefficient: Callable[[Nonlinearity], complex]) -> Number:
    """Return four times the size of g20 or g11 in the closed loop."""
    here, taken = (coefficient(_at_critical_gain(damping)) for damping in (DAMPING, TAKEN_DAMPING))
    return Number(
        4.0 * abs(here),
        [Correction(TAKEN_FOR_DAMPING, 4.0 * abs(taken))],
        f"{_number(4.0 * taken)} with the damping of eq. 8: printed is that of the loop without "
        "filter, with -+ i. The formula asks for coordinates in which the linear part has Jordan "
        "form; there the filter takes part.",
    )


@CHAPTER.number("eq-23-value", "eq. 23", "g20 at v0 = 0.49: four times its size", 1.764)
def _(_: Evidence) -> Number:
    return _quadratic_size(lambda q: q.g20)


@CHAPTER.formula(
    "eq-24-formula",
    "eq. 24",
    "g11 from the derivatives of Q",
    "g11 = (Q1_11 + Q1_22 + i (Q2_11 + Q2_22)) / 4",
)
def _() -> Formula:
    return g11_formula()


@CHAPTER.number("eq-24-value", "eq. 24", "g11 at v0 = 0.49: four times its size", 1.764)
def _(_: Evidence) -> Number:
    return _quadratic_size(lambda q: q.g11)


def _mixed(sign: float, plane: int) -> list[complex]:
    """Return G110 (sign +1) or G101 (-1) of the samples, Q2 derived by y1 or y2, and Q1 too."""
    return [
        (q.by(1, 1, 3) + sign * q.by(2, plane, 3) + 1j * (q.by(2, 1, 3) - sign * q.by(1, plane, 3)))
        / 2.0
        for q in samples(3)
    ]


@CHAPTER.formula(
    "eq-25-formula",
    "eq. 25",
    "G110 from the derivatives of Q",
    "G110 = (Q1_13 + Q2_13 + i (Q2_13 - Q1_13)) / 2",
)
def _() -> Formula:
    return Formula(
        _mixed(1.0, 1),
        [q.g110 for q in samples(3)],
        [Correction("With Q2_23 in the real and Q1_23 in the imaginary part", _mixed(1.0, 2))],
        "Tried on arbitrary nonlinearities.",
    )


@CHAPTER.formula(
    "eq-26-formula",
    "eq. 26",
    "G101 from the derivatives of Q",
    "G101 = (Q1_13 - Q2_13 + i (Q2_13 + Q1_13)) / 2",
)
def _() -> Formula:
    return Formula(
        _mixed(-1.0, 1),
        [q.g101 for q in samples(3)],
        [Correction("With Q2_23 in the real and Q1_23 in the imaginary part", _mixed(-1.0, 2))],
        "Tried on arbitrary nonlinearities.",
    )


def _vanishes(coefficient: Callable[[Nonlinearity], complex]) -> Observation:
    here, taken = (coefficient(_at_critical_gain(damping)) for damping in (DAMPING, TAKEN_DAMPING))
    return Observation(
        _number(taken),
        max(abs(here), abs(taken)) < 1e-9,
        remark="In Jordan coordinates, y3 scaled to the slide's speed, with the damping of eq. 8; "
        f"{_number(here)} with that of eq. 5. The quadratic friction acts on all three "
        "coordinates: each of them moves the slide.",
    )


@CHAPTER.statement("eq-25-value", "eq. 25", "G110 is zero")
def _(_: Evidence) -> Observation:
    return _vanishes(lambda q: q.g110)


@CHAPTER.statement("eq-26-value", "eq. 26", "G101 is zero")
def _(_: Evidence) -> Observation:
    return _vanishes(lambda q: q.g101)


@CHAPTER.formula(
    "eq-27-formula",
    "eq. 27",
    "w20 from the derivatives of Q3",
    "w20 = (Q3_11 - Q3_22 - 2 i Q3_13) / (4 (2 i omega (mu_0 - lambda_3(mu_0))))",
)
def _() -> Formula:
    corrected = [
        (q.by(3, 1, 1) - q.by(3, 2, 2) - 2j * q.by(3, 1, 2))
        / (4.0 * (2j * q.frequency - q.third_eigenvalue))
        for q in samples(3)
    ]
    return Formula(
        None,
        [q.w20 for q in samples(3)],
        [
            Correction(
                "With 2 i omega(mu_0) - lambda_3(mu_0) in the denominator and Q3_12 for Q3_13",
                corrected,
            )
        ],
        "As printed a parameter value mu_0 is subtracted from an eigenvalue.",
    )


@CHAPTER.statement("eq-27-value", "eq. 27", "w20 is zero")
def _(_: Evidence) -> Observation:
    return _vanishes(lambda q: q.w20)


@CHAPTER.formula(
    "eq-28-formula",
    "eq. 28",
    "w11 from the derivatives of Q3",
    "w11 = (Q3_11 + Q3_22) / (4 lambda_3)",
)
def _() -> Formula:
    printed = np.array(
        [(q.by(3, 1, 1) + q.by(3, 2, 2)) / (4.0 * q.third_eigenvalue) for q in samples(3)]
    )
    return Formula(
        printed,
        [q.w11 for q in samples(3)],
        [Correction("With the opposite sign", -printed)],
        "Tried on arbitrary nonlinearities.",
    )


@CHAPTER.statement("eq-28-value", "eq. 28", "w11 is zero")
def _(_: Evidence) -> Observation:
    return _vanishes(lambda q: q.w11)


@CHAPTER.number("eq-29-constant", "eq. 29", "G21 without a cubic gain, printed as -3.6/8", -0.45)
def _(_: Evidence) -> Number:
    here, taken = (_at_critical_gain(damping).cubic.real for damping in (DAMPING, TAKEN_DAMPING))
    return Number(
        here,
        [Correction(TAKEN_FOR_DAMPING, taken)],
        f"Real part, in Jordan coordinates; {taken:.5f} with the damping of eq. 8.",
    )


@CHAPTER.number(
    "eq-29-gain", "eq. 29", "Coefficient of the cubic gain in G21, printed as 6/8", 0.75
)
def _(_: Evidence) -> Number:
    def slope(damping: float) -> float:
        return (_at_critical_gain(damping, 1.0).cubic - _at_critical_gain(damping, 0.0).cubic).real

    passed = 1j / (1j + FILTER.corner_frequency)
    return Number(
        slope(DAMPING),
        [Correction(TAKEN_FOR_DAMPING, slope(TAKEN_DAMPING))],
        "Printed is what a gain on the speed itself would do; it acts on what the filter passes, "
        f"which is {abs(passed):.3f} of the speed at the frequency one and "
        f"{np.angle(passed, deg=True):.0f} degrees ahead. The gain called k3 is the k2 of eq. 18.",
    )


@CHAPTER.formula(
    "eq-30-formula",
    "eq. 30",
    "sigma from these coefficients",
    "sigma = Re{g20 g11 / (2 omega_0) + (G21 + G101 g20) / 2}",
)
def _() -> Formula:
    printed = [
        (q.g20 * q.g11 / (2.0 * q.frequency) + (q.cubic + q.g101 * q.g20) / 2.0).real
        for q in samples(3)
    ]
    corrected = [
        (
            1j * q.g20 * q.g11 / (2.0 * q.frequency)
            + (q.cubic + 2.0 * q.g110 * q.w11 + q.g101 * q.w20) / 2.0
        ).real
        for q in samples(3)
    ]
    return Formula(
        printed,
        [q.sigma for q in samples(3)],
        [
            Correction(
                "With i in front of g20 g11, with 2 G110 w11 added and w20 for g20", corrected
            )
        ],
        "Compared with the projection method, on arbitrary nonlinearities.",
    )


@CHAPTER.number("eq-30-value", "eq. 30", "sigma without a cubic gain, printed as -3.6/8", -0.45)
def _(_: Evidence) -> Number:
    here, taken = (
        critical(STUDIED_SPEED, damping).first_lyapunov_coefficient
        for damping in (DAMPING, TAKEN_DAMPING)
    )
    return Number(
        here,
        [Correction(TAKEN_FOR_DAMPING, taken)],
        f"By the projection method; {taken:.5f} with the damping of eq. 8. Of G21 half belongs in "
        "sigma, which eq. 15 has and eq. 30 has not.",
    )


@CHAPTER.statement("eq-30-sign", "eq. 30", "sigma is negative without a cubic gain")
def _(_: Evidence) -> Observation:
    found = [
        critical(STUDIED_SPEED, damping).first_lyapunov_coefficient
        for damping in (DAMPING, TAKEN_DAMPING)
    ]
    return Observation(listed(found), max(found) < 0.0, remark="For both dampings.")


@CHAPTER.number("eq-30-imaginary", "eq. 30", "Imaginary part beside it, 3.6^2/16", 0.81)
def _(_: Evidence) -> Number:
    here, taken = (
        (1j * q.g20 * q.g11 / (2.0 * q.frequency)).imag
        for q in (_at_critical_gain(damping) for damping in (DAMPING, TAKEN_DAMPING))
    )
    return Number(
        here,
        [Correction(TAKEN_FOR_DAMPING, taken)],
        f"Of i g20 g11 / (2 omega_0); {taken:.4f} with the damping of eq. 8. The factor v0^2 is "
        "missing, and 16 should be 32. Without consequence for sigma.",
    )


@CHAPTER.number("eq-30-criterion", "eq. 30", "Cubic gain below which sigma is negative", 0.6)
def _(_: Evidence) -> Number:
    here, taken = (critical(STUDIED_SPEED, damping).cubic for damping in (DAMPING, TAKEN_DAMPING))
    assert here is not None
    assert taken is not None
    speeds, corners = (0.2, 0.4, STUDIED_SPEED), (0.02, 0.2, 2.0)
    others = (
        f"{listed([critical(v, DAMPING, d).cubic or 0.0 for v in speeds])} at d = {d:g}"
        for d in corners
    )
    slow, fast = (
        [_largest_cubic_gain(v, d, start) for v in speeds for d in (0.2, 2.0, 20.0)]
        for start in (-30.0, -900.0)
    )
    return Number(
        here,
        [Correction(TAKEN_FOR_DAMPING, taken)],
        f"{taken:.4g} with the damping of eq. 8: the filter passes little of the speed and shifts "
        f"its phase. At v0 = {listed(speeds)} it is {'; '.join(others)}: the printed bound is that "
        "of a filter with d near zero, which passes the speed unchanged. "
        "For large vibrations this bound, the cubic coefficient of the friction, does mean "
        "something whatever the filter: above k2 = "
        f"{min(slow):.3f} to {max(slow):.3f} the motion runs away from X' = -30, above "
        f"{min(fast):.3f} to {max(fast):.3f} from X' = -900 (these v0, d = 0.2 to 20, k1 = 0).",
    )


def _largest_cubic_gain(belt_speed: float, corner_frequency: float, speed: float) -> float:
    """Return the cubic gain above which the motion with that speed at first runs away."""
    motion = _controlled_motion()

    def stays(cubic: float) -> bool:
        motion.begin(unit_drive(belt_speed), 0.0, 0.0)
        motion.set_gains(corner_frequency, 0.0, cubic)
        motion.restart(0.0, speed)
        motion.low_passed = 0.0
        motion.advance(100.0)
        return not motion.unbounded

    return border(stays, 0.0, 2.0)


@cache
def _controlled_motion() -> Motion:
    return Motion(unit_drive(0.4), 0.0, 0.0, continuous_control=True)


@CHAPTER.statement(
    "eq-30-hopf", "eq. 30", "With k1 = -0.0395 a Hopf point at v = 0.49, with cycles at v < 0.49"
)
def _(_: Evidence) -> Observation:
    gains = replace(FILTER, linear=_PRINTED_GAIN)
    here, taken = (
        hopf_points(unit_drive(STUDIED_SPEED, damping=damping), gains)[-1]
        for damping in (DAMPING, TAKEN_DAMPING)
    )
    directed = [p.supercritical and p.crossing_speed < 0.0 for p in (here, taken)]
    return Observation(
        f"v = {here.belt_speed:.5f}",
        directed[0] and abs(here.belt_speed - STUDIED_SPEED) < 1e-3,
        directed[1] and abs(taken.belt_speed - STUDIED_SPEED) < 1e-3,
        f"{TAKEN_FOR_DAMPING} v = {taken.belt_speed:.5f}; sigma = "
        f"{taken.first_lyapunov_coefficient:.4f}, so that stable cycles begin below it.",
    )


@CHAPTER.statement(
    "before-control", "section 4.2", "Without the filter the Hopf point is supercritical"
)
def _(_: Evidence) -> Observation:
    sigma = hopf_point().first_lyapunov_coefficient
    return Observation(
        f"sigma = {sigma:.6g}",
        sigma < 0.0,
        remark="As section 2 has it; the same section 4.2 goes on to call it subcritical.",
    )


@CHAPTER.statement(
    "jump", "section 4.2, Fig. 2", "As the speed falls to 0.49 the amplitude rises with a jump"
)
def _(_: Evidence) -> Observation:
    return _square_root_law()


@CHAPTER.statement("jump-subcritical", "section 4.2", "That means a subcritical bifurcation")
def _(_: Evidence) -> Observation:
    return _subcritical()


@CHAPTER.statement(
    "after-control", "section 4.2", "With the filter the Hopf point is supercritical still"
)
def _(_: Evidence) -> Observation:
    speeds = (0.03, 0.1, 0.2, 0.3, 0.4, STUDIED_SPEED)
    found, slow = (
        [critical(speed, DAMPING, d).first_lyapunov_coefficient for speed in speeds]
        for d in (FILTER.corner_frequency, 0.2)
    )
    return Observation(
        f"sigma = {listed(found)}",
        max(*found, *slow) < 0.0,
        remark=f"At v0 = {listed(speeds)} and their critical gains, d = 2, k2 = 0; "
        f"{min(slow):.4f} to {max(slow):.4f} with d = 0.2.",
    )


@CHAPTER.statement(
    "control-at-049", "section 4.2", "With the filter the amplitude at v0 = 0.49 is smaller"
)
def _(_: Evidence) -> Observation:
    here, taken = (amplitudes(STUDIED_SPEED, damping) for damping in (DAMPING, TAKEN_DAMPING))
    gains = replace(FILTER, linear=_PRINTED_GAIN / 2.0)
    drive = unit_drive(STUDIED_SPEED, damping=TAKEN_DAMPING)
    cycle = limit_cycle_of_run(drive, 0.0, gains=gains)
    left = 0.0 if cycle is None else cycle.measures.amplitude or 0.0
    resting = expansion(STUDIED_SPEED, TAKEN_DAMPING, replace(FILTER, linear=-0.05)).stable
    return Observation(
        f"{listed(here)} without filter" if here else "no vibration without filter",
        bool(here) and left < here[0],
        bool(taken) and left < taken[0],
        f"{TAKEN_FOR_DAMPING} the amplitude falls from {listed(taken)} to {left:.4g} with half the "
        f"critical gain; with k1 = -0.05 the slide {'rests' if resting else 'vibrates'}.",
    )


@CHAPTER.statement(
    "subcritical-controlled", "section 4.2", "The filter removes a subcritical bifurcation"
)
def _(_: Evidence) -> Observation:
    before = hopf_point().first_lyapunov_coefficient
    after = critical(STUDIED_SPEED, DAMPING).first_lyapunov_coefficient
    return Observation(
        f"sigma = {before:.4g} without, {after:.4g} with it",
        before > 0.0 > after,
        remark="There was none to remove; the filter brings sigma nearer to zero, if anything."
        if abs(after) < abs(before)
        else "There was none to remove.",
    )


@CHAPTER.statement(
    "fig-13-amplitude", "section 4.2, Fig. 13", "The controller's parameters change the amplitude"
)
def _(evidence: Evidence) -> Observation:
    linear, cubic, slow = (
        [amplitude(portrait) for portrait in panel.portraits]
        for panel in evidence.portraits(13).panels
    )
    ratios = [max(sizes) / min(filter(None, sizes)) for sizes in (linear, cubic, slow)]
    return Observation(
        f"by factors of {listed(ratios)}",
        min(ratios) > 1.1,
        remark=f"Of the motions that vibrate. Over k1 with d = 2: {listed(linear)}; over k2: "
        f"{listed(cubic)}; over k1 with d = 0.2: {listed(slow)}.",
    )


@CHAPTER.statement(
    "fig-13-vanish", "section 4.2, Fig. 13", "They can make the limit cycle disappear"
)
def _(evidence: Evidence) -> Observation:
    linear, cubic, _ = evidence.portraits(13).panels
    ends = linear.portraits[-1].measures.regime
    strongest = cubic.portraits[-1]
    vibrates = sum(portrait.measures.regime in VIBRATING for portrait in cubic.portraits)
    gains = strongest.case.gains
    assert gains is not None
    resting = [_comes_to_rest(k1, x, y) for k1 in (-1.0, -10.0) for x, y in _STARTS]
    return Observation(
        f"{ends} at {linear.portraits[-1].case.label}",
        ends is Regime.EQUILIBRIUM and all(resting),
        remark=f"k1 does, below {critical(0.4, DAMPING).linear:.4f}: with k1 = -1 and -10 the "
        f"slide comes to rest from {sum(resting)} of {len(resting)} starts up to 3 away. k2 alone "
        "cannot, as it does "
        f"not change the eigenvalues: {vibrates} of {len(cubic.portraits)} motions vibrate, with "
        f"k2 = {gains.cubic:g} at the amplitude {amplitude(strongest):.4f}.",
    )


def _comes_to_rest(linear: float, position: float, speed: float) -> bool:
    motion, drive = _controlled_motion(), unit_drive(0.4)
    motion.begin(drive, 0.0, 0.0)
    motion.set_gains(FILTER.corner_frequency, linear, 0.0)
    motion.restart(position, speed)
    motion.advance(3000.0)
    off = abs(motion.position - drive.equilibrium_position) + abs(motion.velocity)
    return off < 1e-3 * drive.belt_speed


@CHAPTER.statement(
    "fig-13-design", "section 4.2, Fig. 13", "The filter as designed in section 4.1 serves here"
)
def _(_: Evidence) -> Observation:
    needed, slow = critical(0.4, DAMPING).linear, critical(0.4, DAMPING, 0.2).linear
    taken = expansion(0.4, TAKEN_DAMPING, replace(FILTER, linear=_PRINTED_GAIN)).stable
    here = expansion(0.4, DAMPING, replace(FILTER, linear=_PRINTED_GAIN)).stable
    without, left = (
        controlled_amplitude(0.4, replace(FILTER, linear=linear)) for linear in (0.0, _PRINTED_GAIN)
    )
    return Observation(
        f"k1 = {needed:.4f} is needed at v0 = 0.4",
        here,
        taken,
        f"That is {needed / _PRINTED_GAIN:.0f} times the {_PRINTED_GAIN:g} found for v0 = 0.49, "
        f"which leaves the amplitude {left:.4f} of {without:.4f}; with the "
        f"corner frequency d = 0.2 in place of 2, {slow:.4f} would do.",
    )
