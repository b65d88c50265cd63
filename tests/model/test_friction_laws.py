"""The friction laws: properties of every law in `LAWS`, and values of those known here."""

from dataclasses import replace
from math import exp
from typing import Any

import heyoka
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import Parameter, constants_of
from stickslip_ros.model.friction import (
    LAWS,
    Coulomb,
    CurveFollower,
    Dahl,
    Exponential,
    FrictionLaw,
    Linear,
    Stiction,
    Stribeck,
    Table,
)
from stickslip_ros.model.symbols import numbers, structure, with_symbols
from tests.examples import examples

STRIBECK = Stribeck(static=0.4, minimum=0.25, minimum_speed=0.5)
COULOMB = Coulomb(static=0.4)
LINEAR = Linear(static=0.4, slope=0.9)
EXPONENTIAL = Exponential(static=0.4, kinetic=0.25, decay_speed=0.5, viscous=0.1)
GAUSSIAN = Exponential(static=0.4, kinetic=0.25, decay_speed=0.5, viscous=0.1, exponent=2.0)

LARGEST = 10.0
"""Magnitude of random constants, in SI units."""

speeds = st.floats(-5.0, 5.0)
signs = st.sampled_from([-1.0, 1.0])
# Not closer to the limit of an element than the step of a difference.
shares = st.floats(-1.0, 1.0).map(lambda share: round(share, 4))
CURVES = (Stribeck, Coulomb, Exponential, Table)
"""Laws that a law with a memory can follow; a linear one falls below zero."""
every_law = pytest.mark.parametrize("kind", LAWS.values(), ids=LAWS)


def values(constant: Parameter) -> st.SearchStrategy[float]:
    """Values within the bounds of a constant."""
    if constant.whole:
        return st.integers(int(constant.at_least), 6)
    least = max(constant.at_least, 0.05 if constant.positive else -LARGEST)
    largest = max(least, 0.0) + LARGEST
    if constant.below < largest:
        largest = 0.99 * constant.below  # close to it the equations are steep
    return st.just(constant.default) | st.floats(least, largest)


@st.composite
def laws(draw: st.DrawFn, kind: type[FrictionLaw]) -> FrictionLaw:
    """Laws with constants that fit together, the defaults among them."""
    described = constants_of(kind).items()
    made: dict[str, Any] = {name: draw(values(constant)) for name, constant in described}
    if issubclass(kind, Table):
        made["points"] = draw(points())
    if issubclass(kind, CurveFollower):
        made["curve"] = draw(st.sampled_from(CURVES).flatmap(laws))
    law = kind(**made)
    assume(law.refusal() is None)
    return law


@st.composite
def points(draw: st.DrawFn) -> tuple[tuple[float, float], ...]:
    """Points of a table."""
    steps = draw(st.lists(st.floats(0.05, LARGEST), max_size=5))
    speeds = np.cumsum([0.0, *steps]).tolist()
    return tuple((speed, draw(st.floats(0.0, LARGEST))) for speed in speeds)


_compiled: dict[Any, Any] = {}


def compiled(law: FrictionLaw) -> Any:
    """Friction and the rates of the memory, compiled from symbols for laws of a structure.

    They are functions of speed, sign, memory, switches and constants.
    """
    key = structure(law)
    if key not in _compiled:
        names = (*law.states, *law.switches, *dict(numbers(law, "law")))
        speed, sign, *others = heyoka.make_vars("speed", "sign", *names)
        symbols = dict(zip(names, others, strict=True))
        symbolic = with_symbols(law, "law", symbols)
        memory, switches = ([symbols[name] for name in each] for each in (law.states, law.switches))
        arguments = (speed, sign, memory, switches)
        results = [symbolic.friction(*arguments), *symbolic.memory_rates(*arguments)]
        _compiled[key] = heyoka.cfunc(results, [speed, sign, *others])
    return _compiled[key]


