"""The relative speed up to which a slide counts as sticking, where none is given."""

from collections.abc import Mapping
from math import inf, isfinite
from typing import Any

from stickslip_ros.physics.measures.breakpoints import STICK_SHARE
from stickslip_ros.physics.model.friction import LAWS
from stickslip_ros.physics.model.sensor import Sensor


def automatic_stick_speed(plant: Mapping[str, Any], fastest_belt: float = 0.0) -> float | None:
    """Return the automatic stick speed for samples of a plant.

    It is zero for exact samples of a slide that sticks exactly. Friction with a memory adds
    `STICK_SHARE` of the fastest belt speed, and a sensor what it may err in the velocity.

    Parameters
    ----------
    plant : mapping
        Parameters of the plant by flat name, as far as they are known. Those that no plant can have
        count as unknown.
    fastest_belt : float, optional
        Fastest belt speed, m/s. By default it is not known beforehand.

    Returns
    -------
    float or None
        Stick speed, m/s; None for friction with a memory on a belt whose speed is not known, see
        `SampleMeter`.
    """
    law = LAWS.get(str(plant.get("friction.law")))
    error = _velocity_error(plant)
    if law is None or not law.states:
        return error
    if error and not fastest_belt:
        fastest_belt = abs(_number(plant, "belt_speed"))
    return STICK_SHARE * fastest_belt + error if fastest_belt or error else None


def _velocity_error(plant: Mapping[str, Any]) -> float:
    """Return what the sensor may err in the velocity, m/s; 0 without a possible sensor."""
    prefix = "sensor."
    values = {name.removeprefix(prefix): plant[name] for name in plant if name.startswith(prefix)}
    rate = _number(plant, "rate")
    if not values or rate <= 0.0:
        return 0.0
    try:
        error = Sensor.from_values(values).velocity_error(1.0 / rate)
    except (ArithmeticError, TypeError, ValueError):
        return 0.0
    return error if 0.0 <= error < inf else 0.0


def _number(plant: Mapping[str, Any], name: str) -> float:
    """Return a parameter that is a finite number; otherwise 0."""
    try:
        value = float(plant.get(name, 0.0))
    except (OverflowError, TypeError, ValueError):
        return 0.0
    return value if isfinite(value) else 0.0
