"""Section 4.1: the washout filter and the closed loop, eq. 16 to 22."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import Washout
from stickslip_ros.model.functions import zero_between
from stickslip_ros.paper.claims.paper_values import (
    BELT_SPEEDS,
    DAMPING,
    FILTER,
    PRINTED_GAIN,
    PRINTED_HOPF_SPEED,
    STATES,
    STUDIED_SPEED,
    TAKEN_DAMPING,
    TAKEN_FOR_DAMPING,
    critical,
    expansion,
    falling,
    for_both,
    formula_for_both,
    known,
    number_for_both,
    printed_trace,
    rates,
    trace,
)
from stickslip_ros.paper.claims.verdict import Computations, Evidence, Formula, Number, Observation
from stickslip_ros.paper.figures import unit_drive
from stickslip_ros.theory.hopf import crossing_speed, hopf_points
from stickslip_ros.theory.linear import hurwitz_determinants

computes = Computations()

_SOME_GAINS = replace(FILTER, linear_gain=-0.3, cubic_gain=-2.0)


@computes("eq-16-linear")
def _(_: Evidence) -> Observation:
    found = expansion(STUDIED_SPEED)
    square, cube = found.quadratic[1, 1, 1] / 2.0, found.cubic[1, 1, 1, 1] / 6.0
    return Observation(max(abs(square), abs(cube)) < 1e-9, square=square, cube=cube)


def _slow_states() -> FloatArray:
    """Return deviations from the equilibrium, up to ten, with the slide slower than the belt.

    Half of them are of the order of one.
    """
    states = STATES * np.where(np.arange(STATES.shape[1]) % 2, 10.0, 1.0)
    states[1] = STUDIED_SPEED - np.abs(states[1])
    return states


def _friction(speed: FloatArray, last: float) -> FloatArray:
    """Return F of eq. 6 and 16 at the belt speed of section 4.1, with a factor in the last term."""
    cubes = speed**3 + 3.0 * speed * STUDIED_SPEED**2 - last * speed**2
    return -0.45 * speed + 0.6 * cubes


def _loop_rates(gains: Washout | None) -> FloatArray:
    states = _slow_states()
    states[0] += expansion(STUDIED_SPEED).equilibrium[0]
    return rates(unit_drive(STUDIED_SPEED), states if gains else states[:2], gains)


@computes("eq-16")
def _(_: Evidence) -> Formula:
    x, y, _w = _slow_states()
    printed, corrected = (
        -_friction(y, last) - DAMPING * y - x for last in (3.0, 3.0 * STUDIED_SPEED)
    )
    return Formula(
        printed, _loop_rates(None)[1], {"With the factor v0 in the last term of F": corrected}
    )


@computes("eq-17")
def _(_: Evidence) -> Formula:
    _x, y, w = _slow_states()
    moved = expansion(STUDIED_SPEED, gains=_SOME_GAINS).equilibrium[0]
    moved -= expansion(STUDIED_SPEED).equilibrium[0]
    return Formula(
        y - _SOME_GAINS.corner_frequency * w, _loop_rates(_SOME_GAINS)[2], moved=abs(moved)
    )


@computes("eq-18")
def _(_: Evidence) -> Formula:
    _x, y, w = _slow_states()
    v = y - _SOME_GAINS.corner_frequency * w
    return Formula(
        None,
        _loop_rates(_SOME_GAINS)[1] - _loop_rates(None)[1],
        {
            "With v, which is not defined, read as y - d w as in eq. 19": _SOME_GAINS.linear_gain
            * v
            + _SOME_GAINS.cubic_gain * v**3
        },
    )


@computes("eq-18-linear")
def _(_: Evidence) -> Observation:
    gains = (0.0, -0.1, -0.3)

    def speeds(cubic: float) -> list[float]:
        loops = [replace(FILTER, linear_gain=linear, cubic_gain=cubic) for linear in gains]
        return [hopf_points(unit_drive(0.4), loop)[-1].belt_speed for loop in loops]

    without, with_cubic = speeds(0.0), speeds(-5.0)
    return Observation(
        falling(without) and bool(np.allclose(without, with_cubic, rtol=1e-12)),
        without=without,
        gains=gains,
    )


@computes("eq-19")
def _(_: Evidence) -> Formula:
    x, y, w = _slow_states()
    v = y - _SOME_GAINS.corner_frequency * w
    force = _SOME_GAINS.linear_gain * v + _SOME_GAINS.cubic_gain * v**3
    friction = _friction(y, 3.0 * STUDIED_SPEED)
    return Formula([y, -friction - DAMPING * y - x + force, v], _loop_rates(_SOME_GAINS))


def _printed_jacobian(p: float, linear: float) -> FloatArray:
    return np.array([[0.0, 1.0, 0.0], [-1.0, p + linear, -2.0 * linear], [0.0, 1.0, -2.0]])


computes["eq-20"] = lambda _: Formula(
    _printed_jacobian(trace(STUDIED_SPEED), _SOME_GAINS.linear_gain),
    expansion(STUDIED_SPEED, gains=_SOME_GAINS).jacobian,
)
computes["eq-20-trace"] = lambda _: number_for_both(lambda damping: trace(STUDIED_SPEED, damping))


_EQ_21: dict[int, Callable[[FloatArray, float], FloatArray]] = {
    1: lambda p, k1: 2.0 - (p + k1),
    2: lambda p, k1: 2.0 * k1 - (p + 1.0),
    3: lambda p, _: np.full_like(p, 2.0),
}
"""The coefficients as printed, of p and k1."""


@computes("eq-21-c1", 1)
@computes("eq-21-c2", 2)
@computes("eq-21-c3", 3)
def _(_: Evidence, order: int) -> Formula:
    """Compare a coefficient of eq. 21, over belt speeds, with that of the loop's Jacobian."""

    def coefficients(damping: float) -> list[float]:
        expansions = (expansion(speed, damping, _SOME_GAINS) for speed in BELT_SPEEDS.tolist())
        return [np.poly(found.jacobian)[order] for found in expansions]

    p = trace(STUDIED_SPEED, TAKEN_DAMPING)
    # c1 c2 - c3 = 0 with c1 = 2 - p - k1, c2 = 2 k1 - p - 1, c3 = 2, a square in k1
    discriminant = (5.0 - p) ** 2 - 8.0 * (2.0 + (2.0 - p) * (p + 1.0))
    return formula_for_both(
        _EQ_21[order](printed_trace(BELT_SPEEDS), _SOME_GAINS.linear_gain),
        coefficients,
        c2=np.poly(_printed_jacobian(p, _SOME_GAINS.linear_gain))[2],
        root="no" if discriminant < 0.0 else "a",
        discriminant=discriminant,
    )