# The cubic has a = 3 (0.4 - 0.25) / (2 0.5) = 0.45 and b = (0.4 - 0.25) / (2 0.5^3) = 0.6.
@pytest.mark.parametrize(
    ("law", "relative_speed", "expected"),
    [
        (STRIBECK, -0.4, 0.4 - 0.45 * 0.4 + 0.6 * 0.4**3),
        (STRIBECK, -0.5, 0.25),
        (STRIBECK, -1.0, 0.55),
        (STRIBECK, 0.2, -0.4 + 0.45 * 0.2 - 0.6 * 0.2**3),
        (COULOMB, -0.7, 0.4),
        (COULOMB, 3.0, -0.4),
        (LINEAR, -0.2, 0.4 - 0.9 * 0.2),
        (LINEAR, 0.3, -0.4 + 0.9 * 0.3),
        (EXPONENTIAL, -0.5, 0.25 + 0.15 * exp(-1.0) + 0.1 * 0.5),
        (EXPONENTIAL, 1.0, -(0.25 + 0.15 * exp(-2.0) + 0.1)),
        (GAUSSIAN, 1.0, -(0.25 + 0.15 * exp(-4.0) + 0.1)),
        (GAUSSIAN, -0.25, 0.25 + 0.15 * exp(-0.25) + 0.025),
        (replace(GAUSSIAN, exponent=1.5), -2.0, 0.25 + 0.15 * exp(-8.0) + 0.2),
        (Coulomb(0.4, 0.1), 2.0, -0.6),
        (Coulomb(0.4, 0.1), -2.0, 0.6),
        (Stiction(0.4, 0.3, 0.1), -2.0, 0.5),
        (Dahl(0.4, 20.0), -0.3, 0.4),
    ],
)
def test_coefficient(law: FrictionLaw, relative_speed: float, expected: float) -> None:
    sign = np.sign(relative_speed)
    assert law.coefficient(relative_speed, sign) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("law", "refusal"),
    [
        (Stribeck(static=0.4, minimum=0.5), "minimum = 0.5 must not exceed static = 0.4"),
        (Exponential(static=0.1, kinetic=0.25), "kinetic = 0.25 must not exceed static = 0.1"),
        (Stiction(static=0.1, kinetic=0.25), "kinetic = 0.25 must not exceed static = 0.1"),
        (Exponential(static=0.25, kinetic=0.25), None),
        (Coulomb(static=0.0), None),
    ],
)
def test_the_static_coefficient_is_the_largest(law: FrictionLaw, refusal: str | None) -> None:
    assert law.refusal() == refusal


@every_law
@examples(quick=15, thorough=30)
@given(st.data(), speeds, signs)
def test_friction_starts_at_its_limits_and_is_odd_where_they_are_equal(
    kind: type[FrictionLaw], data: st.DataObject, speed: float, sign: float
) -> None:
    law = data.draw(laws(kind))
    forward, backward = law.limits
    assert min(forward, backward) >= 0.0
    if isinstance(law, Stiction):
        assert law.coefficient(0.0, -1.0) == law.kinetic <= backward == law.static
    elif law.sticks:
        assert law.coefficient(0.0, 1.0) == pytest.approx(-forward, rel=1e-14, abs=1e-14)
        assert law.coefficient(0.0, -1.0) == pytest.approx(backward, rel=1e-14, abs=1e-14)
    if forward == backward and (law.sticks or speed * sign > 0.0):
        assert law.coefficient(-speed, -sign) == -law.coefficient(speed, sign)


