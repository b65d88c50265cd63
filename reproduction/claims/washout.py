"""Section 4.1: the washout filter and the closed loop, eq. 16 to 22."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from reproduction.claims.paper_values import (
    BELT_SPEEDS,
    DAMPING,
    FILTER,
    PRINTED_GAIN,
    PRINTED_HOPF_SPEED,
    STATES,
    STUDIED_SPEED,
    TAKEN_DAMPING,
    TAKEN_FOR_DAMPING,
    at,
    critical,
    falling,
    for_both,
    formula_for_both,
    known,
    number_for_both,
    printed_trace,
)
from reproduction.claims.verdict import Computations, Evidence, Formula, Number, Observation
from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.functions import zero_between
from stickslip_ros.theory.linear import hurwitz_determinants

computes = Computations()

_GAINS = replace(FILTER, linear_gain=-0.3, cubic_gain=-2.0)

_WITHOUT, _WITH_FILTER = at(STUDIED_SPEED), at(STUDIED_SPEED, gains=_GAINS)
"""The loop of section 4.1, open and with some gains."""

_AT_PRINTED_GAIN = replace(FILTER, linear_gain=PRINTED_GAIN)

_FAR = STATES * np.where(np.arange(STATES.shape[1]) % 2, 10.0, 1.0)
_X, _Y, _W = _FAR[0], STUDIED_SPEED - np.abs(_FAR[1]), _FAR[2]
"""Deviations from the equilibrium, up to ten, with the slide slower than the belt.

