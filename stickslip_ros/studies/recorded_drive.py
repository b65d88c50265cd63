"""The drive of a recorded run, from the parameters that its bag holds."""

import json
from pathlib import Path

from stickslip_ros.bags.reader import Recording
from stickslip_ros.bags.table_file import is_table
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.scenarios.curve_file import CURVES, as_pairs
from stickslip_ros.scenarios.parameter_field import known_parameters
from stickslip_ros.scenarios.parameters import PlantParameters


def recorded_drive(bag: Path, namespace: str | None = None) -> Drive | None:
    """Return the drive whose parameters were recorded, None where they are not or not all.

    A table has none.
    """
    if is_table(bag):
        return None
    with Recording(bag, namespace) as recording:
        texts = recording.metadata("stickslip_ros/plant") or {}
        curves = recording.metadata(CURVES) or {}
    try:
        values = {
            name: json.loads(text)
            for name, text in texts.items()
            if name in known_parameters(PlantParameters)
        }
        known = {path: as_pairs(json.loads(text)) for path, text in curves.items()}
        plant = PlantParameters.validated(values, str(bag), known)
    except (ValueError, RecursionError, InvalidInputError):
        return None
    return plant.as_drive() if values.keys() >= set(plant.drive_names()) else None
