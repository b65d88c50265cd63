"""The relative speed up to which a slide counts as sticking, where none is given."""

from collections.abc import Mapping
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
        Parameters of the plant by flat name, as far as they are known.
    fastest_belt : float, optional
        Fastest belt speed, m/s. By default it is not known beforehand.

    Returns
    -------
    float or None
        Stick speed, m/s; None for friction with a memory on a belt whose speed is not known, see
        `SampleMeter`.
    """
    law = LAWS.get(str(plant.get("friction.law")))
    sensor = {name.removeprefix("sensor."): plant[name] for name in plant if "sensor." in name}
    rate = float(plant.get("rate", 1.0))
    error = Sensor.from_values(sensor).velocity_error(1.0 / rate) if sensor else 0.0
    if law is None or not law.states:
        return error
    belt_speed = fastest_belt or (abs(float(plant.get("belt_speed", 0.0))) if error else 0.0)
    return STICK_SHARE * belt_speed + error if belt_speed or error else None
