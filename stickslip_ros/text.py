"""Format text for messages, tables and figures."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from difflib import SequenceMatcher
from math import isfinite
from typing import Any

_PREFIXES = {1e9: "G", 1e6: "M", 1e3: "k", 1.0: "", 1e-3: "m", 1e-6: "µ", 1e-9: "n"}
_LONGEST_NAME, _MOST_SUGGESTIONS = 80, 3
_LEAST_SIMILARITY = 0.6
"""Ratio of `SequenceMatcher` above which two names are close."""


def printable(text: str) -> str:
    """Return a text on one line, with control characters shown as escape sequences.

    A name in a foreign bag or scenario file can then not control the terminal, or imitate a line
    of this program.
    """
    if text.isprintable():
        return text
    return "".join(
        character if character.isprintable() else ascii(character)[1:-1] for character in text
    )


def shown(value: Any) -> str:
    """Return a value as messages show it; a long one is shortened."""
    try:
        text = repr(value)
    except Exception:  # a value of the code of others, or a number of more than 4300 digits
        text = f"an object of class {type(value).__name__}"
    return text if len(text) <= _LONGEST_NAME else f"{text[:_LONGEST_NAME]}..."


def renamed(sentence: str, names: Mapping[str, str]) -> str:
    """Return a sentence that has other names wherever it says NAME = VALUE."""
    known = "|".join(map(re.escape, sorted(names, key=len, reverse=True)))
    return re.sub(rf"(?<![\w.])({known})(?= = )", lambda match: names[match[1]], sentence)


def quantity(value: float, unit: str) -> str:
    """Return a rounded value with its unit, if any, and a prefix unless this is one as 1/s."""
    scale, prefix = prefix_for(value) if unit and not unit.startswith("1") else (1.0, "")
    return f"{value / scale:.4g} {prefix}{unit}".rstrip()


def number_in(text: str) -> float:
    """Return the number that a peer reports as text; 0 if it is none, or no finite one."""
    with suppress(ValueError, OverflowError):
        number = int(text) if text.isdecimal() else float(text)
        return number if isfinite(number) else 0.0
    return 0.0


def prefix_for(largest: float) -> tuple[float, str]:
    """Return the divisor and the prefix with which a value of this magnitude is 1 or more.

    Values below the smallest prefix, including zero, get no prefix.
    """
    magnitude = abs(largest)
    return next(((scale, p) for scale, p in _PREFIXES.items() if magnitude >= scale), (1.0, ""))


def finite(value: Any) -> Any:
    """Return a value for JSON: null for what is infinite or not a number, which JSON lacks.

    A complex number becomes [real, imaginary], and an array a list.
    """
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, complex):
        value = [value.real, value.imag]
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [finite(item) for item in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value


def by_group(names: Iterable[str]) -> str:
    """Return flat names in order, those of a group (friction.static) as one (friction.*)."""
    groups = {f"{name.partition('.')[0]}.*" if "." in name else name for name in names}
    return ", ".join(sorted(groups))


def did_you_mean(name: str, known: Iterable[str], otherwise: str | None = None) -> str:
    """Return the end of a message about an unknown name: the known names that are close to it.

    If none is close, return `otherwise`, by default all known names. Names are close if they have
    the same last part (plant.friction.static and plant.static), or if its words include those of
    the unknown name (linear_gain and gain); otherwise, the most similar name is close. Of two close
    names the one that has all words of the other and more (friction.reverse.static) is omitted.
    """
    names, name = sorted(known), name[:_LONGEST_NAME]
    last = name.rpartition(".")[2]
    close = [term for term in names if term.rpartition(".")[2] == last]
    close = close or [term for term in names if _words(last) <= _words(term)]
    if not close:
        ratios = {term: _likeness(name, term) for term in names}
        best = max(ratios.values(), default=0.0)
        close = [term for term in names if ratios[term] == best >= _LEAST_SIMILARITY]
    parts = {term: set(re.split(r"[._]", term)) for term in close}
    close = [term for term in close if not any(parts[other] < parts[term] for other in close)]
    if close:
        return f"did you mean {' or '.join(close[:_MOST_SUGGESTIONS])}?"
    return f"known are {', '.join(names)}" if otherwise is None else otherwise


def must_be_one_of(name: str, allowed: Collection[str]) -> str:
    """Return the end of a message that refuses a name: those that are close, and all allowed."""
    hint = did_you_mean(name, allowed, "")
    return f"{hint} must be one of {', '.join(allowed)}".lstrip()


def _words(name: str) -> set[str]:
    return set(name.rpartition(".")[2].split("_"))


def _likeness(name: str, known: str) -> float:
    """Return the similarity of two names, from 0 to 1; a common first part does not count."""
    group = name[: name.find(".") + 1]
    if known.startswith(group):
        name, known = name.removeprefix(group), known.removeprefix(group)
    return SequenceMatcher(None, name.lower(), known.lower()).ratio()
