"""The coefficients of the normal form, eq. 12 to 15 and, with the filter, eq. 23 to 30."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from operator import attrgetter

import numpy as np

from stickslip_ros.paper.claims.claim import Computations, Evidence, Formula, Number, Observation
from stickslip_ros.paper.claims.normal_form import Nonlinearity, samples
from stickslip_ros.paper.claims.paper_values import (
    DAMPING,
    FILTER,
    PRINTED_HOPF_SPEED,
    STUDIED_SPEED,
    TAKEN_DAMPING,
    critical,
    expansion,
    for_both,
    hopf_point,
    known,
    number_for_both,
)
from stickslip_ros.paper.claims.summaries import complex_number, listed
from stickslip_ros.physics.theory.hopf import first_lyapunov_coefficient

computes = Computations()


def _at_hopf_point(damping: float) -> Nonlinearity:
    """Return the nonlinearity of the open loop at v_b1."""
    return Nonlinearity.at(expansion(hopf_point(damping).belt_speed, damping))


def _at_critical_gain(damping: float, cubic: float = 0.0) -> Nonlinearity:
    """Return the nonlinearity at the belt speed and the critical gain of section 4.1."""
    gains = replace(FILTER, linear=critical(STUDIED_SPEED, damping).linear, cubic=cubic)
    return Nonlinearity.at(expansion(STUDIED_SPEED, damping, gains))


def _on_samples(
    order: int,
    printed: Callable[[Nonlinearity], complex] | None,
    true: Callable[[Nonlinearity], complex],
    corrections: Mapping[str, Callable[[Nonlinearity], complex]],
    remark: str = "Tried on arbitrary nonlinearities.",
) -> Formula:
    """Return a formula of a coefficient, by its values for arbitrary nonlinearities."""
    tried = samples(order)
    return Formula(
        None if printed is None else [printed(q) for q in tried],
        [true(q) for q in tried],
        {what: [corrected(q) for q in tried] for what, corrected in corrections.items()},
        remark,
    )


def _beat(q: Nonlinearity) -> complex:
    """Return the term of the second derivatives in eq. 15 and 30, without the i in front."""
    return q.g20 * q.g11 / (2.0 * q.frequency)


@computes("eq-12-value", attrgetter("g20"))
@computes("eq-13-value", attrgetter("g11"))
def _(_: Evidence, coefficient: Callable[[Nonlinearity], complex]) -> Number:
    """Return four times the imaginary part of g20 or g11, which are imaginary at v_b1."""
    return number_for_both(
        lambda damping: 4.0 * coefficient(_at_hopf_point(damping)).imag,
        "{taken:.5f} with the damping of eq. 8; a misprint, since eq. 11 prints the same "
        f"product 3.6 v_b1 with the digits {3.6 * PRINTED_HOPF_SPEED:.4f}.",
    )


def _printed_g20(q: Nonlinearity, mixed: int) -> complex:
    real = q.by(1, 1, 1) - q.by(1, 2, 2) + 2.0 * q.by(mixed, 1, 2)
    return (real + 1j * (q.by(2, 1, 1) - q.by(2, 2, 2) - 2.0 * q.by(1, 1, 2))) / 4.0


computes["eq-12-formula"] = computes["eq-23-formula"] = lambda _: _on_samples(
    2,
    lambda q: _printed_g20(q, 1),
    lambda q: q.g20,
    {"With Q2 in place of Q1 in the real part's last term": lambda q: _printed_g20(q, 2)},
    "Tried on arbitrary nonlinearities; the derivative in question is zero for the drive.",
)
computes["eq-13-formula"] = computes["eq-24-formula"] = lambda _: _on_samples(
    2,
    lambda q: (q.by(1, 1, 1) + q.by(1, 2, 2) + 1j * (q.by(2, 1, 1) + q.by(2, 2, 2))) / 4.0,
    lambda q: q.g11,
    {},
)
computes["eq-14-real"] = lambda _: _on_samples(
    2,
    lambda q: (q.by(1, 1, 1, 1) + q.by(1, 1, 2, 2) + q.by(2, 1, 1, 2) + q.by(2, 2, 2, 2)) / 8.0,
    lambda q: q.cubic.real,
    {},
)
computes["eq-14-imaginary"] = lambda _: _on_samples(
    2,
    lambda q: (q.by(2, 1, 1, 1) - q.by(2, 1, 2, 2) - 2.0 * q.by(1, 1, 1, 2)) / 8.0,
    lambda q: q.cubic.imag,
    {
        "With (Q2_111 + Q2_122 - Q1_112 - Q1_222) / 8": lambda q: (
            (q.by(2, 1, 1, 1) + q.by(2, 1, 2, 2) - q.by(1, 1, 1, 2) - q.by(1, 2, 2, 2)) / 8.0
        )
    },
    "This does not affect sigma, which contains the real part only.",
)
computes["eq-14-value"] = lambda _: Number(
    _at_hopf_point(DAMPING).cubic.real, remark="For any damping."
)


@computes("eq-15-formula")
def _(_: Evidence) -> Formula:
    at_hopf = _at_hopf_point(DAMPING)
    without = (at_hopf.g20 * at_hopf.g11 / 2.0 + at_hopf.cubic / 2.0).real
    return _on_samples(
        2,
        lambda q: _beat(q).real * q.cubic.real / 2.0,
        lambda q: q.sigma,
        {
            "With a sum in place of the product": lambda q: (_beat(q) + q.cubic / 2.0).real,
            "With i in front of g20 g11, and a sum in place of the product,": lambda q: (
                (1j * _beat(q) + q.cubic / 2.0).real
            ),
        },
        f"Compared with the projection method. Without i the sum would be {without:.4g} at v_b1.",
    )


computes["eq-15-value"] = lambda _: Number(
    known(first_lyapunov_coefficient(expansion(hopf_point().belt_speed))),
    remark="By the projection method, from heyoka's derivatives.",
)
computes["eq-15-imaginary"] = lambda _: number_for_both(
    lambda damping: ((q := _at_hopf_point(damping)).g20 * q.g11).real / 2.0,
    "Of i g20 g11 / 2; even with the damping of eq. 8 it is 3.6^2 v_b1^2 / 32 = {taken:.4f}. "
    "This does not affect sigma.",
)


@computes("eq-23-value", attrgetter("g20"))
@computes("eq-24-value", attrgetter("g11"))
def _(_: Evidence, coefficient: Callable[[Nonlinearity], complex]) -> Number:
    """Return four times the magnitude of g20 or g11 in the closed loop."""
    taken = 4.0 * coefficient(_at_critical_gain(TAKEN_DAMPING))
    return number_for_both(
        lambda damping: 4.0 * abs(coefficient(_at_critical_gain(damping))),
        f"{complex_number(taken)} with the damping of eq. 8: the printed value is that of the loop "
        "without filter, with -+ i. The formula needs coordinates in which the linear part has "
        "Jordan form; these contain the filter.",
    )


def _mixed(q: Nonlinearity, sign: float, plane: int) -> complex:
    """Return G110 (sign +1) or G101 (-1), Q2 derived by y1 or y2, and Q1 too."""
    real = q.by(1, 1, 3) + sign * q.by(2, plane, 3)
    return (real + 1j * (q.by(2, 1, 3) - sign * q.by(1, plane, 3))) / 2.0


@computes("eq-25-formula", attrgetter("g110"), 1.0)
@computes("eq-26-formula", attrgetter("g101"), -1.0)
def _(_: Evidence, true: Callable[[Nonlinearity], complex], sign: float) -> Formula:
    corrected = "With Q2_23 in the real and Q1_23 in the imaginary part"
    return _on_samples(
        3, lambda q: _mixed(q, sign, 1), true, {corrected: lambda q: _mixed(q, sign, 2)}
    )


@computes("eq-25-value", attrgetter("g110"))
@computes("eq-26-value", attrgetter("g101"))
@computes("eq-27-value", attrgetter("w20"))
@computes("eq-28-value", attrgetter("w11"))
def _(_: Evidence, coefficient: Callable[[Nonlinearity], complex]) -> Observation:
    here, taken = for_both(lambda damping: coefficient(_at_critical_gain(damping)))
    return Observation(
        complex_number(taken),
        max(abs(here), abs(taken)) < 1e-9,
        remark="In Jordan coordinates, y3 scaled to the slide's speed, with the damping of eq. 8; "
        f"{complex_number(here)} with that of eq. 5. The quadratic friction acts on all three "
        "coordinates, since each of them moves the slide.",
    )


computes["eq-27-formula"] = lambda _: _on_samples(
    3,
    None,
    lambda q: q.w20,
    {
        "With 2 i omega(mu_0) - lambda_3(mu_0) in the denominator and Q3_12 for Q3_13": lambda q: (
            (q.by(3, 1, 1) - q.by(3, 2, 2) - 2j * q.by(3, 1, 2))
            / (4.0 * (2j * q.frequency - q.third_eigenvalue))
        )
    },
    "The printed formula subtracts an eigenvalue from a parameter value mu_0.",
)


def _printed_w11(q: Nonlinearity) -> float:
    return (q.by(3, 1, 1) + q.by(3, 2, 2)) / (4.0 * q.third_eigenvalue)


computes["eq-28-formula"] = lambda _: _on_samples(
    3, _printed_w11, lambda q: q.w11, {"With the opposite sign": lambda q: -_printed_w11(q)}
)
computes["eq-29-constant"] = lambda _: number_for_both(
    lambda damping: _at_critical_gain(damping).cubic.real,
    "Real part, in Jordan coordinates; {taken:.5f} with the damping of eq. 8.",
)


@computes("eq-29-gain")
def _(_: Evidence) -> Number:
    def slope(damping: float) -> float:
        return (_at_critical_gain(damping, 1.0).cubic - _at_critical_gain(damping, 0.0).cubic).real

    passed = 1j / (1j + FILTER.corner_frequency)
    return number_for_both(
        slope,
        "The printed value is for a gain on the speed itself; the gain acts on the filter output, "
        f"which is {abs(passed):.3f} of the speed at the frequency one and "
        f"{np.angle(passed, deg=True):.0f} degrees ahead. The gain called k3 is the k2 of eq. 18.",
    )


computes["eq-30-formula"] = lambda _: _on_samples(
    3,
    lambda q: (_beat(q) + (q.cubic + q.g101 * q.g20) / 2.0).real,
    lambda q: q.sigma,
    {
        "With i in front of g20 g11, with 2 G110 w11 added and w20 for g20": lambda q: (
            (1j * _beat(q) + (q.cubic + 2.0 * q.g110 * q.w11 + q.g101 * q.w20) / 2.0).real
        )
    },
    "Compared with the projection method, on arbitrary nonlinearities.",
)
computes["eq-30-value"] = lambda _: number_for_both(
    lambda damping: critical(STUDIED_SPEED, damping).first_lyapunov_coefficient,
    "By the projection method; {taken:.5f} with the damping of eq. 8. Half of G21 belongs in "
    "sigma, as in eq. 15 but not in eq. 30.",
)


@computes("eq-30-sign")
def _(_: Evidence) -> Observation:
    found = for_both(lambda damping: critical(STUDIED_SPEED, damping).first_lyapunov_coefficient)
    return Observation(listed(found), max(found) < 0.0, remark="For both dampings.")


computes["eq-30-imaginary"] = lambda _: number_for_both(
    lambda damping: _beat(_at_critical_gain(damping)).real,
    "Of i g20 g11 / (2 omega_0); {taken:.4f} with the damping of eq. 8. The factor v0^2 is "
    "missing, and 16 should be 32. This does not affect sigma.",
)
