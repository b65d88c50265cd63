"""How the friction laws of other packages are identified: their adapters, by entry point."""

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.identified_law import IdentifiedLaw
from stickslip_ros.model.friction import LAWS
from stickslip_ros.scenarios.foreign_laws import (
    ADAPTERS,
    FRICTION_LAWS,
    check_name,
    entries_of_other_packages,
    loaded,
    made,
)


def foreign_names() -> list[str]:
    """Return the friction laws for which other packages have adapters."""
    return [entry.name for entry, _ in entries_of_other_packages(ADAPTERS)]


def foreign_adapter(name: str) -> IdentifiedLaw | None:
    """Return the adapter that another package has for a friction law; None if there is none.

    Raises InvalidInputError with the reason if it is refused.
    """
    for entry, package in entries_of_other_packages(ADAPTERS):
        if entry.name == name:
            try:
                kind = loaded(entry, IdentifiedLaw)
                check_name(name, kind)
                if name not in LAWS:
                    reason = FRICTION_LAWS.refused.get(name, "no package names one")
                    raise InvalidInputError(f"has no friction law {name}: {reason}")
                return made(kind)
            except InvalidInputError as error:
                raise InvalidInputError(
                    f"law {name} is refused: {entry.value} of package {package.name} {error}"
                ) from None
    return None
