"""Friction laws fitted to pairs of speed and force."""

import numpy as np
import pytest

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.friction_map import fitted_curves
from stickslip_ros.model.friction import Exponential

SPEED = np.geomspace(0.001, 0.2, 20)
VELOCITY = np.concatenate([-SPEED[::-1], SPEED])


def forces(kinetic: float = 20.0, exponent: float = 1.0, drop: float = 10.0) -> FloatArray:
    speed = np.abs(VELOCITY)
    size = kinetic + drop * np.exp(-((speed / 0.01) ** exponent)) + 60.0 * speed
    return np.sign(VELOCITY) * size


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_the_constants_are_within_their_errors(exponent: float) -> None:
    truth = {"static": 30.0, "kinetic": 20.0, "viscous": 60.0, "decay_speed": 0.01}
    apart: list[list[float]] = []
    for seed in range(40):
        noise = 0.2 * np.random.default_rng(seed).standard_normal(len(VELOCITY))
        curves = fitted_curves(VELOCITY, forces(exponent=exponent) + noise, "exponential")
        if len(curves) > 1:  # by chance
            continue
        found = curves[0].estimates
        law = curves[0].law
        assert isinstance(law, Exponential)
        assert law.exponent == exponent
        apart.append([(found[n].value - truth[n]) / found[n].standard_error for n in truth])
        assert all(found[n].value == pytest.approx(truth[n], rel=0.2) for n in truth)
    assert len(apart) > 35
    assert np.abs(np.mean(apart, axis=0)).max() < 0.5
    assert np.std(apart, axis=0) == pytest.approx(np.ones(4), abs=0.3)


def test_exact_pairs_give_the_constants() -> None:
    (curve,) = fitted_curves(VELOCITY, forces())
    found = {name: each.value for name, each in curve.estimates.items()}
    truth = {"kinetic": 20.0, "static": 30.0, "viscous": 60.0, "decay_speed": 0.01}
    assert found == pytest.approx(truth, rel=1e-4)
    (curve,) = fitted_curves(VELOCITY, forces(drop=0.0))
    assert curve.law.name == "coulomb"
    found = {name: each.value for name, each in curve.estimates.items()}
    assert found == pytest.approx({"static": 20.0, "viscous": 60.0})


def test_directions_that_differ_have_laws_of_their_own() -> None:
    force = np.where(VELOCITY > 0.0, forces(), forces(25.0))
    forward, backward = fitted_curves(VELOCITY, force)
    assert forward.estimates["kinetic"].value == pytest.approx(20.0, rel=1e-3)
    assert backward.estimates["kinetic"].value == pytest.approx(25.0, rel=1e-3)
    (alone,) = fitted_curves(VELOCITY[:20], force[:20])
    assert alone.estimates["kinetic"].value == pytest.approx(25.0, rel=1e-3)


def test_too_few_pairs_and_other_laws_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="there are 20 and 7 pairs"):
        fitted_curves(VELOCITY[13:], forces()[13:])
    with pytest.raises(InvalidInputError, match="there are 0 pairs"):
        fitted_curves(np.zeros(40), forces())
    with pytest.raises(InvalidInputError, match="law lugre is invalid"):
        fitted_curves(VELOCITY, forces(), "lugre")


def test_numbers_of_any_size_are_fitted_or_refused() -> None:
    for scale in (1e-100, 1e-30, 1e30, 1e100):
        for velocity, force in ((scale, 1.0), (1.0, scale), (scale, scale)):
            fitted_curves(velocity * VELOCITY, force * forces())
