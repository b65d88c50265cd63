"""How samples are to be read: whether they are exact, and what counts as sticking."""

from collections.abc import Mapping
from math import inf, isfinite
from typing import Any, NamedTuple

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.measures.breakpoints import STICK_SHARE
from stickslip_ros.physics.model.friction import LAWS
from stickslip_ros.physics.model.sensor import Sensor


class Reading(NamedTuple):
    """How samples are to be read. Without arguments they are exact."""

    stick_speed: float | None = 0.0
    """Largest relative speed, m/s, at which exact samples stick; None for friction with a memory
    on a belt whose speed is not known, see `STICK_SHARE`."""
    noisy: bool | None = False
    """Whether the samples have noise; None if it is to be found from them."""

    def checked(self) -> "Reading":
        """Return the reading. Raises InvalidInputError for a stick speed that is not possible."""
        speed = self.stick_speed
        if speed is not None and not (isfinite(speed) and speed >= 0.0):
            raise InvalidInputError(
                f"stick_speed = {speed} is refused: must be finite and at least 0 (m/s)"
            )
        return self


EXACT = Reading()
"""Reading of exact samples."""

UNKNOWN = Reading(0.0, None)
"""Reading of samples of which nothing is known."""


def reading_of(
    plant: Mapping[str, Any], fastest_belt: float = 0.0, *, given: float | None = None
) -> Reading:
    """Return how samples of a plant are to be read.

    Samples of an exact sensor stick at exactly the speed of the belt, those of friction with a
    memory at `STICK_SHARE` of it. A sensor that errs gives samples with noise.

    Parameters
    ----------
    plant : mapping
        Parameters of the plant by flat name, as far as they are known. Those that no plant can have
        count as unknown.
    fastest_belt : float, optional
        Fastest belt speed, m/s. By default it is not known beforehand.
    given : float, optional
        Stick speed that the user gives, m/s: then the samples are read as exact ones.

    Returns
    -------
    Reading
        Stick speed, and whether the samples have noise.
    """
    if given is not None:
        return Reading(given)
    if not plant:
        return UNKNOWN
    law = LAWS.get(str(plant.get("friction.law")))
    if law is None or not law.states:
        stick_speed = 0.0
    else:
        stick_speed = STICK_SHARE * fastest_belt if fastest_belt else None
    return Reading(stick_speed, _errs(plant))


def _errs(plant: Mapping[str, Any]) -> bool | None:
    """Return whether the sensor errs; None where its values are not those of a sensor."""
    prefix = "sensor."
    values = {name.removeprefix(prefix): plant[name] for name in plant if name.startswith(prefix)}
    try:
        sensor = Sensor.from_values(values)
        lengths = sensor.position_resolution, sensor.position_noise, sensor.velocity_noise
        known = all(0.0 <= float(value) < inf for value in lengths)
    except (ArithmeticError, TypeError, ValueError):
        return None
    return not sensor.exact if known else None