@every_law
@examples(quick=15, thorough=30)
@given(st.data(), speeds, signs, st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_in_other_units_it_has_the_same_coefficient_and_characteristic_speed(
    kind: type[FrictionLaw],
    data: st.DataObject,
    speed: float,
    sign: float,
    unit: float,
    length: float,
) -> None:
    law = data.draw(laws(kind))
    scaled, fastest = law.scaled(unit, length), law.characteristic_speed
    assert fastest > 0.0
    assert scaled.characteristic_speed == pytest.approx(fastest / unit)
    if law.sticks or speed * sign >= 0.0:  # a memory of steady slip has its direction
        assert scaled.coefficient(speed / unit, sign) == pytest.approx(
            law.coefficient(speed, sign), rel=1e-12, abs=1e-12
        )


@every_law
@examples(quick=10, thorough=30)
@given(st.data(), speeds, signs, st.floats(1e-3, 1e3))
def test_multiplied_it_has_as_many_times_the_friction_and_the_same_memory(
    kind: type[FrictionLaw], data: st.DataObject, speed: float, sign: float, factor: float
) -> None:
    """Normal force and coefficients share a force: how does not matter."""
    law = data.draw(laws(kind))
    other, close = law.multiplied(factor), 1e-12 * largest_term(law)
    memory = [data.draw(st.floats(-1.2, 1.2)) * each for each in law.memory_at(speed, sign)]
    state = speed, sign, memory, law.switches_at(speed, sign, memory)
    same = speed, sign, memory, other.switches_at(speed, sign, memory)
    friction = law.friction(*state)
    assert other.friction(*same) / factor == pytest.approx(friction, rel=1e-12, abs=close)
    rates = list(law.memory_rates(*state))
    assert list(other.memory_rates(*same)) == pytest.approx(rates, rel=1e-9, abs=close)
    assert other.limits == pytest.approx([factor * each for each in law.limits])


@every_law
@examples(quick=10, thorough=30)
@given(data=st.data())
def test_arrays_and_symbols_give_what_numbers_give(
    kind: type[FrictionLaw], data: st.DataObject
) -> None:
    law = data.draw(laws(kind))
    relative_speeds = np.array([-1.5, -0.3, -0.0, 0.0, 0.2, 2.5])
    directions = np.array([-1.0, -1.0, -1.0, 1.0, 1.0, 1.0])
    one_by_one = [
        float(law.coefficient(float(speed), float(sign)))
        for speed, sign in zip(relative_speeds, directions, strict=True)
    ]
    close = {"rel": 1e-14, "abs": 1e-14 * largest_term(law)}
    found = law.coefficient(relative_speeds, directions)
    assert found.tolist() == pytest.approx(one_by_one, **close)
    constants = [value for _, value in numbers(law, "law")]
    # A power of a symbol keeps 1e-12 away from zero. Bristles are stiff.
    close["abs"] *= 100.0 * (1.0 + getattr(law, "bristle_damping", 0.0))
    for speed, sign in zip(relative_speeds.tolist(), directions.tolist(), strict=True):
        share = data.draw(st.floats(-1.2, 1.2))
        memory = [share * each for each in law.memory_at(speed, sign)]
        switches = law.switches_at(speed, sign, memory)
        friction, *rates = compiled(law)(np.array([speed, sign, *memory, *switches, *constants]))
        expected = law.memory_rates(speed, sign, memory, switches)
        assert friction == pytest.approx(law.friction(speed, sign, memory, switches), **close)
        assert rates == pytest.approx(list(expected), **close)


def largest_term(law: FrictionLaw) -> float:
    """Size of what may cancel in a coefficient at speeds below 5 m/s."""
    of_speeds = law.coefficient(np.array([-5.0, -1.0, 1.0, 5.0]), np.array([-1.0, -1.0, 1.0, 1.0]))
    constants = (abs(value) for _, value in numbers(law, "law"))
    return max(1.0, *np.abs(of_speeds).tolist(), *constants)


@pytest.mark.parametrize("kind", [law for law in LAWS.values() if law.states])
@given(st.data(), st.floats(1e-3, 1.0), signs, shares, st.floats(1e-3, 3.0))
def test_the_memory_after_a_duration_is_the_solution_of_its_rates(
    kind: type[FrictionLaw],
    data: st.DataObject,
    speed: float,
    sign: float,
    share: float,
    part: float,
) -> None:
    law = data.draw(laws(kind))
    relative_speed = sign * speed
    start = [share * each for each in law.memory_at(relative_speed, sign)]
    duration, scale = part * memory_time(law, speed), memory_scale(law, relative_speed)
    switches = law.switches_at(relative_speed, sign, start)
    found = law.memory_after(relative_speed, start, switches, duration)
    halfway = law.memory_after(relative_speed, start, switches, 0.5 * duration)
    then = law.switches_following(switches, relative_speed, sign, halfway)
    again = law.memory_after(relative_speed, halfway, then, 0.5 * duration)
    np.testing.assert_allclose(np.array(again) / scale, np.array(found) / scale, atol=2e-7)
    step = 1e-9 * duration
    slope = (np.array(law.memory_after(relative_speed, start, switches, step)) - start) / step
    rates = np.array(law.memory_rates(relative_speed, sign, start, switches))
    unit = scale / duration
    np.testing.assert_allclose(slope / unit, rates / unit, rtol=1e-3, atol=1e-3)


def memory_time(law: FrictionLaw, speed: float) -> float:
    """Time in which the memory changes at a speed, s."""
    return float(np.abs(law.memory_at(speed, 1.0)).max()) / speed


def memory_scale(law: FrictionLaw, relative_speed: float) -> Any:
    """Change of the memory that counts."""
    return np.abs(law.memory_at(relative_speed, 1.0)) + 1e-300


def test_the_memory_of_a_law_that_does_not_say_it_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="dahl does not say what its memory is"):
        FrictionLaw.memory_after(Dahl(), 0.1, (0.0,), (), 1.0)
