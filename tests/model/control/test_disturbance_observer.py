from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from stickslip_ros.model.control import DisturbanceObserver
from stickslip_ros.model.drive import Drive
from tests.model.control.answers import answers, assert_same, random_record

LAW = DisturbanceObserver(nominal_mass=80.0, bandwidth=120.0, position_gain=2e5, velocity_gain=3e3)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("limit", [np.inf, 250.0])
def test_the_estimate_is_the_low_pass_of_the_force_that_is_not_known(
    seed: int, limit: float
) -> None:
    """P' = g (u + g m x' - p), for the pair of p and the held input as a matrix exponential."""
    record, g, m = random_record(seed), 120.0, 80.0
    p = held = g * m * record.velocity[0]
    expected = []
    rows = zip(*record[:3], record.reference.T, strict=True)
    for step, x, y, (r, r1, r2) in rows:
        p = (expm(step * np.array([[-g, g], [0.0, 0.0]])) @ [p, held])[0]
        force = 2e5 * (r - x) + 3e3 * (r1 - y) + m * r2 - (g * m * y - p)
        expected.append(np.clip(force, -limit, limit))
        held = expected[-1] + g * m * y
    found = answers(replace(LAW, force_limit=limit), record)
    assert_same(found, np.array(expected))


def test_it_takes_the_mass_of_a_drive() -> None:
    assert LAW.for_drive(Drive(mass=250.0)).nominal_mass == 250.0
