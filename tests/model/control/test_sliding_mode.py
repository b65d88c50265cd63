import numpy as np
import pytest

from stickslip_ros.model.control import SlidingMode
from tests.model.control.answers import answers, assert_same, random_record


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("layer", [0.05, 1e-9])
def test_the_force_is_that_of_the_surface(seed: int, layer: float) -> None:
    record = random_record(seed)
    distance = record.rate + 40.0 * record.error
    expected = 70.0 * (record.reference[2] + 40.0 * record.rate)
    expected += 500.0 * np.clip(distance / layer, -1.0, 1.0)
    law = SlidingMode(nominal_mass=70.0, slope=40.0, switching_force=500.0, boundary_layer=layer)
    assert_same(answers(law, record), expected)


def test_without_a_layer_it_switches_and_is_not_linear() -> None:
    law = SlidingMode(nominal_mass=0.0, slope=40.0, switching_force=500.0, boundary_layer=0.0)
    record = random_record(7)
    expected = 500.0 * np.sign(record.rate + 40.0 * record.error)
    assert_same(answers(law, record), expected)
    assert law.linear_feedback(1e-3) is None