Half of them are of the order of one.
"""

_V = _Y - FILTER.corner_frequency * _W
"""The filter output v = y - d w there, eq. 19."""

_CONTROL = _GAINS.linear_gain * _V + _GAINS.cubic_gain * _V**3
"""The control u = k1 v + k2 v^3 there, eq. 18."""


def _friction(last: float) -> FloatArray:
    """Return F of eq. 6 and 16 there, with a factor in the last term."""
    return -0.45 * _Y + 0.6 * (_Y**3 + 3.0 * _Y * STUDIED_SPEED**2 - last * _Y**2)


def _open_rates() -> FloatArray:
    return _WITHOUT.rates(np.array([_X + _WITHOUT.equilibrium, _Y]))


def _closed_rates() -> FloatArray:
    return _WITH_FILTER.rates(np.array([_X + _WITHOUT.equilibrium, _Y, _W]))


@computes("eq-16-linear")
def _(_: Evidence) -> Observation:
    found = _WITHOUT.expansion
    square, cube = found.quadratic[1, 1, 1] / 2.0, found.cubic[1, 1, 1, 1] / 6.0
    return Observation(max(abs(square), abs(cube)) < 1e-9, square=square, cube=cube)


@computes("eq-16")
def _(_: Evidence) -> Formula:
    printed, corrected = (
        -_friction(last) - DAMPING * _Y - _X for last in (3.0, 3.0 * STUDIED_SPEED)
    )
    corrections = {"With the factor v0 in the last term of F": corrected}
    return Formula(printed, _open_rates()[1], corrections)


computes["eq-17"] = lambda _: Formula(
    _V, _closed_rates()[2], moved=abs(_WITH_FILTER.equilibrium - _WITHOUT.equilibrium)
)
computes["eq-18"] = lambda _: Formula(
    None,
    _closed_rates()[1] - _open_rates()[1],
    {"With v, which is not defined, read as y - d w as in eq. 19": _CONTROL},
)


@computes("eq-18-linear")
def _(_: Evidence) -> Observation:
    gains = (0.0, -0.1, _GAINS.linear_gain)

    def speeds(cubic: float) -> list[float]:
        loops = [replace(FILTER, linear_gain=linear, cubic_gain=cubic) for linear in gains]
        return [at(0.4, gains=loop).hopf.belt_speed for loop in loops]

    without = speeds(0.0)
    same = bool(np.allclose(without, speeds(-5.0), rtol=1e-12))
    return Observation(falling(without) and same, without=without, gains=gains)


@computes("eq-19")
def _(_: Evidence) -> Formula:
    acceleration = -_friction(3.0 * STUDIED_SPEED) - DAMPING * _Y - _X + _CONTROL
    return Formula([_Y, acceleration, _V], _closed_rates())


def _printed_jacobian(p: float, linear: float) -> FloatArray:
    return np.array([[0.0, 1.0, 0.0], [-1.0, p + linear, -2.0 * linear], [0.0, 1.0, -2.0]])


computes["eq-20"] = lambda _: Formula(
    _printed_jacobian(_WITHOUT.trace, _GAINS.linear_gain), _WITH_FILTER.expansion.jacobian
)
computes["eq-20-trace"] = lambda _: number_for_both(
    lambda damping: at(STUDIED_SPEED, damping).trace
)


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
        loops = (at(speed, damping, _GAINS) for speed in BELT_SPEEDS.tolist())
        return [np.poly(loop.expansion.jacobian)[order] for loop in loops]

    p = at(STUDIED_SPEED, TAKEN_DAMPING).trace
    # c1 c2 - c3 = 0 with c1 = 2 - p - k1, c2 = 2 k1 - p - 1, c3 = 2, a square in k1
    discriminant = (5.0 - p) ** 2 - 8.0 * (2.0 + (2.0 - p) * (p + 1.0))
    return formula_for_both(
        _EQ_21[order](printed_trace(BELT_SPEEDS), _GAINS.linear_gain),
        coefficients,
        c2=np.poly(_printed_jacobian(p, _GAINS.linear_gain))[2],
        root="no" if discriminant < 0.0 else "a",
        discriminant=discriminant,
    )


@computes("eq-21-condition")
def _(_: Evidence) -> Observation:
    gain = critical(STUDIED_SPEED, TAKEN_DAMPING).linear
    p = at(STUDIED_SPEED, TAKEN_DAMPING).trace
    c1, c2, c3 = np.poly(_printed_jacobian(p, gain))[1:]
    pair = at(STUDIED_SPEED, TAKEN_DAMPING, replace(FILTER, linear_gain=gain)).eigenvalues[0]
    defect, real = abs(c1 * c2 - c3), abs(pair.real)
    return Observation(max(defect, real) < 1e-9, defect=defect, gain=gain, real=real, pair=pair)


@computes("eq-21-gain")
def _(_: Evidence) -> Number:
    p = 0.0078  # as printed
    rounded = zero_between(
        lambda k1: float(hurwitz_determinants(_printed_jacobian(p, k1))[-1]), -0.5, 0.5
    )
    exact = critical(STUDIED_SPEED, TAKEN_DAMPING).linear
    corrections = {
        TAKEN_FOR_DAMPING: exact,
        f"{TAKEN_FOR_DAMPING}, and p rounded to {p:g}": rounded,
    }
    return Number(critical(STUDIED_SPEED).linear, corrections, exact=exact)


@computes("eq-22-roots")
def _(_: Evidence) -> Observation:
    pair, _conjugate, real = at(STUDIED_SPEED, TAKEN_DAMPING, _AT_PRINTED_GAIN).eigenvalues
    return Observation(pair.imag > 0.0 and real.imag == 0.0, pair=pair, real=real)


@computes("eq-22-alpha")
def _(_: Evidence) -> Formula:
    loops = [at(speed, TAKEN_DAMPING, _AT_PRINTED_GAIN) for speed in BELT_SPEEDS.tolist()]
    printed = -(1.5995 + 1.8 * BELT_SPEEDS**2)
    return Formula(
        printed,
        [loop.eigenvalues[0].real for loop in loops],
        off=np.abs(printed - [loop.trace for loop in loops]).max(),
        loop=at(STUDIED_SPEED, TAKEN_DAMPING, _AT_PRINTED_GAIN),
    )


computes["eq-22-value"] = lambda _: number_for_both(_crossing)


def _crossing(damping: float) -> float:
    gains = replace(FILTER, linear_gain=critical(STUDIED_SPEED, damping).linear)
    return known(at(STUDIED_SPEED, damping, gains).expansion.crossing_speed)


computes["eq-11-product"] = lambda _: Number(-3.6 * PRINTED_HOPF_SPEED)
computes["eq-22-product"] = lambda _: Number(-3.6 * STUDIED_SPEED)


@computes("eq-22-sign")
def _(_: Evidence) -> Observation:
    found = for_both(_crossing)
    return Observation(max(found) < 0.0, found=found)
