"""Sensor and actuator as parameters of the plant: the constants of their classes."""

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.measures.reading import Reading
from stickslip_ros.physics.model.actuator import IDEAL_ACTUATOR, Actuator
from stickslip_ros.physics.model.sensor import EXACT_SENSOR, MeasuredVelocity, Sensor
from stickslip_ros.physics.motion import Motion
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.parameter_field import Fixed, known_parameters
from stickslip_ros.scenarios.parameters import PlantParameters


def test_their_constants_are_parameters_of_the_plant() -> None:
    known = known_parameters(PlantParameters)
    sensor = {name: each for name, each in known.items() if name.startswith("sensor.")}
    actuator = {name: each for name, each in known.items() if name.startswith("actuator.")}
    assert {each.fixed for each in sensor.values()} == {Fixed.ACTIVE}
    assert {each.fixed for each in actuator.values()} == {Fixed.NEVER}
    units = {name: each.unit for name, each in (sensor | actuator).items()}
    assert units == {
        "sensor.position_resolution": "m",
        "sensor.position_noise": "m",
        "sensor.velocity": None,
        "sensor.difference_samples": None,
        "sensor.velocity_noise": "m/s",
        "sensor.seed": None,
        "actuator.limit": "N",
        "actuator.resolution": "N",
        "actuator.time_constant": "s",
    }
    assert known["sensor.velocity"].choices == ("exact", "difference")
    assert known["sensor.difference_samples"].bounds == "at least 1"
    assert not known["actuator.limit"].finite


def test_they_are_ideal_by_default() -> None:
    plant = PlantParameters()
    assert plant.as_sensor() == EXACT_SENSOR
    assert plant.as_drive().actuator == IDEAL_ACTUATOR


def test_the_plant_has_the_parts_of_its_parameters() -> None:
    plant = PlantParameters.validated(
        {
            "sensor.position_resolution": 0.25,
            "sensor.velocity": "difference",
            "actuator.time_constant": 0.5,
        },
        "here",
    )
    assert plant.as_sensor() == Sensor(0.25, velocity=MeasuredVelocity.DIFFERENCE)
    drive = plant.as_drive()
    assert drive.actuator == Actuator(time_constant=0.5)
    loop = plant.as_loop(Motion(drive, 0.15, 0.3))
    assert (loop.sample.position, loop.sample.velocity) == (0.25, 0.0)
    assert (loop.true_sample.position, loop.true_sample.velocity) == (0.15, 0.3)


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        ("sensor.position_noise=-1", "must be a finite number at least 0 m"),
        ("sensor.velocity=exactly", "sensor.velocity = 'exactly' is refused: must be one of"),
        ("sensor.difference_samples=0", "must be a whole number at least 1"),
        ("sensor.difference_samples=301", "difference_samples = 301 must not exceed 300"),
        ("sensor.seed=-1", "sensor.seed = -1 is refused: must be a whole number at least 0"),
        ("actuator.limit=0", "actuator.limit = 0 is refused: must be a number above 0 N"),
        ("actuator.time_constant=nan", "actuator.time_constant = nan is refused: must be a finite"),
    ],
)
def test_a_value_that_is_not_allowed_is_refused(override: str, sentence: str) -> None:
    with pytest.raises(InvalidInputError) as refused:
        load_scenario("feed_drive", [f"plant.{override}"])
    assert sentence in str(refused.value)


def test_a_difference_has_the_noise_of_the_positions() -> None:
    both = ["plant.sensor.velocity=difference", "plant.sensor.velocity_noise=0.1"]
    with pytest.raises(InvalidInputError, match=r"sensor\.velocity_noise = 0\.1 m/s must be 0"):
        load_scenario("feed_drive", both)


def test_the_samples_of_a_sensor_that_errs_are_read_as_noisy() -> None:
    encoder = ["plant.sensor.position_resolution=1e-6", "plant.sensor.velocity=difference"]
    assert load_scenario("feed_drive", []).reading == Reading(0.0, noisy=False)
    assert load_scenario("feed_drive", encoder).reading == Reading(0.0, noisy=True)
    given = [*encoder, "analyzer.stick_speed=0.001"]
    assert load_scenario("feed_drive", given).reading == Reading(0.001, noisy=False)
    memory = [*encoder, "plant.friction.law=dahl"]
    assert load_scenario("feed_drive", memory).reading == Reading(pytest.approx(4e-4), noisy=True)
