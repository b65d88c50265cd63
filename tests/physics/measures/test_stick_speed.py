"""The automatic stick speed: what of a plant decides about it, and values that no plant has."""

from typing import Any

import pytest

from stickslip_ros.physics.measures.stick_speed import automatic_stick_speed

ENCODER = {"sensor.position_resolution": 1e-6, "sensor.velocity": "difference", "rate": 1000.0}
MEMORY = {"friction.law": "lugre", "belt_speed": -0.04}


@pytest.mark.parametrize(
    ("plant", "fastest_belt", "expected"),
    [
        ({}, 0.0, 0.0),
        ({"friction.law": "stribeck", "belt_speed": 0.04}, 0.04, 0.0),
        (ENCODER, 0.0, 1e-3),
        ({**ENCODER, "sensor.difference_samples": 4}, 0.0, 2.5e-4),
        ({**ENCODER, "sensor.velocity": "exact"}, 0.0, 0.0),
        (MEMORY, 0.0, None),
        (MEMORY, 0.05, 5e-4),
        ({**MEMORY, **ENCODER}, 0.0, 4e-4 + 1e-3),
        ({**MEMORY, **ENCODER}, 0.05, 5e-4 + 1e-3),
    ],
)
def test_law_belt_and_sensor_decide(
    plant: dict[str, Any], fastest_belt: float, expected: float | None
) -> None:
    found = automatic_stick_speed(plant, fastest_belt)
    assert found == (expected if expected is None else pytest.approx(expected, rel=1e-12))


@pytest.mark.parametrize(
    "change",
    [
        {"rate": 0.0},
        {"rate": "fast"},
        {"rate": 10**400},
        {"rate": float("nan")},
        {"sensor.velocity": "exactly"},
        {"sensor.position_resolution": "fine"},
        {"sensor.position_resolution": float("inf")},
        {"sensor.position_resolution": -1.0},
        {"sensor.difference_samples": 0},
        {"sensor.difference_samples": [1]},
    ],
)
def test_values_that_no_plant_has_count_as_unknown(change: dict[str, Any]) -> None:
    assert automatic_stick_speed({**ENCODER, **change}) == 0.0
    assert automatic_stick_speed({**MEMORY, **ENCODER, **change}, 0.04) == pytest.approx(4e-4)
