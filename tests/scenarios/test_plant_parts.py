"""Sensor and actuator as parameters of the plant: the constants of their classes."""

import pytest

from stickslip_ros.measures.sample_assumptions import SampleAssumptions
from stickslip_ros.model.actuator import IDEAL_ACTUATOR, Actuator
from stickslip_ros.model.sensor import EXACT_SENSOR, MeasuredVelocity, Sensor
from stickslip_ros.motion import Motion
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.parameters import PlantParameters
from tests.scenarios.files import refusal


def test_the_plant_has_the_parts_of_its_parameters() -> None:
    plant = PlantParameters().changed(
        {
            "sensor.position_resolution": 0.25,
            "sensor.velocity": "difference",
            "actuator.time_constant": 0.5,
        },
        "here",
    )
    assert PlantParameters().sensor == EXACT_SENSOR
    assert PlantParameters().as_drive().actuator == IDEAL_ACTUATOR
    assert plant.sensor == Sensor(0.25, velocity=MeasuredVelocity.DIFFERENCE)
    drive = plant.as_drive()
    assert drive.actuator == Actuator(time_constant=0.5)
    loop = plant.as_loop(Motion(drive, 0.15, 0.3))
    assert (loop.sample.position, loop.sample.velocity) == (0.25, 0.0)
    assert (loop.true_sample.position, loop.true_sample.velocity) == (0.15, 0.3)


def test_constants_that_do_not_fit_together_are_refused() -> None:
    for overrides, sentence in (
        (["sensor.difference_samples=301"], "a whole number at least 1 and at most 300"),
        (
            ["sensor.velocity=difference", "sensor.velocity_noise=0.1"],
            "sensor.velocity_noise = 0.1 m/s must be 0",
        ),
    ):
        assert sentence in refusal("feed_drive", *(f"plant.{each}" for each in overrides))


def test_the_samples_of_a_sensor_that_errs_are_read_as_noisy() -> None:
    encoder = ["plant.sensor.position_resolution=1e-6", "plant.sensor.velocity=difference"]
    for overrides, stick_speed, noisy in (
        ([], 0.0, False),
        (encoder, 0.0, True),
        ([*encoder, "analyzer.stick_speed=0.001"], 0.001, False),
        ([*encoder, "plant.friction.law=dahl"], pytest.approx(4e-4), True),
    ):
        expected = SampleAssumptions(stick_speed, noisy=noisy, unbounded_speed=100.0, period=1e6)
        assert load_scenario("feed_drive", overrides).reading == expected
