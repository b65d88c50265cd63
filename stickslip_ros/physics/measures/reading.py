"""How samples are to be read: whether they are exact, and what counts as sticking."""

from collections.abc import Mapping
from math import inf, isfinite
from typing import Any, NamedTuple

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.measures.breakpoints import STICK_SHARE
from stickslip_ros.physics.model.friction import LAWS
from stickslip_ros.physics.model.sensor import Sensor


class SampleAssumptions(NamedTuple):
    """How samples are to be read. Without arguments they are exact."""

    stick_speed: float | None = 0.0
    """Largest relative speed, m/s, at which exact samples stick; None for friction with a memory
    on a belt whose speed is not known, see `STICK_SHARE`."""
    noisy: bool | None = False
    """Whether the samples have noise; None if it is to be found from them."""
    within: float = 0.0
    """Step of the actuator over the stiffness, m: the range in which it can hold the slide."""
    varies: bool = False
    """Whether belt, load, disturbance or reference vary: then nothing is a drift."""

    def checked(self) -> "SampleAssumptions":
        """Return these. Raises InvalidInputError for a stick speed that is not possible."""
        speed = self.stick_speed
        if speed is not None and not (isfinite(speed) and speed >= 0.0):
            raise InvalidInputError(
                f"stick_speed = {speed} is refused: must be finite and at least 0 (m/s)"
            )
        return self


EXACT = SampleAssumptions()
"""Assumptions for exact samples."""

UNKNOWN = SampleAssumptions(0.0, None)
"""Assumptions for samples of which nothing is known."""


_CHANGING = ("ramp", "sine", "trapezoid", "table", "topic")
"""Kinds of courses and references that keep changing."""


def reading_of(
    plant: Mapping[str, Any], fastest_belt: float = 0.0, *, given: float | None = None
) -> SampleAssumptions:
    """Return how samples of a plant are to be read, by its parameters as far as they are known.

    Samples of an exact sensor stick at exactly the speed of the belt, those of friction with a
    memory at `STICK_SHARE` of its fastest speed, m/s. A sensor that errs gives samples with noise.
    Parameters that no plant can have count as unknown. With a stick speed that is `given`, m/s, the
    samples are read as exact ones.
    """
    (noisy, within), changing = _resolution(plant), varies(plant)
    if given is not None:
        return SampleAssumptions(given, within=within, varies=changing)
    if not plant:
        return UNKNOWN
    law = LAWS.get(str(plant.get("friction.law")))
    if law is None or not law.states:
        stick_speed = 0.0
    else:
        stick_speed = STICK_SHARE * fastest_belt if fastest_belt else None
    return SampleAssumptions(stick_speed, noisy, within, changing)


def varies(parameters: Mapping[str, Any]) -> bool:
    """Return whether a course or a reference among the parameters of a node keeps changing."""
    return any(
        name.endswith(".kind") and str(value) in _CHANGING for name, value in parameters.items()
    )


def _resolution(plant: Mapping[str, Any]) -> tuple[bool | None, float]:
    """Return whether the sensor errs, and the step of the actuator over the stiffness, m.

    None and 0 where the values are not those of a sensor and an actuator.
    """
    prefix = "sensor."
    values = {name.removeprefix(prefix): plant[name] for name in plant if name.startswith(prefix)}
    try:
        sensor = Sensor.from_values(values)
        lengths = sensor.position_resolution, sensor.position_noise, sensor.velocity_noise
        within = float(plant.get("actuator.resolution", 0.0)) / float(plant.get("stiffness") or inf)
        known = all(0.0 <= float(value) < inf for value in (*lengths, within))
    except (ArithmeticError, TypeError, ValueError):
        return None, 0.0
    return (not sensor.exact, within) if known else (None, 0.0)
