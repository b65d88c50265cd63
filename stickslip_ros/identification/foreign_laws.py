"""How the friction laws of other packages are identified: their adapters, by entry point."""

from importlib.metadata import EntryPoint
from math import isfinite
from typing import Any

import numpy as np

from stickslip_ros.errors import InvalidInputError, in_words
from stickslip_ros.identification.identified_law import IdentifiedLaw
from stickslip_ros.model.friction import LAWS
from stickslip_ros.scenarios.foreign_laws import (
    FRICTION_LAWS,
    check_class,
    entries_of_other_packages,
    loaded,
)

GROUP = "stickslip_ros.identified_laws"
"""Entry point group in which other packages name the adapters of their friction laws."""
_SPEEDS = np.array([0.01, 0.1, 0.3, 1.0])
"""Speeds at which an adapter is tried, in fastest speeds."""
_MASS, _STIFFNESS = 100.0, 1e6
"""Drive with which an adapter is tried, kg and N/m."""
_TOLERANCE = 1e-6
"""Share of the friction by which the terms may differ from the law."""


def foreign_names() -> list[str]:
    """Return the friction laws for which other packages have adapters."""
    return [entry.name for entry, _ in entries_of_other_packages(GROUP)]


def foreign_adapter(name: str) -> IdentifiedLaw | None:
    """Return the adapter that another package has for a friction law; None if there is none.

    Raises InvalidInputError with the reason if it is refused.
    """
    for entry, package in entries_of_other_packages(GROUP):
        if entry.name == name:
            try:
                return _adapter(entry)
            except InvalidInputError as error:
                raise InvalidInputError(
                    f"law {name} is refused: {entry.value} of package {package.name} {error}"
                ) from None
    return None


def _adapter(entry: EntryPoint) -> IdentifiedLaw:
    kind: Any = loaded(entry, IdentifiedLaw)
    check_class(entry.name, kind)
    if entry.name not in LAWS:
        reason = FRICTION_LAWS.refused.get(entry.name, "no package names one")
        raise InvalidInputError(f"has no friction law {entry.name}: {reason}")
    try:
        adapter = kind()
        try_adapter(adapter)
    except InvalidInputError:
        raise
    except (Exception, SystemExit) as error:  # the code of others: anything
        raise InvalidInputError(f"fails when it is tried: {in_words(error)}") from None
    return adapter


def try_adapter(adapter: IdentifiedLaw) -> None:
    """Try an adapter: its coordinates must make the law, whose friction its terms must give.

    Raises InvalidInputError with the reason if they do not, and anything that the adapter raises.
    """
    kind = LAWS[adapter.name]
    scale = float(kind().characteristic_speed)
    fastest = 3.0 * scale if isfinite(scale) else 1.0
    speeds, shape = fastest * _SPEEDS, fastest / 3.0
    forces = [0.5**number for number in range(len(adapter.least))]
    terms = adapter.terms(speeds, shape)
    if terms.shape != (len(speeds), len(forces)):
        raise InvalidInputError(
            f"has terms of shape {terms.shape} at {len(speeds)} speeds: must be "
            f"{(len(speeds), len(forces))}, a column for each value of `least`"
        )
    coordinates = adapter.coordinates_of(forces, shape)
    given = {"mass": _MASS, "stiffness": _STIFFNESS, **adapter.start(coordinates, 1e-9)}
    for values in adapter.starts(given, fastest):
        missing = [name for name in adapter.coordinates if name not in values]
        if missing:
            raise InvalidInputError(f"starts without a value of {', '.join(missing)}")
        for name in adapter.coordinates:
            low, high = adapter.bounds(name, values, fastest)
            if not low <= values[name] <= high:
                raise InvalidInputError(
                    f"starts with {name} = {values[name]:.6g}: its bounds are {low:.6g} to "
                    f"{high:.6g}"
                )
        law = adapter.friction({**values, **coordinates}, 1.0)
        if not isinstance(law, kind):
            raise InvalidInputError(f"makes {type(law).__name__}: must be {kind.__name__}")
        refusal = law.refusal()
        if refusal is not None:
            raise InvalidInputError(f"makes a law that is refused: {refusal}")
        for speed, force in zip(speeds.tolist(), (terms @ forces).tolist(), strict=True):
            own = -float(law.coefficient(speed, 1.0))
            if not abs(force - own) <= _TOLERANCE * abs(own):
                raise InvalidInputError(
                    f"gives {force:.6g} N by its terms at {speed:.4g} m/s, and {own:.6g} N by its "
                    "law: must be the same"
                )
