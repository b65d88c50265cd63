"""How samples are to be read, from the parameters of a plant as far as they are known."""

from typing import Any

import pytest

from stickslip_ros.measures.sample_assumptions import UNKNOWN, SampleAssumptions, reading_of

ENCODER = {"sensor.position_resolution": 1e-6, "sensor.velocity": "difference"}
STATIC = {"friction.law": "stribeck", "belt_speed": 0.04}
MEMORY = {"friction.law": "lugre", "belt_speed": -0.04}


@pytest.mark.parametrize(
    ("plant", "fastest_belt", "expected"),
    [
        ({}, 0.0, UNKNOWN),
        (STATIC, 0.04, SampleAssumptions(0.0, noisy=False)),
        ({**STATIC, **ENCODER}, 0.04, SampleAssumptions(0.0, noisy=True)),
        ({**STATIC, "sensor.velocity_noise": 1e-6}, 0.04, SampleAssumptions(0.0, noisy=True)),
        ({**STATIC, "sensor.velocity": "exact"}, 0.04, SampleAssumptions(0.0, noisy=False)),
        (MEMORY, 0.0, SampleAssumptions(None, noisy=False)),
        (MEMORY, 0.05, SampleAssumptions(5e-4, noisy=False)),
        ({**MEMORY, "friction.law": "rate_state"}, 0.05, SampleAssumptions(5e-4, noisy=False)),
        ({**MEMORY, **ENCODER}, 0.05, SampleAssumptions(5e-4, noisy=True)),
    ],
)
def test_law_belt_and_sensor_decide(
    plant: dict[str, Any], fastest_belt: float, expected: SampleAssumptions
) -> None:
    assert reading_of(plant, fastest_belt) == expected


def test_a_stick_speed_that_is_given_is_for_samples_as_they_are() -> None:
    assert reading_of({**STATIC, **ENCODER}, 0.04, given=1e-3) == SampleAssumptions(
        1e-3, noisy=False
    )


@pytest.mark.parametrize(
    "change",
    [
        {"sensor.velocity": "exactly"},
        {"sensor.position_resolution": "fine"},
        {"sensor.position_resolution": float("inf")},
        {"sensor.position_resolution": -1.0},
        {"sensor.position_noise": [1]},
    ],
)
def test_whether_a_sensor_errs_that_there_cannot_be_is_found_from_the_samples(
    change: dict[str, Any],
) -> None:
    assert reading_of({**STATIC, **ENCODER, **change}).noisy is None


@pytest.mark.parametrize(
    ("rate", "period"), [(400.0, 2.5e6), (0.0, None), ("fast", None), (1e300, None)]
)
def test_the_period_of_the_stamps_is_that_of_the_rate(rate: Any, period: float | None) -> None:
    assert reading_of({**STATIC, "rate": rate}).period == period
