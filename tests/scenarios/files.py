"""Scenario files for the tests."""

from pathlib import Path
from typing import Any

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.plant_parameters import PlantParameters


def scenario_file(folder: Path, text: str) -> str:
    """Write the text to a scenario file; return its path."""
    path = folder / "scenario.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def section(pattern: str, parameters: str) -> str:
    """Return a section of a parameter file; `parameters` is a YAML mapping in braces."""
    return f'"{pattern}":\n  ros__parameters: {parameters}\n'


def plant(**values: Any) -> PlantParameters:
    """Return parameters of the plant; `__` in a name stands for a dot."""
    flat = {name.replace("__", "."): value for name, value in values.items()}
    return PlantParameters().changed(flat, "test")


def refusal(path: str, *overrides: str, namespace: str = "/feed_drive") -> str:
    """Return with what message a scenario is refused, which is a single line."""
    with pytest.raises(InvalidInputError) as caught:
        load_scenario(path, overrides, namespace)
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    return message
