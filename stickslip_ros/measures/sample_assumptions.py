"""How the samples of a plant are to be read, by what is known of it."""

from collections.abc import Mapping
from math import inf
from typing import Any, NamedTuple

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.breakpoints import STICK_SHARE
from stickslip_ros.model.drive import UNBOUNDED_SPEED, Drive
from stickslip_ros.model.friction import LAWS, WITHDRAWN, Coulomb
from stickslip_ros.model.sensor import Sensor
from stickslip_ros.stamps import NANOSECONDS


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
    unbounded_speed: float = inf
    """Speed of the slide, m/s, at which a plant ends a motion that diverges."""
    period: float | None = None
    """Time between the stamps of a plant, ns; None where it is not known."""


EXACT = SampleAssumptions()
"""Assumptions for exact samples."""

UNKNOWN = SampleAssumptions(0.0, None)
"""Assumptions for samples of which nothing is known."""

CHANGING_KINDS = ("ramp", "sine", "trapezoid", "table", "topic")
"""Kinds of signals and references that keep changing."""


def reading_of(
    plant: Mapping[str, Any], fastest_belt: float = 0.0, *, given: float | None = None
) -> SampleAssumptions:
    """Return how samples of a plant are to be read, by its parameters as far as they are known.

    Samples of an exact sensor stick at exactly the speed of the belt, those of friction with a
    memory at `STICK_SHARE` of its fastest speed, m/s. A sensor that errs gives samples with noise.
    Parameters that no plant can have count as unknown. With a stick speed that is `given`, m/s, the
    samples are read as exact ones.
    """
    if given is None and not plant:
        return UNKNOWN
    name, rate = str(plant.get("friction.law")), plant.get("rate")
    has_memory = name in WITHDRAWN or (name in LAWS and bool(LAWS[name].states))
    known = SampleAssumptions(
        (STICK_SHARE * fastest_belt or None) if has_memory else 0.0,
        *_resolution(plant),
        any(k.endswith(".kind") and str(kind) in CHANGING_KINDS for k, kind in plant.items()),
        _unbounded_speed(plant),
        NANOSECONDS / rate if isinstance(rate, float) and 0.0 < rate <= NANOSECONDS else None,
    )
    return known if given is None else known._replace(stick_speed=given, noisy=False)


def held_range(step: float, stiffness: float) -> float:
    """Return the range, m, in which an actuator with this step (N) can hold the slide.

    Without a spring, `stiffness` (N/m) of 0, it holds none.
    """
    return step / (stiffness or inf)


def _resolution(plant: Mapping[str, Any]) -> tuple[bool | None, float]:
    """Return whether the sensor errs, and the step of the actuator over the stiffness, m.

    None and 0 where the values are not those of a sensor and an actuator.
    """
    prefix = "sensor."
    values = {name.removeprefix(prefix): plant[name] for name in plant if name.startswith(prefix)}
    try:
        sensor = Sensor.from_values(values)
        lengths = sensor.position_resolution, sensor.position_noise, sensor.velocity_noise
        step = float(plant.get("actuator.resolution", 0.0))
        within = held_range(step, float(plant.get("stiffness") or 0.0))
        known = all(0.0 <= float(value) < inf for value in (*lengths, within))
    except (ArithmeticError, TypeError, ValueError):
        return None, 0.0
    return (not sensor.exact, within) if known else (None, 0.0)


def _unbounded_speed(plant: Mapping[str, Any]) -> float:
    """Return the speed at which a plant ends a motion, m/s; infinite where it is not known."""
    try:
        names = "mass", "stiffness", "normal_force"
        constants: dict[str, Any] = {name: float(plant[name]) for name in names}
        law = Coulomb(static=float(plant.get("friction.static", 0.0)))  # a table has none
        drive = Drive(damping=0.0, belt_speed=0.0, friction=law, **constants)
        return UNBOUNDED_SPEED * drive.speed_scale
    except (ArithmeticError, InvalidInputError, LookupError, TypeError, ValueError):
        return inf
