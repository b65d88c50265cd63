"""What somebody may have meant by a name that does not exist."""

from collections.abc import Iterable
from difflib import SequenceMatcher

_LONGEST, _MOST = 80, 3
_ALIKE = 0.6
"""Ratio of `SequenceMatcher` from which on two names are close."""


def did_you_mean(name: str, known: Iterable[str], otherwise: str | None = None) -> str:
    """Return the end of a message about an unknown name: the known names that are close to it.

    Where none is close it is `otherwise`, by default all that are known. Names
    are close whose last part is the same, as plant.friction.static to plant.static, or has the
    same words and more, as linear_gain to gain; or else the one that is most alike.
    """
    names, name = sorted(known), name[:_LONGEST]
    last = name.rpartition(".")[2]
    close = [each for each in names if each.rpartition(".")[2] == last]
    close = close or [each for each in names if _words(last) <= _words(each)]
    if not close:
        ratios = {each: _likeness(name, each) for each in names}
        best = max(ratios.values(), default=0.0)
        close = [each for each in names if ratios[each] == best >= _ALIKE]
    if close:
        return f"did you mean {' or '.join(close[:_MOST])}?"
    return f"known are {', '.join(names)}" if otherwise is None else otherwise


def _words(name: str) -> set[str]:
    return set(name.rpartition(".")[2].split("_"))


def _likeness(name: str, known: str) -> float:
    """Return how alike two names are, from 0 to 1; a first part that they share says nothing."""
    group = name[: name.find(".") + 1]
    if known.startswith(group):
        name, known = name.removeprefix(group), known.removeprefix(group)
    return SequenceMatcher(None, name.lower(), known.lower()).ratio()
