"""The actuator: what turns a command into the force that is held."""

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.model.actuator import IDEAL_ACTUATOR, Actuator
from tests.examples import examples


def test_an_ideal_actuator_holds_the_command() -> None:
    assert IDEAL_ACTUATOR.limiter is None
    assert Actuator(time_constant=0.1).limiter is None
    assert IDEAL_ACTUATOR.force(3.0, ()) == 3.0


@pytest.mark.parametrize(
    ("limit", "resolution", "command", "held"),
    [
        (10.0, 0.0, 9.5, 9.5),
        (10.0, 0.0, 11.0, 10.0),
        (10.0, 0.0, -inf, -10.0),
        (inf, 3.0, 4.5, 6.0),
        (inf, 3.0, 1.5, 0.0),
        (inf, 3.0, -7.6, -9.0),
        (10.0, 4.0, 30.0, 8.0),  # limited, and then rounded: 2.5 steps, half to even
        (10.0, 6.0, 30.0, 10.0),  # rounded up above the limit
        (inf, 1e-300, 2.5, 2.5),
    ],
)
def test_a_command_is_limited_rounded_and_limited(
    limit: float, resolution: float, command: float, held: float
) -> None:
    limiter = Actuator(limit, resolution).limiter
    assert limiter(command) == held


@given(st.floats(1.0, 1e6), st.floats(1e-3, 10.0), st.floats(-1e7, 1e7))
@examples(quick=50, thorough=100)
def test_the_force_is_within_the_limit_and_near_the_command(
    limit: float, resolution: float, command: float
) -> None:
    limiter = Actuator(limit, resolution).limiter
    force = limiter(command)
    assert abs(force) <= limit
    assert limiter(-command) == -force
    assert abs(force - max(-limit, min(limit, command))) <= resolution * (0.5 + 1e-6)