@computes("eq-21-condition")
def _(_: Evidence) -> Observation:
    gain = critical(STUDIED_SPEED, TAKEN_DAMPING).linear
    c1, c2, c3 = np.poly(_printed_jacobian(trace(STUDIED_SPEED, TAKEN_DAMPING), gain))[1:]
    found = expansion(STUDIED_SPEED, TAKEN_DAMPING, replace(FILTER, linear_gain=gain)).eigenvalues
    return Observation(
        abs(c1 * c2 - c3) < 1e-9 and abs(found[0].real) < 1e-9,
        defect=abs(c1 * c2 - c3),
        gain=gain,
        real=abs(found[0].real),
        found=found,
    )


@computes("eq-21-gain")
def _(_: Evidence) -> Number:
    p = 0.0078  # as printed
    rounded = zero_between(
        lambda k1: float(hurwitz_determinants(_printed_jacobian(p, k1))[-1]), -0.5, 0.5
    )
    exact = critical(STUDIED_SPEED, TAKEN_DAMPING).linear
    return Number(
        critical(STUDIED_SPEED, DAMPING).linear,
        {
            TAKEN_FOR_DAMPING: exact,
            f"{TAKEN_FOR_DAMPING}, and p rounded to {p:g}": rounded,
        },
        exact=exact,
    )


@computes("eq-22-roots")
def _(_: Evidence) -> Observation:
    gains = replace(FILTER, linear_gain=PRINTED_GAIN)
    pair, _conjugate, real = expansion(STUDIED_SPEED, TAKEN_DAMPING, gains).eigenvalues
    return Observation(pair.imag > 0.0 and real.imag == 0.0, pair=pair, real=real)


@computes("eq-22-alpha")
def _(_: Evidence) -> Formula:
    gains = replace(FILTER, linear_gain=PRINTED_GAIN)
    found = [expansion(speed, TAKEN_DAMPING, gains).eigenvalues for speed in BELT_SPEEDS.tolist()]
    printed = -(1.5995 + 1.8 * BELT_SPEEDS**2)
    off = np.abs(printed - [values.sum().real for values in found]).max()
    at_studied = expansion(STUDIED_SPEED, TAKEN_DAMPING, gains).eigenvalues[0].real
    return Formula(printed, [values[0].real for values in found], off=off, at_studied=at_studied)


computes["eq-22-value"] = lambda _: number_for_both(_crossing)


def _crossing(damping: float) -> float:
    gains = replace(FILTER, linear_gain=critical(STUDIED_SPEED, damping).linear)
    return known(crossing_speed(expansion(STUDIED_SPEED, damping, gains)))


@computes("eq-11-product", PRINTED_HOPF_SPEED)
@computes("eq-22-product", STUDIED_SPEED)
def _(_: Evidence, speed: float) -> Number:
    return Number(-3.6 * speed)


@computes("eq-22-sign")
def _(_: Evidence) -> Observation:
    found = for_both(_crossing)
    return Observation(max(found) < 0.0, found=found)
