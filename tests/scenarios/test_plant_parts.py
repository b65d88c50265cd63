"""Sensor and actuator as parameters of the plant: the constants of their classes."""

import sys
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType
from typing import Any

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model import actuator as actuators
from stickslip_ros.physics.model import sensor as sensors
from stickslip_ros.physics.model.actuator import IDEAL_ACTUATOR
from stickslip_ros.physics.model.constants import constant
from stickslip_ros.physics.model.sensor import EXACT_SENSOR, Measure, Sensor
from stickslip_ros.physics.motion import Motion
from stickslip_ros.scenarios import parameters
from stickslip_ros.scenarios.parameter_field import Fixed, known_parameters
from stickslip_ros.scenarios.parameters import PlantParameters
from tests.physics.actuators import Lag


@dataclass(frozen=True)
class Offset(Sensor):
    offset: float = constant(0.0, "Offset of the position.", "m")
    every: int = constant(1, "Number of samples.", at_least=1, whole=True)

    def start(self, period: float) -> Measure | None:
        if self.offset == 0.0:
            return None
        return lambda number, position, velocity: (position + self.offset, velocity)


@pytest.fixture
def with_parts(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The parameters where sensor and actuator have constants."""
    monkeypatch.setattr(sensors, "Sensor", Offset)
    monkeypatch.setattr(actuators, "Actuator", Lag)
    spec = spec_from_file_location("parameters_with_parts", parameters.__file__)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    spec.loader.exec_module(module)
    return module


def test_ideal_parts_have_no_parameters() -> None:
    names = known_parameters(PlantParameters)
    assert not [name for name in names if name.startswith(("sensor", "actuator"))]
    plant = PlantParameters()
    assert plant.as_sensor() == EXACT_SENSOR
    assert plant.as_drive().actuator == IDEAL_ACTUATOR
    assert not {"sensor", "actuator"} & plant.model_dump().keys()


def test_their_constants_are_parameters_of_the_plant(with_parts: ModuleType) -> None:
    known = known_parameters(with_parts.PlantParameters)
    names = [name for name in known if name not in known_parameters(PlantParameters)]
    assert names == [
        "sensor.offset",
        "sensor.every",
        "actuator.time_constant",
        "actuator.largest",
    ]
    assert [known[name].fixed for name in names] == [Fixed.ACTIVE] * 2 + [Fixed.NEVER] * 2
    assert [known[name].kind for name in names] == [float, int, float, float]
    assert [known[name].unit for name in names] == ["m", None, "s", "N"]
    assert known["actuator.time_constant"].bounds == "at least 0"
    assert not known["actuator.largest"].finite


def test_the_plant_has_the_parts_of_its_parameters(with_parts: ModuleType) -> None:
    values: dict[str, Any] = {"sensor.offset": 0.25, "actuator.time_constant": 0.5}
    plant = with_parts.PlantParameters.validated(values, "here")
    assert plant.as_sensor() == Offset(0.25)
    drive = plant.as_drive()
    assert drive.actuator == Lag(0.5)
    loop = plant.as_loop(Motion(drive, 0.1, 0.0))
    assert loop.sample.position == 0.35
    assert loop.true_sample.position == 0.1
    assert with_parts.PlantParameters().as_drive().actuator == Lag()
    with pytest.raises(InvalidInputError, match=r"actuator\.time_constant = -1"):
        with_parts.PlantParameters.validated({"actuator.time_constant": -1.0}, "here")
