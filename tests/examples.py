"""Number of examples of a property test, where the profile's number does not suit it."""

from typing import Any

from hypothesis import settings

from tests.conftest import THOROUGH


def examples(*, quick: int, thorough: int, **others: Any) -> settings:
    """Return settings with so many examples in the quick profile and in the thorough one."""
    is_thorough = settings.get_current_profile_name() == THOROUGH
    return settings(max_examples=thorough if is_thorough else quick, **others)
