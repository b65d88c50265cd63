"""The models of the nodes' parameters, and the values derived from them."""

from math import inf

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.sample_assumptions import SampleAssumptions
from stickslip_ros.model.actuator import IDEAL_ACTUATOR, Actuator
from stickslip_ros.model.constants import Changes, Parameter
from stickslip_ros.model.sensor import EXACT_SENSOR, MeasuredVelocity, Sensor
from stickslip_ros.motion import Motion
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS, ControllerParameters
from stickslip_ros.scenarios.plant_parameters import PlantParameters

# Only while a node is not active; every physical parameter and gain can be set at any time.
FIXED: dict[str, set[str]] = {"plant": {"rate", "pace"}, "analyzer": {"bag", "window"}}


def known(node: str) -> dict[str, Parameter]:
    return {parameter.name: parameter for parameter in NODE_PARAMETERS[node].known.values()}


def test_defaults_and_what_may_change_while_active() -> None:
    """docs/parameters.md has names, units and defaults; test_generated.py compares it."""
    for node, model in NODE_PARAMETERS.items():
        values, parameters = model.flat(), known(node)
        for name, parameter in parameters.items():
            assert values[name] == parameter.default or values[name] is parameter.default  # nan
        fixed = {
            name for name, parameter in parameters.items() if parameter.changes is not Changes.LIVE
        }
        assert fixed >= FIXED.get(node, set())
        if isinstance(model, ControllerParameters):
            assert fixed.isdisjoint(model.control_law.constants())
    assert {p.name for p in known("plant").values() if p.changes is not Changes.LIVE}.isdisjoint(
        PlantParameters().drive_names()
    )


def test_the_last_sample_of_a_plant() -> None:
    for duration, rate, last in ((2.0, 100.0, 200), (0.1, 3.0, 0), (inf, 100.0, None)):
        plant = PlantParameters().changed({"duration": duration, "rate": rate}, "test")
        assert plant.last_sample == last


def test_no_node_is_waited_for_that_cannot_be() -> None:
    for name in ("1bad", "", "a-b", "/", "a//b", "a/", "a/1b", "ä", "a\n"):
        with pytest.raises(InvalidInputError, match=r"test: wait_for = .* must be names of nodes"):
            PlantParameters().changed({"wait_for": ["plant", name]}, "test")


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
