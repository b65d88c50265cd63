"""A law whose constants differ between the directions, by the properties of its two laws."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.model.friction import (
    Coulomb,
    Dahl,
    Directional,
    Exponential,
    FrictionLaw,
    Linear,
    Stribeck,
    Table,
)
from stickslip_ros.model.plain_drive import drive_system
from stickslip_ros.theory.linear import expand
from tests.drives import PAPER

PAIRS: list[tuple[FrictionLaw, FrictionLaw]] = [
    (Stribeck(0.4, 0.25, 0.5), Stribeck(0.5, 0.2, 0.4)),
    (Coulomb(0.4, 0.0), Coulomb(0.3, 0.05)),
    (Linear(0.4, 0.1), Linear(0.3, -0.2)),
    (Exponential(0.4, 0.25, 0.5, 0.1), Exponential(0.5, 0.3, 0.1, 0.2)),
    (Exponential(0.4, 0.25, 0.5, 0.1), Exponential(0.5, 0.3, 0.1, 0.2, 2.0)),
    (Exponential(0.4, 0.25, 0.5, 0.1, 1.5), Exponential(0.5, 0.3, 0.1, 0.2, 2.0)),
    (Table(((0.0, 0.4), (0.3, 0.3))), Table(((0.0, 0.5), (0.1, 0.2), (0.5, 0.3)))),
]
pairs = pytest.mark.parametrize(("forward", "reverse"), PAIRS)


@pairs
@given(speed=st.floats(0.0, 3.0))
def test_each_direction_has_its_law(
    forward: FrictionLaw, reverse: FrictionLaw, speed: float
) -> None:
    law = Directional(forward, reverse)
    assert law.coefficient(speed, 1.0) == forward.coefficient(speed, 1.0)
    assert law.coefficient(-speed, -1.0) == reverse.coefficient(-speed, -1.0)
    assert law.at_rest(speed) == reverse.at_rest(speed)
    assert law.at_rest(-speed) == forward.at_rest(-speed)


@pairs
def test_a_scaled_law_has_scaled_laws(forward: FrictionLaw, reverse: FrictionLaw) -> None:
    law = Directional(forward, reverse)
    scaled = Directional(forward.scaled(4.0, 2.0), reverse.scaled(4.0, 2.0))
    assert law.scaled(4.0, 2.0) == scaled
    speeds = forward.characteristic_speed, reverse.characteristic_speed
    assert law.characteristic_speed == min(speeds)


def test_a_refusal_names_the_law_that_is_refused() -> None:
    good, bad = Stribeck(0.4, 0.25, 0.5), Stribeck(0.2, 0.25, 0.5)
    assert Directional(good, good).refusal() is None
    assert Directional(bad, good).refusal() == "minimum = 0.25 must not exceed static = 0.2"
    reverse = "reverse.minimum = 0.25 must not exceed reverse.static = 0.2"
    assert Directional(good, bad).refusal() == reverse
    assert Directional(Dahl(0.4, 20.0), Dahl(0.3, 20.0)).refusal() is None
    assert "bristle_stiffness" in Directional(Dahl(0.4, 20.0), Dahl(0.4, 30.0)).refusal()


def test_laws_of_two_classes_are_refused() -> None:
    with pytest.raises(TypeError, match="two laws of one class"):
        Directional(Coulomb(), Linear())


def test_laws_of_one_structure_share_their_flows() -> None:
    def structure(law: FrictionLaw) -> int:
        return drive_system(replace(PAPER, friction=law)).structure

    one = structure(Directional(Coulomb(0.4, 0.1), Coulomb(0.3, 0.2)))
    assert structure(Directional(Coulomb(0.2, 0.3), Coulomb(0.1, 0.4))) == one
    assert structure(Directional(Coulomb(0.2, 0.3), Coulomb(0.1))) != one
    assert structure(Coulomb(0.2, 0.3)) != structure(Coulomb(0.2))
    tables = [Table(((0.0, 0.4), (0.3, 0.3))), Table(((0.0, 0.5), (0.1, 0.2), (0.5, 0.3)))]
    assert structure(tables[0]) == structure(tables[1])
    assert structure(Exponential(exponent=2.0)) != structure(Exponential())
    assert structure(Exponential(exponent=1.5)) == structure(Exponential(exponent=1.75))


def test_a_belt_that_moves_forward_has_the_law_of_backward_slip() -> None:
    """The slide at rest on it has v_r < 0."""
    forward, reverse = Exponential(0.5, 0.2, 0.1, 0.0), Exponential(0.4, 0.3, 0.3, 0.01)
    drive = replace(PAPER, friction=Directional(forward, reverse))
    for belt_speed, law in ((0.2, reverse), (-0.2, forward)):
        own = expand(replace(drive, belt_speed=belt_speed))
        other = expand(replace(drive, belt_speed=belt_speed, friction=law))
        np.testing.assert_allclose(own.eigenvalues, other.eigenvalues, rtol=1e-12)
        np.testing.assert_allclose(own.equilibrium, other.equilibrium, rtol=1e-14)
